#include "stages/group_classes/make_classes.h"

#include <algorithm>
#include <cmath>

namespace cairn::group_classes {
namespace {

// A track that triangulates, and may become a class.
struct Candidate {
  size_t track_idx = 0;
  FeatureClass feature_class;
};

DropReason ReasonOf(const Track& track, const Triangulation& triangulation,
                    const TriangulateOptions& options) {
  if (triangulation.outcome == TriangulateOutcome::kSmallAngle) return DropReason::kSmallAngle;
  return static_cast<int>(track.size()) < options.min_num_observations ? DropReason::kFewObservations
                                                                       : DropReason::kReprojectionError;
}

// The keypoints of a track: all of them, or those that are not inliers.
std::vector<uint32_t> KeypointsOf(const MatchedFeatures& matched, const Track& track,
                                  const std::vector<int>& matched_idx, const std::vector<int>& without) {
  std::vector<uint32_t> keypoints;
  auto skipped = without.begin();
  for (size_t i = 0; i < track.size(); ++i) {
    if (skipped != without.end() && *skipped == static_cast<int>(i)) {
      ++skipped;
      continue;
    }
    keypoints.push_back(matched.images[matched_idx[track[i].image_idx]].image_id);
    keypoints.push_back(track[i].keypoint_idx);
  }
  return keypoints;
}

FeatureClass ClassOf(const MatchedFeatures& matched, const Track& track, const Triangulation& triangulation,
                     const std::vector<int>& matched_idx, ClassAppearance* appearance) {
  FeatureClass feature_class;
  feature_class.position = triangulation.position;
  feature_class.covariance = triangulation.covariance;
  feature_class.reprojection_error_px = triangulation.rms_error_px;
  std::vector<const uint8_t*> descriptors;
  for (const int i : triangulation.inliers) {
    const TrackElement& element = track[i];
    const int idx = matched_idx[element.image_idx];
    const Features& features = matched.features[idx];
    feature_class.observations.push_back(
        {matched.images[idx].image_id, element.keypoint_idx, features.keypoints[element.keypoint_idx]});
    descriptors.push_back(features.descriptors.row(element.keypoint_idx).data());
  }
  DescribeClass(descriptors, appearance);
  appearance->position = feature_class.position;
  appearance->num_observations = static_cast<int>(feature_class.observations.size());
  feature_class.descriptor = appearance->centre;
  return feature_class;
}

}  // namespace

void MakeClasses(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                 const std::vector<Triangulation>& triangulations, const std::vector<int>& matched_idx,
                 const GroupClassesOptions& options, Classes* classes,
                 std::vector<DroppedItem>* dropped_items) {
  const auto drop = [&](size_t t, DropReason reason) {
    ++classes->dropped[DescribeDropReason(reason).name];
    dropped_items->push_back({.reason = reason,
                              .item_id = static_cast<int64_t>(t),
                              .seen_at = KeypointsOf(matched, tracks[t], matched_idx, {})});
  };
  std::vector<Candidate> candidates;
  std::vector<ClassAppearance> appearances;
  for (size_t t = 0; t < tracks.size(); ++t) {
    if (triangulations[t].outcome != TriangulateOutcome::kOk) {
      drop(t, ReasonOf(tracks[t], triangulations[t], options.triangulation));
      continue;
    }
    candidates.push_back(
        {t, ClassOf(matched, tracks[t], triangulations[t], matched_idx, &appearances.emplace_back())});
  }
  const std::vector<Ambiguity> ambiguity = FindAmbiguous(appearances, options.ambiguity);
  for (size_t i = 0; i < candidates.size(); ++i) {
    const size_t t = candidates[i].track_idx;
    if (ambiguity[i] != Ambiguity::kNone) {
      drop(t, ambiguity[i] == Ambiguity::kAmbiguous ? DropReason::kAmbiguous : DropReason::kDuplicate);
      continue;
    }
    const ClassId class_id = static_cast<ClassId>(classes->classes.size() + 1);
    std::vector<uint32_t> outliers = KeypointsOf(matched, tracks[t], matched_idx, triangulations[t].inliers);
    if (!outliers.empty()) {
      dropped_items->push_back(
          {.reason = DropReason::kOutlier, .item_id = class_id, .seen_at = std::move(outliers)});
    }
    candidates[i].feature_class.class_id = class_id;
    classes->classes.push_back(std::move(candidates[i].feature_class));
  }
}

}  // namespace cairn::group_classes
