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

// Finds the recipe that `compile`, `configure` and `pareto` are given: a recipe, a film, a bag, or the folder
// of a capture.  For all but a recipe, the recipe that compiles it with defaults is written beside the map:
// NAME.toml beside NAME.cairn; without `map`, NAME is its name (without a file's suffix), in the current
// folder.  An existing recipe with the same content stays; one with other content is never overwritten.
// Errors: NotFound; InvalidArgument, each with what to do instead: a folder without images, a build folder, a
// file that is an image, a map or another database, another NAME.toml, a name that Make cannot handle; Io.
Result<RecipeSource> FindRecipe(const std::string& given, const std::string& map);

// Errors: NotFound, InvalidArgument, each with what it is instead, where `given` is not the folder of a
// capture, a film or a bag.
Status CheckIsSurvey(const std::string& given);

// Writes a recipe for `map` where none is beside it.  Returns whether it is new.  Errors: InvalidArgument
// (one with other content is there, which is never overwritten; `what`: "compiles hall with defaults"), Io.
Result<bool> WriteNewRecipe(const std::string& recipe, const std::string& text, const std::string& what,
                            const std::string& map);

}  // namespace cairn::pipeline
