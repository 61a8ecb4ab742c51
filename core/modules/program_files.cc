#include "core/modules/program_files.h"

#include <sys/auxv.h>

#include <filesystem>

namespace cairn {

namespace fs = std::filesystem;

Result<std::string> ProgramPath() {
  std::error_code error;
  const fs::path path = fs::read_symlink("/proc/self/exe", error);
  if (!error) return path.string();
  // Without /proc, as in a bare chroot: by the path that the kernel was given, where that is a whole one.
  const auto* const started_by = reinterpret_cast<const char*>(getauxval(AT_EXECFN));
  std::error_code other_error;
  if (started_by != nullptr && fs::path(started_by).is_absolute()) {
    const fs::path file = fs::canonical(started_by, other_error);
    if (!other_error) return file.string();
  }
  return MakeError(ErrorCode::kFailed, "/proc/self/exe: cannot be read: {}", error.message());
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
