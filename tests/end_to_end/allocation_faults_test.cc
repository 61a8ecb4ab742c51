// What commands that write and read maps leave and say where a request for memory is refused.

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/end_to_end/program_run.h"
#include "tests/end_to_end/signed_epochs.h"

namespace cairn {
namespace {

using testing::AnyOf;
using testing::HasSubstr;

class AllocationFaults : public SignedEpochs {
 protected:
  AllocationFaults() : SignedEpochs("allocation_faults_test") {}

  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers have an allocator of their own";
#endif
  }

  ProgramRun RunWithFault(const std::string& command, const Contents& before, int64_t at,
                          const std::string& more = "") const {
    FillWork(before);
    std::filesystem::remove(folder_ / "log");
    return RunShell(fmt::format("LD_PRELOAD='{}' FAULT_AT={} FAULT_LOG='{}' {} {}", CAIRN_ALLOCATION_LIBRARY,
                                at, folder_ / "log", more, command));
  }

  // `printed`: what the command says where none is refused.
  int64_t NumRequests(const std::string& command, const Contents& before, std::string* printed) const {
    const ProgramRun run = RunWithFault(command, before, 0);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    *printed = run.out;
    return std::atoll(Bytes("log").c_str());
  }

  // Refuses requests of `command`: about `kNumFaults` of them, evenly, as many of what the program does
  // before any command, and each of the last ones, where files take their places; all of them where
  // CAIRN_FAULTS_ALL is set.  Either there was another way, or it says so, with the code of its own. `check`:
  // what is in the folder then, less what is temporary.
  void ForSomeFaults(const std::string& command, const Contents& before,
                     const std::function<void(bool succeeded, const Contents&)>& check) const {
    std::string printed;
    const int64_t num_of_start = NumRequests("cairn --version", {}, &printed);
    const int64_t num_requests = NumRequests(command, before, &printed);
    ASSERT_GT(num_requests, num_of_start);
    const bool all = std::getenv("CAIRN_FAULTS_ALL") != nullptr;
    int num_refused = 0, num_other_ways = 0;
    for (const std::string more : {"", "FAULT_FROM=1"}) {  // one, or all that follow, too
      for (int64_t at = 1; at <= num_requests;) {
        SCOPED_TRACE(fmt::format("{}, request {} of {} {}", command, at, num_requests, more));
        const ProgramRun run = RunWithFault(command, before, at, more);
        const int64_t step = at <= num_of_start ? num_of_start : num_requests - num_of_start;
        const bool each = all || (more.empty() && at > num_requests - kNumLast);
        at += each ? 1 : std::max<int64_t>(1, step / kNumFaults);
        EXPECT_THAT(run.exit_code, AnyOf(0, static_cast<int>(ErrorCode::kNoMemory))) << run.err;
        if (run.exit_code != 0) {
          EXPECT_THAT(run.err, HasSubstr("out of memory"));
        } else {
          EXPECT_EQ(run.out, printed);
        }
        ++(run.exit_code == 0 ? num_other_ways : num_refused);
        check(run.exit_code == 0, WorkThatStays());
      }
    }
    std::printf("%s: %d refused, %d went on\n", command.c_str(), num_refused, num_other_ways);
    EXPECT_GT(num_refused, kNumFaults);
  }

  static constexpr int kNumFaults = 30, kNumLast = 150;
};

TEST_F(AllocationFaults, UpdateInPlaceLeavesTheOldOrTheNewMap) {
  const std::string older = Bytes("1"), old_map = Bytes("2"), new_map = Bytes("3");
  ForSomeFaults("cairn update apply " + work_ + "/map " + folder_ / "delta" + " --in-place --public-key " +
                    folder_ / "key.pub",
                {{"map", old_map}, {"map.previous", older}}, [&](bool succeeded, const Contents& after) {
                  const bool is_new = after.at("map") == new_map;
                  EXPECT_TRUE(is_new || (!succeeded && after.at("map") == old_map));
                  EXPECT_TRUE(after.at("map.previous") == (is_new ? old_map : older));
                  EXPECT_EQ(after.size(), 2u);
                });
}

TEST_F(AllocationFaults, RollbackExchangesBothMapsOrNone) {
  const std::string older = Bytes("1"), old_map = Bytes("2");
  ForSomeFaults("cairn update rollback " + work_ + "/map --public-key " + folder_ / "key.pub",
                {{"map", old_map}, {"map.previous", older}}, [&](bool succeeded, const Contents& after) {
                  const bool is_back = after.at("map") == older;
                  EXPECT_TRUE(is_back || (!succeeded && after.at("map") == old_map));
                  EXPECT_TRUE(after.at("map.previous") == (is_back ? old_map : older));
                });
}

TEST_F(AllocationFaults, WhatIsWrittenIsWholeOrNotThere) {
  const std::string key = " --key " + folder_ / "key";
  struct Case {
    std::string command, expected;
  };
  for (const Case& each :
       {Case{"cairn migrate " GOLDEN_DIR "/map_1.0.cairn", "unsigned"},
        Case{"cairn sign " + folder_ / "unsigned" + key + " --epoch 3", "3"},
        Case{"cairn update delta " + folder_ / "2" + " " + folder_ / "3" + key, "delta"}}) {
    const std::string expected = Bytes(each.expected);
    ForSomeFaults(each.command + " -o " + work_ + "/out", {}, [&](bool succeeded, const Contents& after) {
      const bool is_there = after.contains("out");
      EXPECT_TRUE(is_there || !succeeded);
      EXPECT_TRUE(!is_there || after.at("out") == expected);
    });
  }
}

// No map is called damaged, and no signature false, because there was no memory to look at it.
TEST_F(AllocationFaults, VerifyJudgesNothing) {
  ForSomeFaults("cairn verify " + folder_ / "2" + " --public-key " + folder_ / "key.pub", {},
                [](bool, const Contents&) {});
}

}  // namespace
}  // namespace cairn
