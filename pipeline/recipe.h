#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"
#include "pipeline/stage_options.h"

namespace cairn {

// What a map is made from: a TOML file with `name`, `seed`, one capture (or [simulate]), and a table of
// options per stage.  docs/recipe.md lists every key.
struct Recipe {
  std::string name;   // becomes the map's name: letters, digits, '-', '_' and '.'
  uint64_t seed = 0;  // of everything random in the compile
  // Folder of the capture; relative paths of the recipe are resolved against the recipe's folder.  Empty
  // where the capture is simulated.
  std::string capture_path;
  // Held-out images for the self-test; empty = the capture's queries.txt, if it has one.
  std::string queries_path;
  std::string floor_plan_path;  // empty = none
  // "auto", or the up direction in the capture's frame as "x,y,z".
  std::string up = "auto";
  bool simulated = false;            // [simulate]: the capture is rendered first
  std::vector<StageOptions> stages;  // in the order of the line, defaults overridden by the recipe's tables
};

// Reads a recipe.  `stages` are the stages with their defaults (AllStageOptions()).
// Errors: NotFound, Io, Corrupt (not TOML), Unsupported (several captures); InvalidArgument for an unknown
// key or table (with the nearest valid one), a wrong type or a value outside its range.  Each names the file
// and the line.
Result<Recipe> ReadRecipe(const std::string& path, std::vector<StageOptions> stages);

// The reference page of recipes (docs/recipe.md): every key with its default, range and meaning, in Markdown.
std::string RecipeReference(const std::vector<StageOptions>& stages);

}  // namespace cairn
