#include "runtime/update_map.h"

#include <fcntl.h>
#include <stdio.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>

#include "core/file.h"
#include "core/file_lock.h"
#include "core/map_delta.h"
#include "core/map_file.h"
#include "core/output_path.h"
#include "core/temporary.h"
#include "core/write_error.h"
#include "runtime/no_throw.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Holds the folder of a map against other updates and rollbacks there, until it goes.
// Errors: Busy, NotFound, Io.
Result<FileLock> LockFolderOf(const std::string& map_path) {
  FileLock lock(open(FolderOf(map_path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (lock.descriptor() < 0) {
    return MakeError(errno == ENOENT ? ErrorCode::kNotFound : ErrorCode::kIo, "{}: its folder: {}", map_path,
                     std::strerror(errno));
  }
  if (lock.Try(FileLock::Kind::kExclusive) == FileLock::Claim::kHeld) return lock;
  return MakeError(ErrorCode::kBusy, "{}: another update or rollback is at work in its folder; try again",
                   map_path);
}

// The file itself where the path is a link to it: that is what others read.
std::string FileOf(const std::string& map_path) {
  std::error_code error;
  const fs::path file = fs::canonical(map_path, error);
  return error ? map_path : file.string();
}

// What updates that were killed have left beside a map.  REQUIRES: LockFolderOf(map_path)
void RemoveStale(const std::string& map_path) {
  std::error_code error;
  const fs::path map(map_path);
  for (const fs::directory_entry& entry : fs::directory_iterator(FolderOf(map_path), error)) {
    const std::string name = entry.path().filename().string();
    for (const std::string& target : {map.filename().string(), PreviousMapPath(map.filename().string())}) {
      if (IsTemporaryName(name, target)) fs::remove(entry.path(), error);
    }
  }
}

// Writes `bytes`, a map made by a delta, to `path`; `before_replacing` runs when nothing but the last step is
// left.
Status WriteMap(const std::string& bytes, const std::string& path, const std::string& delta_path,
                const UpdateOptions& options, const std::function<Status()>& before_replacing) {
  return ReplaceFileAtomically(path, [&](const std::string& temporary) -> Status {
    std::ofstream file(temporary, std::ios::binary);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    file.close();
    if (!file) return WriteError(path, "cannot be written", errno);
    // What robots would refuse to open must not take the place of what they can.
    if (const Result<MapFile> map = MapFile::Open(temporary, {.public_key = options.public_key}); !map.ok()) {
      return MakeError(map.error().code, "{}: leads to a map that cannot be opened: {}", delta_path,
                       map.error().message);
    }
    return before_replacing();
  });
}

// A second name for the file, or, where the file system has none, a copy.
Status KeepPrevious(const std::string& map_path) {
  std::error_code ignored;
  if (fs::is_symlink(PreviousMapPath(map_path), ignored)) fs::remove(PreviousMapPath(map_path), ignored);
  return ReplaceFileAtomically(PreviousMapPath(map_path), [&](const std::string& temporary) -> Status {
    std::error_code error;
    fs::create_hard_link(map_path, temporary, error);
    if (error) fs::copy_file(map_path, temporary, error);
    if (error) return WriteError(PreviousMapPath(map_path), "cannot be written", error.value());
    return Ok();
  });
}

}  // namespace

Status ApplyDelta(const std::string& old_path, const std::string& delta_path, const std::string& new_path,
                  const UpdateOptions& options) {
  return WithoutExceptions("ApplyDelta", [&]() -> Status {
    if (IsSameFile(old_path, new_path)) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "{}: is the map to start from and cannot be the one to write; --in-place replaces it and "
          "keeps the old one beside it",
          new_path);
    }
    CAIRN_RETURN_IF_ERROR(CheckOutputIsNoInput(new_path, {delta_path}));
    CAIRN_ASSIGN_OR_RETURN(const MapDelta delta, ReadMapDelta(delta_path, options.public_key));
    CAIRN_ASSIGN_OR_RETURN(const std::string old_bytes, ReadFile(old_path));
    CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ApplyMapDelta(delta, old_bytes, old_path, delta_path));
    return WriteMap(bytes, new_path, delta_path, options, [] { return Ok(); });
  });
}

Result<bool> UpdateMap(const std::string& given_path, const std::string& delta_path,
                       const UpdateOptions& options) {
  return WithoutExceptions("UpdateMap", [&]() -> Result<bool> {
    const std::string map_path = FileOf(given_path);
    CAIRN_RETURN_IF_ERROR(CheckOutputIsNoInput(map_path, {delta_path}));
    CAIRN_ASSIGN_OR_RETURN(const FileLock lock, LockFolderOf(map_path));
    RemoveStale(map_path);
    CAIRN_ASSIGN_OR_RETURN(const MapDelta delta, ReadMapDelta(delta_path, options.public_key));
    CAIRN_ASSIGN_OR_RETURN(const std::string old_bytes, ReadFile(map_path));
    if (HashOf(old_bytes) == delta.new_hash) return false;
    CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ApplyMapDelta(delta, old_bytes, map_path, delta_path));
    CAIRN_RETURN_IF_ERROR(
        WriteMap(bytes, map_path, delta_path, options, [&] { return KeepPrevious(map_path); }));
    return true;
  });
}

std::string PreviousMapPath(const std::string& map_path) { return map_path + ".previous"; }

Status RollBackMap(const std::string& given_path, const UpdateOptions& options) {
  return WithoutExceptions("RollBackMap", [&]() -> Status {
    const std::string map_path = FileOf(given_path);
    CAIRN_ASSIGN_OR_RETURN(const FileLock lock, LockFolderOf(map_path));
    const std::string previous = PreviousMapPath(map_path);
    std::error_code error;
    if (!fs::exists(previous, error)) {
      return MakeError(
          ErrorCode::kNotFound,
          "{}: no such file; there is a previous map only where `cairn apply --in-place` made one", previous);
    }
    CAIRN_RETURN_IF_ERROR(MapFile::Open(previous, {.public_key = options.public_key}));
    CAIRN_RETURN_IF_ERROR(CheckFileHash(previous));
    if (renameat2(AT_FDCWD, previous.c_str(), AT_FDCWD, map_path.c_str(), RENAME_EXCHANGE) == 0) return Ok();
    if (errno == ENOENT) return MakeError(ErrorCode::kNotFound, "{}: no such file", map_path);
    return WriteError(map_path, fmt::format("cannot be exchanged with {}", previous), errno);
  });
}

}  // namespace cairn
