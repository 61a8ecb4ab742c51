#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "core/base/error.h"

namespace cairn {

// Largest amount of memory that a process should take by default, MiB: four fifths of the machine's, or of
// its control group's limit (version 1 or 2, this group or one that it lies in) where that is smaller.
int64_t DefaultMemoryMib();

// What the program takes before it reads anything, bytes: its libraries and their tables.
inline constexpr int64_t kProgramBytes = int64_t{64} << 20;

// Gives what was freed back to the system.  The C library keeps it, for each of the threads that asked for
// it, and what another thread asks for is taken anew: after freeing much that many threads have made, and
// before as much is made again.
void ReturnFreedMemory();

// Refuses work that is estimated not to fit, before it begins.  `work` names it: "grouping the matches of
// m.db".  Errors: NoMemory, with the estimate and the limit.
//
// Most stages hold their input in a form that takes a multiple of its file's bytes (measured,
// bench/crash/README.md).
Status CheckMemoryForFile(const std::string& work, const std::string& path, double bytes_per_file_byte,
                          int64_t memory_mib);
// `num_bytes`: the estimate by the file's bytes.
Status CheckMemoryForFile(const std::string& work, const std::string& path,
                          const std::function<double(double)>& num_bytes, int64_t memory_mib);
Status CheckMemory(const std::string& work, int64_t num_bytes, int64_t memory_mib);

}  // namespace cairn
