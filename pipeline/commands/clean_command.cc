#include "pipeline/commands/commands.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "core/files/database.h"
#include "core/files/file.h"
#include "core/files/folder_manifest.h"
#include "pipeline/build/build_files.h"
#include "pipeline/build/build_folder.h"
#include "pipeline/build/folder_lock.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

struct CleanArguments {
  std::string target;
  std::string build_dir;
  bool all = false;
  bool dry_run = false;
};

// What is removed: files first, then the folders that they leave empty, each after the folders inside it.
struct Removal {
  std::vector<fs::path> files, folders;
  std::vector<fs::path> kept;  // not cairn's
};

// Files and folders below `folder`; `is_ours` judges the paths of files relative to it.
template <typename IsOurs>
void CollectFolder(const fs::path& folder, const IsOurs& is_ours, Removal* removal) {
  std::error_code error;
  std::vector<fs::path> folders = {folder};
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder, error)) {
    if (entry.is_directory() && !entry.is_symlink()) {
      folders.push_back(entry.path());
    } else {
      (is_ours(entry.path().lexically_relative(folder)) ? removal->files : removal->kept)
          .push_back(entry.path());
    }
  }
  std::sort(folders.rbegin(), folders.rend());
  removal->folders.insert(removal->folders.end(), folders.begin(), folders.end());
}

Removal CollectBuildFolder(const std::string& build_dir) {
  Removal removal;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(build_dir, error)) {
    const std::string name = entry.path().filename().string();
    if (!entry.is_directory() || entry.is_symlink()) {
      (IsBuildFileName(name) ? removal.files : removal.kept).push_back(entry.path());
    } else if (name == "options") {
      CollectFolder(
          entry.path(), [](const fs::path& path) { return IsOptionsFileName(path.string()); }, &removal);
    } else if (IsBuildFileName(name)) {
      const std::set<std::string> files = OwnFiles(entry.path().string());
      CollectFolder(
          entry.path(), [&](const fs::path& path) { return files.contains(path.string()); }, &removal);
    } else {
      removal.kept.push_back(entry.path());
    }
  }
  for (auto* paths : {&removal.files, &removal.kept}) std::sort(paths->begin(), paths->end());
  removal.folders.emplace_back(build_dir);
  return removal;
}

// A folder's files as one line, the others one by one.
std::string RemovalText(const Removal& removal, const std::string& build_dir, const char* verb) {
  std::map<std::string, std::pair<int64_t, uintmax_t>> entries;  // path -> files, bytes
  for (const fs::path& path : removal.files) {
    const fs::path relative = path.lexically_relative(build_dir);
    const bool is_inside = std::distance(relative.begin(), relative.end()) > 1 && *relative.begin() != "..";
    auto& [num_files, num_bytes] =
        entries[is_inside ? (build_dir / *relative.begin()).string() + "/" : path.string()];
    std::error_code error;
    const uintmax_t size = fs::is_symlink(path) ? 0 : fs::file_size(path, error);
    num_files++;
    if (!error) num_bytes += size;
  }
  std::string text;
  for (const auto& [path, count] : entries) {
    text += fmt::format("{} {} ({}{:.1f} MB)\n", verb, path,
                        path.back() == '/' ? fmt::format("{} files, ", count.first) : "",
                        static_cast<double>(count.second) / 1e6);
  }
  for (const fs::path& path : removal.kept) text += fmt::format("kept {}: not cairn's\n", path.string());
  return text;
}

Status Remove(const Removal& removal) {
  for (const fs::path& path : removal.files) {
    std::error_code error;
    fs::remove(path, error);
    if (error) return MakeError(ErrorCode::kIo, "{}: cannot be removed: {}", path.string(), error.message());
  }
  for (const fs::path& path : removal.folders) {
    std::error_code error;  // a folder that still has files stays
    fs::remove(path, error);
  }
  return Ok();
}

// Build folders that were last configured from a recipe, in the current folder and in the recipe's.
std::vector<std::string> BuildFoldersOf(const std::string& recipe) {
  std::set<std::string> found;
  const fs::path path = fs::absolute(recipe).lexically_normal();
  for (const fs::path& place : {fs::current_path(), path.parent_path()}) {
    std::error_code error;
    for (const fs::directory_entry& entry : fs::directory_iterator(place, error)) {
      if (ConfiguredRecipe(entry.path().string()) == path.string())
        found.insert(entry.path().lexically_normal());
    }
  }
  return {found.begin(), found.end()};
}

