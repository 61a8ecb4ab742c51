#include "core/files/output_path.h"

#include <unistd.h>

#include <cerrno>
#include <filesystem>

#include "core/files/write_error.h"

namespace cairn {
namespace fs = std::filesystem;

bool IsSameFile(const std::string& path1, const std::string& path2) {
  std::error_code error;
  return fs::path(path1).lexically_normal() == fs::path(path2).lexically_normal() ||
         fs::equivalent(path1, path2, error);
}

std::string FolderOf(const std::string& path) {
  const fs::path file(path);
  return file.has_parent_path() ? file.parent_path().string() : ".";
}

std::string FileOf(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_symlink(path, error)) return path;
  const std::filesystem::path file = std::filesystem::canonical(path, error);
  return error ? path : file.string();
}

Status CheckCanBeReplaced(const std::string& path) {
  if (path.empty()) return MakeError(ErrorCode::kInvalidArgument, "an output's path is empty");
  const std::string folder = FolderOf(path);
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    return MakeError(ErrorCode::kIo, "{}: the folder {} does not exist; create it first", path, folder);
  }
  const fs::file_status status = fs::status(path, error);
  if (fs::is_directory(status)) return MakeError(ErrorCode::kIo, "{}: is a folder, expected a file", path);
  // A new file would take its name: root would lose /dev/null.
  if (fs::exists(status) && !fs::is_regular_file(status))
    return MakeError(ErrorCode::kIo, "{}: is a device or a pipe, expected a file", path);
  if (access(folder.c_str(), W_OK) != 0)
    return WriteError(path, fmt::format("the folder {} may not be written", folder), errno);
  return Ok();
}

Status CheckOutputIsNoInput(const std::string& output, const std::vector<std::string>& inputs) {
  for (const std::string& input : inputs) {
    if (!input.empty() && IsSameFile(input, output))
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: is an input and cannot be the output; choose another name", output);
  }
  return Ok();
}

}  // namespace cairn
