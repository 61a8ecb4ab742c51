#include "pipeline/program/check_outputs.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <set>

#include "core/capture/capture_frame.h"
#include "core/files/output_path.h"
#include "core/images/image_file.h"
#include "core/seal/signature_list.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// What commands call the files and folders that they write.
constexpr std::array kOutputs = {"--output",  "--svg",    "--ambiguity-svg", "--depfile",
                                 "--details", "--report", "--stamp"};

bool HasAnyName(const CLI::Option& option, const auto& names) {
  return std::any_of(names.begin(), names.end(), [&](const auto& name) { return option.check_name(name); });
}

// What an argument names: PATH, or the path of NAME=PATH.
std::vector<std::string> PathsOf(const CLI::Option& option) {
  std::vector<std::string> paths;
  for (const std::string& text : option.results()) {
    paths.push_back(text);
    if (const size_t equals = text.find('='); equals != std::string::npos)
      paths.push_back(text.substr(equals + 1));
  }
  return paths;
}

bool LiesIn(const fs::path& path, const fs::path& folder) {
  std::error_code error;
  const fs::path relative = fs::canonical(path, error).lexically_relative(fs::canonical(folder, error));
  return !relative.empty() && *relative.begin() != "." && *relative.begin() != "..";
}

// Whether a capture may consist of such a file.
bool IsOfCapture(const fs::path& file) {
  return file.extension() == ".txt" || file.filename() == kCaptureFrameFile || HasImageSuffix(file.string());
}

struct Output {
  std::string path;
  bool is_whole = false;  // a folder is replaced with all that is in it
};

Status CheckOutput(const Output& written, const std::string& input) {
  const std::string& output = written.path;
  std::error_code error;
  if (!fs::exists(output, error) || !fs::exists(input, error)) return Ok();
  CAIRN_RETURN_IF_ERROR(CheckOutputIsNoInput(output, {input}));
  if (written.is_whole && fs::is_directory(output, error) && LiesIn(input, output)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: has the input {} in it and cannot be the output; choose another name", output,
                     input);
  }
  if (fs::is_directory(input, error) && IsOfCapture(output) && LiesIn(output, input)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is a file of the input {} and cannot be the output; choose another name", output,
                     input);
  }
  return Ok();
}

}  // namespace

Status CheckOutputs(const CLI::App& command, const std::vector<std::string>& may_be_output) {
  std::vector<std::string> inputs;
  std::vector<Output> outputs;
  std::set<std::string> given_signatures;  // which may be those of the output already
  for (const CLI::Option* option : command.get_options()) {
    const std::vector<std::string> paths = PathsOf(*option);
    if (HasAnyName(*option, kOutputs)) {
      for (const std::string& path : paths) outputs.push_back({path, option->check_name("--output")});
    } else if (!HasAnyName(*option, may_be_output)) {
      if (option->check_name("--signatures")) given_signatures.insert(paths.begin(), paths.end());
      inputs.insert(inputs.end(), paths.begin(), paths.end());
    }
  }
  for (size_t i = 0; i < outputs.size(); ++i) {
    for (size_t k = 0; k < i; ++k) {
      if (IsSameFile(outputs[i].path, outputs[k].path)) {
        return MakeError(ErrorCode::kInvalidArgument,
                         "{}: two different files cannot be written there; choose another name for one",
                         outputs[i].path);
      }
    }
  }
  // Signatures are read and written beside what they sign.
  for (const Output& output : outputs) {
    for (const std::string& input : inputs) {
      if (IsSameFile(output.path, SignaturesPath(input))) {
        return MakeError(
            ErrorCode::kInvalidArgument,
            "{}: are the signatures of the input {} and cannot be the output; choose another name",
            output.path, input);
      }
      if (IsSameFile(SignaturesPath(output.path), input) && !given_signatures.contains(input)) {
        return MakeError(
            ErrorCode::kInvalidArgument,
            "{}: is an input, and where the signatures of the output {} are; choose another name", input,
            output.path);
      }
    }
  }
  for (const Output& output : outputs) {
    for (const std::string& input : inputs) CAIRN_RETURN_IF_ERROR(CheckOutput(output, input));
  }
  return Ok();
}

}  // namespace cairn::pipeline
