#include "core/feature_files/npz_file.h"

#include <zip.h>

#include <memory>
#include <regex>
#include <utility>

#include "core/base/text.h"
#include "core/files/input_file.h"

namespace cairn {
namespace {

constexpr zip_uint64_t kMaxNumBytes = zip_uint64_t{1} << 30;
constexpr int64_t kMaxNumRows = 10'000'000;
constexpr size_t kMaxHeaderBytes = 4096;

using Archive = std::unique_ptr<zip_t, decltype(&zip_discard)>;

Result<Archive> OpenArchive(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
  int code = 0;
  Archive archive(zip_open(path.c_str(), ZIP_RDONLY, &code), &zip_discard);
  if (archive) return archive;
  zip_error_t error;
  zip_error_init_with_code(&error, code);
  const std::string why = zip_error_strerror(&error);
  zip_error_fini(&error);
  return MakeError(ErrorCode::kCorrupt, "{}: not an .npz file of NumPy: {}", path, why);
}

// The bytes of an entry; nothing where there is none.
Result<std::optional<std::string>> ReadEntry(const std::string& path, const std::string& entry) {
  CAIRN_ASSIGN_OR_RETURN(const Archive archive, OpenArchive(path));
  zip_stat_t stat;
  zip_stat_init(&stat);
  if (zip_stat(archive.get(), entry.c_str(), 0, &stat) != 0) return std::optional<std::string>();
  if ((stat.valid & ZIP_STAT_SIZE) == 0 || stat.size > kMaxNumBytes)
    return MakeError(ErrorCode::kCorrupt, "{}: {}: {} bytes, at most 1 GiB is read", path, entry, stat.size);
  const std::unique_ptr<zip_file_t, decltype(&zip_fclose)> file(zip_fopen(archive.get(), entry.c_str(), 0),
                                                                &zip_fclose);
  std::string bytes(stat.size, '\0');
  zip_uint64_t num_read = 0;
  while (file && num_read < stat.size) {
    const zip_int64_t more = zip_fread(file.get(), bytes.data() + num_read, stat.size - num_read);
    if (more <= 0) break;
    num_read += static_cast<zip_uint64_t>(more);
  }
  char beyond = 0;  // reading to the end checks the sum of the bytes
  if (!file || num_read != stat.size || zip_fread(file.get(), &beyond, 1) != 0)
    return MakeError(ErrorCode::kCorrupt, "{}: {} is damaged", path, entry);
  return std::optional<std::string>(std::move(bytes));
}

struct Header {
  std::string type;
  bool is_by_columns = false;
  std::vector<int64_t> shape;
};

// The header's text, a dictionary of Python: {'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }
// [NumPy Enhancement Proposal 1].
std::optional<Header> ParseHeader(const std::string& text) {
  static const std::regex kType("'descr'\\s*:\\s*'([^']*)'"), kOrder("'fortran_order'\\s*:\\s*(True|False)"),
      kShape("'shape'\\s*:\\s*\\(([0-9, ]*)\\)");
  std::smatch type, order, shape;
  if (!std::regex_search(text, type, kType) || !std::regex_search(text, order, kOrder) ||
      !std::regex_search(text, shape, kShape))
    return std::nullopt;
  Header header{.type = type[1], .is_by_columns = order[1] == "True"};
  for (const std::string& number : SplitFields(shape[1].str(), ',')) {
    if (number.empty()) continue;  // "(3,)"
    if (!ParseNumber(number, &header.shape.emplace_back()) || header.shape.back() > kMaxNumRows)
      return std::nullopt;
  }
  return header;
}

}  // namespace

Result<std::optional<NumberTable>> ReadNpzArray(const std::string& path, const std::string& name) {
  const std::string entry = name + ".npy";
  CAIRN_ASSIGN_OR_RETURN(const std::optional<std::string> bytes, ReadEntry(path, entry));
  if (!bytes) return std::optional<NumberTable>();
  const Error no_array = MakeError(ErrorCode::kCorrupt, "{}: {} is not an array of NumPy", path, entry);
  // "\x93NUMPY", version, length of the header (2 bytes; from version 2 on 4), header, numbers
  if (bytes->size() < 12 || !bytes->starts_with("\x93NUMPY")) return no_array;
  const auto byte = [&](size_t i) { return static_cast<size_t>(static_cast<uint8_t>((*bytes)[i])); };
  const bool is_long = byte(6) > 1;
  const size_t begin = is_long ? 12 : 10;
  const size_t length = byte(8) | byte(9) << 8 | (is_long ? byte(10) << 16 | byte(11) << 24 : 0);
  if (length > kMaxHeaderBytes || begin + length > bytes->size()) return no_array;
  const std::optional<Header> header = ParseHeader(bytes->substr(begin, length));
  if (!header) return no_array;
  const std::optional<NumberType> type = NumberTypeOf(header->type);
  if (!type || header->shape.empty() || header->shape.size() > 2) {
    return MakeError(
        ErrorCode::kUnsupported,
        "{}: {}: numbers of type '{}' in {} dimensions; float16, float32, float64 and uint8 are read, in "
        "one or two dimensions",
        path, entry, header->type, header->shape.size());
  }
  NumberTable table{.type = *type};
  table.num_rows = header->shape.size() == 2 ? header->shape[0] : 1;
  table.num_cols = header->shape.back();
  table.bytes = bytes->substr(begin + length);
  if (table.num_rows > 0 && table.num_cols > static_cast<int64_t>(kMaxNumBytes) / table.num_rows)
    return no_array;
  if (std::ssize(table.bytes) != table.num_rows * table.num_cols * BytesOf(table.type)) {
    return MakeError(ErrorCode::kCorrupt, "{}: {}: {} bytes for {} x {} numbers of type {}", path, entry,
                     table.bytes.size(), table.num_rows, table.num_cols, header->type);
  }
  if (header->is_by_columns) {  // its columns, one after the other, are rows
    std::swap(table.num_rows, table.num_cols);
    table = Transposed(table);
  }
  return std::optional<NumberTable>(std::move(table));
}

}  // namespace cairn
