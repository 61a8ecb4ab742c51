#include "runtime/map/update_map.h"

#include <fcntl.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <utility>

#include "core/base/no_throw.h"
#include "core/delta/map_delta.h"
#include "core/files/file.h"
#include "core/files/file_descriptor.h"
#include "core/files/file_lock.h"
#include "core/files/output_path.h"
#include "core/files/replacement.h"
#include "core/files/temporary.h"
#include "core/files/write_error.h"
#include "core/map/map_epoch.h"
#include "core/map/map_file.h"
#include "core/seal/signature_list.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Removes what killed updates have left beside a map.  REQUIRES: LockFolderOf(map_path)
void RemoveStale(const std::string& map_path) {
  for (const std::string& target : {map_path, PreviousMapPath(map_path), SignaturesPath(map_path)}) {
    for (const std::string& temporary : TemporariesOf(target)) {
      std::error_code error;
      fs::remove(temporary, error);
    }
  }
}

// Whether `next` may follow the map at `old_path`, which has these signatures besides its seal's.
Status CheckMayFollow(const MapFile& next, const std::string& next_name, const std::string& old_path,
                      const SignatureList& old_signatures, const UpdateOptions& options) {
  CAIRN_RETURN_IF_ERROR(CheckAskedFor(next.head(), next_name, options.name, options.min_epoch));
  const Result<MapFile> old =
      MapFile::Open(old_path, {.public_key = options.public_key, .signatures = old_signatures});
  if (!old.ok()) {
    const ErrorCode code = old.error().code;
    if (code == ErrorCode::kNotSigned || code == ErrorCode::kWrongKey) return Ok();
    return old.error();
  }
  if (!old->seal().is_signed() || old->seal().file == next.seal().file) return Ok();
  return CheckFollows(next.head(), next_name, old->head(), old_path, options.allow_older);
}

// The signatures at this path.  A file that has none counts as if it were not there: it is no reason to keep
// the map, and the new one's take its place.  Errors: Io (it may have some, which must not be lost).
Result<SignatureList> SignaturesAt(const std::string& path) {
  Result<SignatureList> signatures = ReadSignatures(path);
  if (!signatures.ok() && signatures.error().code != ErrorCode::kIo) return SignatureList();
  return signatures;
}

Result<SignatureList> SignaturesBeside(const std::string& map_path) {
  return SignaturesAt(SignaturesPath(FileOf(map_path)));
}

// Those that come with a delta.
Result<SignatureList> SignaturesOf(const std::string& delta_path, const UpdateOptions& options) {
  if (!options.signatures.empty()) return ReadSignatures(options.signatures);
  return ReadSignaturesIfThere(SignaturesPath(delta_path));
}

SignatureList Union(SignatureList signatures, const SignatureList& more) {
  signatures.insert(signatures.end(), more.begin(), more.end());
  std::sort(signatures.begin(), signatures.end());
  signatures.erase(std::unique(signatures.begin(), signatures.end()), signatures.end());
  return signatures;
}

// A file that will become a map, and what its seal says.
struct NextMap {
  Replacement file;
  Seal seal;
};

// Writes the file that will become `path`: a map made by a delta from the one at `old_path`.  It is opened as
// a robot would: a map that robots would refuse must not replace one that they can open.
Result<NextMap> WriteMap(const std::string& bytes, const std::string& path, const std::string& old_path,
                         const std::string& delta_path, const SignatureList& signatures,
                         const UpdateOptions& options) {
  CAIRN_ASSIGN_OR_RETURN(Replacement file, Replacement::Begin(path));
  CAIRN_RETURN_IF_ERROR(file.Write(bytes));
  CAIRN_ASSIGN_OR_RETURN(const SignatureList beside, SignaturesBeside(old_path));
  const Result<MapFile> map = MapFile::Open(
      file.temporary(), {.public_key = options.public_key, .signatures = Union(signatures, beside)});
  if (!map.ok()) {
    return MakeError(map.error().code, "{}: leads to a map that cannot be opened: {}", delta_path,
                     map.error().message);
  }
  CAIRN_RETURN_IF_ERROR(CheckMayFollow(*map, fmt::format("{}: the map that it leads to", delta_path),
                                       old_path, beside, options));
  return NextMap{std::move(file), map->seal()};
}

