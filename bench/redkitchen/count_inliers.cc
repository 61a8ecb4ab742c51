// Counts the verified matches of two databases under one stated test, whoever verified them and with which
// threshold: for each pair of images an essential matrix is fitted to the database's own verified matches
// (five-point USAC with a fixed seed, then least squares; the same for both), and matches within 1, 2 and 4
// pixels of it (Sampson) count.  Only pairs with at least 15 of them are summed, and only pairs that both
// databases could have: the second one lists every pair that it tried, as COLMAP's do.
//
//   count_inliers CAIRN_MATCHES.db COLMAP.db
#include <cstdio>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/pooled.h"
#include "core/colmap/colmap_database.h"
#include "core/geometry/estimate_two_view.h"
#include "core/geometry/relative_pose.h"
#include "core/geometry/two_view_error.h"

namespace cairn {
namespace {

constexpr int kMinNumInliers = 15;
constexpr double kLimitsPx[] = {1, 2, 4};
using NamePair = std::pair<std::string, std::string>;

struct ImageFeatures {
  std::string name;
  const Camera* camera = nullptr;
  std::vector<Eigen::Vector3d> bearings;
};

struct Tables {
  std::map<CameraId, Camera> cameras;
  std::map<ImageId, ImageFeatures> images;
  std::map<NamePair, TwoViewGeometry> pairs;
  int64_t num_keypoints = 0;
};

Result<Tables> ReadTables(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  return WithDatabaseErrors(path, [&]() -> Result<Tables> {
    Tables tables;
    CAIRN_ASSIGN_OR_RETURN(tables.cameras, ReadDatabaseCameras(database));
    CAIRN_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> images, ReadDatabaseImages(database));
    for (const DatabaseImage& image : images) {
      ImageFeatures& features = tables.images[image.image_id];
      features.name = image.name;
      features.camera = &tables.cameras.at(image.camera_id);
      CAIRN_ASSIGN_OR_RETURN(const PooledVector<Keypoint> keypoints,
                             ReadDatabaseKeypoints(database, image.image_id));
      for (const Keypoint& keypoint : keypoints) {
        const auto ray = CameraFromImage(*features.camera, {keypoint.x, keypoint.y});
        features.bearings.push_back(ray ? ray->homogeneous().normalized() : Eigen::Vector3d::Zero().eval());
      }
      tables.num_keypoints += static_cast<int64_t>(keypoints.size());
    }
    CAIRN_ASSIGN_OR_RETURN(std::vector<TwoViewGeometry> geometries,
                           ReadDatabaseTwoViewGeometries(database, 0));
    for (TwoViewGeometry& geometry : geometries) {
      const NamePair names =
          std::minmax(tables.images.at(geometry.image_id1).name, tables.images.at(geometry.image_id2).name);
      tables.pairs.emplace(names, std::move(geometry));
    }
    return tables;
  });
}

// Matches of a pair within each limit of the essential matrix that fits them.
std::vector<int64_t> CountInliers(const Tables& tables, const TwoViewGeometry& geometry) {
  std::vector<int64_t> counts(std::size(kLimitsPx), 0);
  const ImageFeatures& image1 = tables.images.at(geometry.image_id1);
  const ImageFeatures& image2 = tables.images.at(geometry.image_id2);
  Correspondences c;
  for (const Match& match : geometry.inliers)
    c.Add(image1.bearings[match.idx1], image2.bearings[match.idx2], c.size());
  const double focal_px = 0.5 * (image1.camera->MeanFocal() + image2.camera->MeanFocal());
  const auto E = EstimateEssentialMatrix(c, {.max_error_rad = 2 / focal_px});
  if (!E) return counts;
  Correspondences near;
  for (int i = 0; i < c.size(); ++i) {
    if (std::sqrt(SquaredSampsonError(*E, c.bearings1[i], c.bearings2[i])) * focal_px <= 4)
      near.Add(c.bearings1[i], c.bearings2[i], i);
  }
  const Eigen::Matrix3d refined =
      EssentialMatrix(RefineRelativePose(PoseFromEssentialMatrix(*E, near), near, 1 / focal_px, 6));
  for (int i = 0; i < c.size(); ++i) {
    const double error_px =
        std::sqrt(SquaredSampsonError(refined, c.bearings1[i], c.bearings2[i])) * focal_px;
    for (size_t limit = 0; limit < counts.size(); ++limit)
      counts[limit] += error_px <= kLimitsPx[limit] ? 1 : 0;
  }
  return counts;
}

void PrintRow(const char* name, const Tables& tables, const Tables& tried) {
  std::vector<const TwoViewGeometry*> geometries;
  for (const auto& [names, geometry] : tables.pairs) {
    if (!geometry.inliers.empty() && tried.pairs.contains(names)) geometries.push_back(&geometry);
  }
  std::vector<std::vector<int64_t>> counts(geometries.size());
  ParallelFor(static_cast<int64_t>(geometries.size()), static_cast<int>(std::thread::hardware_concurrency()),
              [&](int64_t i) { counts[i] = CountInliers(tables, *geometries[i]); });
  std::printf("%-7s %.0f keypoints an image, %zu pairs verified of %zu", name,
              static_cast<double>(tables.num_keypoints) / static_cast<double>(tables.images.size()),
              geometries.size(), tried.pairs.size());
  for (size_t limit = 0; limit < std::size(kLimitsPx); ++limit) {
    int64_t num_pairs = 0, num_inliers = 0;
    for (const std::vector<int64_t>& count : counts) {
      if (count[limit] < kMinNumInliers) continue;
      ++num_pairs;
      num_inliers += count[limit];
    }
    std::printf("; within %g px %lld inliers in %lld pairs of >= %d", kLimitsPx[limit],
                static_cast<long long>(num_inliers), static_cast<long long>(num_pairs), kMinNumInliers);
  }
  std::printf("\n");
}

int Main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: count_inliers CAIRN_MATCHES.db COLMAP.db\n");
    return 2;
  }
  const Result<Tables> ours = ReadTables(argv[1]), theirs = ReadTables(argv[2]);
  for (const Result<Tables>* tables : {&ours, &theirs}) {
    if (tables->ok()) continue;
    std::fprintf(stderr, "%s\n", tables->error().message.c_str());
    return 1;
  }
  PrintRow("cairn", *ours, *theirs);
  PrintRow("COLMAP", *theirs, *theirs);
  return 0;
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) { return cairn::Main(argc, argv); }
