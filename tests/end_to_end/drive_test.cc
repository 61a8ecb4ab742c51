#include <filesystem>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A small building with rooms of their own, compiled to a visual memory.
class Drive : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("drive_test");
    const ProgramRun run = RunShell(
        fmt::format("cairn compile {} -o {} --progress none --threads 2", kRecipe, Path("rooms.cairn")));
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static std::string Path(const std::string& name) { return *folder_ / name; }
  static ProgramRun Run(const std::string& arguments, const char* servo = "ideal") {
    return RunShell(fmt::format("cairn drive {} --building {} --servo {} {}", Path("rooms.cairn"), kRecipe,
                                servo, arguments));
  }

  static constexpr char kRecipe[] = CAIRN_SOURCE_DIR "/maps/drive_unique/recipe.toml";
  static TemporaryFolder* folder_;
};
TemporaryFolder* Drive::folder_ = nullptr;

// The survey's own images, in their order.
TEST_F(Drive, WhereItIsIsKnownAfterSomeImages) {
  std::string images, odometry = "# ahead left turn\n";
  for (int i = 30; i < 36; ++i) {
    images += fmt::format(" {}/d{:04}.jpg", Path("rooms.build/capture/images"), i);
    odometry += "0.3 0 0\n";
  }
  ASSERT_TRUE(WriteFileAtomically(Path("wheels.txt"), odometry).ok());
  for (const std::string& options : {std::string(), " --odometry " + Path("wheels.txt")}) {
    const ProgramRun run = RunShell("cairn where " + Path("rooms.cairn") + images + options + " --json");
    ASSERT_EQ(run.exit_code, 0) << run.err;
    std::istringstream lines(run.out);
    std::string line;
    int num_lines = 0;
    while (std::getline(lines, line)) {
      const auto step = nlohmann::json::parse(line);
      double sum = step["elsewhere"];
      for (const auto& place : step["places"]) sum += place["probability"].get<double>();
      EXPECT_LE(sum, 1 + 1e-9);
      // No single image makes a place certain.
      if (num_lines == 0) EXPECT_LE(step["places"][0]["probability"].get<double>(), 0.991) << line;
      if (num_lines == 5) {
        EXPECT_GT(step["places"][0]["probability"].get<double>(), 0.99) << line;
        EXPECT_THAT(step["places"][0]["image"].get<std::string>(), testing::StartsWith("d003")) << line;
      }
      ++num_lines;
    }
    EXPECT_EQ(num_lines, 6) << run.out;
  }
  const ProgramRun people = RunShell("cairn where " + Path("rooms.cairn") + images);
  ASSERT_EQ(people.exit_code, 0) << people.err;
  EXPECT_THAT(people.out, HasSubstr("by itself"));
  EXPECT_THAT(people.out, HasSubstr("\nat d003"));
}

TEST_F(Drive, WhereRefusesWhatItCannotUse) {
  const std::string image = Path("rooms.build/capture/images/d0030.jpg");
  const auto where = [&](const std::string& arguments) {
    return RunShell("cairn where " + Path("rooms.cairn") + " " + arguments);
  };
  EXPECT_EQ(where("").exit_code, 2);
  EXPECT_NE(where(Path("none.jpg")).exit_code, 0);
  ASSERT_TRUE(WriteFileAtomically(Path("short.txt"), "0 0 0\n").ok());
  const ProgramRun missing = where(image + " " + image + " --odometry " + Path("short.txt"));
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_THAT(missing.err, HasSubstr("it has lines for 1 images, and none for image 2"));
  EXPECT_THAT(where(image + " --odometry " + Path("short.txt") + " --reach-links 3").err,
              HasSubstr("is for images without odometry"));
  EXPECT_THAT(where(image + " --way-sigma-m 1").err, HasSubstr("is the error of odometry"));
  EXPECT_THAT(where(image + " --fix-ratio 2").err, HasSubstr("fix_ratio = 2: must be in"));
}

TEST_F(Drive, ALostRobotReachesItsGoalAndRecordsTheWay) {
  const std::string arguments = "--start 0.9,0.95,340 --goal d0040.jpg --svg " + Path("run.svg") + " -o ";
  const ProgramRun run = Run(arguments + Path("run.json"));
  ASSERT_EQ(run.exit_code, 0) << run.err << run.out;
  EXPECT_THAT(run.out, HasSubstr("arrived: "));
  const auto record = nlohmann::json::parse(*ReadFile(Path("run.json")));
  EXPECT_TRUE(record["reached"]);
  EXPECT_LT(record["goal_error_m"].get<double>(), 0.3);
  EXPECT_GT(record["way_m"].get<double>(), 5);
  for (const auto& leg : record["legs"]) {
    if (leg["hypotheses"].empty()) continue;
    double sum = 0;
    for (const auto& hypothesis : leg["hypotheses"]) sum += hypothesis["posterior"].get<double>();
    EXPECT_NEAR(sum, 1, 1e-9);
  }
  EXPECT_THAT(*ReadFile(Path("run.svg")), HasSubstr("</svg>"));
  ASSERT_EQ(Run(arguments + Path("again.json")).exit_code, 0);
  EXPECT_EQ(*ReadFile(Path("again.json")), *ReadFile(Path("run.json"))) << "same seed, same drive";
}

