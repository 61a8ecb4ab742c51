// Features in COLMAP's databases: blobs of descriptors, whose type no version before 4.0 states.
#include <map>

#include "core/colmap/colmap_database.h"
#include "core/feature_files/feature_files.h"
#include "core/features/descriptor_kind_table.h"
#include "core/features/features.h"

namespace cairn {
namespace {

// What the first row of descriptors says of all.
struct FirstRow {
  int columns = 0;  // bytes of a descriptor
  int64_t type = 0;
};

Result<FirstRow> ReadFirstRow(SQLite::Database& database, const std::string& path) {
  const bool has_type = HasColumn(database, "descriptors", "type");
  LimitedStatement query(
      database, fmt::format("SELECT cols, {} FROM descriptors WHERE rows > 0 ORDER BY image_id LIMIT 1",
                            has_type ? "type" : "0"));
  if (!query.executeStep()) return MakeError(ErrorCode::kNoData, "{}: no image has descriptors", path);
  const int64_t columns = query.getColumn(0).getInt64();
  if (columns < 1 || columns > kMaxDescriptorDim * int64_t{sizeof(double)})
    return MakeError(ErrorCode::kCorrupt, "{}: table descriptors: {} bytes a descriptor", path, columns);
  return FirstRow{static_cast<int>(columns), query.getColumn(1).getInt64()};
}

// Whether descriptors have no more than a place.
bool HasPlacesAlone(SQLite::Database& database, ImageId image_id) {
  LimitedStatement query(database, "SELECT cols FROM keypoints WHERE image_id = ?");
  query.bind(1, image_id);
  return query.executeStep() && query.getColumn(0).getInt64() == 2;
}

class ColmapFeatures : public FeatureReader {
 public:
  ColmapFeatures(std::string path, std::map<std::string, ImageId> images, DescriptorKind stated,
                 FirstRow first)
      : path_(std::move(path)), images_(std::move(images)), stated_(std::move(stated)), first_(first) {}

  // COLMAP 4.0 says with a number what extracted them, and stores floating-point numbers as their bytes.
  // Before, 128 bytes are SIFT's, and more are taken for numbers, as few binary descriptors are as long.
  Result<DescriptorKind> Kind(const DescriptorChoice& choice) const override {
    if (!stated_.is_sift()) return stated_;
    DescriptorChoice chosen = choice;
    const bool may_be_floats = first_.columns % sizeof(float) == 0;
    if (choice.type == "auto" && may_be_floats && (first_.type != 0 || first_.columns > kSiftDescriptorDim))
      chosen.type = "float";
    NumberTable table{.type = NumberType::kUInt8, .num_cols = first_.columns};
    if (chosen.type == "float" || chosen.type == "dense") {
      if (!may_be_floats)
        return MakeError(ErrorCode::kUnsupported, "{} bytes a descriptor are no numbers of 4 bytes",
                         first_.columns);
      table = {.type = NumberType::kFloat32, .num_cols = first_.columns / int64_t{sizeof(float)}};
    }
    return KindOf(table, chosen);
  }

  Result<std::optional<Features>> Read(const std::string& name, const DescriptorKind& kind) const override {
    const auto image = images_.find(name);
    if (image == images_.end()) return std::optional<Features>();
    return WithDatabaseErrors(path_, [&]() -> Result<std::optional<Features>> {
      CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(path_));
      Features features;
      CAIRN_ASSIGN_OR_RETURN(features.keypoints, ReadDatabaseKeypoints(database, image->second));
      const DescriptorKind as_bytes{.type = DescriptorType::kBinary, .num_values = first_.columns};
      CAIRN_ASSIGN_OR_RETURN(features.descriptors,
                             ReadDatabaseDescriptors(database, image->second,
                                                     stated_.is_sift() && !kind.is_sift() ? as_bytes : kind));
      if (HasPlacesAlone(database, image->second)) {
        for (Keypoint& keypoint : features.keypoints) keypoint.scale = 0;
      }
      if (std::ssize(features.keypoints) != features.descriptors.rows()) {
        return MakeError(ErrorCode::kCorrupt, "{}: image {}: {} keypoints and {} descriptors", path_, name,
                         features.keypoints.size(), features.descriptors.rows());
      }
      features.kind = kind;
      if (!stated_.is_sift() || kind.is_sift()) return std::optional<Features>(std::move(features));
      CAIRN_RETURN_IF_ERROR(Unfold(name, &features));
      return std::optional<Features>(std::move(features));
    });
  }

 private:
  // Descriptors from their bytes.
  Status Unfold(const std::string& name, Features* features) const {
    const DescriptorMatrix& bytes = features->descriptors;
    NumberTable table{.type = NumberType::kUInt8, .num_rows = bytes.rows(), .num_cols = bytes.cols()};
    if (features->kind.type != DescriptorType::kBinary) {
      table.type = NumberType::kFloat32;
      table.num_cols = features->kind.num_values;
    }
    table.bytes.assign(reinterpret_cast<const char*>(bytes.data()), static_cast<size_t>(bytes.size()));
    Result<DescriptorMatrix> descriptors = DescriptorsOf(table, features->kind);
    if (!descriptors.ok())
      return MakeError(ErrorCode::kCorrupt, "{}: image {}: {}", path_, name, descriptors.error().message);
    features->descriptors = std::move(*descriptors);
    return Ok();
  }

  std::string path_;
  std::map<std::string, ImageId> images_;
  DescriptorKind stated_;  // by cairn, of its own databases; else SIFT
  FirstRow first_;
};

}  // namespace

Result<std::unique_ptr<FeatureReader>> OpenColmapFeatures(const std::string& path) {
  return WithDatabaseErrors(path, [&]() -> Result<std::unique_ptr<FeatureReader>> {
    CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(path));
    CAIRN_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> listed, ReadDatabaseImages(database));
    std::map<std::string, ImageId> images;
    for (const DatabaseImage& image : listed) images.emplace(image.name, image.image_id);
    CAIRN_ASSIGN_OR_RETURN(const DescriptorKind stated, ReadDescriptorKind(database, path));
    CAIRN_ASSIGN_OR_RETURN(const FirstRow first, ReadFirstRow(database, path));
    return std::unique_ptr<FeatureReader>(
        std::make_unique<ColmapFeatures>(path, std::move(images), stated, first));
  });
}

}  // namespace cairn
