#include "core/output_path.h"

#include <filesystem>

namespace cairn {

Status CheckOutputIsNoInput(const std::string& output, const std::vector<std::string>& inputs) {
  for (const std::string& input : inputs) {
    std::error_code error;
    if (!input.empty() && (input == output || std::filesystem::equivalent(input, output, error)))
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: is an input and cannot be the output; choose another name", output);
  }
  return Ok();
}

}  // namespace cairn
