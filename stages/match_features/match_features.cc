#include "stages/match_features/match_features.h"

#include <filesystem>
#include <limits>
#include <map>
#include <optional>

#include <opencv2/core/utility.hpp>

#include "core/colmap_database.h"
#include "core/file.h"
#include "core/parallel.h"

namespace cairn {
namespace {

constexpr int64_t kBatchSize = 1024;  // pairs

// What matching needs to know of one image.
struct View {
  ImageId image_id = 0;
  const Camera* camera = nullptr;
  PackedDescriptors descriptors;
  std::vector<Eigen::Vector2d> rays;  // normalised coordinates of the keypoints, NaN where undefined
  std::optional<Pose> cam_from_world;
};

struct Views {
  std::map<CameraId, Camera> cameras;
  std::vector<View> views;
  bool all_posed = true;
};

Result<Views> ReadViews(SQLite::Database& database, const Capture* capture) {
  Views result;
  CAIRN_ASSIGN_OR_RETURN(result.cameras, ReadDatabaseCameras(database));
  CAIRN_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> images, ReadDatabaseImages(database));
  std::map<std::string, Pose> poses;
  if (capture != nullptr) {
    for (const CaptureImage& image : capture->images) {
      if (image.cam_from_world) poses.emplace(image.name, *image.cam_from_world);
    }
  }
  for (const DatabaseImage& image : images) {
    const auto camera = result.cameras.find(image.camera_id);
    if (camera == result.cameras.end()) {
      return MakeError(ErrorCode::kCorrupt, "{}: image {} has camera {}, which the database does not list",
                       database.getFilename(), image.name, image.camera_id);
    }
    View view;
    view.image_id = image.image_id;
    view.camera = &camera->second;
    CAIRN_ASSIGN_OR_RETURN(const DescriptorMatrix descriptors,
                           ReadDatabaseDescriptors(database, image.image_id));
    view.descriptors = PackedDescriptors(descriptors);
    CAIRN_ASSIGN_OR_RETURN(const std::vector<Keypoint> keypoints,
                           ReadDatabaseKeypoints(database, image.image_id));
    if (static_cast<size_t>(descriptors.rows()) != keypoints.size()) {
      return MakeError(ErrorCode::kCorrupt, "{}: image {} has {} keypoints but {} descriptors",
                       database.getFilename(), image.name, keypoints.size(), descriptors.rows());
    }
    for (const Keypoint& keypoint : keypoints) {
      const auto ray = CameraFromImage(*view.camera, Eigen::Vector2d(keypoint.x, keypoint.y));
      view.rays.push_back(ray.value_or(Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN())));
    }
    if (const auto pose = poses.find(image.name); pose != poses.end()) view.cam_from_world = pose->second;
    result.all_posed &= view.cam_from_world.has_value();
    result.views.push_back(std::move(view));
  }
  return result;
}

Result<IndexPairs> SelectPairs(const Views& views, const MatchFeaturesOptions& options, int num_threads,
                               std::string* chosen) {
  const int num_images = static_cast<int>(views.views.size());
  *chosen = options.pairs != "auto" ? options.pairs : views.all_posed ? "frustum" : "exhaustive";
  if (*chosen == "exhaustive") return ExhaustivePairs(num_images);
  if (*chosen == "sequence") return SequencePairs(num_images, options.sequence_window);
  if (!views.all_posed) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "pairs = frustum needs a pose for every image; give --capture, or choose pairs = exhaustive");
  }
  std::vector<PosedCamera> posed;
  for (const View& view : views.views) posed.push_back({*view.camera, *view.cam_from_world});
  return FrustumPairs(posed, options.frustum, num_threads);
}

Status MatchAll(const Views& views, const IndexPairs& pairs, const MatchFeaturesOptions& options,
                int num_threads, Progress& progress, MatchFeaturesSummary* summary,
                SQLite::Database& database) {
  for (int64_t begin = 0; begin < summary->num_pairs_tried; begin += kBatchSize) {
    const int64_t size = std::min<int64_t>(kBatchSize, summary->num_pairs_tried - begin);
    std::vector<TwoViewGeometry> geometries(size);
    std::vector<size_t> num_putative(size, 0);
    ParallelFor(size, num_threads, [&](int64_t i) {
      if (progress.Cancelled()) return;
      const auto& [idx1, idx2] = pairs[begin + i];
      const View& view1 = views.views[idx1];
      const View& view2 = views.views[idx2];
      const std::vector<Match> matches =
          MatchDescriptors(view1.descriptors, view2.descriptors, options.matcher);
      num_putative[i] = matches.size();
      geometries[i] =
          VerifyPair({view1.camera, &view1.rays, view1.cam_from_world},
                     {view2.camera, &view2.rays, view2.cam_from_world}, matches, options.verification);
      geometries[i].image_id1 = view1.image_id;
      geometries[i].image_id2 = view2.image_id;
      progress.Advance();
    });
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while matching features");
    for (int64_t i = 0; i < size; ++i) {
      summary->num_putative += static_cast<int64_t>(num_putative[i]);
      if (geometries[i].inliers.empty()) continue;
      WriteDatabaseTwoViewGeometry(database, geometries[i]);
      summary->num_pairs_verified++;
      summary->num_inliers += static_cast<int64_t>(geometries[i].inliers.size());
    }
  }
  return Ok();
}

}  // namespace

