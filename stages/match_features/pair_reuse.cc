#include "stages/match_features/pair_reuse.h"

#include <cstring>

#include "core/base/pooled.h"
#include "core/features/hash_features.h"

namespace cairn::match_features {
namespace {

ContentHash HashGeometry(const TwoViewGeometry& geometry) {
  ContentHasher hasher;
  hasher.UInt(static_cast<uint64_t>(geometry.config));
  hasher.Text(
      {reinterpret_cast<const char*>(geometry.inliers.data()), geometry.inliers.size() * sizeof(Match)});
  for (const Eigen::Matrix3d* matrix : {&geometry.F, &geometry.E, &geometry.H})
    for (const double value : matrix->reshaped()) hasher.Double(value);
  return hasher.Finish();
}

Eigen::Matrix3d MatrixFrom(const SQLite::Column& column) {
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> matrix = Eigen::Matrix3d::Zero();
  if (column.getBytes() == sizeof(double) * 9)
    std::memcpy(matrix.data(), column.getBlob(), sizeof(double) * 9);
  return matrix;
}

// A row of two_view_geometries, without the ids.  Its contents are checked by a hash.
std::optional<TwoViewGeometry> ReadRow(SQLite::Database& database, int64_t pair_id) {
  SQLite::Statement query(database,
                          "SELECT data, config, F, E, H FROM two_view_geometries WHERE pair_id = ?");
  query.bind(1, pair_id);
  if (!query.executeStep()) return std::nullopt;
  TwoViewGeometry geometry;
  const SQLite::Column inliers = query.getColumn(0);
  geometry.inliers.resize(inliers.getBytes() / sizeof(Match));
  if (!geometry.inliers.empty())
    std::memcpy(geometry.inliers.data(), inliers.getBlob(), geometry.inliers.size() * sizeof(Match));
  geometry.config = static_cast<TwoViewConfig>(query.getColumn(1).getInt());
  geometry.F = MatrixFrom(query.getColumn(2));
  geometry.E = MatrixFrom(query.getColumn(3));
  geometry.H = MatrixFrom(query.getColumn(4));
  return geometry;
}

}  // namespace

ContentHash HashCamera(const Camera& camera) {
  ContentHasher hasher;
  hasher.UInt(static_cast<uint64_t>(camera.model)).UInt(camera.width).UInt(camera.height);
  hasher.UInt(camera.has_focal_prior ? 1 : 0);
  for (const double parameter : camera.params) hasher.Double(parameter);
  return hasher.Finish();
}

ContentHash HashPose(const Pose& pose) {
  ContentHasher hasher;
  for (const double value : pose.rotation.coeffs()) hasher.Double(value);
  for (const double value : pose.translation) hasher.Double(value);
  return hasher.Finish();
}

PairKeys::PairKeys(SQLite::Database& features, const MatchImages& images, const MatchPairsOptions& options)
    : features_(features), images_(images), image_keys_(images.images.size()) {
  MatchPairsOptions described = options;
  ContentHasher hasher;
  hasher.Text("pair").Text(OptionsToml(DescribeOptions(&described)));
  if (!images.descriptor_kind.is_sift()) hasher.Text(ToString(images.descriptor_kind));
  options_ = hasher.Finish();
}

Result<ContentHash> PairKeys::OfImage(int idx) {
  if (image_keys_[idx]) return *image_keys_[idx];
  const MatchImage& image = images_.images[idx];
  CAIRN_ASSIGN_OR_RETURN(const PooledVector<Keypoint> keypoints,
                         ReadDatabaseKeypoints(features_, image.image_id));
  CAIRN_ASSIGN_OR_RETURN(const DescriptorMatrix descriptors,
                         ReadDatabaseDescriptors(features_, image.image_id, images_.descriptor_kind));
  image_keys_[idx] = ContentHasher()
                         .Hash(HashFeatures(keypoints, descriptors))
                         .Hash(HashCamera(images_.cameras.at(image.camera_id)))
                         .Finish();
  return *image_keys_[idx];
}

Result<ContentHash> PairKeys::Of(const std::pair<int, int>& pair) {
  CAIRN_ASSIGN_OR_RETURN(const ContentHash image_key1, OfImage(pair.first));
  CAIRN_ASSIGN_OR_RETURN(const ContentHash image_key2, OfImage(pair.second));
  ContentHasher key;
  key.Hash(options_).Hash(image_key1).Hash(image_key2);
  const std::optional<Pose> stated = StatedRelativePose(images_.images[pair.first].cam_from_world,
                                                        images_.images[pair.second].cam_from_world);
  if (stated) key.Hash(HashPose(*stated));
  return key.Finish();
}

std::optional<PairResult> FindPairResult(const ContentHash& key, const MatchImage& image1,
                                         const MatchImage& image2, ReuseSources* sources) {
  return sources->Find(key, [&](const ReuseEntry& entry, ReuseSources::Source& source) {
    std::optional<PairResult> result;
    const bool is_verified = entry.contents != ContentHash();
    std::optional<TwoViewGeometry> geometry;
    if (is_verified) {
      geometry = ReadRow(source.Database(), entry.row);
      if (!geometry || HashGeometry(*geometry) != entry.contents) return result;
    } else {
      geometry.emplace();
      geometry->config = static_cast<TwoViewConfig>(entry.row);
    }
    geometry->image_id1 = image1.image_id;
    geometry->image_id2 = image2.image_id;
    result = {std::move(*geometry), static_cast<int>(entry.count)};
    return result;
  });
}

ReuseEntry EntryOf(const ContentHash& key, const PairResult& result) {
  const TwoViewGeometry& geometry = result.geometry;
  const bool is_verified = !geometry.inliers.empty();
  return {.key = key,
          .contents = is_verified ? HashGeometry(geometry) : ContentHash(),
          .row = is_verified ? PairIdFromImageIds(geometry.image_id1, geometry.image_id2)
                             : static_cast<int64_t>(geometry.config),
          .count = result.num_putative};
}

}  // namespace cairn::match_features
