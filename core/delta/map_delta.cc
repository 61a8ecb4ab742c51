#include "core/delta/map_delta.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <string_view>

#include "core/base/blob.h"
#include "core/delta/prefix_compression.h"
#include "core/delta/row_delta.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "core/map/map_epoch.h"
#include "core/map/map_file.h"
#include "core/seal/signature.h"

namespace cairn {
namespace {

// The last byte is the format: 2 where there are rows.
constexpr std::string_view kMagic("cairn map delta", 15);
constexpr char kWithoutRows = '1', kWithRows = '2';
constexpr size_t kLinkBytes = 4;
constexpr uint32_t kMaxPageSize = 65536;

std::string ShortHex(const Hash& hash) {
  std::string text;
  for (size_t i = 0; i < 8; ++i) text += fmt::format("{:02x}", hash[i]);
  return text;
}

uint32_t BigEndian32(const char* bytes) {
  uint32_t value = 0;
  for (size_t i = 0; i < kLinkBytes; ++i) value = value << 8 | static_cast<uint8_t>(bytes[i]);
  return value;
}

bool IsPageSize(uint64_t size) { return size >= 512 && size <= kMaxPageSize && std::has_single_bit(size); }

// A page that is the last of its block has 0 for the next one, whatever its own number: with `ends`, it gets
// a mark of its own, so that two maps of other pages have the same there.  The inverse of itself.
uint32_t ExchangeEnd(uint32_t link, uint32_t page, bool ends) {
  constexpr uint32_t kEnd = 0x80000000;
  const uint32_t end = 0 - page;
  return !ends ? link : link == end ? kEnd : link == kEnd ? end : link;
}

// The pages' contents, then what links them.  REQUIRES: whole pages
std::string UnlinkPages(std::string_view file, size_t page_size, bool ends) {
  std::string contents(file.substr(0, std::min(page_size, file.size())));
  contents.reserve(file.size());
  BlobWriter links;
  for (size_t page = 1; page * page_size < file.size(); ++page) {
    const std::string_view bytes = file.substr(page * page_size, page_size);
    contents += bytes.substr(kLinkBytes);
    const auto number = static_cast<uint32_t>(page + 1);
    links.UInt32(ExchangeEnd(BigEndian32(bytes.data()) - number, number, ends));
  }
  return contents + links.Take();
}

// The inverse.  REQUIRES: whole pages
std::string LinkPages(std::string_view unlinked, size_t page_size, bool ends) {
  const size_t num_pages = unlinked.size() / page_size;
  std::string file(unlinked.substr(0, page_size));
  file.reserve(unlinked.size());
  BlobReader links(unlinked.substr(unlinked.size() - (num_pages - 1) * kLinkBytes));
  for (size_t page = 1; page < num_pages; ++page) {
    const auto number = static_cast<uint32_t>(page + 1);
    const uint32_t link = ExchangeEnd(links.UInt32(), number, ends) + number;
    for (int shift = 24; shift >= 0; shift -= 8) file += static_cast<char>(link >> shift & 0xff);
    file += unlinked.substr(page_size + (page - 1) * (page_size - kLinkBytes), page_size - kLinkBytes);
  }
  return file;
}

// A map's bytes, checked against the file hash of its seal.
Result<std::string> ReadWholeMap(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckFileHash(path));
  CAIRN_ASSIGN_OR_RETURN(std::string bytes, ReadFile(path));
  if (bytes.size() > static_cast<size_t>(MapDelta::kMaxMapBytes)) {
    return MakeError(ErrorCode::kUnsupported,
                     "{}: {} bytes, but deltas are made of maps of at most {} bytes; send it whole", path,
                     bytes.size(), MapDelta::kMaxMapBytes);
  }
  return bytes;
}

// What the signature is of.
std::string SignedHead(const MapDelta& delta) {
  BlobWriter writer;
  writer.Bytes(kMagic);
  writer.UInt8(static_cast<uint8_t>(delta.has_rows ? kWithRows : kWithoutRows));
  writer.Bytes(delta.old_hash.data(), delta.old_hash.size());
  writer.Bytes(delta.new_hash.data(), delta.new_hash.size());
  writer.UInt64(delta.old_num_bytes);
  writer.UInt64(delta.new_num_bytes);
  writer.UInt32(delta.old_page_size);
  writer.UInt32(delta.new_page_size);
  const Hash hash = HashOf(delta.map_name + '\0' + delta.payload);
  writer.Bytes(hash.data(), hash.size());
  writer.Bytes(delta.public_key.data(), delta.public_key.size());
  return writer.Take();
}

// A payload with the rows, where it is shorter and what a robot makes of it is the new map.
Status TryRows(const MapFile& old_map, const std::string& old_bytes, const MapFile& new_map,
               const std::string& new_bytes, MapDelta* delta) {
  if (std::max(old_bytes.size(), new_bytes.size()) > static_cast<size_t>(MapDelta::kMaxRowMapBytes))
    return Ok();
  CAIRN_ASSIGN_OR_RETURN(const MapRows old_rows, ReadMapRows(old_map));
  CAIRN_ASSIGN_OR_RETURN(const MapRows new_rows, ReadMapRows(new_map));
  CAIRN_ASSIGN_OR_RETURN(const std::optional<std::string> rows,
                         MakeRowDelta(old_rows, new_rows, new_map.path()));
  if (!rows) return Ok();
  BlobWriter writer;
  writer.UInt32(static_cast<uint32_t>(rows->size()));
  writer.Bytes(*rows);
  CAIRN_ASSIGN_OR_RETURN(
      const std::string frame,
      CompressAfter(UnlinkPages(old_bytes, delta->old_page_size, /*ends=*/true) + EncodedBlocks(new_rows),
                    UnlinkPages(new_bytes, delta->new_page_size, /*ends=*/true), new_map.path()));
  writer.Bytes(frame);
  MapDelta with_rows = *delta;
  with_rows.has_rows = true;
  with_rows.payload = writer.Take();
  if (with_rows.payload.size() >= delta->payload.size()) return Ok();
  const Result<std::string> made = ApplyMapDelta(with_rows, old_bytes, old_map.path(), new_map.path());
  if (made.ok() && *made == new_bytes) *delta = std::move(with_rows);
  return Ok();
}

}  // namespace

