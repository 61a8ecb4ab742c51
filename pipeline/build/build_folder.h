#pragma once

#include <string>

#include "core/base/error.h"
#include "pipeline/build/recipe.h"

namespace cairn::pipeline {

// Where a recipe is compiled to, and by which program; all paths are absolute.
struct BuildPaths {
  std::string build_dir;  // the build folder: options, stage files, stamps
  std::string map;        // NAME.cairn
  std::string program;    // cairn
  std::string recipe;     // as an absolute path
};

// What a film or bag is called in the build folder, once it is imported: "film-NAME", "bag-NAME".
std::string FootageFolderName(const RecipeCapture& capture);

// Whether captures have no poses, or none in the frame of the others: then `reconstruct` finds them.
bool IsReconstructed(const Recipe& recipe);
// Whether only some have none: then these are registered to the others.  Errors: those of SessionsToRegister.
Result<bool> IsRegistered(const Recipe& recipe);
// Whether the recipe names a floor plan: then `decompose_views` divides it.
bool HasFloorPlan(const Recipe& recipe);
// Whether images are held out of the survey: listed, rendered, or by `reconstruct`.
bool HasQueries(const Recipe& recipe);
// Whether runs of the survey's images try maps without them instead: then `leave_out` makes these.
bool LeavesOut(const Recipe& recipe);

// Splits a recipe into the files that map.mk's rules depend on, each rewritten only when its content changes:
//   options/STAGE.toml    every option of the stage, in canonical form (OptionsToml)
//   options/seed, name, capture, queries    one value each; `capture` has a line for each of several,
//                         `queries` is "left_out" where LeavesOut
//   options/film-NAME, options/bag-NAME     what is imported, and how
//   options/odometry      whose odometry or IMU gives poses their scale, and how bags' is read
//   options/program       hash of the program: another program redoes every stage, whatever its date
//   config.mk             MAP, CAPTURE, FOOTAGE, FOOTAGE_FILES, FOOTAGE_OPTIONS, SESSIONS, SESSION_QUERIES,
//   SESSIONS_REGISTERED,
//                         SIMULATED, RECONSTRUCTED, KNOWN_PLACES, QUERIES, LEFT_OUT, FLOOR_PLAN,
//                         FLOOR_PLAN_FILES, NAME, SEED, PROGRAM, VOCABULARY_TREE, PREVIOUS_MAP and MODEL for
//                         map.mk
//   recipe                path of the recipe, for people and for `cairn clean`; not part of a Makefile
// Errors: InvalidArgument (CheckMakePath; places that [reconstruct] names, with several captures), NotFound
// (a file that [reconstruct] names), Io.
Status WriteBuildFolder(const Recipe& recipe, const BuildPaths& paths);

// The map and the recipe that a folder was last configured for; empty where it is not a build folder.
std::string ConfiguredMap(const std::string& build_dir);
std::string ConfiguredRecipe(const std::string& build_dir);

}  // namespace cairn::pipeline
