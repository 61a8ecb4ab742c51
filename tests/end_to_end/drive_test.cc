#include <filesystem>

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
