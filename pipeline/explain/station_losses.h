#pragma once

#include <optional>
#include <vector>

#include "core/blocks/map_rows.h"
#include "core/world/drop_reason.h"

namespace cairn::pipeline {

// What became of the scene features at every station, from the map's own counts (core/blocks/map_findings.h).
class StationLosses {
 public:
  explicit StationLosses(const MapRows& rows);

  // Items that a reason dropped at a station.
  int At(DropReason reason, StationIdx station) const;
  // Distinct landmarks that the images taken there see.
  int NumLandmarks(StationIdx station) const { return num_landmarks_[station]; }
  // Scene features that were seen there from too few places: images around it would make landmarks of them.
  int NumSeenTooSeldom(StationIdx station) const;
  // That look like others elsewhere.
  int NumAlike(StationIdx station) const;
  // That a robot there can expect to see: features of the world, kept or not.
  int NumVisible(StationIdx station) const;
  // Why it is covered by no region; nothing where a region covers it, or where the map does not store it.
  std::optional<DropReason> WhyUncovered(StationIdx station) const;

 private:
  const MapRows& rows_;
  std::vector<int> num_landmarks_, num_of_regions_;
};

}  // namespace cairn::pipeline
