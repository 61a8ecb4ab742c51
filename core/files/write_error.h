#pragma once

#include <string>
#include <string_view>

#include "core/base/error.h"

namespace cairn {

// What to say of a write that failed with `error_number` (an errno): "PATH: cannot be synced: No space left
// on device", as DiskFull, ReadOnly or Io.
Error WriteError(const std::string& path, std::string_view what, int error_number);

}  // namespace cairn
