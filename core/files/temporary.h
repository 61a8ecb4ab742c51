#pragma once

#include <sys/types.h>

#include <string>

#include "core/base/error.h"

namespace cairn {

// Where a folder is written before it takes the target's place: TARGET.tmp-PROCESS, beside it.
std::string TemporaryPath(const std::string& target);
// The same for a file, under a name that nobody can predict: TARGET.tmp-PROCESS-RANDOM.
std::string RandomTemporaryPath(const std::string& target);
// Whether a name is that of such a temporary of `target` (a name; "" = of anything), or of what SQLite, a
// replaced folder or a temporary's own temporary leaves beside one: TARGET.tmp-PROCESS-journal, -old.
bool IsTemporaryName(const std::string& name, const std::string& target);

// A file that this process has just created, empty and open for reading and writing.
struct TemporaryFile {
  std::string path;
  int descriptor = -1;  // the caller closes it
};
// Creates a file beside `target` with this mode, less the umask.  Never opens a file that already exists, nor
// follows a link that somebody planted.  Errors: ReadOnly, DiskFull, Io.
Result<TemporaryFile> CreateTemporary(const std::string& target, mode_t mode);

}  // namespace cairn
