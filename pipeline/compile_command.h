#pragma once

#include "core/command.h"

namespace cairn {

// `cairn compile RECIPE.toml -o NAME.cairn`: splits the recipe into a build folder and lets GNU Make run
// map.mk there.
Command CompileCommand();
// `cairn configure RECIPE.toml -o NAME.cairn --build-dir DIR`: only splits the recipe, for Makefiles that
// include map.mk.
Command ConfigureCommand();
// `cairn recipe-reference`: prints docs/recipe.md.
Command RecipeReferenceCommand();

}  // namespace cairn
