#include "pipeline/build/build_files.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <regex>
#include <set>

#include "core/files/file.h"
#include "core/files/folder_manifest.h"
#include "core/files/temporary.h"
#include "pipeline/build/build_folder.h"
#include "pipeline/build/line.h"
#include "stages/extract_features/dependency_file.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// The name without the suffix that a temporary file of it has.
std::string WithoutTemporaryMark(const std::string& name) {
  return IsTemporaryName(name, "") ? name.substr(0, name.rfind(".tmp-")) : name;
}

}  // namespace

bool IsBuildFileName(const std::string& name) {
  static const std::regex kStageFile = [] {
    std::string stems = "images|(film|bag|map)-[-A-Za-z0-9_.]+";
    for (const LineStage& stage : kLine) stems += "|" + fs::path(stage.file).stem().string();
    return std::regex("(" + stems +
                      ")([-.][0-9]+(of[0-9]+|-plan)?)*(\\.db|\\.cairn)?(\\.d|\\.stamp|\\.begun|\\.reuse|\\."
                      "solved|\\.shards|"
                      "\\.report\\.json)*");
  }();
  static const std::set<std::string> kOthers = {"config.mk", "recipe", "check.json", "error.json", "lock"};
  const std::string stem = WithoutTemporaryMark(name);
  return kOthers.contains(stem) || std::regex_match(stem, kStageFile);
}

bool IsOptionsFileName(const std::string& name) {
  static const std::regex kFootage("(film|bag)-[-A-Za-z0-9_.]+");
  static const std::set<std::string> kOthers = {"seed",    "name",    "capture",   "odometry",
                                                "queries", "program", "floor_plan"};
  const std::string stem = WithoutTemporaryMark(name);
  return kOthers.contains(stem) || std::regex_match(stem, kFootage) ||
         std::any_of(std::begin(kLine), std::end(kLine),
                     [&](const LineStage& stage) { return stem == std::string(stage.name) + ".toml"; });
}

Status CheckBuildFolder(const std::string& build_dir) {
  // Make reads it.
  const std::string dependencies = build_dir + "/images.d";
  std::error_code no_file;
  if (fs::exists(fs::symlink_status(dependencies, no_file))) {
    const Result<std::string> text = ReadFile(dependencies);
    if (!text.ok() || !extract_features::IsDependencyFile(*text)) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: is not as extract-features writes it, and make would do what it says; remove it",
                       dependencies);
    }
  }
  if (!ConfiguredRecipe(build_dir).empty()) return Ok();
  std::set<std::string> theirs;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(build_dir, error)) {
    const std::string name = entry.path().filename().string();
    // All there is of a build that was killed before it wrote config.mk.
    if (name == "lock" || (name.starts_with("map-") && !OwnFiles(entry.path().string()).empty())) continue;
    if (IsBuildFileName(name)) theirs.insert(name);
  }
  if (theirs.empty()) return Ok();
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: not a build folder of cairn (nothing in it says that cairn wrote config.mk), and its "
                   "{} would be overwritten; name another folder with --build-dir, or move this one away",
                   build_dir, *theirs.begin());
}

}  // namespace cairn::pipeline
