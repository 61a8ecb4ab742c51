#pragma once

#include <span>
#include <string>

namespace cairn {

// Why a stage dropped something.  The numbers are stored in the stages' files and in maps: append only, never
// renumber.  What each means is said once, in drop_reason.cc and in schemas/drops.md.
enum class DropReason : int {
  // extract_features
  kUnreadable = 1,
  // match_features
  kNoFeatures = 10,
  kFewMatches = 11,
  kFewInliers = 12,
  kWatermark = 13,
  // group_classes
  kNoPose = 20,
  kPairWithoutPose = 21,
  kFewObservations = 22,
  kReprojectionError = 23,
  kSmallAngle = 24,
  kAmbiguous = 25,
  kDuplicate = 26,
  kOutlier = 27,
  kVanished = 28,
  // filter_visibility
  kFewStations = 30,
  kHoles = 31,
  kNoBlock = 32,
  kTrimmedAway = 33,
  kScattered = 34,
  kOutsideArea = 35,
  // decompose_regions
  kNotCommon = 40,
  kNotChosen = 41,
  kFewFeatures = 42,
  kFewCommonFeatures = 43,
  kLeftOver = 44,
  // emit_map
  kOverBudget = 50,
  kNotNeeded = 51,
};

// What is dropped, and so what is counted.
//   image, pair, station    as in the glossary
//   feature                 a scene feature: a track, a feature class or a feature of a world, by the stage
//   keypoint                of a class that stays
//   view                    a class that stays and a station that saw it, but where it does not count as
//                           visible
enum class DropKind { kImage, kPair, kFeature, kKeypoint, kView, kStation };
const char* DropKindName(DropKind kind);  // "image"

struct DropReasonEntry {
  DropReason reason;
  const char* stage;  // "group_classes"
  DropKind kind;
  const char* name;  // "few_observations": unique
  const char* text;  // why, as the rest of a sentence: "its track has fewer keypoints than ..."
};

// All reasons, ascending.
std::span<const DropReasonEntry> AllDropReasons();
const DropReasonEntry& DescribeDropReason(DropReason reason);
// The entry of a stored number; null where there is none.
const DropReasonEntry* FindDropReason(int reason_id);

}  // namespace cairn
