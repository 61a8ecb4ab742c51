#include "stages/group_classes/group_classes.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "core/base/parallel.h"
#include "core/capture/sessions.h"
#include "core/structure/union_matches.h"
#include "stages/group_classes/make_classes.h"

namespace cairn::group_classes {
namespace {

// Of twelve bytes.
constexpr size_t kMaxNumMatchesInMemory = size_t{1} << 24;

// Per posed image and keypoint: whether its camera has a ray for it.
std::vector<std::vector<bool>> FindRays(const MatchedFeatures& matched, const PosedImages& posed,
                                        int num_threads) {
  std::vector<std::vector<bool>> has_ray(posed.num_images());
  ParallelFor(posed.num_images(), num_threads, [&](int64_t i) {
    const auto num_keypoints =
        static_cast<KeypointIdx>(matched.features[posed.feature_idx[i]].keypoints.size());
    for (KeypointIdx k = 0; k < num_keypoints; ++k)
      has_ray[i].push_back(RayOf(matched, posed, {static_cast<int32_t>(i), k}).has_value());
  });
  return has_ray;
}

// Also lists pairs one of whose images has no pose.
Result<std::vector<Track>> BuildTracks(const MatchedFeatures& matched, const PosedImages& posed,
                                       const std::string& scratch_beside, int num_threads, Progress& progress,
                                       std::vector<DroppedItem>* dropped_items, int64_t* num_conflicts) {
  std::map<ImageId, int> posed_idx;
  std::vector<int> num_keypoints;
  for (int i = 0; i < posed.num_images(); ++i) {
    posed_idx.emplace(matched.images[posed.feature_idx[i]].image_id, i);
    num_keypoints.push_back(static_cast<int>(matched.features[posed.feature_idx[i]].keypoints.size()));
  }
  const std::vector<std::vector<bool>> has_ray = FindRays(matched, posed, num_threads);
  if (std::accumulate(num_keypoints.begin(), num_keypoints.end(), int64_t{0}) > INT32_MAX) {
    return MakeError(ErrorCode::kUnsupported,
                     "{}: the images have more than {} keypoints; divide the survey, a map for each floor or "
                     "building",
                     matched.path, INT32_MAX);
  }
  ScoredMatches matches = scratch_beside.empty()
                              ? ScoredMatches(num_keypoints)
                              : ScoredMatches(num_keypoints, scratch_beside, kMaxNumMatchesInMemory);
  MatchReader reader(matched);
  progress.Begin("read matches", posed.num_images(), "images");
  int num_done = 0;  // images of which all pairs with later ones are read
  CAIRN_RETURN_IF_ERROR(reader.ForEachPair([&](const TwoViewGeometry& geometry) -> Status {
    const auto image1 = posed_idx.find(geometry.image_id1), image2 = posed_idx.find(geometry.image_id2);
    if (image1 == posed_idx.end() || image2 == posed_idx.end()) {
      dropped_items->push_back({.reason = DropReason::kPairWithoutPose,
                                .item_id = PairIdFromImageIds(geometry.image_id1, geometry.image_id2)});
      return Ok();
    }
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while reading matches");
    if (image1->second > num_done) progress.Advance(image1->second - std::exchange(num_done, image1->second));
    CAIRN_ASSIGN_OR_RETURN(const auto descriptors1, reader.DescriptorsOf(posed.feature_idx[image1->second]));
    CAIRN_ASSIGN_OR_RETURN(const auto descriptors2, reader.DescriptorsOf(posed.feature_idx[image2->second]));
    for (const Match& match : geometry.inliers) {
      if (!has_ray[image1->second][match.idx1] || !has_ray[image2->second][match.idx2]) continue;
      const int32_t dot =
          descriptors1->row(match.idx1).cast<int32_t>().dot(descriptors2->row(match.idx2).cast<int32_t>());
      matches.Add({image1->second, match.idx1}, {image2->second, match.idx2}, dot);
    }
    return matches.status();
  }));
  progress.Advance(posed.num_images() - num_done);
  progress.End();
  return UnionMatches(std::move(matches), num_conflicts);
}

// Images without a pose.
void ListUnposed(const MatchedFeatures& matched, const PosedImages& posed,
                 std::vector<DroppedItem>* dropped_items) {
  std::set<ImageId> posed_ids;
  for (const int i : posed.feature_idx) posed_ids.insert(matched.images[i].image_id);
  for (const DatabaseImage& image : matched.images) {
    if (!posed_ids.contains(image.image_id))
      dropped_items->push_back({.reason = DropReason::kNoPose, .item_id = image.image_id});
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

// Gives classes an age, and takes those out that are probably gone.
void Forget(const std::vector<std::string>& sessions, const std::set<ImageId>& landmark_images,
            const PersistenceOptions& options, int num_threads, GroupClassesResult* result) {
  Classes& classes = result->classes;
  ImageSessions images;
  for (const SurveyImage& image : classes.images) {
    images.session.push_back(SessionOfImage(sessions, image.name));
    images.shows_landmarks_only.push_back(landmark_images.contains(image.image_id));
  }
  Persistence persistence =
      EstimatePersistence(classes, images, static_cast<int>(sessions.size()), num_threads);
  classes.sessions = sessions;
  classes.changes = std::move(persistence.changes);
  result->sessions = std::move(persistence.sessions);
  std::vector<FeatureClass> kept;
  kept.reserve(classes.classes.size());
  for (size_t i = 0; i < classes.classes.size(); ++i) {
    FeatureClass& feature = classes.classes[i];
    feature.age = std::move(persistence.ages[i]);
    if (feature.age.presence >= options.min_presence) {
      kept.push_back(std::move(feature));
      continue;
    }
    ++classes.dropped[DescribeDropReason(DropReason::kVanished).name];
    DroppedItem& item = result->dropped_items.emplace_back();
    item.reason = DropReason::kVanished;
    item.item_id = feature.class_id;
    for (const Observation& observation : feature.observations)
      item.seen_at.insert(item.seen_at.end(), {observation.image_id, observation.keypoint_idx});
    classes.vanished.push_back(std::move(feature));
  }
  classes.classes = std::move(kept);
}

}  // namespace

OptionTable DescribeOptions(GroupClassesOptions* o) {
  TriangulateOptions& t = o->triangulation;
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
       .help = "adjust the survey's poses and cameras to its images; auto: all but those of a reconstruction",
       .choices = {"auto", "always", "never"}},
      {.name = "initial_reprojection_error_px",
       .value = &o->initial_reprojection_error_px,
       .help = "largest reprojection error in the first triangulation, pixels",
       .min = 1e-3},
  };
  OptionTable adjustment = DescribeOptions(&o->adjustment);
  std::vector<std::string> names;
  for (const Option& option : adjustment) names.push_back(option.name);
  table.insert(table.end(), adjustment.begin(), adjustment.end());
  AddCondition({"refine_poses", {"auto", "always"}}, names, &table);
  table.push_back(
      {.name = "min_separation_ratio",
       .value = &o->ambiguity.min_separation_ratio,
       .help = "classes closer in feature space than this many of their radii are ambiguous; 0: none are",
       .min = 0});
  table.push_back({.name = "max_duplicate_distance_m",
                   .value = &o->ambiguity.max_duplicate_distance_m,
                   .help = "look-alikes closer than this are one scene feature found twice, metres",
                   .min = 0});
  for (Option& option : DescribeOptions(&o->persistence)) table.push_back(std::move(option));
  return table;
}

Result<GroupClassesResult> GroupClasses(const MatchedFeatures& matched, const Capture& capture,
                                        const GroupClassesOptions& options, int num_threads,
                                        Progress& progress, SolvedFile* solved,
                                        const std::vector<std::string>& sessions,
                                        const std::string& scratch_beside) {
  PosedImages posed = CollectPosedImages(matched, capture);
  if (posed.num_images() == 0) {
    return MakeError(ErrorCode::kNoData,
                     "{}: no image has a pose, but landmarks are triangulated from posed images; give an "
                     "images.txt with cam_from_world poses",
                     capture.root);
  }
  GroupClassesResult result;
  ListUnposed(matched, posed, &result.dropped_items);
  CAIRN_ASSIGN_OR_RETURN(const std::vector<Track> tracks,
                         BuildTracks(matched, posed, scratch_beside, num_threads, progress,
                                     &result.dropped_items, &result.num_conflicts));
  result.num_tracks = static_cast<int64_t>(tracks.size());

  progress.Begin("triangulate tracks", 1, "rounds");
  TriangulateOptions first = options.triangulation;
  first.max_reprojection_error_px =
      std::max(options.initial_reprojection_error_px, first.max_reprojection_error_px);
  std::vector<Triangulation> triangulations = TriangulateTracks(matched, tracks, posed, first, num_threads);
  result.initial_rms_px = RmsErrorPx(triangulations);
  progress.Advance();
  progress.End();
  const bool is_reconstructed = capture.frame && capture.frame->is_reconstructed;
  result.poses_refined =
      options.refine_poses == "always" || (options.refine_poses == "auto" && !is_reconstructed);
  if (result.poses_refined) {
    result.findings = AdjustSurvey(matched, tracks, first, options.triangulation, options.adjustment,
                                   num_threads, progress, solved, &posed);
  } else {
    result.findings.keypoints =
        MeasureSurvey(matched, tracks, options.triangulation, options.adjustment, num_threads, posed);
  }
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while adjusting poses");
  progress.Begin("group classes", 2, "steps");
  triangulations = TriangulateTracks(matched, tracks, posed, options.triangulation, num_threads);
  progress.Advance();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while grouping classes");
  result.final_rms_px = RmsErrorPx(triangulations);

  Classes& classes = result.classes;
  classes.cameras = posed.cameras;
  if (!matched.features.empty()) classes.descriptor_kind = matched.features.front().kind;
  auto found = classes.cameras.begin();
  for (const auto& [camera_id, stated] : matched.cameras) {
    if (found->model != stated.model || found->params != stated.params)
      classes.stated_cameras.push_back(stated);
    ++found;
  }
  classes.keypoint_correlation = result.findings.keypoints.correlation;
  for (int i = 0; i < posed.num_images(); ++i) {
    const DatabaseImage& image = matched.images[posed.feature_idx[i]];
    classes.images.push_back({image.image_id, image.name, image.camera_id, posed.poses[i], posed.stated[i]});
  }
  classes.camera_from_given = posed.camera_from_given;
  MeasurePoseNoise(&classes);
  CAIRN_RETURN_IF_ERROR(MakeClasses(matched, tracks, triangulations, posed.feature_idx, options, &classes,
                                    &result.dropped_items));
  if (sessions.size() > 1)
    Forget(sessions, matched.landmark_images, options.persistence, num_threads, &result);
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
