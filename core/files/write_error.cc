#include "core/files/write_error.h"

#include <cerrno>
#include <cstring>

namespace cairn {
namespace {

ErrorCode CodeOf(int error_number) {
  switch (error_number) {
    case ENOSPC:
    case EDQUOT:
      return ErrorCode::kDiskFull;
    case EACCES:
    case EPERM:
    case EROFS:
      return ErrorCode::kReadOnly;
    case ENOMEM:
      return ErrorCode::kNoMemory;
    default:
      return ErrorCode::kIo;
  }
}

}  // namespace

Error WriteError(const std::string& path, std::string_view what, int error_number) {
  return MakeError(CodeOf(error_number), "{}: {}: {}", path, what, std::strerror(error_number));
}

}  // namespace cairn
