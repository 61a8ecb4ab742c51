#pragma once

#include <cstdint>
#include <string>

#include "core/base/error.h"

namespace cairn {

// Refuses a long run whose results are estimated not to fit on the disk, before it begins.  `folder` is that
// of the results, `work` names it: "the features of 1200 images".  Errors: DiskFull, with the estimate and
// what is free.
Status CheckDiskSpace(const std::string& work, const std::string& folder, int64_t num_bytes);

}  // namespace cairn