// Puts the signatures of the next map, those of `candidates` that are valid, beside the map at `map_path`,
// where those of the maps that are there stay.  It is done before the next map is put in place, and there is
// nothing to be done after that.  So whenever a robot stops:
// - before the file of signatures is renamed, the old map has its signatures, as ever;
// - between the two renames, the file has those of the old map, of the one before it and of the next one:
// more
//   than are needed;
// - after the map is renamed, the same file has those of the new map and of the old one, which is .previous
//   now, so that to go back is one exchange.
// Signatures of other maps prove nothing about the one in place: a reader passes over them.  A reader that
// has opened the map just before it was renamed finds its signatures afterwards, too.
Status KeepSignatures(const Seal& next, const SignatureList& candidates, const std::string& map_path,
                      const std::optional<KeyRing>& trusted) {
  const std::string path = SignaturesPath(map_path);
  CAIRN_ASSIGN_OR_RETURN(const SignatureList beside, SignaturesAt(path));
  SignatureList kept = ValidSignatures(SignedBytesOf(next), Union(candidates, beside));
  if (std::includes(beside.begin(), beside.end(), kept.begin(), kept.end())) return Ok();
  for (const std::string& there : {map_path, PreviousMapPath(map_path)}) {
    const Result<Seal> seal = ReadSeal(there);
    if (!seal.ok() && seal.error().code == ErrorCode::kIo) return seal.error();
    if (seal.ok()) kept = Union(std::move(kept), ValidSignatures(SignedBytesOf(*seal), beside));
  }
  if (kept.size() > kMaxSignatures && trusted) {
    // Whoever has a delivery in his hands can sign it, too; what nobody trusts must not be in the way.
    std::erase_if(kept, [&](const KeySignature& each) { return trusted->Find(each.public_key) == nullptr; });
  }
  if (kept.size() > kMaxSignatures) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: would have {} signatures, at most {}; send only those of the keys that are trusted",
                     path, kept.size(), kMaxSignatures);
  }
  CAIRN_ASSIGN_OR_RETURN(Replacement file, Replacement::Begin(path));
  CAIRN_RETURN_IF_ERROR(file.Write(EncodeSignatures(kept)));
  // Whoever may read the map may read its signatures.
  struct stat map = {};
  if (stat(map_path.c_str(), &map) == 0) {
    const FileDescriptor descriptor(open(file.temporary().c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
    if (descriptor.get() < 0) return WriteError(path, "cannot be written", errno);
    CAIRN_RETURN_IF_ERROR(GiveAttributes(descriptor.get(), map, path));
  }
  return file.Finish();
}

int Exchange(const std::string& path1, const std::string& path2) {
  return renameat2(AT_FDCWD, path1.c_str(), AT_FDCWD, path2.c_str(), RENAME_EXCHANGE);
}

// Keeps the map in place as the previous one until it is known whether a new one replaces it.  If so, Confirm
// drops the older previous map; else the destructor restores that one.
class KeptMap {
 public:
  KeptMap(const std::string& map_path, int folder)
      : map_path_(map_path), previous_(PreviousMapPath(map_path)), folder_(folder) {}
  KeptMap(const KeptMap&) = delete;
  KeptMap& operator=(const KeptMap&) = delete;
  ~KeptMap() {
    if (!is_kept_) return;
    if (aside_.empty()) {
      unlink(previous_.c_str());
    } else if (Exchange(aside_, previous_) == 0) {
      unlink(aside_.c_str());
    } else {
      rename(aside_.c_str(), previous_.c_str());
    }
  }

  // Errors: Io, ReadOnly, DiskFull.
  Status Keep() {
    struct stat before = {};
    const bool is_there = lstat(previous_.c_str(), &before) == 0;
    if (is_there && !S_ISREG(before.st_mode) && !S_ISLNK(before.st_mode))
      return MakeError(ErrorCode::kIo, "{}: is not a file, so the old map cannot be kept there; remove it",
                       previous_);
    CAIRN_ASSIGN_OR_RETURN(std::string second, SecondName());
    if (is_there && Exchange(second, previous_) == 0) {
      aside_ = std::move(second);  // without asking for memory: what is aside must be known
    } else {
      // There is nothing to keep, or the file system cannot exchange: the older one is moved aside first.
      if (is_there) {
        std::string aside = RandomTemporaryPath(previous_);
        if (rename(previous_.c_str(), aside.c_str()) != 0) return CannotKeep(second, errno);
        aside_ = std::move(aside);
      }
      if (rename(second.c_str(), previous_.c_str()) != 0) {
        const int error = errno;
        if (is_there) rename(aside_.c_str(), previous_.c_str());
        return CannotKeep(second, error);
      }
    }
    is_kept_ = true;
    if (fsync(folder_) == 0 || errno == EINVAL) return Ok();  // EINVAL: there is nothing to sync
    return WriteError(map_path_, "its folder cannot be synced; the map stays as it is", errno);
  }

  void Confirm() {
    if (!aside_.empty()) unlink(aside_.c_str());  // else it only takes space, and the next update removes it
    is_kept_ = false;
  }

 private:
  // A second name (link) for the map's file, or a copy where links are not possible.
  Result<std::string> SecondName() {
    const std::string second = RandomTemporaryPath(previous_);
    if (link(map_path_.c_str(), second.c_str()) == 0) return second;
    CAIRN_ASSIGN_OR_RETURN(Replacement copy, Replacement::Begin(second, 0600));
    CAIRN_RETURN_IF_ERROR(copy.CopyFrom(map_path_));
    Status status = copy.FinishNew();
    if (status.ok()) {
      const FileDescriptor file(open(second.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
      struct stat map = {};
      if (file.get() < 0 || stat(map_path_.c_str(), &map) != 0) return CannotKeep(second, errno);
      status = GiveAttributes(file.get(), map, previous_);
    }
    if (status.ok()) return second;
    unlink(second.c_str());
    return status.error();
  }

  Error CannotKeep(const std::string& second, int error) const {
    unlink(second.c_str());
    return WriteError(previous_, "the old map cannot be kept there", error);
  }

  std::string map_path_, previous_;
  std::string aside_;  // the previous map before this one
  int folder_;
  bool is_kept_ = false;
};

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
    CAIRN_ASSIGN_OR_RETURN(const SignatureList given, SignaturesOf(delta_path, options));
    CAIRN_ASSIGN_OR_RETURN(const std::string old_bytes, ReadFile(old_path));
    CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ApplyMapDelta(delta, old_bytes, old_path, delta_path));
    CAIRN_ASSIGN_OR_RETURN(NextMap next, WriteMap(bytes, new_path, old_path, delta_path, given, options));
    CAIRN_ASSIGN_OR_RETURN(const SignatureList beside, SignaturesBeside(old_path));
    CAIRN_RETURN_IF_ERROR(KeepSignatures(next.seal, Union(given, beside), new_path, options.public_key));
    return next.file.Finish();
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
    CAIRN_ASSIGN_OR_RETURN(const SignatureList given, SignaturesOf(delta_path, options));
    CAIRN_ASSIGN_OR_RETURN(const std::string old_bytes, ReadFile(map_path));
    if (HashOf(old_bytes) == delta.new_hash) {
      CAIRN_ASSIGN_OR_RETURN(const SignatureList beside, SignaturesBeside(map_path));
      CAIRN_ASSIGN_OR_RETURN(
          const MapFile map,
          MapFile::Open(map_path, {.public_key = options.public_key, .signatures = Union(given, beside)}));
      CAIRN_RETURN_IF_ERROR(CheckAskedFor(map.head(), map_path, options.name, options.min_epoch));
      CAIRN_RETURN_IF_ERROR(KeepSignatures(map.seal(), given, map_path, options.public_key));
      CAIRN_RETURN_IF_ERROR(SyncFolderOf(map_path, lock.descriptor()));
      return false;
    }
    CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ApplyMapDelta(delta, old_bytes, map_path, delta_path));
    CAIRN_ASSIGN_OR_RETURN(NextMap next, WriteMap(bytes, map_path, map_path, delta_path, given, options));
    CAIRN_RETURN_IF_ERROR(KeepSignatures(next.seal, given, map_path, options.public_key));
    KeptMap previous(map_path, lock.descriptor());
    CAIRN_RETURN_IF_ERROR(previous.Keep());
    const Status status = next.file.Finish();
    if (next.file.is_in_place()) previous.Confirm();
    if (!status.ok()) return status.error();
    return true;
  });
}

