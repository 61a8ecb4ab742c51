#include "pipeline/build_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "core/file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLockFile = "/lock";

Status CreateFolder(const std::string& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (!error) return Ok();
  return MakeError(ErrorCode::kIo, "{}: the folder cannot be made: {}", path, error.message());
}

std::string Absolute(const std::string& path) {
  std::string text = fs::absolute(path).lexically_normal().string();
  while (text.size() > 1 && text.back() == '/') text.pop_back();
  return text;
}

// Tells programs apart without reading them, as map.mk does: bytes and seconds since 1970.
std::string SizeAndDate(const std::string& path) {
  struct stat status = {};
  if (stat(path.c_str(), &status) != 0) return "";
  return fmt::format("{}-{}", status.st_size, status.st_mtim.tv_sec);
}

// The value of an option of [reconstruct].
std::string ReconstructOptionText(const Recipe& recipe, const std::string& name) {
  for (const StageOptions& stage : recipe.stages) {
    if (stage.stage != "reconstruct") continue;
    for (const Option& option : stage.table) {
      if (option.name == name) return OptionValueText(option);
    }
  }
  return "";
}

// Files that tell where images stand, beside the capture's own.
Result<std::string> KnownPlaces(const Recipe& recipe, const std::string& capture) {
  std::string files;
  for (const char* name : {"control_points", "distances"}) {
    const std::string file = ReconstructOptionText(recipe, name);
    if (file.empty()) continue;
    const std::string path = (fs::path(capture) / file).lexically_normal().string();
    CAIRN_RETURN_IF_ERROR(CheckMakePath(fmt::format("[reconstruct] {}", name), path));
    if (!fs::exists(path)) {
      return MakeError(ErrorCode::kNotFound,
                       "[reconstruct] {} = \"{}\": there is no {} (paths are relative to the capture)", name,
                       file, path);
    }
    files += (files.empty() ? "" : " ") + path;
  }
  return files;
}

// The held-out images that check_map localizes; empty = the map is sealed without a self-test.
std::string QueriesPath(const Recipe& recipe, const std::string& capture, const std::string& build_dir) {
  if (!recipe.queries_path.empty()) return Absolute(recipe.queries_path);
  if (IsReconstructed(recipe))
    return ReconstructOptionText(recipe, "hold_out_every") == "0" ? "" : build_dir + "/poses/queries.txt";
  const std::string queries = capture + "/queries.txt";
  return recipe.simulated || fs::exists(queries) ? queries : "";
}

}  // namespace

bool IsReconstructed(const Recipe& recipe) {
  return !recipe.simulated && !fs::exists(recipe.capture_path + "/images.txt");
}

Status CheckMakePath(const std::string& what, const std::string& path) {
  static constexpr std::string_view kSpecial = "$#%:;&|<>()[]*?'\"`\\=!";
  for (const char c : path) {
    const bool is_space = std::isspace(static_cast<unsigned char>(c)) != 0;
    if (!is_space && kSpecial.find(c) == std::string_view::npos) continue;
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{} '{}' has {} in its path, which Make cannot carry; rename the folder or put it elsewhere", what,
        path, is_space ? "a space" : fmt::format("'{}'", c));
  }
  return Ok();
}

Status WriteBuildFolder(const Recipe& recipe, const BuildPaths& paths) {
  const std::string capture = recipe.simulated ? paths.build_dir + "/capture" : Absolute(recipe.capture_path);
  const std::string queries = QueriesPath(recipe, capture, paths.build_dir);
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the build folder", paths.build_dir));
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the map", paths.map));
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the capture", capture));
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the list of queries", queries));
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the program", paths.program));

  const std::string options = paths.build_dir + "/options";
  CAIRN_RETURN_IF_ERROR(CreateFolder(options));
  for (const StageOptions& stage : recipe.stages) {
    CAIRN_RETURN_IF_ERROR(
        WriteFileAtomically(options + "/" + stage.stage + ".toml", OptionsToml(stage.table)));
  }
  const std::string seed = std::to_string(recipe.seed);
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(options + "/seed", seed + "\n"));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(options + "/name", recipe.name + "\n"));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(options + "/capture", capture + "\n"));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(options + "/queries", queries + "\n"));
  CAIRN_ASSIGN_OR_RETURN(const std::string program_hash, HashFile(paths.program));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(options + "/program", program_hash + "\n"));
  std::string known_places;
  if (IsReconstructed(recipe)) {
    CAIRN_ASSIGN_OR_RETURN(known_places, KnownPlaces(recipe, capture));
  }
  const std::string config = fmt::format(
      "# Written by cairn from the recipe; edit that instead.\n"
      "MAP := {}\nCAPTURE := {}\nSIMULATED := {}\nRECONSTRUCTED := {}\nKNOWN_PLACES := {}\nQUERIES := {}\n"
      "NAME := {}\nSEED := {}\nPROGRAM := {}\n",
      paths.map, capture, recipe.simulated ? "yes" : "no", IsReconstructed(recipe) ? "yes" : "no",
      known_places, queries, recipe.name, seed, SizeAndDate(paths.program));
  return WriteFileAtomically(paths.build_dir + "/config.mk", config);
}

void RemoveStaleTemporaries(const std::string& build_dir) {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(build_dir, error)) {
    const bool is_stale = entry.path().filename().string().find(".tmp-") != std::string::npos ||
                          entry.path().extension() == ".begun";  // the stamp of a rule that did not end
    if (!is_stale) continue;
    std::error_code remove_error;  // one that cannot be removed only takes room
    fs::remove(entry.path(), remove_error);
  }
}

Result<FolderLock> FolderLock::Acquire(const std::string& build_dir) {
  CAIRN_RETURN_IF_ERROR(CreateFolder(build_dir));
  const std::string path = build_dir + kLockFile;
  const int fd = open(path.c_str(), O_RDWR | O_CREAT, 0666);
  if (fd < 0) return MakeError(ErrorCode::kIo, "{}: cannot be opened: {}", path, std::strerror(errno));
  if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
    const int reason = errno;
    close(fd);
    if (reason != EWOULDBLOCK) {
      return MakeError(ErrorCode::kIo, "{}: cannot be locked: {}", path, std::strerror(reason));
    }
    std::string owner = ReadFile(path).ok() ? ReadFile(path).value() : "";
    while (!owner.empty() && owner.back() == '\n') owner.pop_back();
    return MakeError(
        ErrorCode::kBusy,
        "{}: another compile (process {}) is at work in this build folder; wait for it, or give another "
        "--build-dir",
        build_dir, owner.empty() ? "unknown" : owner);
  }
  const std::string owner = fmt::format("{}\n", getpid());
  if (ftruncate(fd, 0) != 0 || write(fd, owner.data(), owner.size()) != static_cast<ssize_t>(owner.size())) {
    const int reason = errno;
    close(fd);
    return MakeError(ErrorCode::kIo, "{}: cannot be written: {}", path, std::strerror(reason));
  }
  return FolderLock(fd);
}

FolderLock::FolderLock(FolderLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

FolderLock::~FolderLock() {
  if (fd_ >= 0) close(fd_);
}

}  // namespace cairn
