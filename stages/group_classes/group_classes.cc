#include "stages/group_classes/group_classes.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "core/base/parallel.h"
#include "core/camera/panorama.h"
#include "core/camera/pixel_ray.h"
#include "core/files/database.h"
#include "stages/group_classes/make_classes.h"
#include "stages/group_classes/union_matches.h"

namespace cairn::group_classes {
namespace {

// The posed images, contiguous, and what triangulation needs of each.
struct PosedImages {
  std::vector<int> feature_idx;  // index into MatchedFeatures::images
  std::vector<const Camera*> cameras;
  std::vector<int> camera_idx;
  std::vector<std::vector<std::optional<PixelRay>>> rays;  // per keypoint, by the unrefined camera
  std::vector<Pose> stated;
  int num_images() const { return static_cast<int>(stated.size()); }
};

PosedImages CollectPosedImages(const MatchedFeatures& matched, const Capture& capture, int num_threads) {
  std::map<std::string, Pose> poses;
  for (const CaptureImage& image : capture.images) {
    if (image.cam_from_world) poses.emplace(image.name, *image.cam_from_world);
  }
  PosedImages posed;
  for (size_t i = 0; i < matched.images.size(); ++i) {
    const std::optional<Pose> pose = FindPose(poses, matched.images[i].name);
    if (!pose) continue;
    posed.feature_idx.push_back(static_cast<int>(i));
    const auto camera = matched.cameras.find(matched.images[i].camera_id);
    posed.cameras.push_back(&camera->second);
    posed.camera_idx.push_back(static_cast<int>(std::distance(matched.cameras.begin(), camera)));
    posed.stated.push_back(*pose);
  }
  posed.rays.resize(posed.num_images());
  ParallelFor(posed.num_images(), num_threads, [&](int64_t i) {
    for (const Keypoint& keypoint : matched.features[posed.feature_idx[i]].keypoints) {
      posed.rays[i].push_back(MakePixelRay(*posed.cameras[i], Eigen::Vector2d(keypoint.x, keypoint.y)));
    }
  });
  return posed;
}

std::vector<Track> BuildTracks(const MatchedFeatures& matched, const PosedImages& posed,
                               int64_t* num_conflicts) {
  std::map<ImageId, int> posed_idx;
  std::vector<int> num_keypoints;
  for (int i = 0; i < posed.num_images(); ++i) {
    posed_idx.emplace(matched.images[posed.feature_idx[i]].image_id, i);
    num_keypoints.push_back(static_cast<int>(posed.rays[i].size()));
  }
  std::vector<ScoredMatch> matches;
  for (const TwoViewGeometry& geometry : matched.geometries) {
    const auto image1 = posed_idx.find(geometry.image_id1), image2 = posed_idx.find(geometry.image_id2);
    if (image1 == posed_idx.end() || image2 == posed_idx.end()) continue;
    const DescriptorMatrix& descriptors1 = matched.features[posed.feature_idx[image1->second]].descriptors;
    const DescriptorMatrix& descriptors2 = matched.features[posed.feature_idx[image2->second]].descriptors;
    for (const Match& match : geometry.inliers) {
      const int32_t dot =
          descriptors1.row(match.idx1).cast<int32_t>().dot(descriptors2.row(match.idx2).cast<int32_t>());
      if (!posed.rays[image1->second][match.idx1] || !posed.rays[image2->second][match.idx2]) continue;
      matches.push_back({{image1->second, match.idx1}, {image2->second, match.idx2}, dot});
    }
  }
  return UnionMatches(num_keypoints, std::move(matches), num_conflicts);
}

// State of the poses while they are refined.
struct PoseState {
  std::vector<Pose> poses;
  std::vector<double> focal_ratios;  // per camera
  Pose camera_from_given;
};

std::vector<PosedRay> RaysOf(const Track& track, const PosedImages& posed, const PoseState& state) {
  std::vector<PosedRay> rays;
  for (const TrackElement& element : track) {
    const int i = element.image_idx;
    const double ratio = state.focal_ratios[posed.camera_idx[i]];
    const PixelRay& ray = *posed.rays[i][element.keypoint_idx];
    rays.push_back({state.poses[i], ratio == 1 ? ray : WithFocalRatio(ray, ratio)});
  }
  return rays;
}

std::vector<Triangulation> TriangulateAll(const std::vector<Track>& tracks, const PosedImages& posed,
                                          const PoseState& state, const TriangulateOptions& options,
                                          int num_threads) {
  std::vector<Triangulation> triangulations(tracks.size());
  ParallelFor(static_cast<int64_t>(tracks.size()), num_threads,
              [&](int64_t t) { triangulations[t] = Triangulate(RaysOf(tracks[t], posed, state), options); });
  return triangulations;
}

double RmsErrorPx(const std::vector<Triangulation>& triangulations) {
  double total = 0, count = 0;
  for (const Triangulation& t : triangulations) {
    if (t.outcome != TriangulateOutcome::kOk) continue;
    total += t.rms_error_px * t.rms_error_px * static_cast<double>(t.inliers.size());
    count += static_cast<double>(t.inliers.size());
  }
  return count > 0 ? std::sqrt(total / count) : 0;
}

bool IsPinhole(const Camera& camera) {
  return camera.model == CameraModel::kPinhole || camera.model == CameraModel::kSimplePinhole;
}

void Refine(const MatchedFeatures& matched, const std::vector<Track>& tracks,
            const std::vector<Triangulation>& triangulations, const PosedImages& posed,
            const RefinePosesOptions& options, PoseState* state) {
  PoseProblem problem;
  problem.stated_poses = posed.stated;
  problem.camera_idx = posed.camera_idx;
  for (const auto& [camera_id, camera] : matched.cameras)
    problem.is_focal_refined.push_back(IsPinhole(camera));
  problem.poses = state->poses;
  problem.focal_ratios = state->focal_ratios;
  problem.camera_from_given = state->camera_from_given;
  for (size_t t = 0; t < tracks.size(); ++t) {
    if (triangulations[t].outcome != TriangulateOutcome::kOk) continue;
    const int point_idx = static_cast<int>(problem.points.size());
    problem.points.push_back(triangulations[t].position);
    for (const int i : triangulations[t].inliers) {
      const TrackElement& element = tracks[t][i];
      problem.observations.push_back(
          {element.image_idx, point_idx, *posed.rays[element.image_idx][element.keypoint_idx]});
    }
  }
  RefinePoses(options, &problem);
  state->poses = problem.poses;
  state->focal_ratios = problem.focal_ratios;
  state->camera_from_given = problem.camera_from_given;
}

// Images without a pose, and pairs that have one of them.
void ListUnposed(const MatchedFeatures& matched, const PosedImages& posed,
                 std::vector<DroppedItem>* dropped_items) {
  std::set<ImageId> posed_ids;
  for (const int i : posed.feature_idx) posed_ids.insert(matched.images[i].image_id);
  for (const DatabaseImage& image : matched.images) {
    if (!posed_ids.contains(image.image_id))
      dropped_items->push_back({.reason = DropReason::kNoPose, .item_id = image.image_id});
  }
  for (const TwoViewGeometry& geometry : matched.geometries) {
    if (posed_ids.contains(geometry.image_id1) && posed_ids.contains(geometry.image_id2)) continue;
    dropped_items->push_back({.reason = DropReason::kPairWithoutPose,
                              .item_id = PairIdFromImageIds(geometry.image_id1, geometry.image_id2)});
  }
}

// How far the refined poses moved from the stated ones, without the common offset.
void MeasurePoseNoise(Classes* classes) {
  double squared_m = 0, squared_deg = 0;
  for (const SurveyImage& image : classes->images) {
    const Pose in_given_frame = classes->camera_from_given.Inverse() * image.cam_from_world;
    squared_m += std::pow(CenterErrorM(in_given_frame, image.given_cam_from_world), 2);
    squared_deg += std::pow(RotationErrorDeg(in_given_frame, image.given_cam_from_world), 2);
  }
  const double num_axes = 3.0 * static_cast<double>(classes->images.size());
  // Less than a micrometre is rounding, not noise.
  classes->stated_pose_sigma_m = std::round(1e6 * std::sqrt(squared_m / num_axes)) / 1e6;
  classes->stated_pose_sigma_deg = std::round(1e4 * std::sqrt(squared_deg / num_axes)) / 1e4;
}

}  // namespace

OptionTable DescribeOptions(GroupClassesOptions* o) {
  TriangulateOptions& t = o->triangulation;
  RefinePosesOptions& r = o->refinement;
  OptionTable table = {
      {.name = "min_num_observations",
       .value = &t.min_num_observations,
       .help = "fewest keypoints of a class",
       .min = 2},
      {.name = "max_reprojection_error_px",
       .value = &t.max_reprojection_error_px,
       .help = "largest reprojection error of a keypoint that stays in its class, pixels",
       .min = 1e-3},
      {.name = "min_triangulation_angle_deg",
       .value = &t.min_triangulation_angle_deg,
       .help = "smallest angle between two rays to a class, degrees",
       .min = 1e-3,
       .max = 180},
      {.name = "refine_poses",
       .value = &o->refine_poses,
       .help = "refine the survey's poses; auto: all but reconstructed ones, when the first triangulation's "
               "error exceeds auto_refine_error_px",
       .choices = {"auto", "always", "never"}},
      {.name = "auto_refine_error_px",
       .value = &o->auto_refine_error_px,
       .help =
           "refine_poses = auto: root mean square reprojection error from which poses are refined, pixels",
       .min = 1e-3},
      {.name = "initial_reprojection_error_px",
       .value = &o->initial_reprojection_error_px,
       .help = "largest reprojection error in the first triangulation, pixels",
       .min = 1e-3},
      {.name = "num_rounds",
       .value = &o->num_rounds,
       .help = "rounds of refinement and new triangulation",
       .min = 1,
       .max = 100},
      {.name = "pose_sigma_m",
       .value = &r.pose_sigma_m,
       .help = "standard deviation of the stated poses, metres",
       .min = 1e-6},
      {.name = "pose_sigma_deg",
       .value = &r.pose_sigma_deg,
       .help = "standard deviation of the stated poses, degrees",
       .min = 1e-6},
      {.name = "keypoint_sigma_px",
       .value = &r.keypoint_sigma_px,
       .help = "standard deviation of a keypoint, pixels",
       .min = 1e-3},
      {.name = "refine_camera_offset",
       .value = &r.refine_camera_offset,
       .help = "refine one rigid offset between all stated poses and their cameras"},
      {.name = "offset_sigma_m",
       .value = &r.offset_sigma_m,
       .help = "standard deviation of that offset, metres",
       .min = 1e-6},
      {.name = "offset_sigma_deg",
       .value = &r.offset_sigma_deg,
       .help = "standard deviation of that offset, degrees",
       .min = 1e-6},
      {.name = "refine_focal",
       .value = &r.refine_focal,
       .help = "refine the focal length of pinhole cameras"},
      {.name = "focal_sigma_ratio",
       .value = &r.focal_sigma_ratio,
       .help = "standard deviation of the refined over the stated focal length",
       .min = 1e-6},
      {.name = "max_num_iterations",
       .value = &r.max_num_iterations,
       .help = "most iterations of a round's solver",
       .min = 1},
      {.name = "min_separation_ratio",
       .value = &o->ambiguity.min_separation_ratio,
       .help = "classes closer in feature space than this many of their radii are ambiguous; 0: none are",
       .min = 0},
      {.name = "max_duplicate_distance_m",
       .value = &o->ambiguity.max_duplicate_distance_m,
       .help = "look-alikes closer than this are one scene feature found twice, metres",
       .min = 0},
  };
  AddCondition({"refine_poses", {"auto"}}, {"auto_refine_error_px"}, &table);
  AddCondition({"refine_poses", {"auto", "always"}},
               {"num_rounds", "pose_sigma_m", "pose_sigma_deg", "refine_camera_offset", "offset_sigma_m",
                "offset_sigma_deg", "refine_focal", "focal_sigma_ratio", "max_num_iterations"},
               &table);
  AddCondition({"refine_camera_offset", {"true"}}, {"offset_sigma_m", "offset_sigma_deg"}, &table);
  AddCondition({"refine_focal", {"true"}}, {"focal_sigma_ratio"}, &table);
  return table;
}

Result<MatchedFeatures> ReadMatchedFeatures(const std::string& matches_path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(matches_path));
  return WithDatabaseErrors(matches_path, [&]() -> Result<MatchedFeatures> {
    MatchedFeatures matched;
    CAIRN_ASSIGN_OR_RETURN(matched.cameras, ReadDatabaseCameras(database));
    CAIRN_ASSIGN_OR_RETURN(matched.images, ReadDatabaseImages(database));
    std::map<ImageId, size_t> num_keypoints;
    for (const DatabaseImage& image : matched.images) {
      if (matched.cameras.count(image.camera_id) == 0) {
        return MakeError(ErrorCode::kCorrupt, "{}: image {} has camera {}, which the database does not list",
                         matches_path, image.name, image.camera_id);
      }
      Features features;
      CAIRN_ASSIGN_OR_RETURN(features.keypoints, ReadDatabaseKeypoints(database, image.image_id));
      CAIRN_ASSIGN_OR_RETURN(features.descriptors, ReadDatabaseDescriptors(database, image.image_id));
      if (static_cast<size_t>(features.descriptors.rows()) != features.keypoints.size()) {
        return MakeError(ErrorCode::kCorrupt, "{}: image {} has {} keypoints but {} descriptors",
                         matches_path, image.name, features.keypoints.size(), features.descriptors.rows());
      }
      num_keypoints.emplace(image.image_id, features.keypoints.size());
      matched.features.push_back(std::move(features));
    }
    CAIRN_ASSIGN_OR_RETURN(matched.geometries, ReadDatabaseTwoViewGeometries(database, 1));
    for (const TwoViewGeometry& geometry : matched.geometries) {
      const auto image1 = num_keypoints.find(geometry.image_id1),
                 image2 = num_keypoints.find(geometry.image_id2);
      if (image1 == num_keypoints.end() || image2 == num_keypoints.end()) {
        return MakeError(ErrorCode::kCorrupt,
                         "{}: a pair names images {} and {}, of which one is not in the database",
                         matches_path, geometry.image_id1, geometry.image_id2);
      }
      for (const Match& match : geometry.inliers) {
        if (match.idx1 >= image1->second || match.idx2 >= image2->second) {
          return MakeError(ErrorCode::kCorrupt,
                           "{}: pair ({}, {}) matches keypoints {} and {}, beyond the images' {} and {}",
                           matches_path, geometry.image_id1, geometry.image_id2, match.idx1, match.idx2,
                           image1->second, image2->second);
        }
      }
    }
    return matched;
  });
}