// Whether a file is a map of cairn's, by its name and what SQLite has at its byte 68.
bool IsMap(const fs::path& path) {
  std::error_code error;
  return path.extension() == ".cairn" && fs::is_regular_file(fs::symlink_status(path, error)) &&
         IsSqliteFile(path.string()) && ReadHead(path.string(), 72).ends_with("crmp");
}

Status CleanBuildFolder(const std::string& build_dir, const fs::path& map, const CleanArguments& arguments,
                        std::ostream& out) {
  std::error_code error;
  Removal removal;
  std::optional<FolderLock> lock;
  if (fs::exists(build_dir + "/config.mk", error)) {
    CAIRN_ASSIGN_OR_RETURN(FolderLock held, FolderLock::Acquire(build_dir, NewBuildSession()));
    lock.emplace(std::move(held));
    removal = CollectBuildFolder(build_dir);
  } else if (fs::exists(build_dir, error)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: has no config.mk: not a build folder of cairn; nothing was removed", build_dir);
  }
  // What a file of the folder names may be anything.
  if (arguments.all && IsMap(map)) {
    removal.files.push_back(map);
    const fs::path report = ReportPath(map.string());
    if (fs::is_regular_file(fs::symlink_status(report, error))) removal.files.push_back(report);
  } else if (arguments.all && !map.empty() && fs::exists(fs::symlink_status(map, error))) {
    removal.kept.push_back(map);
  }
  out << RemovalText(removal, build_dir, arguments.dry_run ? "would remove" : "removed");
  return arguments.dry_run ? Ok() : Remove(removal);
}

Status Clean(const CleanArguments& arguments, std::ostream& out) {
  const fs::path target = fs::absolute(arguments.target).lexically_normal();
  std::error_code error;
  if (target.extension() == ".cairn") {
    const fs::path build_dir = arguments.build_dir.empty()
                                   ? fs::path(target).replace_extension(".build")
                                   : fs::absolute(arguments.build_dir).lexically_normal();
    if (!fs::exists(build_dir, error) && !(arguments.all && fs::exists(target, error))) {
      return MakeError(ErrorCode::kNotFound,
                       "{}: there is no build folder {}; was it compiled with --build-dir?", arguments.target,
                       build_dir.string());
    }
    return CleanBuildFolder(build_dir.string(), target, arguments, out);
  }
  if (fs::is_directory(target, error)) {
    if (!arguments.build_dir.empty()) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{} is a folder, and --build-dir names another; leave one of them out",
                       arguments.target);
    }
    return CleanBuildFolder(target.string(), ConfiguredMap(target.string()), arguments, out);
  }
  if (!fs::exists(target, error))
    return MakeError(ErrorCode::kNotFound, "{}: no such file", arguments.target);
  std::vector<std::string> build_dirs = BuildFoldersOf(arguments.target);
  if (!arguments.build_dir.empty())
    build_dirs = {fs::absolute(arguments.build_dir).lexically_normal().string()};
  if (build_dirs.empty()) {
    return MakeError(ErrorCode::kNotFound,
                     "{}: no build folder of this recipe is here or beside it; give the map or --build-dir",
                     arguments.target);
  }
  for (const std::string& build_dir : build_dirs)
    CAIRN_RETURN_IF_ERROR(CleanBuildFolder(build_dir, ConfiguredMap(build_dir), arguments, out));
  return Ok();
}

}  // namespace

Command CleanCommand() {
  const auto arguments = std::make_shared<CleanArguments>();
  return {.name = "clean",
          .summary = "Remove the build folder of a map, but no file in it that cairn did not make",
          .add_arguments =
              [arguments](ArgumentParser& parser) {
                parser
                    .Add("target", arguments->target,
                         "The map, its build folder, or its recipe (its build folders here and beside it)")
                    .Required()
                    .Type("NAME.cairn|DIR|RECIPE.toml");
                parser.Add("--build-dir", arguments->build_dir, "Build folder [NAME.build beside the map]")
                    .Type("FOLDER");
                parser.AddFlag("--all", arguments->all, "Remove the map and its build report as well");
                parser.AddFlag("-n,--dry-run", arguments->dry_run, "Only print what would be removed");
              },
          .run = [arguments](
                     const CommandEnvironment& environment) { return Clean(*arguments, *environment.out); }};
}

}  // namespace cairn::pipeline
