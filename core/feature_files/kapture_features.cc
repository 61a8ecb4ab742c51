// kapture's features [kapture_format 1.1, "reconstruction/"]: descriptors.txt "name, dtype, dsize,
// keypoints_type, metric_type", keypoints.txt "name, dtype, dsize", and raw numbers in IMAGE.desc and
// IMAGE.kpt; version 1.0 has no folder for each type.
#include <algorithm>
#include <filesystem>

#include "core/base/printable.h"
#include "core/base/text.h"
#include "core/feature_files/feature_files.h"
#include "core/files/file.h"
#include "core/files/input_file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// A folder of one type, and what its text says.
struct TypeFolder {
  std::string folder;
  std::string name;
  NumberType type = NumberType::kFloat32;
  int64_t num_cols = 0;
  std::string keypoints_type, metric;  // of descriptors
};

Result<TypeFolder> ReadTypeFolder(const std::string& folder, const std::string& text_name) {
  const std::string path = folder + "/" + text_name;
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  for (const std::string_view line : SplitLines(text)) {
    if (Trim(line).empty() || Trim(line).front() == '#') continue;
    const std::vector<std::string> fields = SplitFields(line, ',');
    TypeFolder found{.folder = folder};
    const auto type = fields.size() < 3 ? std::nullopt : NumberTypeOf(fields[1]);
    if (!type || !ParseNumber(fields[2], &found.num_cols) || found.num_cols < 1 || found.num_cols > 65536) {
      return MakeError(ErrorCode::kUnsupported,
                       "{}: '{}'; expected a name, float16, float32, float64 or uint8, and how many for each",
                       path, line);
    }
    found.name = fields[0];
    found.type = *type;
    if (fields.size() > 3) found.keypoints_type = fields[3];
    if (fields.size() > 4) found.metric = fields[4];
    return found;
  }
  return MakeError(ErrorCode::kCorrupt, "{}: no line says what the numbers are", path);
}

// The only type in `folder`: it itself, or a folder in it.  Errors: also InvalidArgument where there are
// several.
Result<std::string> OnlyType(const std::string& folder, const std::string& text_name) {
  std::error_code error;
  if (fs::exists(folder + "/" + text_name, error)) return folder;
  std::vector<std::string> found;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code none;
    if (fs::exists(entry->path() / text_name, none)) found.push_back(entry->path().string());
  }
  std::sort(found.begin(), found.end());
  if (found.size() == 1) return found.front();
  if (found.empty()) return MakeError(ErrorCode::kNotFound, "{}: no {} in it", folder, text_name);
  return MakeError(ErrorCode::kInvalidArgument, "{}: descriptors of {} types; name the folder of one: {}",
                   folder, found.size(), fmt::join(found, ", "));
}

Result<std::optional<NumberTable>> ReadTable(const TypeFolder& type, const std::string& name,
                                             const char* ending, const char* archive) {
  const std::string path = type.folder + "/" + name + ending;
  std::error_code error;
  if (!IsPathBelow(name) || !fs::exists(path, error)) {
    if (fs::exists(type.folder + "/" + archive, error)) {
      return MakeError(ErrorCode::kUnsupported, "{}/{}: archives are not read; unpack it there: tar -xf {}",
                       type.folder, archive, archive);
    }
    return std::optional<NumberTable>();
  }
  NumberTable table{.type = type.type, .num_cols = type.num_cols};
  CAIRN_ASSIGN_OR_RETURN(table.bytes, ReadFile(path));
  const int64_t row_bytes = type.num_cols * BytesOf(type.type);
  table.num_rows = std::ssize(table.bytes) / row_bytes;
  if (table.num_rows * row_bytes != std::ssize(table.bytes)) {
    return MakeError(ErrorCode::kCorrupt, "{}: {} bytes, not whole rows of {}", path, table.bytes.size(),
                     row_bytes);
  }
  return std::optional<NumberTable>(std::move(table));
}

