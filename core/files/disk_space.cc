#include "core/files/disk_space.h"

#include <filesystem>

namespace cairn {

namespace fs = std::filesystem;

Status CheckDiskSpace(const std::string& work, const std::string& folder, int64_t num_bytes) {
  std::error_code error;
  const fs::space_info space = fs::space(folder.empty() ? "." : folder, error);
  if (error || num_bytes <= static_cast<int64_t>(space.available)) return Ok();  // unknown: writing will tell
  return MakeError(ErrorCode::kDiskFull,
                   "{}: {} takes about {:.0f} MB, but the disk has {:.0f} MB left; make room, or continue "
                   "anyway with --no-space-check",
                   folder, work, static_cast<double>(num_bytes) / 1e6,
                   static_cast<double>(space.available) / 1e6);
}

}  // namespace cairn
