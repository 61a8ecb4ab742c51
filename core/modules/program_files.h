#pragma once

#include <string>

#include "core/base/error.h"

namespace cairn {

// This program's own file, absolute; not the link that it was started by.  Errors: Failed.
Result<std::string> ProgramPath();

// The file `name` (share/cairn/map.mk) that comes with `program`: beside it in a build folder, one folder up
// where it is installed.  No other place is looked at, whatever the working directory and the environment
// are. Errors: NotFound.
Result<std::string> InstalledPath(const std::string& program, const std::string& name);

}  // namespace cairn