Result<MapDelta> MakeMapDelta(const std::string& old_path, const std::string& new_path,
                              const std::optional<SecretKey>& key, bool allow_older) {
  CAIRN_ASSIGN_OR_RETURN(const MapFile old_map, MapFile::Open(old_path, {}));
  CAIRN_ASSIGN_OR_RETURN(const MapFile new_map, MapFile::Open(new_path, {}));
  const bool is_same = old_map.seal().file == new_map.seal().file;
  if (old_map.seal().is_signed() && new_map.seal().is_signed() && !is_same) {
    CAIRN_RETURN_IF_ERROR(CheckFollows(new_map.head(), new_path, old_map.head(), old_path, allow_older));
  }
  MapDelta delta;
  delta.map_name = new_map.head().name;
  CAIRN_ASSIGN_OR_RETURN(const std::string old_bytes, ReadWholeMap(old_path));
  CAIRN_ASSIGN_OR_RETURN(const std::string new_bytes, ReadWholeMap(new_path));
  delta.old_hash = HashOf(old_bytes);
  delta.new_hash = HashOf(new_bytes);
  delta.old_num_bytes = old_bytes.size();
  delta.new_num_bytes = new_bytes.size();
  delta.old_page_size = static_cast<uint32_t>(ParseSqliteHeader(old_bytes).page_size);
  delta.new_page_size = static_cast<uint32_t>(ParseSqliteHeader(new_bytes).page_size);
  CAIRN_ASSIGN_OR_RETURN(
      delta.payload, CompressAfter(UnlinkPages(old_bytes, delta.old_page_size, /*ends=*/false),
                                   UnlinkPages(new_bytes, delta.new_page_size, /*ends=*/false), new_path));
  CAIRN_RETURN_IF_ERROR(TryRows(old_map, old_bytes, new_map, new_bytes, &delta));
  if (key) {
    CAIRN_ASSIGN_OR_RETURN(delta.public_key, PublicKeyOf(*key));
    CAIRN_ASSIGN_OR_RETURN(delta.signature, SignBytes(SignedHead(delta), *key));
  }
  return delta;
}

std::string EncodeMapDelta(const MapDelta& delta) {
  BlobWriter writer;
  writer.Bytes(SignedHead(delta));
  writer.Bytes(delta.signature.data(), delta.signature.size());
  writer.UInt32(static_cast<uint32_t>(delta.map_name.size()));
  writer.Bytes(delta.map_name);
  writer.Bytes(delta.payload);
  return writer.Take();
}