Result<GroupClassesResult> GroupClasses(const MatchedFeatures& matched, const Capture& capture,
                                        const GroupClassesOptions& options, int num_threads,
                                        Progress& progress) {
  const PosedImages posed = CollectPosedImages(matched, capture, num_threads);
  if (posed.num_images() == 0) {
    return MakeError(ErrorCode::kNoData,
                     "{}: no image has a pose, but landmarks are triangulated from posed images; give an "
                     "images.txt with cam_from_world poses",
                     capture.root);
  }
  GroupClassesResult result;
  const std::vector<Track> tracks = BuildTracks(matched, posed, &result.num_conflicts);
  result.num_tracks = static_cast<int64_t>(tracks.size());

  PoseState state{posed.stated, std::vector<double>(matched.cameras.size(), 1.0), Pose()};
  progress.Begin("group classes", 2 + options.num_rounds, "rounds");
  TriangulateOptions first = options.triangulation;
  first.max_reprojection_error_px =
      std::max(options.initial_reprojection_error_px, first.max_reprojection_error_px);
  std::vector<Triangulation> triangulations = TriangulateAll(tracks, posed, state, first, num_threads);
  result.initial_rms_px = RmsErrorPx(triangulations);
  progress.Advance();
  const bool is_reconstructed = capture.frame && capture.frame->is_reconstructed;
  result.poses_refined =
      options.refine_poses == "always" || (options.refine_poses == "auto" && !is_reconstructed &&
                                           result.initial_rms_px > options.auto_refine_error_px);
  if (result.poses_refined) {
    for (int round = 0; round < options.num_rounds && !progress.Cancelled(); ++round) {
      Refine(matched, tracks, triangulations, posed, options.refinement, &state);
      triangulations = TriangulateAll(tracks, posed, state, options.triangulation, num_threads);
      progress.Advance();
    }
  } else {
    triangulations = TriangulateAll(tracks, posed, state, options.triangulation, num_threads);
    progress.Advance(options.num_rounds);
  }
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while grouping classes");
  result.final_rms_px = RmsErrorPx(triangulations);

  Classes& classes = result.classes;
  int camera_idx = 0;
  for (auto [camera_id, camera] : matched.cameras) {
    const double ratio = state.focal_ratios[camera_idx++];
    if (IsPinhole(camera)) {
      for (int f = 0; f < (camera.model == CameraModel::kPinhole ? 2 : 1); ++f) camera.params[f] *= ratio;
    }
    classes.cameras.push_back(camera);
  }
  for (int i = 0; i < posed.num_images(); ++i) {
    const DatabaseImage& image = matched.images[posed.feature_idx[i]];
    classes.images.push_back({image.image_id, image.name, image.camera_id, state.poses[i], posed.stated[i]});
  }
  classes.camera_from_given = state.camera_from_given;
  MeasurePoseNoise(&classes);
  ListUnposed(matched, posed, &result.dropped_items);
  MakeClasses(matched, tracks, triangulations, posed.feature_idx, options, &classes, &result.dropped_items);
  progress.Advance();
  progress.End();
  if (classes.classes.empty()) {
    std::string most = "no matches";
    int64_t count = 0;
    for (const auto& [reason, num] : classes.dropped) {
      if (num > count) most = fmt::format("{} by {}", count = num, reason);
    }
    return MakeError(ErrorCode::kNoData,
                     "{}: none of {} tracks became a class (most were dropped: {}); do the poses fit the "
                     "images, and does every place appear in {} images?",
                     capture.root, result.num_tracks, most, options.triangulation.min_num_observations);
  }
  return result;
}

}  // namespace cairn::group_classes
