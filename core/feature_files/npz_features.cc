// Folders of .npz files.
#include <algorithm>
#include <filesystem>
#include <utility>

#include "core/feature_files/feature_files.h"
#include "core/feature_files/npz_file.h"
#include "core/files/input_file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr float kShiftPx = 0.5F;  // the first pixel's centre is (0, 0) there

// In how many files it is looked for what their arrays are.
constexpr size_t kMostTried = 64;

// Of n keypoints; d x n becomes n x d.  n x n says neither: it is as in other files.
NumberTable WithRows(NumberTable table, int64_t num_keypoints, bool are_columns) {
  const bool is_square = table.num_rows == table.num_cols;
  const bool turns =
      is_square ? are_columns : table.num_cols == num_keypoints && table.num_rows != num_keypoints;
  return turns ? Transposed(table) : std::move(table);
}

struct NpzArrays {
  NumberTable keypoints, descriptors;
};

Result<NpzArrays> ReadArrays(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::optional<NumberTable> keypoints, ReadNpzArray(path, "keypoints"));
  CAIRN_ASSIGN_OR_RETURN(std::optional<NumberTable> descriptors, ReadNpzArray(path, "descriptors"));
  if (!keypoints || !descriptors) {
    return MakeError(ErrorCode::kCorrupt, "{}: no array '{}'; expected 'keypoints' and 'descriptors'", path,
                     keypoints ? "descriptors" : "keypoints");
  }
  return NpzArrays{*keypoints, std::move(*descriptors)};
}

class NpzFeatures : public FeatureReader {
 public:
  NpzFeatures(std::string folder, std::string first, bool are_columns)
      : folder_(std::move(folder)), first_(std::move(first)), are_columns_(are_columns) {}

  Result<DescriptorKind> Kind(const DescriptorChoice& choice) const override {
    CAIRN_ASSIGN_OR_RETURN(const RawFeatures raw, ReadNpz(first_));
    Result<DescriptorKind> kind = KindOf(raw.descriptors, choice);
    if (!kind.ok()) return MakeError(kind.error().code, "{}: {}", first_, kind.error().message);
    return kind;
  }

  Result<std::optional<Features>> Read(const std::string& name, const DescriptorKind& kind) const override {
    const fs::path image = fs::path(folder_) / name;
    fs::path replaced = image;
    replaced.replace_extension(".npz");
    for (const fs::path& path : {fs::path(image.string() + ".npz"), replaced}) {
      std::error_code error;
      if (!IsPathBelow(name) || !fs::exists(path, error)) continue;
      CAIRN_ASSIGN_OR_RETURN(const RawFeatures raw, ReadNpz(path.string()));
      Result<Features> features = FeaturesFromRaw(raw, kind, kShiftPx);
      if (!features.ok())
        return MakeError(features.error().code, "{}: {}", path.string(), features.error().message);
      return std::optional<Features>(std::move(*features));
    }
    return std::optional<Features>();
  }

 private:
  Result<RawFeatures> ReadNpz(const std::string& path) const {
    CAIRN_ASSIGN_OR_RETURN(NpzArrays arrays, ReadArrays(path));
    return RawFeatures{Floats(arrays.keypoints),
                       WithRows(std::move(arrays.descriptors), arrays.keypoints.num_rows, are_columns_)};
  }

  std::string folder_;
  std::string first_;  // by name
  bool are_columns_;   // whether a column is a descriptor, where an array is square
};

}  // namespace

Result<std::unique_ptr<FeatureReader>> OpenNpzFeatures(const std::string& path) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::recursive_directory_iterator file(path, fs::directory_options::skip_permission_denied, error), end;
       !error && file != end; file.increment(error)) {
    if (file->path().extension() == ".npz") names.push_back(file->path().string());
  }
  if (error) return MakeError(ErrorCode::kIo, "{}: {}", path, error.message());
  if (names.empty()) {
    return MakeError(
        ErrorCode::kNoData,
        "{}: no .npz file and no reconstruction/keypoints in it; expected a folder of .npz files (one for "
        "each image, with the arrays keypoints and descriptors) or a kapture folder",
        path);
  }
  std::sort(names.begin(), names.end());
  bool are_columns = false;
  for (size_t i = 0; i < std::min(names.size(), kMostTried); ++i) {
    CAIRN_ASSIGN_OR_RETURN(const NpzArrays arrays, ReadArrays(names[i]));
    const int64_t rows = arrays.descriptors.num_rows, columns = arrays.descriptors.num_cols;
    if (rows == columns) continue;
    are_columns = columns == arrays.keypoints.num_rows;
    break;
  }
  return std::unique_ptr<FeatureReader>(std::make_unique<NpzFeatures>(path, names.front(), are_columns));
}

}  // namespace cairn
