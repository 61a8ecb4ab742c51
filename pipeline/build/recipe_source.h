#pragma once

#include <string>

#include "core/base/error.h"

namespace cairn::pipeline {

// A recipe and the map to compile it to.
struct RecipeSource {
  std::string recipe;
  std::string map;           // as given; empty: NAME.cairn in the current folder, by the recipe's name
  bool was_written = false;  // the recipe is new
};

// What `compile`, `configure` and `pareto` are given as a recipe: one, or the folder of a capture.  For a
// folder the recipe that compiles it with defaults is written beside the map: NAME.toml beside NAME.cairn;
// without `map` that is the folder's name, in the current folder.  A recipe of the same content stays; one of
// another is never written over. Errors: NotFound; InvalidArgument, each with what to do instead: a folder
// without images, a build folder, a file that is an image, a map or another database, another NAME.toml, a
// name that Make cannot carry; Io.
Result<RecipeSource> FindRecipe(const std::string& given, const std::string& map);

}  // namespace cairn::pipeline
