#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "pipeline/build/footage.h"
#include "pipeline/build/stage_options.h"

namespace cairn::pipeline {

// One survey of a recipe; paths are resolved against the recipe's folder.
struct RecipeCapture {
  // The session's name in the map: that of the capture's folder where the recipe gives none.
  std::string name;
  std::string path;
  CaptureKind kind = CaptureKind::kFolder;
  FootageOptions footage;  // of films and bags
  // Held-out images for the self-test; empty = the capture's queries.txt, if it has one.
  std::string queries_path;
  std::string floor_plan_path;  // empty = none
  // frame = "register": its poses, if it has any, are in a frame of its own.
  bool is_registered = false;

  // Films and bags are imported into the build folder first.
  bool IsFootage() const { return kind != CaptureKind::kFolder; }
};

// What a map is made from: a TOML file with `name`, `seed`, captures (or [simulate]), and a table of options
// per stage.  docs/recipe.md lists every key.
struct Recipe {
  std::string name;   // becomes the map's name: letters, digits, '-', '_' and '.'
  uint64_t seed = 0;  // of everything random in the compile
  // In the order of the recipe, with different names; none where the capture is simulated.
  std::vector<RecipeCapture> captures;
  // "auto", or the up direction in the captures' frame as "x,y,z".
  std::string up = "auto";
  bool simulated = false;  // [simulate]: the capture is rendered first
  // [simulate] floor_plan: a file of the rendered capture, relative to it; empty = none.
  std::string simulated_floor_plan;
  std::vector<StageOptions> stages;  // in the order of the line, defaults overridden by the recipe's tables
  // Keys of stages' tables that the recipe has, in its order.
  struct Key {
    std::string place;  // "FILE:LINE"
    std::string stage;
    std::string name;
  };
  std::vector<Key> stage_keys;
};

// Reads a recipe.  `stages` are the stages with their defaults (AllStageOptions()).
// Errors: NotFound, Io, Corrupt (not TOML); InvalidArgument for an unknown key or table (with the nearest
// valid one), a wrong type or a value outside its range, two captures of one name or folder, or of different
// up directions.  Each names the file and the line.
Result<Recipe> ReadRecipe(const std::string& path, std::vector<StageOptions> stages);

// Keys of the recipe that no stage reads, given its other keys: a line for each, with its place and the
// reason.  One recipe may serve several captures, so these keys are reported and not refused.  `skipped`:
// stages that do not run, and why.
std::vector<std::string> UnreadKeys(const Recipe& recipe,
                                    const std::vector<std::pair<std::string, std::string>>& skipped);

// The name that a map or a session gets from its folder, or its file without the suffix: characters that a
// name must not have become '_'.
std::string NameOfFolder(const std::string& path);

// The reference page of recipes (docs/recipe.md): every key with its default, range and meaning, in Markdown.
std::string RecipeReference(const std::vector<StageOptions>& stages);

}  // namespace cairn::pipeline
