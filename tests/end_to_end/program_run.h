#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

// What a run of the real program left behind.
struct ProgramRun {
  int exit_code = 0;
  std::string out, err;
};

// Runs a shell command line in which `cairn` is the built program.
ProgramRun RunShell(const std::string& command_line);

// A folder of this process, removed with the object.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const std::string& name);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  std::string operator/(const std::string& name) const { return (path_ / name).string(); }
  std::string string() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

// Writes the recipe of a building of two rooms seen in about a hundred small images; `more` is appended.
void WriteTinyRecipe(const std::string& path, const std::string& more = "");

// The part of WriteTinyRecipe that follows [simulate]: options that suit so small a survey.
std::string TinyStageOptions();

// The same of a building that is half as large, in smaller images.
void WriteSmallRecipe(const std::string& path);

// Writes a recipe with TinyStageOptions for captures that exist; their paths may be relative to the recipe's.
void WriteCaptureRecipe(const std::string& path, const std::vector<std::string>& captures);

// Renders the survey of WriteTinyRecipe into the folder `capture`; the recipe stays beside it, CAPTURE.toml.
// A failure is a fatal one of the test.
void RenderTinySurvey(const std::string& capture, const std::string& simulate_arguments = "");

// A copy of the survey of `capture` with its first `num_images` images only, and no queries.
void CopyCapture(const std::string& capture, const std::string& copy, int num_images);

// Replaces the first occurrence of `from` in a text file.
void ReplaceInFile(const std::string& path, const std::string& from, const std::string& to);

}  // namespace cairn
