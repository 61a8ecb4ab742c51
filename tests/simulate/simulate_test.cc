#include "stages/simulate/simulate.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include <gtest/gtest.h>
#include <CLI/CLI.hpp>

#include "core/capture/capture.h"
#include "core/colmap/rig_config.h"
#include "core/files/file.h"
#include "stages/simulate/command.h"

namespace cairn::simulate {
namespace {

namespace fs = std::filesystem;

// A few small images of a coarse building.
sim::SimulateOptions TinyOptions() {
  sim::SimulateOptions options;
  options.texel_m = 0.04;
  options.image_width_px = 64;
  options.image_height_px = 48;
  options.spacing_m = 1.5;
  options.num_queries = 5;
  return options;
}

class SimulateCaptureTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / fmt::format("simulate_test_{}", getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  static std::map<std::string, std::string> Files(const std::string& root) {
    std::map<std::string, std::string> files;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root)) {
      if (entry.is_regular_file())
        files[fs::relative(entry.path(), root).string()] = *ReadFile(entry.path().string());
    }
    return files;
  }

  fs::path folder_;
  NoProgress progress_;
};

TEST_F(SimulateCaptureTest, ARigTakesTheQueriesOfALatticeAndAllOfADrive) {
  sim::SimulateOptions options = TinyOptions();
  options.rig_num_cameras = 3;
  options.rig_radius_m = 0.25;
  ASSERT_TRUE(SimulateCapture(options, Path("lattice"), 7, 2, progress_).ok());
  options.survey = "driven";
  options.step_m = 2;
  ASSERT_TRUE(SimulateCapture(options, Path("driven"), 7, 2, progress_).ok());
  for (const char* name : {"lattice", "driven"}) {
    const Capture capture = *ReadCapture(Path(name));
    const auto rig = *ReadRigConfig(Path(name) + "/rig_config.json");
    ASSERT_EQ(rig.size(), 3U);
    std::map<std::string, Pose> poses;
    for (const auto* images : {&capture.images, &capture.queries}) {
      for (const CaptureImage& image : *images) poses[image.name] = *image.cam_from_world;
    }
    int num_rigs = 0;
    for (const auto& [image, pose] : poses) {
      EXPECT_TRUE(fs::exists(Path(name) + "/images/" + image)) << image;
      if (!NameInRig(rig, 0, image).ok()) continue;
      ++num_rigs;
      for (size_t camera = 0; camera < 3; ++camera) {
        const Pose expected = rig[camera].cam_from_rig * pose;
        const Pose stated = poses.at(*NameInRig(rig, camera, image));
        EXPECT_LT(CenterErrorM(stated, expected), 1e-5);
        EXPECT_LT(RotationErrorDeg(stated, expected), 1e-3);
      }
      // Evenly turned, each so far from the axis.
      EXPECT_NEAR(CenterErrorM(poses.at(*NameInRig(rig, 1, image)), pose), 0.25 * std::sqrt(3.0), 1e-4);
      EXPECT_NEAR(RotationErrorDeg(poses.at(*NameInRig(rig, 1, image)), pose), 120, 1e-3);
    }
    EXPECT_EQ(num_rigs,
              static_cast<int>(capture.queries.size() / 3) +
                  (name == std::string("driven") ? static_cast<int>(capture.images.size() / 3) : 0));
  }
  EXPECT_EQ((*ReadCapture(Path("lattice"))).queries.size(), 15U);
}

TEST_F(SimulateCaptureTest, WritesTheSameBytesForAnyNumberOfThreads) {
  ASSERT_TRUE(SimulateCapture(TinyOptions(), Path("one"), 7, 1, progress_).ok());
  ASSERT_TRUE(SimulateCapture(TinyOptions(), Path("four"), 7, 4, progress_).ok());
  ASSERT_TRUE(SimulateCapture(TinyOptions(), Path("other"), 8, 4, progress_).ok());
  EXPECT_EQ(Files(Path("one")), Files(Path("four")));
  EXPECT_NE(Files(Path("one")), Files(Path("other")));
}

TEST_F(SimulateCaptureTest, WritesACaptureThatReadsBack) {
  sim::SimulateOptions options = TinyOptions();
  options.pose_noise_deg = 2;
  const Result<SimulateResult> result = SimulateCapture(options, Path("capture"), 0, 2, progress_);
  ASSERT_TRUE(result.ok());
  const Result<Capture> capture = ReadCapture(Path("capture"));
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_TRUE(capture->has_poses);
  EXPECT_TRUE(capture->rejects.empty());
  EXPECT_TRUE(capture->warnings.empty());
  EXPECT_EQ(static_cast<int>(capture->images.size()), result->num_images);
  EXPECT_EQ(result->num_images, 4 * result->num_stations);
  EXPECT_EQ(capture->queries.size(), 5u);
  ASSERT_EQ(capture->cameras.size(), 1u);
  EXPECT_DOUBLE_EQ(capture->cameras.begin()->second.FocalX(), 32);
  for (const CaptureImage& image : capture->images) {
    EXPECT_NEAR(image.cam_from_world->rotation.norm(), 1, 1e-9);
    EXPECT_NEAR(image.cam_from_world->Center().z(), options.camera_height_m, 1e-6);
    EXPECT_TRUE(fs::exists(capture->ImagePath(image)));
  }
  EXPECT_TRUE(fs::exists(Path("capture") + "/floor_plan.geojson"));
}

