#include "pipeline/build/build_files.h"

#include <filesystem>
#include <regex>
#include <set>

#include "core/files/temporary.h"
#include "pipeline/build/build_folder.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// The name without what a temporary of it has at its end.
std::string WithoutTemporaryMark(const std::string& name) {
  return IsTemporaryName(name, "") ? name.substr(0, name.rfind(".tmp-")) : name;
}

}  // namespace

bool IsBuildFileName(const std::string& name) {
  static const std::regex kStageFile(
      "(capture|images|features|matches|poses|classes|world|regions|vocabulary|appearance|views|unsealed|map)"
      "([-.][0-9]+(of[0-9]+)?)*(\\.db|\\.cairn)?(\\.d|\\.stamp|\\.begun|\\.reuse|\\.report\\.json)*");
  static const std::set<std::string> kOthers = {"config.mk", "recipe", "check.json", "error.json", "lock"};
  const std::string stem = WithoutTemporaryMark(name);
  return kOthers.contains(stem) || std::regex_match(stem, kStageFile);
}

bool IsOptionsFileName(const std::string& name) {
  static const std::regex kOptionsFile(
      "seed|name|capture|queries|program|floor_plan|"
      "(simulate|extract_features|match_features|reconstruct|group_classes|filter_visibility|decompose_"
      "regions|"
      "build_vocabulary|link_appearance|decompose_views|emit_map|check_map)\\.toml");
  return std::regex_match(WithoutTemporaryMark(name), kOptionsFile);
}

Status CheckBuildFolder(const std::string& build_dir) {
  if (!ConfiguredRecipe(build_dir).empty()) return Ok();
  std::set<std::string> theirs;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(build_dir, error)) {
    const std::string name = entry.path().filename().string();
    if (name == "lock") continue;  // all that a build leaves which is killed before it has written config.mk
    if (IsBuildFileName(name)) theirs.insert(name);
  }
  if (theirs.empty()) return Ok();
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: is no build folder of cairn (nothing in it says that cairn wrote config.mk), and its "
                   "{} would be overwritten; name another with --build-dir, or move this one away",
                   build_dir, *theirs.begin());
}

}  // namespace cairn::pipeline
