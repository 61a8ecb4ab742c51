#pragma once

#include <string>

#include "core/base/error.h"
#include "core/line/command.h"
#include "pipeline/build/build_folder.h"

namespace cairn::pipeline {

// What `cairn compile`, and commands that end in a compile, are told.
struct CompileArguments {
  std::string recipe;  // or a film, a bag, the folder of a capture
  std::string output;
  std::string build_dir;
  std::string until;
  int num_shards = 1;
  int min_num_shard_images = 64;
  int num_jobs = 0;  // 0: as many as shards
  std::string launcher;
  bool no_space_check = false;
};

// Adds --until to --no-space-check.
void AddRunArguments(ArgumentParser& parser, CompileArguments* arguments);

// The map, the build folder and the recipe, absolute.  Errors: InvalidArgument (a map whose name does not end
// in .cairn, a folder that is no build folder), Io (the map's folder does not exist).
Result<BuildPaths> ResolvePaths(const CompileArguments& arguments);

// Compiles the recipe.  Errors: that of the stage that failed.
Status Compile(CompileArguments arguments, const CommandEnvironment& environment);

}  // namespace cairn::pipeline