TEST_F(SimulateCaptureTest, ReplacesAnOldCaptureAsAWhole) {
  ASSERT_TRUE(SimulateCapture(TinyOptions(), Path("capture"), 0, 2, progress_).ok());
  sim::SimulateOptions fewer = TinyOptions();
  fewer.num_queries = 2;
  ASSERT_TRUE(SimulateCapture(fewer, Path("capture") + "/", 0, 2, progress_).ok());
  ASSERT_TRUE(SimulateCapture(fewer, Path("other"), 0, 2, progress_).ok());
  EXPECT_EQ(Files(Path("capture")), Files(Path("other")));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()),
            2);  // nothing left beside them
}

TEST_F(SimulateCaptureTest, RefusesToReplaceWhatItDidNotMake) {
  ASSERT_TRUE(SimulateCapture(TinyOptions(), Path("capture"), 0, 2, progress_).ok());
  std::ofstream(Path("capture") + "/images/mine.jpg") << "x";
  const Result<SimulateResult> result = SimulateCapture(TinyOptions(), Path("capture"), 0, 2, progress_);
  ASSERT_FALSE(result.ok());
  EXPECT_NE(result.error().message.find("images/mine.jpg: was not made by cairn"), std::string::npos);
  EXPECT_TRUE(fs::exists(Path("capture") + "/images/mine.jpg"));
  EXPECT_FALSE(SimulateCapture(TinyOptions(), Path("nowhere/capture"), 0, 2, progress_).ok());
}

TEST_F(SimulateCaptureTest, LeavesTheOldCaptureWhenCancelled) {
  class Impatient : public Progress {
   public:
    void Begin(std::string_view, int64_t, std::string_view) override {}
    void Advance(int64_t) override {}
    void End() override {}
    bool Cancelled() const override { return true; }
  } impatient;
  ASSERT_TRUE(SimulateCapture(TinyOptions(), Path("capture"), 0, 2, progress_).ok());
  const auto before = Files(Path("capture"));
  const Result<SimulateResult> result = SimulateCapture(TinyOptions(), Path("capture"), 1, 2, impatient);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kCancelled);
  EXPECT_EQ(Files(Path("capture")), before);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

class SimulateCommandTest : public SimulateCaptureTest {
 protected:
  Status RunCommand(const std::vector<std::string>& arguments, const CommandEnvironment& given = {}) {
    CLI::App app;
    const Command command = SimulateCommand();
    ArgumentParser parser(app);
    command.add_arguments(parser);
    std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
    app.parse(reversed);
    CommandEnvironment environment = given;
    environment.progress = &progress_;
    StageReport report;
    environment.report = &report;
    std::ostringstream out;
    environment.out = &out;
    return command.run(environment);
  }
  std::string Write(const std::string& name, const std::string& contents) {
    std::ofstream(Path(name)) << contents;
    return Path(name);
  }
  static constexpr const char* kTiny =
      "texel_m = 0.04\nimage_width_px = 64\nimage_height_px = 48\nspacing_m = 1.5\nnum_queries = 2\n";
};

TEST_F(SimulateCommandTest, TakesItsTableAndTheSeedFromARecipe) {
  const std::string recipe =
      Write("recipe.toml",
            std::string("name = \"x\"\nseed = 3\n[match_features]\npairs = \"auto\"\n[simulate]\n") + kTiny);
  ASSERT_TRUE(RunCommand({recipe, "-o", Path("a")}).ok());
  CommandEnvironment seed3, seed4;
  seed3.seed = 3, seed3.seed_given = true;
  seed4.seed = 4, seed4.seed_given = true;
  const std::string flat = Write("options.toml", kTiny);
  ASSERT_TRUE(RunCommand({flat, "-o", Path("b")}, seed3).ok());
  ASSERT_TRUE(RunCommand({"--options", flat, "-o", Path("c")}, seed3).ok());
  ASSERT_TRUE(RunCommand({recipe, "-o", Path("d")}, seed4).ok());
  EXPECT_EQ(Files(Path("a")), Files(Path("b")));
  EXPECT_EQ(Files(Path("a")), Files(Path("c")));
  EXPECT_NE(Files(Path("a")), Files(Path("d")));
}

TEST_F(SimulateCommandTest, NamesTheFileAndTheKeyOfABadRecipe) {
  const std::vector<std::pair<std::string, std::string>> recipes = {
      {"name = \"x\"\n[[capture]]\npath = \".\"\n", "[simulate]"},
      {"[simulate]\nspacing = 0.5\n", "spacing_m"},
      {"[simulate]\nspacing_m = \"wide\"\n", "spacing_m"},
      {"seed = -1\n[simulate]\n", "seed"},
      {"simulate = 3\n", "not a table"},
      {"[simulate\n", "not TOML"},
  };
  for (const auto& [contents, words] : recipes) {
    const Status status = RunCommand({Write("recipe.toml", contents), "-o", Path("capture")});
    ASSERT_FALSE(status.ok()) << contents;
    EXPECT_NE(status.error().message.find("recipe.toml"), std::string::npos) << status.error().message;
    EXPECT_NE(status.error().message.find(words), std::string::npos) << status.error().message;
    EXPECT_FALSE(fs::exists(Path("capture")));
  }
}

}  // namespace
}  // namespace cairn::simulate
