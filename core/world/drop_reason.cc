#include "core/world/drop_reason.h"

namespace cairn {
namespace {

constexpr DropReasonEntry kReasons[] = {
    {DropReason::kUnreadable, "extract_features", DropKind::kImage, "unreadable",
     "the image or its entry in the capture cannot be used"},
    {DropReason::kNoFeatures, "match_features", DropKind::kImage, "no_features",
     "no feature was found in it"},
    {DropReason::kFewMatches, "match_features", DropKind::kPair, "few_matches",
     "fewer descriptors match than min_num_inliers"},
    {DropReason::kFewInliers, "match_features", DropKind::kPair, "few_inliers",
     "the geometry of two views confirms fewer matches than min_num_inliers"},
    {DropReason::kWatermark, "match_features", DropKind::kPair, "watermark",
     "what matches stands still on the borders of both images"},
    {DropReason::kNoPose, "group_classes", DropKind::kImage, "no_pose",
     "no pose is stated for it, it was not registered, or it is held out"},
    {DropReason::kPairWithoutPose, "group_classes", DropKind::kPair, "pair_without_pose",
     "one of its images has no pose"},
    {DropReason::kFewObservations, "group_classes", DropKind::kFeature, "few_observations",
     "its track has fewer keypoints than min_num_observations"},
    {DropReason::kReprojectionError, "group_classes", DropKind::kFeature, "reprojection_error",
     "fewer than min_num_observations of its rays agree on a point up to max_reprojection_error_px"},
    {DropReason::kSmallAngle, "group_classes", DropKind::kFeature, "small_angle",
     "its rays meet at less than min_triangulation_angle_deg"},
    {DropReason::kAmbiguous, "group_classes", DropKind::kFeature, "ambiguous",
     "another feature at another place looks the same (min_separation_ratio)"},
    {DropReason::kDuplicate, "group_classes", DropKind::kFeature, "duplicate",
     "a look-alike with more keypoints within max_duplicate_distance_m stands for it"},
    {DropReason::kOutlier, "group_classes", DropKind::kKeypoint, "outlier",
     "its ray misses the class's point by more than max_reprojection_error_px"},
    {DropReason::kVanished, "group_classes", DropKind::kFeature, "vanished",
     "later sessions should have seen it and did not: it is there with less than min_presence"},
    {DropReason::kFewStations, "filter_visibility", DropKind::kFeature, "few_stations",
     "fewer stations see it than min_num_stations or min_num_stations_driven"},
    {DropReason::kHoles, "filter_visibility", DropKind::kFeature, "holes",
     "its area has more or larger holes than max_num_holes and max_hole_stations"},
    {DropReason::kNoBlock, "filter_visibility", DropKind::kFeature, "no_block",
     "its area holds no full block of min_block_side stations a side"},
    {DropReason::kTrimmedAway, "filter_visibility", DropKind::kFeature, "trimmed_away",
     "no station of its largest connected area has min_num_neighbours of its 8 neighbours there"},
    {DropReason::kScattered, "filter_visibility", DropKind::kFeature, "scattered",
     "fewer than min_num_stations_driven of the stations that see it are connected"},
    {DropReason::kOutsideArea, "filter_visibility", DropKind::kView, "outside_area",
     "the station sees it, but lies outside of the one compact area that counts"},
    {DropReason::kNotCommon, "decompose_regions", DropKind::kFeature, "not_common",
     "no region has it in view from all of its stations"},
    {DropReason::kNotChosen, "decompose_regions", DropKind::kFeature, "not_chosen",
     "a region could keep it, but has enough others"},
    {DropReason::kFewFeatures, "decompose_regions", DropKind::kStation, "few_features",
     "fewer than k features are visible from it"},
    {DropReason::kFewCommonFeatures, "decompose_regions", DropKind::kStation, "few_common_features",
     "fewer than k features are visible from it and all stations within tau hops"},
    {DropReason::kLeftOver, "decompose_regions", DropKind::kStation, "left_over",
     "it is coverable, but no region covers it: rho, or what the algorithm leaves"},
    {DropReason::kOverBudget, "emit_map", DropKind::kFeature, "over_budget",
     "max_bytes leaves no room for it, and others serve the survey's images better"},
    {DropReason::kNotNeeded, "emit_map", DropKind::kFeature, "not_needed",
     "left-out survey images are localized as well without it"},
};

}  // namespace

const char* DropKindName(DropKind kind) {
  switch (kind) {
    case DropKind::kImage:
      return "image";
    case DropKind::kPair:
      return "pair";
    case DropKind::kFeature:
      return "feature";
    case DropKind::kKeypoint:
      return "keypoint";
    case DropKind::kView:
      return "view";
    case DropKind::kStation:
      return "station";
  }
  return "";
}

std::span<const DropReasonEntry> AllDropReasons() { return kReasons; }

const DropReasonEntry* FindDropReason(int reason_id) {
  for (const DropReasonEntry& entry : kReasons) {
    if (static_cast<int>(entry.reason) == reason_id) return &entry;
  }
  return nullptr;
}

const DropReasonEntry& DescribeDropReason(DropReason reason) {
  return *FindDropReason(static_cast<int>(reason));
}

}  // namespace cairn
