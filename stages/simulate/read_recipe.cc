#include "stages/simulate/read_recipe.h"

#include "core/options/toml_options.h"

namespace cairn::simulate {

Status ReadSimulateRecipe(const std::string& path, sim::SimulateOptions* options, uint64_t* seed) {
  CAIRN_ASSIGN_OR_RETURN(const toml::table document, ReadTomlFile(path));
  const toml::node* node = document.get("simulate");
  if (node == nullptr && (document.contains("name") || document.contains("capture"))) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: a recipe without [simulate], so there is nothing to render; add the table, or "
                     "compile the recipe's own capture",
                     path);
  }
  if (node == nullptr) return SetOptionsFromToml(document, path, DescribeOptions(options));
  if (!node->is_table()) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: 'simulate' is not a table; write [simulate]",
                     TomlPlace(path, *node));
  }
  if (const toml::node* seed_node = document.get("seed")) {
    const auto* value = seed_node->as_integer();
    if (value == nullptr || value->get() < 0) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: seed: expected an integer of at least 0",
                       TomlPlace(path, *seed_node));
    }
    *seed = static_cast<uint64_t>(value->get());
  }
  OptionTable table = DescribeOptions(options);
  std::string floor_plan;
  table.push_back(
      {.name = SimulatedFloorPlanKey::kName, .value = &floor_plan, .help = SimulatedFloorPlanKey::kHelp});
  return SetOptionsFromToml(*node->as_table(), path, table);
}

}  // namespace cairn::simulate
