#include "stages/reconstruct/by_colmap/run_program.h"

#include <chrono>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn::reconstruct {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

const NoProgress kNoProgress;

TEST(RunProgram, ReadsLinesOfBothOutputsAndKeepsTheLastOnes) {
  std::vector<std::string> lines;
  RunProgramOptions options;
  options.num_last_lines = 2;
  options.on_line = [&](const std::string& line) { lines.push_back(line); };
  const auto outcome = RunProgram({"sh", "-c", "echo one; echo; echo =====; echo two >&2; printf three"},
                                  options, kNoProgress);
  ASSERT_TRUE(outcome.ok());
  EXPECT_TRUE(outcome->succeeded());
  EXPECT_THAT(lines, ElementsAre("one", "two", "three"));
  EXPECT_THAT(outcome->last_lines, ElementsAre("two", "three"));
}

TEST(RunProgram, PassesExitCodesSignalsAndEnvironmentOn) {
  RunProgramOptions options;
  options.environment = {"CAIRN_TEST_VALUE=seven"};
  EXPECT_EQ(RunProgram({"sh", "-c", "exit 7"}, options, kNoProgress)->exit_code, 7);
  EXPECT_EQ(RunProgram({"sh", "-c", "kill -9 $$"}, options, kNoProgress)->exit_code, 128 + 9);
  EXPECT_THAT(RunProgram({"sh", "-c", "echo $CAIRN_TEST_VALUE"}, options, kNoProgress)->last_lines,
              ElementsAre("seven"));
  EXPECT_THAT(RunProgram({"cat"}, options, kNoProgress)->last_lines, IsEmpty()) << "its input is empty";
}

TEST(RunProgram, MissingProgramIsNotFound) {
  const auto outcome = RunProgram({"no-such-program-anywhere"}, {}, kNoProgress);
  ASSERT_FALSE(outcome.ok());
  EXPECT_EQ(outcome.error().code, ErrorCode::kNotFound);
}

// The program starts another and both ignore SIGTERM: past the limit neither is left.
TEST(RunProgram, EndsTheWholeGroupPastItsTime) {
  const std::string pid_file = testing::TempDir() + "/run_program_test.pid";
  RunProgramOptions options;
  options.max_seconds = 0.5;
  const auto outcome =
      RunProgram({"sh", "-c", "trap '' TERM; (sleep 600 & echo $! > '" + pid_file + "'; wait); sleep 600"},
                 options, kNoProgress);
  ASSERT_TRUE(outcome.ok());
  EXPECT_TRUE(outcome->timed_out);
  EXPECT_FALSE(outcome->succeeded());
  const pid_t grandchild = std::stoi(*ReadFile(pid_file));
  const auto is_gone = [&] {  // a zombie has no command line
    const auto command = ReadFile("/proc/" + std::to_string(grandchild) + "/cmdline");
    return !command.ok() || command->empty();
  };
  for (int i = 0; i < 1000 && !is_gone(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_TRUE(is_gone());
}

TEST(RunProgram, WaitsForOneThatClosesItsOutputsButNotForWhatItLeftBehind) {
  EXPECT_EQ(RunProgram({"sh", "-c", "exec >&- 2>&-; sleep 0.3; exit 3"}, {}, kNoProgress)->exit_code, 3);
  const auto outcome = RunProgram({"sh", "-c", "sleep 5 & echo left"}, {}, kNoProgress);
  ASSERT_TRUE(outcome.ok());
  EXPECT_THAT(outcome->last_lines, ElementsAre("left"));
}

class CancelledProgress final : public Progress {
 public:
  void Begin(std::string_view, int64_t, std::string_view) override {}
  void Advance(int64_t) override {}
  void End() override {}
  bool Cancelled() const override { return true; }
};

TEST(RunProgram, StopsOnRequest) {
  const auto outcome = RunProgram({"sleep", "600"}, {}, CancelledProgress());
  ASSERT_FALSE(outcome.ok());
  EXPECT_EQ(outcome.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace cairn::reconstruct