std::string PreviousMapPath(const std::string& map_path) { return map_path + ".previous"; }

Status RollBackMap(const std::string& given_path, const UpdateOptions& options) {
  return WithoutExceptions("RollBackMap", [&]() -> Status {
    const std::string map_path = FileOf(given_path);
    CAIRN_ASSIGN_OR_RETURN(const FileLock lock, LockFolderOf(map_path));
    const std::string previous = PreviousMapPath(map_path);
    struct stat status = {};
    if (lstat(previous.c_str(), &status) != 0) {
      if (errno != ENOENT) return WriteError(previous, "cannot be opened", errno);
      return MakeError(
          ErrorCode::kNotFound,
          "{}: no such file; there is a previous map only where `cairn update apply --in-place` made one",
          previous);
    }
    // A link would replace the map.
    if (!S_ISREG(status.st_mode))
      return MakeError(ErrorCode::kIo, "{}: is not a regular file; no update has put it there", previous);
    CAIRN_ASSIGN_OR_RETURN(const MapFile before, MapFile::Open(previous, {.public_key = options.public_key}));
    CAIRN_RETURN_IF_ERROR(CheckFileHash(previous));
    CAIRN_RETURN_IF_ERROR(CheckAskedFor(before.head(), previous, options.name, options.min_epoch));
    // The map in place may be the damaged one: that it cannot be opened is no reason to keep it.
    const Result<MapFile> map = MapFile::Open(map_path, {.public_key = options.public_key});
    if (!map.ok() && map.error().code == ErrorCode::kNoMemory) return map.error();
    if (map.ok() && (map->seal().is_signed() || before.seal().is_signed())) {
      CAIRN_RETURN_IF_ERROR(
          CheckFollows(before.head(), previous, map->head(), map_path, /*allow_older=*/true));
    }
    if (Exchange(previous, map_path) != 0) {
      if (errno == ENOENT) return MakeError(ErrorCode::kNotFound, "{}: no such file", map_path);
      return WriteError(map_path, fmt::format("cannot be exchanged with {}", previous), errno);
    }
    return SyncFolderOf(map_path, lock.descriptor());
  });
}

}  // namespace cairn