class KaptureFeatures : public FeatureReader {
 public:
  KaptureFeatures(TypeFolder keypoints, TypeFolder descriptors)
      : keypoints_(std::move(keypoints)), descriptors_(std::move(descriptors)) {}

  Result<DescriptorKind> Kind(const DescriptorChoice& choice) const override {
    DescriptorChoice chosen = choice;
    if (choice.type == "auto" && (descriptors_.metric == "hamming" || descriptors_.metric == "Hamming"))
      chosen.type = "binary";
    const bool has_name = !descriptors_.name.empty() && SplitWords(descriptors_.name).size() == 1 &&
                          !HasControlCharacter(descriptors_.name);
    if (chosen.extractor.empty() && has_name) chosen.extractor = descriptors_.name;
    CAIRN_ASSIGN_OR_RETURN(DescriptorKind kind,
                           KindOf({.type = descriptors_.type, .num_cols = descriptors_.num_cols}, chosen));
    if (kind.is_sift()) kind.extractor.clear();
    return kind;
  }

  Result<std::optional<Features>> Read(const std::string& name, const DescriptorKind& kind) const override {
    CAIRN_ASSIGN_OR_RETURN(const auto keypoints, ReadTable(keypoints_, name, ".kpt", "keypoints.tar"));
    CAIRN_ASSIGN_OR_RETURN(const auto descriptors, ReadTable(descriptors_, name, ".desc", "descriptors.tar"));
    if (!keypoints || !descriptors) return std::optional<Features>();
    Result<Features> features = FeaturesFromRaw({Floats(*keypoints), *descriptors}, kind, 0);
    if (!features.ok()) {
      return MakeError(features.error().code, "{}/{}.desc: {}", descriptors_.folder, name,
                       features.error().message);
    }
    return std::optional<Features>(std::move(*features));
  }

 private:
  TypeFolder keypoints_, descriptors_;
};

// The kapture folder, and the folder of descriptors in it: of the whole, or of one type of descriptors.
struct Folders {
  std::string root, descriptors;
};
std::optional<Folders> FindFolders(const std::string& path) {
  std::error_code error;
  if (fs::is_directory(path + "/reconstruction/descriptors", error))
    return Folders{path, path + "/reconstruction/descriptors"};
  // DIR/reconstruction/descriptors/TYPE
  const fs::path whole = fs::weakly_canonical(path, error);
  if (!error && fs::exists(whole / "descriptors.txt", error) &&
      whole.parent_path().filename() == "descriptors")
    return Folders{whole.parent_path().parent_path().parent_path().string(), whole.string()};
  return std::nullopt;
}

}  // namespace

bool IsKaptureWithFeatures(const std::string& path) { return FindFolders(path).has_value(); }

Result<std::unique_ptr<FeatureReader>> OpenKaptureFeatures(const std::string& path) {
  const std::optional<Folders> folders = FindFolders(path);
  if (!folders) return MakeError(ErrorCode::kNotFound, "{}: no reconstruction/descriptors in it", path);
  CAIRN_ASSIGN_OR_RETURN(const std::string of_descriptors, OnlyType(folders->descriptors, "descriptors.txt"));
  CAIRN_ASSIGN_OR_RETURN(TypeFolder descriptors, ReadTypeFolder(of_descriptors, "descriptors.txt"));
  std::string of_keypoints = folders->root + "/reconstruction/keypoints";
  std::error_code error;
  if (IsPathBelow(descriptors.keypoints_type) &&
      fs::exists(of_keypoints + "/" + descriptors.keypoints_type + "/keypoints.txt", error)) {
    of_keypoints += "/" + descriptors.keypoints_type;
  } else {
    CAIRN_ASSIGN_OR_RETURN(of_keypoints, OnlyType(of_keypoints, "keypoints.txt"));
  }
  CAIRN_ASSIGN_OR_RETURN(TypeFolder keypoints, ReadTypeFolder(of_keypoints, "keypoints.txt"));
  return std::unique_ptr<FeatureReader>(
      std::make_unique<KaptureFeatures>(std::move(keypoints), std::move(descriptors)));
}

}  // namespace cairn
