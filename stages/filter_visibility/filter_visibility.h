#pragma once

#include <string>

#include "core/base/error.h"
#include "core/options/options.h"
#include "core/world/dropped_items.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"

namespace cairn::filter_visibility {

// Turns a survey into a world instance: the stations at which the robot stood, which of them are next to each
// other, and for each feature class that a robot can expect to see again (visible from enough stations, in
// one compact, nearly convex area) the stations that see it.  Before: group_classes.  After:
// decompose_regions.  Implements [Sala06 §VI-B] for lattice surveys.  Differs from it: a station counts among
// its own neighbours when areas are trimmed, so that the middle of a lone 3 x 3 block stays; of equal
// components the one with the smallest station stays.  In surveys that are not lattices a station is a cell
// of the floor and a heading, and a class only needs enough connected stations.
struct FilterVisibilityOptions {
  // How the survey was taken: "lattice" (places on a grid, each with several headings), "driven" (a
  // trajectory), or "auto" (lattice if at least half of the places have headings 30 degrees apart and nine in
  // ten lie on a grid).
  std::string survey = "auto";
  // Direction of up in the capture's world frame, "x,y,z", or "auto": mean of the cameras' up.
  std::string up = "auto";
  // An automatic up within this angle of an axis of the world frame is replaced by that
  // axis.  REQUIRES: in [0, 45]
  double up_snap_deg = 3;
  // Images within this distance of a place belong to it (lattice).  REQUIRES: > 0
  double same_place_m = 0.1;
  // Edge of a station's cell (driven).  REQUIRES: > 0
  double cell_size_m = 0.5;
  // Width of a station's heading (driven).  REQUIRES: in [1, 360]
  double heading_bin_deg = 45;
  // Least number of stations that must see a class (lattice) [Sala06: 16].  REQUIRES: >= 1
  int min_num_stations = 16;
  // Most stations in one hole of a class's area, and most holes (lattice) [Sala06: "few small holes"].  A
  // hole is a set of stations that do not see the class, enclosed by stations that do.  REQUIRES: >= 0
  int max_hole_stations = 4;
  int max_num_holes = 4;
  // The area must hold a full block of this many stations a side (lattice) [Sala06: 3].  REQUIRES: >= 1
  int min_block_side = 3;
  // Least number of a station's 8 lattice neighbours inside the area for it and its neighbours to stay; 0
  // trims nothing (lattice) [Sala06: 7].  REQUIRES: in [0, 8]
  int min_num_neighbours = 7;
  // Least number of connected stations that must see a class (driven).  REQUIRES: >= 1
  int min_num_stations_driven = 3;
};
OptionTable DescribeOptions(FilterVisibilityOptions* options);

struct FilterVisibilityResult {
  World world;  // features in ascending class id
  bool is_lattice = false;
  DropCounts dropped;  // classes, by the first filter that they fail
  // The same classes one by one, and the stations outside of the areas of those that stay.
  std::vector<DroppedItem> dropped_items;
};

// Pure: no files, no clock, no globals.  O(observations log observations).  Errors: InvalidArgument (a bad
// option, or survey = "lattice" for images that do not lie on a grid), Corrupt (a class observed in an
// unknown image), NoData (no image).  A survey of which no class is left is a world of stations without
// features.
Result<FilterVisibilityResult> FilterVisibility(const Classes& classes,
                                                const FilterVisibilityOptions& options);

// Why the world has no feature: how many of the classes each filter dropped.  One sentence.
std::string WhyNoFeature(const FilterVisibilityResult& result, size_t num_classes);

}  // namespace cairn::filter_visibility
