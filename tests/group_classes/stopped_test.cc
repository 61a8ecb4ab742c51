// A run of stage 3 that is killed, and one that is stopped, go on where they stood and end with the same
// bytes.

#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class StoppedStage : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("stopped_stage");
    ASSERT_NO_FATAL_FAILURE(
        RenderTinySurvey(*folder_ / "survey", "--pose-noise-m 0.02 --pose-noise-deg 0.5"));
    const std::string command = fmt::format(
        "cd '{}' && cairn stage extract-features survey -o features.db --max-num-features 300 && "
        "cairn stage match-features features.db --capture survey -o matches.db",
        folder_->string());
    const ProgramRun run = RunShell(command);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    ASSERT_EQ(RunShell(Command("whole.db")).exit_code, 0);
    ASSERT_FALSE(fs::exists(*folder_ / "whole.db.solved"));  // done: it is not needed any more
  }
  static void TearDownTestSuite() { delete folder_; }

  void TearDown() override {
    for (const char* name : {"it.db", "it.db.solved"}) fs::remove_all(*folder_ / name);
  }

  // In parts, so that there are many adjustments.
  static std::string Command(const std::string& output, const std::string& more = "") {
    return fmt::format(
        "cd '{}' && exec cairn stage group-classes matches.db --capture survey --num-images-at-once 40 -o {} "
        "{}",
        folder_->string(), output, more);
  }

  // Sends the signal once that many bytes of solutions are kept.  Returns the exit code; -1 where the run had
  // ended by then.
  static int StopAfter(int64_t num_bytes, const std::string& signal, const std::string& more = "") {
    const std::string solved = *folder_ / "it.db.solved";
    const ProgramRun run =
        RunShell(fmt::format("({}) & pid=$!; while kill -0 $pid 2>/dev/null; do "
                             "if [ $(stat -c %s '{}' 2>/dev/null || echo 0) -ge {} ]; then kill -{} $pid; "
                             "break; fi; done; wait $pid",
                             Command("it.db", more), solved, num_bytes, signal));
    return fs::exists(solved) ? run.exit_code : -1;
  }

  // Goes on, to the bytes of a run that was never stopped.  Returns what was said.
  static std::string GoOn() {
    const ProgramRun run = RunShell(Command("it.db", "--threads 1"));
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_EQ(*HashFile(*folder_ / "it.db"), *HashFile(*folder_ / "whole.db"));
    EXPECT_FALSE(fs::exists(*folder_ / "it.db.solved"));
    return run.err;
  }

  static TemporaryFolder* folder_;
};
TemporaryFolder* StoppedStage::folder_ = nullptr;

TEST_F(StoppedStage, KilledRunGoesOnToTheSameBytes) {
  int num_killed = 0;
  for (const int64_t num_bytes : {1, 50000, 300000, 600000, 900000}) {
    if (StopAfter(num_bytes, "KILL") != 128 + 9) continue;
    ++num_killed;
    EXPECT_FALSE(fs::exists(*folder_ / "it.db"));
    const std::string said = GoOn();
    if (num_bytes > 1) EXPECT_THAT(said, HasSubstr("goes on where an earlier run stood")) << num_bytes;
    fs::remove(*folder_ / "it.db");
  }
  EXPECT_GE(num_killed, 3);
}

TEST_F(StoppedStage, KilledAmongBlocksItGoesOnToTheSameBytes) {
  const std::string blocks = "--num-images-together 40";
  ASSERT_EQ(RunShell(Command("blocks.db", blocks)).exit_code, 0);
  EXPECT_NE(*HashFile(*folder_ / "blocks.db"), *HashFile(*folder_ / "whole.db"));
  const int64_t num_bytes = 1200000;  // some of the blocks; learning and parts are 860,000
  ASSERT_EQ(StopAfter(num_bytes, "KILL", blocks), 128 + 9);
  const ProgramRun run = RunShell(Command("it.db", "--threads 1 " + blocks));
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("goes on where an earlier run stood"));
  EXPECT_EQ(*HashFile(*folder_ / "it.db"), *HashFile(*folder_ / "blocks.db"));
}

TEST_F(StoppedStage, KilledAgainAndAgainItEnds) {
  for (const int64_t num_bytes : {50000, 200000, 400000}) StopAfter(num_bytes, "KILL");
  GoOn();
}

TEST_F(StoppedStage, InterruptedRunSaysSoAndGoesOn) {
  const int code = StopAfter(50000, "INT");
  EXPECT_EQ(code, 10);  // kCancelled
  EXPECT_FALSE(fs::exists(*folder_ / "it.db"));
  EXPECT_THAT(GoOn(), HasSubstr("goes on where an earlier run stood"));
}

TEST_F(StoppedStage, WhatIsDamagedOrForeignChangesNothing) {
  ASSERT_EQ(StopAfter(300000, "KILL"), 128 + 9);
  const std::string path = *folder_ / "it.db.solved";
  const std::string bytes = *ReadFile(path);
  std::string flipped = bytes;
  flipped[bytes.size() / 2] = static_cast<char>(flipped[bytes.size() / 2] ^ 1);
  std::string other_program = bytes;
  other_program[20] = other_program[20] == 'a' ? 'b' : 'a';  // in its identity
  for (const auto& [damaged, said] :
       {std::pair(bytes.substr(0, bytes.size() - 5), "cut off after"), std::pair(flipped, "cut off after"),
        std::pair(std::string("no such file"), "of another program"),
        std::pair(other_program, "of another program")}) {
    std::ofstream(path, std::ios::binary) << damaged;
    EXPECT_THAT(GoOn(), HasSubstr(said));
  }
  // Of other options, as of another survey: nothing in it is asked for.
  ASSERT_EQ(RunShell(fmt::format("cd '{}' && cp whole.db it.db", folder_->string())).exit_code, 0);
  std::ofstream(path, std::ios::binary) << bytes;
  const ProgramRun other = RunShell(Command("it.db", "--num-keypoints-adjusted 60"));
  ASSERT_EQ(other.exit_code, 0) << other.err;
  const ProgramRun alone = RunShell(Command("alone.db", "--num-keypoints-adjusted 60"));
  ASSERT_EQ(alone.exit_code, 0) << alone.err;
  EXPECT_EQ(*HashFile(*folder_ / "it.db"), *HashFile(*folder_ / "alone.db"));
  EXPECT_NE(*HashFile(*folder_ / "it.db"), *HashFile(*folder_ / "whole.db"));
}

TEST_F(StoppedStage, WithoutAPlaceForTheFileItIsAWarning) {
  fs::create_directory(*folder_ / "it.db.solved");
  const ProgramRun run = RunShell(Command("it.db"));
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("a run that is stopped will begin anew"));
  EXPECT_EQ(*HashFile(*folder_ / "it.db"), *HashFile(*folder_ / "whole.db"));
}

}  // namespace
}  // namespace cairn
