#pragma once

#include <string>

#include "core/base/error.h"

namespace cairn {

// Whether `path` leads, perhaps through links, to a regular file: the only kind of input that is opened.  A
// pipe would wait for its writer for ever, and opening a device may have effects.  Errors: NotFound
// (nothing there, or a folder), InvalidArgument (a pipe, a socket or a device), Io; each says what was found.
Status CheckInputFile(const std::string& path);

// Whether a name that comes from a list may be a path below a folder: relative, and no way out of it.
bool IsPathBelow(const std::string& name);

}  // namespace cairn
