#pragma once

#include <map>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"
#include "stages/filter_visibility/filter_visibility.h"

namespace cairn::filter_visibility {

// A column and row of the floor: of the survey's lattice, or of the cells of a driven survey.
using Cell = std::pair<int, int>;

// The stations of a survey, ordered by (row, column, heading).
struct Stations {
  bool is_lattice = false;
  World world;                            // everything but features
  std::vector<Cell> cells;                // per station
  std::map<Cell, StationIdx> station_at;  // lattice surveys: unique
  std::map<ImageId, StationIdx> station_of_image;
};

// The smallest rotation that takes `up` (any length) to +z; identity within 1e-6 of +z.
Pose FloorFromUp(const Eigen::Vector3d& up);

// Recognises the kind of survey and groups its images into stations.  Errors: as FilterVisibility.
Result<Stations> FindStations(const std::vector<SurveyImage>& images, const FilterVisibilityOptions& options);

}  // namespace cairn::filter_visibility
