#pragma once

#include <dirent.h>
#include <unistd.h>

#include <cstdint>
#include <fstream>

namespace cairn {

// What this process holds.
inline double ResidentMib() {
  int64_t num_pages = 0, num_resident = 0;
  std::ifstream("/proc/self/statm") >> num_pages >> num_resident;
  return static_cast<double>(num_resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

inline int NumOpenFiles() {
  int num = -3;  // the folder itself and what lists it, "." and ".."
  DIR* const folder = opendir("/proc/self/fd");
  if (folder == nullptr) return 0;
  while (readdir(folder) != nullptr) ++num;
  closedir(folder);
  return num;
}

}  // namespace cairn
