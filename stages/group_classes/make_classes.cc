#include "stages/group_classes/make_classes.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

namespace cairn::group_classes {
namespace {

// Descriptors of classes that are in memory at once.
constexpr size_t kRowsAtOnce = size_t{1} << 18;

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

// Descriptors of the keypoints of tracks [begin, end) that are kept, track by track: each image's are read
// once.
Result<std::vector<uint8_t>> ReadRows(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                                      const std::vector<Triangulation>& triangulations,
                                      const std::vector<int>& matched_idx, size_t begin, size_t end,
                                      MatchReader* reader) {
  struct Row {
    int image = 0;
    KeypointIdx keypoint = 0;
    size_t place = 0;
  };
  std::vector<Row> rows;
  for (size_t t = begin; t < end; ++t) {
    if (triangulations[t].outcome != TriangulateOutcome::kOk) continue;
    for (const int i : triangulations[t].inliers)
      rows.push_back({matched_idx[tracks[t][i].image_idx], tracks[t][i].keypoint_idx, rows.size()});
  }
  std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.image < b.image; });
  const size_t dim = matched.features.front().kind.space().num_values;
  std::vector<uint8_t> values(rows.size() * dim);
  std::shared_ptr<const DescriptorMatrix> descriptors;
  int image = -1;
  for (const Row& row : rows) {
    if (row.image != image) {
      CAIRN_ASSIGN_OR_RETURN(descriptors, reader->DescriptorsOf(row.image));
      image = row.image;
    }
    std::copy_n(descriptors->row(row.keypoint).data(), dim, &values[row.place * dim]);
  }
  return values;
}

ClassAppearance AppearanceOf(const Triangulation& triangulation, const uint8_t* rows,
                             const DescriptorSpace& space) {
  std::vector<const uint8_t*> descriptors;
  for (size_t i = 0; i < triangulation.inliers.size(); ++i)
    descriptors.push_back(rows + i * space.num_values);
  ClassAppearance appearance;
  DescribeClass(descriptors, space, &appearance);
  appearance.position = triangulation.position;
  appearance.num_observations = static_cast<int>(triangulation.inliers.size());
  return appearance;
}

FeatureClass ClassOf(const MatchedFeatures& matched, const Track& track, const Triangulation& triangulation,
                     const std::vector<int>& matched_idx, const ClassAppearance& appearance) {
  FeatureClass feature_class;
  feature_class.position = triangulation.position;
  feature_class.covariance = triangulation.covariance;
  feature_class.reprojection_error_px = triangulation.rms_error_px;
  feature_class.descriptor = appearance.centre;
  feature_class.observations.reserve(triangulation.inliers.size());
  for (const int i : triangulation.inliers) {
    const TrackElement& element = track[i];
    const int idx = matched_idx[element.image_idx];
    feature_class.observations.push_back({matched.images[idx].image_id, element.keypoint_idx,
                                          matched.features[idx].keypoints[element.keypoint_idx]});
  }
  return feature_class;
}

}  // namespace

Status MakeClasses(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                   const std::vector<Triangulation>& triangulations, const std::vector<int>& matched_idx,
                   const GroupClassesOptions& options, Classes* classes,
                   std::vector<DroppedItem>* dropped_items) {
  const auto drop = [&](size_t t, DropReason reason) {
    ++classes->dropped[DescribeDropReason(reason).name];
    dropped_items->push_back({.reason = reason,
                              .item_id = static_cast<int64_t>(t),
                              .seen_at = KeypointsOf(matched, tracks[t], matched_idx, {})});
  };
  std::vector<size_t> candidates;  // tracks that may become classes
  std::vector<ClassAppearance> appearances;
  appearances.reserve(std::count_if(
      triangulations.begin(), triangulations.end(),
      [](const Triangulation& triangulation) { return triangulation.outcome == TriangulateOutcome::kOk; }));
  MatchReader reader(matched);
  const DescriptorSpace space = matched.features.front().kind.space();
  for (size_t begin = 0, end = 0; begin < tracks.size(); begin = end) {
    for (size_t num_rows = 0; end < tracks.size() && num_rows < kRowsAtOnce; ++end)
      num_rows += triangulations[end].inliers.size();
    CAIRN_ASSIGN_OR_RETURN(const std::vector<uint8_t> rows,
                           ReadRows(matched, tracks, triangulations, matched_idx, begin, end, &reader));
    const uint8_t* next = rows.data();
    for (size_t t = begin; t < end; ++t) {
      if (triangulations[t].outcome != TriangulateOutcome::kOk) {
        drop(t, ReasonOf(tracks[t], triangulations[t], options.triangulation));
        continue;
      }
      candidates.push_back(t);
      appearances.push_back(AppearanceOf(triangulations[t], next, space));
      next += triangulations[t].inliers.size() * space.num_values;
    }
  }
  const std::vector<Ambiguity> ambiguity =
      FindAmbiguous(appearances, classes->descriptor_kind.space(), options.ambiguity);
  classes->classes.reserve(std::count(ambiguity.begin(), ambiguity.end(), Ambiguity::kNone));
  for (size_t i = 0; i < candidates.size(); ++i) {
    const size_t t = candidates[i];
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
    classes->classes.push_back(ClassOf(matched, tracks[t], triangulations[t], matched_idx, appearances[i]));
    classes->classes.back().class_id = class_id;
  }
  return Ok();
}

}  // namespace cairn::group_classes
