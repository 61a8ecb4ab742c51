#pragma once

#include <optional>
#include <vector>

#include "core/blocks/map_findings.h"
#include "core/blocks/map_rows.h"
#include "stages/check_map/check_map.h"

namespace cairn::check_map {

// Median over the stations of the distance from a station's place to the next other place, metres; 0 where
// all stations stand at one place.  O(n^1.5) for a lattice.
double StationSpacingM(const std::vector<MapStation>& stations);

// The station at which a camera stands: of those whose heading is within max_station_heading_deg of the
// camera's (or that see all around) the nearest, then the one of nearest heading, then the first.  Nothing
// where it is farther away than max_station_distance_ratio times the spacing (if all stations are at one
// place: any distance).  `cam_from_world` is in the frame of the poses that the capture states.  O(n).
std::optional<StationIdx> StationOf(const Pose& cam_from_world, double spacing_m, const MapRows& rows,
                                    const CheckMapOptions& options);

// Fills in StationOf of every image with a true pose.
void FindStations(const MapRows& rows, const CheckMapOptions& options, std::vector<HeldOutResult>* results);

// The results of the images with a true pose, by the regions that have their station.  Ascending region;
// images at no station of any region count in kOutsideRegions.
std::vector<RegionSelfTest> SummarizeRegions(const MapRows& rows, const std::vector<HeldOutResult>& results,
                                             const CheckMapOptions& options);

}  // namespace cairn::check_map
