#pragma once

#include <sys/stat.h>

#include <optional>
#include <string>
#include <string_view>

#include "core/base/error.h"

namespace cairn {

// A file on its way to its place: it is written beside it, under a name of its own, and put there in one step
// when it is whole.  A reader sees the old file or the new one.  Leaves nothing behind when it is destroyed
// before that.
class Replacement {
 public:
  // Creates the temporary file, empty.  `new_mode`, less the umask: permissions where no file is replaced;
  // else the new file gets those of the old one at the end, and until then it is its owner's alone.
  // Errors: as CheckCanBeReplaced; ReadOnly, DiskFull, Io.
  static Result<Replacement> Begin(const std::string& path, mode_t new_mode = 0666);
  Replacement(Replacement&& other) noexcept;
  Replacement& operator=(Replacement&&) = delete;
  ~Replacement();

  // The file to be written: through Write and CopyFrom, or by others who open it.
  const std::string& temporary() const { return temporary_; }
  Status Write(std::string_view bytes);
  // All bytes of another file.  Errors: also NotFound.
  Status CopyFrom(const std::string& source_path);

  // Puts the file in place: synced, with owner, group and mode of the file that it replaces, the folder
  // synced afterwards.  A target that has the same bytes already is left untouched, its date included.
  // Errors: ReadOnly, DiskFull, Io; ReadOnly also where owner or group cannot be kept, and the old ones could
  // then no longer read it.  Where only the last step fails, the file stays in place, and the
  // message says so.
  Status Finish();
  // The same for a file that must not exist yet.  Errors: also InvalidArgument (it does).
  Status FinishNew();
  // Whether the target has the new contents: possible also after an error of Finish.
  bool is_in_place() const { return is_in_place_; }

 private:
  Replacement() = default;
  Status PutInPlace(bool may_replace);

  std::string path_, temporary_;
  int file_ = -1, folder_ = -1;
  std::optional<struct stat> replaced_;  // set where there was a file when this began
  bool is_in_place_ = false;
};

// Gives an open file the owner, group and mode of another one, as far as this process may.  Everyone who
// could read the other one can read it.  `path` is for messages.  Errors: ReadOnly (owner or group cannot be
// kept, and the old ones could then no longer read it), Io.
Status GiveAttributes(int descriptor, const struct stat& attributes, const std::string& path);

// Syncs an open folder after `path` in it was put in place.  Errors: Io, with a message that says that it is
// in place.
Status SyncFolderOf(const std::string& path, int folder_descriptor);

}  // namespace cairn
