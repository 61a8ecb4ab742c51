#include "core/files/input_file.h"

#include <algorithm>
#include <filesystem>

namespace cairn {
namespace {

namespace fs = std::filesystem;

const char* KindText(fs::file_type type) {
  switch (type) {
    case fs::file_type::fifo:
      return "a pipe";
    case fs::file_type::socket:
      return "a socket";
    default:
      return "a device";
  }
}

}  // namespace

Status CheckInputFile(const std::string& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  switch (status.type()) {
    case fs::file_type::regular:
      return Ok();
    case fs::file_type::not_found:
      if (fs::is_symlink(fs::symlink_status(path, error)))
        return MakeError(ErrorCode::kNotFound, "{}: a link to a file that does not exist", path);
      return MakeError(ErrorCode::kNotFound, "{}: no such file", path);
    case fs::file_type::directory:
      return MakeError(ErrorCode::kNotFound, "{}: is a folder, expected a file", path);
    case fs::file_type::none:
    case fs::file_type::unknown:
      return MakeError(ErrorCode::kIo, "{}: cannot be read: {}", path, error.message());
    default:
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: is {}, expected a file; save its contents to a file first", path,
                       KindText(status.type()));
  }
}

bool IsPathBelow(const std::string& name) {
  const fs::path path(name);
  return !name.empty() && path.is_relative() && std::find(path.begin(), path.end(), "..") == path.end();
}

}  // namespace cairn