Result<MapDelta> ReadMapDelta(const std::string& path, const std::optional<KeyRing>& required) {
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  if (bytes.empty()) return MakeError(ErrorCode::kEmptyFile, "{}: is empty, expected a delta", path);
  const std::string_view magic = std::string_view(bytes).substr(0, kMagic.size());
  if (magic != kMagic.substr(0, magic.size())) {
    return MakeError(ErrorCode::kUnsupported,
                     "{}: not a delta of maps; make one with `cairn update delta OLD NEW -o D`", path);
  }
  const char format = bytes.size() > kMagic.size() ? bytes[kMagic.size()] : kWithoutRows;
  if (format != kWithoutRows && format != kWithRows) {
    return MakeError(ErrorCode::kUnsupported, "{}: a delta of a later format than this program reads", path);
  }
  BlobReader reader(bytes);
  MapDelta delta;
  const auto read = [&](auto* field) {
    const std::string_view found = reader.Bytes(field->size());
    if (found.size() == field->size()) std::memcpy(field->data(), found.data(), found.size());
  };
  reader.Bytes(kMagic.size() + 1);
  delta.has_rows = format == kWithRows;
  read(&delta.old_hash);
  read(&delta.new_hash);
  delta.old_num_bytes = reader.UInt64();
  delta.new_num_bytes = reader.UInt64();
  delta.old_page_size = reader.UInt32();
  delta.new_page_size = reader.UInt32();
  Hash payload_hash;
  read(&payload_hash);
  read(&delta.public_key);
  read(&delta.signature);
  const uint32_t name_size = reader.UInt32();
  delta.map_name = reader.Bytes(name_size);
  if (!reader.ok()) {
    return MakeError(ErrorCode::kTruncated, "{}: {} bytes, fewer than its head alone has; copy it again",
                     path, bytes.size());
  }
  delta.payload = reader.Bytes(reader.num_left());
  if (HashOf(delta.map_name + '\0' + delta.payload) != payload_hash) {
    return MakeError(ErrorCode::kCorrupt,
                     "{}: its payload does not have the hash that its head states: it was cut off, damaged "
                     "or changed; copy it again",
                     path);
  }
  CAIRN_RETURN_IF_ERROR(CheckSignatureOf(SignedHead(delta), delta.public_key, delta.signature, path,
                                         AnyKeyOf(required), "make it with `cairn update delta --key`",
                                         SignatureList()));
  for (const auto& [num_bytes, page_size] : {std::pair(delta.old_num_bytes, delta.old_page_size),
                                             std::pair(delta.new_num_bytes, delta.new_page_size)}) {
    if (!IsPageSize(page_size) || num_bytes % page_size != 0 || num_bytes == 0 ||
        num_bytes > static_cast<uint64_t>(MapDelta::kMaxMapBytes)) {
      return MakeError(ErrorCode::kCorrupt, "{}: states a map of {} bytes in pages of {}", path, num_bytes,
                       page_size);
    }
  }
  return delta;
}

Result<std::string> ApplyMapDelta(const MapDelta& delta, const std::string& old_bytes,
                                  const std::string& old_path, const std::string& delta_path) {
  const Hash found = HashOf(old_bytes);
  if (found != delta.old_hash || old_bytes.size() != delta.old_num_bytes) {
    const Result<MapFile> map = MapFile::Open(old_path, {});
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: {} of {} bytes with the hash {}..., but {} leads from one of {} bytes with {}... "
                     "to map '{}'; ask for a delta from this map, or for the new map as a whole",
                     old_path, map.ok() ? fmt::format("map '{}'", map->head().name) : "a file",
                     old_bytes.size(), ShortHex(found), delta_path, delta.old_num_bytes,
                     ShortHex(delta.old_hash), delta.map_name);
  }
  std::string prefix = UnlinkPages(old_bytes, delta.old_page_size, delta.has_rows);
  std::string_view frame = delta.payload;
  if (delta.has_rows) {
    if (std::max(delta.old_num_bytes, delta.new_num_bytes) > static_cast<uint64_t>(MapDelta::kMaxRowMapBytes))
      return Corrupt(delta_path, "states rows of a map that is too large for them");
    CAIRN_ASSIGN_OR_RETURN(const MapRows old_rows, ReadMapRows(old_path));
    BlobReader reader(delta.payload);
    const std::string_view row_delta = reader.Bytes(reader.UInt32());
    if (!reader.ok()) return Corrupt(delta_path, "its rows are cut off");
    CAIRN_ASSIGN_OR_RETURN(const MapRows rows,
                           ApplyRowDelta(old_rows, row_delta,
                                         MaxRowBytes(static_cast<int64_t>(delta.new_num_bytes)), delta_path));
    prefix += EncodedBlocks(rows);
    frame = frame.substr(frame.size() - reader.num_left());
  }
  CAIRN_ASSIGN_OR_RETURN(const std::string unlinked,
                         DecompressAfter(prefix, frame, delta.new_num_bytes, delta_path));
  std::string new_bytes = LinkPages(unlinked, delta.new_page_size, delta.has_rows);
  if (HashOf(new_bytes) != delta.new_hash) {
    return MakeError(ErrorCode::kCorrupt, "{}: gives other bytes than it states; ask for it again",
                     delta_path);
  }
  return new_bytes;
}

}  // namespace cairn
