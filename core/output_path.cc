#include "core/output_path.h"

#include <filesystem>

namespace cairn {

bool IsSameFile(const std::string& path1, const std::string& path2) {
  std::error_code error;
  return path1 == path2 || std::filesystem::equivalent(path1, path2, error);
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
