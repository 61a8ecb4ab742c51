#pragma once

#include <cstdint>
#include <string>

#include "core/base/error.h"
#include "sim/render/options.h"

namespace cairn::simulate {

// The one key of [simulate] that is not an option of the stage: which file of the rendered capture is the
// floor plan of the map made from it.
struct SimulatedFloorPlanKey {
  static constexpr const char* kName = "floor_plan";
  static constexpr const char* kHelp =
      "Floor plan for the map, a file of the rendered capture: \"floor_plan.geojson\" is the building's. "
      "Default: none.";
};

// Takes options and seed from a recipe's [simulate] table, or the options from a file with only such a
// table's keys.  Other tables belong to other stages.  Errors: NotFound, Corrupt, InvalidArgument (a recipe
// without the table; keys and values).
Status ReadSimulateRecipe(const std::string& path, sim::SimulateOptions* options, uint64_t* seed);

}  // namespace cairn::simulate
