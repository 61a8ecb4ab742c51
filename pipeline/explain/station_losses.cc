#include "pipeline/explain/station_losses.h"

#include "core/blocks/map_rows.h"

namespace cairn::pipeline {

namespace {

std::vector<char> LandmarksOfRegions(const MapRows& rows) {
  std::vector<char> is_kept(rows.landmarks.size(), 0);
  for (const MapRegion& region : rows.regions) {
    for (const LandmarkIdx landmark : region.landmarks) is_kept[landmark] = 1;
  }
  return is_kept;
}

}  // namespace

StationLosses::StationLosses(const MapRows& rows)
    : rows_(rows),
      num_landmarks_(LandmarksSeenAt(rows)),
      num_of_regions_(LandmarksSeenAt(rows, LandmarksOfRegions(rows))) {}

int StationLosses::At(DropReason reason, StationIdx station) const {
  for (const DropCount& drop : rows_.findings.drops) {
    if (drop.reason_id == static_cast<int>(reason))
      return drop.at_stations.empty() ? 0 : drop.at_stations[station];
  }
  return 0;
}

int StationLosses::NumSeenTooSeldom(StationIdx station) const {
  int sum = 0;
  for (const DropReason reason :
       {DropReason::kFewObservations, DropReason::kSmallAngle, DropReason::kFewStations, DropReason::kHoles,
        DropReason::kNoBlock, DropReason::kTrimmedAway, DropReason::kScattered, DropReason::kOutsideArea}) {
    sum += At(reason, station);
  }
  return sum;
}

int StationLosses::NumAlike(StationIdx station) const { return At(DropReason::kAmbiguous, station); }

int StationLosses::NumVisible(StationIdx station) const {
  return At(DropReason::kNotCommon, station) + At(DropReason::kNotChosen, station) + num_of_regions_[station];
}

std::optional<DropReason> StationLosses::WhyUncovered(StationIdx station) const {
  for (const DropReason reason :
       {DropReason::kFewFeatures, DropReason::kFewCommonFeatures, DropReason::kLeftOver}) {
    if (At(reason, station) > 0) return reason;
  }
  return std::nullopt;
}

}  // namespace cairn::pipeline
