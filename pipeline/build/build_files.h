#pragma once

#include <string>

#include "core/base/error.h"

namespace cairn::pipeline {

// Whether cairn writes a file or folder of this name into a build folder, or leaves one there when it is
// killed (features.db, matches-1-2of3.db.stamp, poses, seed.tmp-4711).
bool IsBuildFileName(const std::string& name);
// The same for BUILD/options.
bool IsOptionsFileName(const std::string& name);

// Ok where a map may be built: there is no such folder, or it is a build folder, or nothing in it has a name
// that cairn would write to.  Errors: InvalidArgument, which names what would be overwritten.
Status CheckBuildFolder(const std::string& build_dir);

}  // namespace cairn::pipeline