OptionTable DescribeOptions(MatchFeaturesOptions* o) {
  return {
      {.name = "pairs",
       .value = &o->pairs,
       .help = "which images to match; auto: frustum where all images have poses, else exhaustive",
       .choices = {"auto", "exhaustive", "frustum", "sequence"}},
      {.name = "sequence_window",
       .value = &o->sequence_window,
       .help = "pairs = sequence: number of successors that each image is matched with",
       .min = 1},
      {.name = "frustum_near_m",
       .value = &o->frustum.near_m,
       .help = "pairs = frustum: nearest scene, metres",
       .min = 1e-3},
      {.name = "frustum_far_m",
       .value = &o->frustum.far_m,
       .help = "pairs = frustum: farthest scene, metres",
       .min = 1e-3},
      {.name = "min_overlap_ratio",
       .value = &o->frustum.min_overlap_ratio,
       .help = "pairs = frustum: least part of either frustum that the other camera sees",
       .min = 0,
       .max = 1},
      {.name = "max_view_angle_deg",
       .value = &o->frustum.max_view_angle_deg,
       .help = "pairs = frustum: largest angle between two views of a point, degrees",
       .min = 1,
       .max = 180},
      {.name = "max_scale_ratio",
       .value = &o->frustum.max_scale_ratio,
       .help = "pairs = frustum: largest ratio of the two distances to a point",
       .min = 1},
      {.name = "max_ratio",
       .value = &o->matcher.max_ratio,
       .help = "largest ratio of the angles to the best and second best descriptor",
       .min = 0,
       .max = 1},
      {.name = "max_angle_rad",
       .value = &o->matcher.max_angle_rad,
       .help = "largest angle between matched descriptors, radians",
       .min = 0,
       .max = 3.2},
      {.name = "max_epipolar_error_px",
       .value = &o->verification.max_epipolar_error_px,
       .help = "largest distance of an inlier to its epipolar line, pixels",
       .min = 1e-3},
      {.name = "max_prior_error_px",
       .value = &o->verification.max_prior_error_px,
       .help =
           "with known poses: largest distance of a match to the epipolar line of the stated poses, pixels",
       .min = 1e-3},
      {.name = "min_num_inliers",
       .value = &o->verification.min_num_inliers,
       .help = "fewest inliers of a verified pair",
       .min = 8},
      {.name = "min_homography_ratio",
       .value = &o->verification.min_homography_ratio,
       .help = "part of the inliers on one homography that makes a pair planar or panoramic (COLMAP: 0.8)",
       .min = 0,
       .max = 1},
  };
}

Result<MatchFeaturesSummary> MatchFeatures(const std::string& features_path, const Capture* capture,
                                           const MatchFeaturesOptions& options,
                                           const std::string& matches_path, int num_threads,
                                           Progress& progress) {
  if (options.frustum.near_m >= options.frustum.far_m) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "frustum_near_m = {:g} must be less than frustum_far_m = {:g}", options.frustum.near_m,
                     options.frustum.far_m);
  }
  if (options.verification.max_prior_error_px < options.verification.max_epipolar_error_px) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "max_prior_error_px = {:g} must be at least max_epipolar_error_px = {:g}",
                     options.verification.max_prior_error_px, options.verification.max_epipolar_error_px);
  }
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database features, OpenDatabaseReadOnly(features_path));
  auto views = WithDatabaseErrors(features_path, [&] { return ReadViews(features, capture); });
  if (!views.ok()) return views.error();
  MatchFeaturesSummary summary;
  for (const View& view : views->views) summary.num_images += view.descriptors.size() > 0 ? 1 : 0;
  if (summary.num_images < 2) {
    return MakeError(ErrorCode::kNoData, "{}: {} image(s) with features, at least 2 are needed to match",
                     features_path, summary.num_images);
  }
  CAIRN_ASSIGN_OR_RETURN(const IndexPairs pairs, SelectPairs(*views, options, num_threads, &summary.pairs));
  summary.num_pairs_tried = static_cast<int64_t>(pairs.size());

  cv::setNumThreads(1);  // pairs are the unit of parallel work
  progress.Begin("match features", summary.num_pairs_tried, "pairs");
  const Status status = ReplaceFileAtomically(matches_path, [&](const std::string& temporary) -> Status {
    std::error_code error;
    if (!std::filesystem::copy_file(features_path, temporary, error)) {
      return MakeError(ErrorCode::kIo, "{}: cannot be copied to {}: {}", features_path, temporary,
                       error.message());
    }
    return WithDatabaseErrors(temporary, [&]() -> Status {
      SQLite::Database database(temporary, SQLite::OPEN_READWRITE);
      database.exec(
          "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN; DELETE FROM two_view_geometries");
      CAIRN_RETURN_IF_ERROR(MatchAll(*views, pairs, options, num_threads, progress, &summary, database));
      if (summary.num_pairs_verified == 0) {
        return MakeError(
            ErrorCode::kNoData,
            "{}: none of {} pairs ({}) has {} verified matches; do the images overlap, and do the poses fit?",
            features_path, summary.num_pairs_tried, summary.pairs, options.verification.min_num_inliers);
      }
      database.exec("COMMIT");
      return Ok();
    });
  });
  progress.End();
  if (!status.ok()) return status.error();
  return summary;
}

}  // namespace cairn
