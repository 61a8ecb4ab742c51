#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/options/options.h"
#include "stages/decompose_views/formats/grid_walls.h"
#include "stages/decompose_views/formats/input_plan.h"
#include "stages/decompose_views/formats/plan_units.h"

namespace cairn::decompose_views {

struct ReadPlanOptions {
  // Of PlanUnits(): the unit of the file's coordinates.
  std::string units = kUnitOfFile;
  // DXF: the layers that have walls (formats/dxf_plan.h); empty: all that are neither off nor frozen.
  std::string layers;
  // DXF: how far a chord of an arc may lie beside it.  REQUIRES: in [0.0001, 10]
  double curve_tolerance_m = 0.01;
  GridWallsOptions grid;
};
OptionTable DescribeOptions(ReadPlanOptions* options);

// Reads a floor plan, in metres:
//   ROS occupancy grids: a map's YAML file, by its name (.yaml, .yml; formats/occupancy_grid.h, grid_walls.h)
//   GeoJSON, where the text begins with '{' (formats/geojson_plan.h)
//   ASCII DXF, where it begins as one does (formats/dxf_plan.h)
//   lines `x0,y0,x1,y1`, blank ones and those that begin with '#' left out
// Errors: those of the formats; of lines NotFound, Corrupt (not four finite numbers in a line; names it),
// NoData; Unsupported: other kinds of file, degrees, and a size that no building has (formats/plan_units.h);
// InvalidArgument: options out of range, or that this kind of file does not have.
Result<InputPlan> ReadPlan(const std::string& path, const ReadPlanOptions& options = {});
// All but grids.  `what` names the text in messages.
Result<InputPlan> ParsePlan(const std::string& text, const std::string& what,
                            const ReadPlanOptions& options = {});

// The files that ReadPlan opens besides `path`: a grid's image.  Where they cannot be told, as the file is
// missing or damaged, none: ReadPlan says why.
std::vector<std::string> OtherFilesOfPlan(const std::string& path);

}  // namespace cairn::decompose_views
