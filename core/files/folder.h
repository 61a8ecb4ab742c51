#pragma once

#include <functional>
#include <string>

#include "core/base/error.h"

namespace cairn {

// Makes or replaces a folder in one step: `write` fills a temporary folder beside it, which gets a manifest
// (folder_manifest.h), is synced and put in its place; on an error (or a kill, or a loss of power) the target
// stays as it was.  A folder that exists is replaced only if it is empty, or cairn made it as one of `kind`
// ("a capture") and nobody has added to it or changed it since: nothing else is ever removed, and the old
// contents only after the new ones are in place.  A folder that would hold the same is left alone, its date
// included; a file that would hold the same keeps its date.  Temporary folders that killed processes left are
// removed where they are cairn's by the same rule.  Errors: InvalidArgument (a folder with something else in
// it, or a file or link instead of a folder), Io, or the error of `write`.
Status ReplaceFolderAtomically(const std::string& path, const std::string& kind,
                               const std::function<Status(const std::string& temporary)>& write);

}  // namespace cairn
