#pragma once

#include <cstdint>

namespace cairn {

// Most memory that a process should take by itself, MiB: four fifths of the machine's, or of its control
// group's limit (version 1 or 2, this group or one that it lies in) where that is smaller.
int64_t DefaultMemoryMib();

}  // namespace cairn
