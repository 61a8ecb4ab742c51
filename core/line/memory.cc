#include "core/line/memory.h"

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

namespace cairn {
namespace {

constexpr int64_t kUnlimited = std::numeric_limits<int64_t>::max();

// The number in a control group's file; unlimited where there is no such file or it says "max".
int64_t ReadLimit(const std::string& path) {
  std::ifstream file(path);
  int64_t limit = 0;
  return file >> limit && limit > 0 ? limit : kUnlimited;
}

// The smallest limit from the group down to the hierarchy's root.
int64_t SmallestLimit(const std::string& root, std::string group, const std::string& file) {
  int64_t smallest = kUnlimited;
  while (true) {
    smallest = std::min(smallest, ReadLimit(root + group + "/" + file));
    const size_t slash = group.rfind('/');
    if (slash == std::string::npos) return smallest;
    group.resize(slash);
  }
}

// /proc/self/cgroup has a line "ID:CONTROLLERS:/GROUP" per hierarchy; version 2 has no controllers.
int64_t ControlGroupLimit() {
  int64_t limit = kUnlimited;
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    const size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const std::string group = line.substr(second + 1);
    if (controllers == ",,") {
      limit = std::min(limit, SmallestLimit("/sys/fs/cgroup", group, "memory.max"));
    } else if (controllers.find(",memory,") != std::string::npos) {
      limit = std::min(limit, SmallestLimit("/sys/fs/cgroup/memory", group, "memory.limit_in_bytes"));
    }
  }
  return limit;
}

}  // namespace

int64_t DefaultMemoryMib() {
  const int64_t machine = int64_t{sysconf(_SC_PHYS_PAGES)} * sysconf(_SC_PAGESIZE);
  return std::max<int64_t>(1, std::min(machine, ControlGroupLimit()) / 5 * 4 >> 20);
}

void ReturnFreedMemory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

Status CheckMemory(const std::string& work, int64_t num_bytes, int64_t memory_mib) {
  const int64_t needed_mib = (num_bytes + kProgramBytes + (int64_t{1} << 20) - 1) >> 20;
  if (needed_mib <= memory_mib) return Ok();
  return MakeError(
      ErrorCode::kNoMemory,
      "{} takes about {} MiB of memory, but --memory allows {} MiB; allow more, or use a larger machine",
      work, needed_mib, memory_mib);
}

Status CheckMemoryForFile(const std::string& work, const std::string& path,
                          const std::function<double(double)>& num_bytes, int64_t memory_mib) {
  std::error_code error;
  const auto file = static_cast<double>(std::filesystem::file_size(path, error));
  if (error) return Ok();  // the reader of the file says why it cannot be read
  return CheckMemory(fmt::format("{} of {}", work, path), std::llround(num_bytes(file)), memory_mib);
}

Status CheckMemoryForFile(const std::string& work, const std::string& path, double bytes_per_file_byte,
                          int64_t memory_mib) {
  return CheckMemoryForFile(
      work, path, [&](double file) { return bytes_per_file_byte * file; }, memory_mib);
}

}  // namespace cairn
