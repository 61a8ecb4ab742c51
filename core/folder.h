#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/error.h"

namespace cairn {

// Makes or replaces a folder in one step: `write` fills a temporary folder beside it, which is synced and put
// in its place; on an error (or a kill) the target stays as it was.  A folder that exists is replaced only if
// it is empty or has a file of `marks`, those that tell what `kind` ("a capture") is: nothing else is ever
// removed.  Temporary folders that killed processes left are removed.
// Errors: Io, or that of `write`.
Status ReplaceFolderAtomically(const std::string& path, const std::string& kind,
                               const std::vector<std::string>& marks,
                               const std::function<Status(const std::string& temporary)>& write);

}  // namespace cairn