TEST_F(Drive, ALostRobotIsSteeredToItsGoalByItsCamera) {
  const ProgramRun run = Run("--start 2,2,0 --goal d0060.jpg -o " + Path("steered.json"), "epipolar");
  ASSERT_EQ(run.exit_code, 0) << run.err << run.out;
  const auto record = nlohmann::json::parse(*ReadFile(Path("steered.json")));
  EXPECT_LT(record["goal_error_m"].get<double>(), 0.1);
  EXPECT_LT(record["goal_error_deg"].get<double>(), 2);
}

// The way to the first image, with sensors as said.
TEST_F(Drive, WheelsThatSlipLeadElsewhereAndInTheDarkNothingIsSeen) {
  const auto first_leg = [&](const std::string& sensors) {
    const std::string path = Path("first_leg.json");
    std::filesystem::remove(path);
    Run("--start 2,2,0 --goal d0060.jpg --max-num-legs 1 " + sensors + " -o " + path, "epipolar");
    const auto record = nlohmann::json::parse(*ReadFile(path));
    return record["legs"].back()["steps"].dump();
  };
  const std::string sure = "--exposure-s 0 --image-gain 0 --slip-ratio 0";
  EXPECT_EQ(first_leg(sure), first_leg(sure));
  EXPECT_NE(first_leg(sure), first_leg("--exposure-s 0 --image-gain 0 --slip-ratio 0.3"));
  EXPECT_NE(first_leg(sure), first_leg("--exposure-s 0.1 --image-gain 0 --slip-ratio 0"));
  EXPECT_NE(first_leg(sure), first_leg("--exposure-s 0 --image-gain 0.5 --slip-ratio 0"));
  const ProgramRun dark =
      Run("--start 2,2,0 --goal d0060.jpg --light-ratio 0.01 --image-noise 10", "epipolar");
  EXPECT_NE(dark.exit_code, 0) << "found its way without light";
}

TEST_F(Drive, TheLeastRiskLeadsToTheGoal) {
  const ProgramRun run = Run("--start 0.9,0.95,340 --goal d0040.jpg --weight risk -o " + Path("risk.json"));
  ASSERT_EQ(run.exit_code, 0) << run.err << run.out;
  EXPECT_LT(nlohmann::json::parse(*ReadFile(Path("risk.json")))["goal_error_m"].get<double>(), 0.3);
  EXPECT_EQ(Run("--start 0.9,0.95,340 --goal d0040.jpg --weight links --wrong-place-m 5").exit_code, 2);
}

TEST_F(Drive, ACarriedRobotIsRecordedWhereItWasPut) {
  const ProgramRun run =
      Run("--start 0.9,0.95,340 --goal d0040.jpg --kidnap 2:1.83,1.38,2 -o " + Path("kidnapped.json"));
  const auto record = nlohmann::json::parse(*ReadFile(Path("kidnapped.json")));
  EXPECT_EQ(run.exit_code == 0, record["reached"].get<bool>()) << run.err;
  EXPECT_EQ(record["error"].get<std::string>().empty(), run.exit_code == 0);
  EXPECT_GE(record["legs"].size(), 3);
}

TEST_F(Drive, WhatCannotBeDrivenIsSaid) {
  const ProgramRun wall = Run("--start -5,1,0 --goal d0040.jpg");
  EXPECT_EQ(wall.exit_code, static_cast<int>(ErrorCode::kInvalidArgument));
  EXPECT_THAT(wall.err, HasSubstr("no place to stand at -5, 1"));
  const ProgramRun goal = Run("--start 0.9,0.95,340 --goal nobody.jpg");
  EXPECT_EQ(goal.exit_code, static_cast<int>(ErrorCode::kNotFound));
  EXPECT_THAT(goal.err, HasSubstr("nobody.jpg"));
  EXPECT_THAT(Run("--start 0.9,nan,0 --goal d0040.jpg").err, HasSubstr("expected X,Y,HEADING"));
  EXPECT_THAT(Run("--start 0.9,0.95,340 --goal d0040.jpg --kidnap 1").err,
              HasSubstr("expected STEP:X,Y,HEADING"));
  EXPECT_NE(Run("--start 0.9,0.95,340 --goal d0040.jpg --max-num-legs 1").exit_code, 0);
}

}  // namespace
}  // namespace cairn
