#include "core/modules/program_files.h"

#include <filesystem>

namespace cairn {

namespace fs = std::filesystem;

Result<std::string> ProgramPath() {
  std::error_code error;
  const fs::path path = fs::read_symlink("/proc/self/exe", error);
  if (error) return MakeError(ErrorCode::kFailed, "/proc/self/exe: cannot be read: {}", error.message());
  return path.string();
}

Result<std::string> InstalledPath(const std::string& program, const std::string& name) {
  const fs::path folder = fs::path(program).parent_path();
  for (const fs::path& place : {folder / name, folder / ".." / name}) {
    std::error_code error;
    const fs::path path = place.lexically_normal();
    if (fs::exists(path, error)) return path.string();
  }
  return MakeError(ErrorCode::kNotFound,
                   "{}: {} is neither beside it nor one folder up; install the program again", program, name);
}

}  // namespace cairn
