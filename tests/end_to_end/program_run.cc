#include "tests/end_to_end/program_run.h"

#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn {

namespace fs = std::filesystem;

ProgramRun RunShell(const std::string& command_line) {
  const std::string stem = fmt::format("{}/end_to_end_{}", testing::TempDir(), getpid());
  const std::string folder = fs::path(CAIRN_PROGRAM).parent_path().string();
  const std::string command = fmt::format("PATH='{}':$PATH; {{ {}\n}} >'{}.out' 2>'{}.err' </dev/null",
                                          folder, command_line, stem, stem);
  const int status = std::system(command.c_str());
  ProgramRun run{.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1,
                 .out = ReadFile(stem + ".out").value(),
                 .err = ReadFile(stem + ".err").value()};
  fs::remove(stem + ".out");
  fs::remove(stem + ".err");
  return run;
}

TemporaryFolder::TemporaryFolder(const std::string& name)
    : path_(fs::path(testing::TempDir()) / fmt::format("{}_{}", name, getpid())) {
  fs::remove_all(path_);
  fs::create_directories(path_);
}

TemporaryFolder::~TemporaryFolder() { fs::remove_all(path_); }

std::string TinyStageOptions() {
  return R"(
[extract_features]
max_num_features = 300
[filter_visibility]
survey = "driven"
cell_size_m = 0.7
heading_bin_deg = 90
min_num_stations_driven = 2
[decompose_regions]
k = 4
tau = 0
[emit_map]
landmarks = "all"
)";
}

void WriteTinyRecipe(const std::string& path, const std::string& more) {
  std::ofstream(path) << R"(name = "tiny"
[simulate]
width_m = 5.5
depth_m = 6
num_rooms = 2
spacing_m = 0.7
image_width_px = 320
image_height_px = 240
texel_m = 0.008
num_queries = 6
)" << TinyStageOptions()
                      << more;
}

void WriteSmallRecipe(const std::string& path) {
  std::ofstream(path) << R"(name = "small"
[simulate]
width_m = 5.5
depth_m = 6
num_rooms = 2
spacing_m = 1
image_width_px = 240
image_height_px = 180
texel_m = 0.01
num_queries = 2
)" << TinyStageOptions();
}

void WriteCaptureRecipe(const std::string& path, const std::vector<std::string>& captures) {
  std::ofstream recipe(path);
  recipe << "name = \"tiny\"\n";
  for (const std::string& capture : captures) recipe << "[[capture]]\npath = \"" << capture << "\"\n";
  recipe << TinyStageOptions();
}

void RenderTinySurvey(const std::string& capture, const std::string& simulate_arguments) {
  WriteTinyRecipe(capture + ".toml");
  const ProgramRun run =
      RunShell("cairn stage simulate " + capture + ".toml -o " + capture + " " + simulate_arguments);
  ASSERT_EQ(run.exit_code, 0) << run.err;
}

void CopyCapture(const std::string& capture, const std::string& copy, int num_images) {
  fs::create_directories(copy + "/images");
  fs::copy_file(capture + "/cameras.txt", copy + "/cameras.txt", fs::copy_options::overwrite_existing);
  std::ifstream images(capture + "/images.txt");
  std::ofstream copied(copy + "/images.txt");
  std::string line;
  while (num_images > 0 && std::getline(images, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    std::string name;
    for (int i = 0; i < 10; ++i) words >> name;
    const fs::path target = fs::path(copy) / "images" / name;
    fs::create_directories(target.parent_path());
    fs::copy_file(fs::path(capture) / "images" / name, target, fs::copy_options::overwrite_existing);
    copied << line << "\n\n";
    std::getline(images, line);  // its points, of which there are none
    --num_images;
  }
}

void ReplaceInFile(const std::string& path, const std::string& from, const std::string& to) {
  std::string text = ReadFile(path).value();
  const size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos) << path << ": no " << from;
  text.replace(at, from.size(), to);
  ASSERT_TRUE(WriteFileAtomically(path, text).ok());
}

}  // namespace cairn
