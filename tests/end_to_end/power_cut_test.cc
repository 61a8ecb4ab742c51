// What a power cut leaves of the files of commands that write maps, wherever it comes.

#include <filesystem>
#include <functional>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/end_to_end/power_cut.h"
#include "tests/end_to_end/program_run.h"
#include "tests/end_to_end/signed_epochs.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

struct Kept {
  PowerCut::Names names;
  PowerCut::Bytes bytes;
};
// How much of what is not synced may be left: each of these, and the random ones several times.
std::vector<Kept> AllKept() {
  using Names = PowerCut::Names;
  using Bytes = PowerCut::Bytes;
  std::vector<Kept> all = {{Names::kNone, Bytes::kNone},
                           {Names::kNone, Bytes::kAll},
                           {Names::kAll, Bytes::kNone},
                           {Names::kAll, Bytes::kAll}};
  for (int i = 0; i < 4; ++i) {
    for (const Names names : {Names::kFirst, Names::kSome}) {
      for (const Bytes bytes : {Bytes::kNone, Bytes::kSome}) all.push_back({names, bytes});
    }
  }
  return all;
}

// Runs a command that works in `folder`, and returns the calls that it made there.
std::vector<DiskCall> Record(const std::string& folder, const std::string& log, const std::string& command) {
  fs::remove(log);
  const ProgramRun run = RunShell(fmt::format("LD_PRELOAD='{}' LC_RECORD_FOLDER='{}' LC_RECORD_LOG='{}' {}",
                                              CAIRN_RECORD_LIBRARY, folder, log, command));
  EXPECT_EQ(run.exit_code, 0) << command << ": " << run.err;
  return ReadDiskCalls(log);
}

std::map<std::string, std::string> BytesOf(const PowerCut::Files& files) {
  std::map<std::string, std::string> bytes;
  for (const auto& [name, file] : files) bytes[name] = file.bytes;
  return bytes;
}

class PowerCuts : public SignedEpochs {
 protected:
  PowerCuts() : SignedEpochs("power_cut_test") {}

  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers want to be loaded before the library that records";
#endif
  }

  // Runs a command on a fresh folder with `before` in it, and makes of the folder all that a power cut after
  // each of its calls may leave.  `check`: whether the command had ended, and what is in the folder.
  void ForEachCut(const std::string& command, const Contents& before,
                  const std::function<void(bool has_ended, const Contents&)>& check) {
    FillWork(before);
    const std::string work = fs::canonical(work_);
    PowerCut disk(work);
    const std::vector<DiskCall> calls = Record(work, folder_ / "log", command);
    const Contents after = Work();
    std::mt19937 random(7);
    std::set<Contents> seen;
    int num_states = 0;
    for (size_t num_done = 0; num_done <= calls.size(); ++num_done) {
      if (num_done > 0) disk.Do(calls[num_done - 1]);
      const bool has_ended = num_done == calls.size();
      if (has_ended) seen.clear();
      for (const Kept& kept : AllKept()) {
        const PowerCut::Files left = disk.Left(kept.names, kept.bytes, &random);
        if (!seen.insert(BytesOf(left)).second) continue;
        WriteFiles(left, work_);
        SCOPED_TRACE(fmt::format("{}, power cut after {} of {} calls; left: {}", command, num_done,
                                 calls.size(), testing::PrintToString(NamesAndSizes(left))));
        check(has_ended, BytesOf(left));
        ++num_states;
      }
    }
    // All calls that changed something were seen.
    EXPECT_EQ(BytesOf(disk.Left(PowerCut::Names::kAll, PowerCut::Bytes::kAll, &random)), after);
    std::printf("%s: %zu calls, %d states\n", command.c_str(), calls.size(), num_states);
    EXPECT_GE(num_states, 3);
  }

  static std::map<std::string, size_t> NamesAndSizes(const PowerCut::Files& files) {
    std::map<std::string, size_t> sizes;
    for (const auto& [name, file] : files) sizes[name] = file.bytes.size();
    return sizes;
  }
};

TEST_F(PowerCuts, UpdateLeavesATrustedMapAndTheNextOneWorks) {
  const RingEpochs ring(folder_);
  ForEachCut(ring.apply(), ring.before(), [&](bool has_ended, const Contents&) {
    const uint64_t epoch = ring.TrustedEpoch("map");
    EXPECT_TRUE(epoch == 3 || (epoch == 2 && !has_ended)) << epoch;
    const uint64_t before = ring.TrustedEpoch("map.previous");
    EXPECT_TRUE(before == 2 || (before == 1 && epoch == 2)) << before;
    const ProgramRun again = RunShell(ring.apply());
    EXPECT_EQ(again.exit_code, 0) << again.err;
    EXPECT_EQ(ring.TrustedEpoch("map"), 3U);
    EXPECT_EQ(ring.TrustedEpoch("map.previous"), 2U);
    EXPECT_EQ(RunShell(ring.rollback()).exit_code, 0);
    EXPECT_EQ(ring.TrustedEpoch("map"), 2U);
  });
}

TEST_F(PowerCuts, RollbackLeavesBothMapsTrusted) {
  const RingEpochs ring(folder_);
  ForEachCut(ring.rollback(), ring.before(), [&](bool has_ended, const Contents&) {
    const uint64_t epoch = ring.TrustedEpoch("map");
    EXPECT_TRUE(epoch == 1 || (epoch == 2 && !has_ended)) << epoch;
    EXPECT_EQ(ring.TrustedEpoch("map.previous"), 3 - epoch);
  });
}

// The old file has the size of the new one.
TEST_F(PowerCuts, OutputIsTheOldOneOrTheWholeNewOne) {
  const std::string key = " --key " + folder_ / "key";
  struct Case {
    std::string command, expected;
  };
  for (const Case& each :
       {Case{"cairn update apply " + folder_ / "2" + " " + folder_ / "delta", "3"},
        Case{"cairn sign " + folder_ / "unsigned" + key + " --epoch 3", "3"},
        Case{"cairn update delta " + folder_ / "2" + " " + folder_ / "3" + key, "delta"}}) {
    const std::string expected = Bytes(each.expected), old_bytes(expected.size(), 'x');
    ForEachCut(each.command + " -o " + work_ + "/out", {{"out", old_bytes}},
               [&](bool has_ended, const Contents& left) {
                 EXPECT_TRUE(left.at("out") == expected || (left.at("out") == old_bytes && !has_ended));
               });
  }
}

TEST_F(PowerCuts, MigratedMapIsTheOldOneOrTheWholeNewOne) {
  const std::string old_map = ReadFile(GOLDEN_DIR "/map_1.0.cairn").value(), new_map = Bytes("unsigned");
  ForEachCut("cairn migrate " GOLDEN_DIR "/map_1.0.cairn -o " + work_ + "/map", {{"map", old_map}},
             [&](bool has_ended, const Contents& left) {
               EXPECT_TRUE(left.at("map") == new_map || (left.at("map") == old_map && !has_ended));
             });
}

TEST_F(PowerCuts, AcceptLeavesTheOldRingOrTheNewOne) {
  const RingEpochs ring(folder_);
  const std::string next = folder_ / "next.ring", bob = folder_ / "bob";
  Run("cairn keys make alice=" + folder_ / "key.pub" + " bob=" + bob + ".pub --threshold 2 --after " +
      folder_ / "ring" + " -o " + next);
  for (const std::string& key : {folder_ / "key", bob}) Run("cairn keys sign " + next + " --key " + key);
  ForEachCut("cairn keys accept " + work_ + "/robot.ring " + next, {{"robot.ring", Bytes("ring")}},
             [&](bool has_ended, const Contents& left) {
               const std::string& robot = left.at("robot.ring");
               EXPECT_TRUE(robot == Bytes("next.ring") || (robot == Bytes("ring") && !has_ended));
             });
}

TEST_F(PowerCuts, NewKeyIsWholeOrNotThere) {
  ForEachCut("cairn keygen " + work_ + "/key", {}, [&](bool has_ended, const Contents& left) {
    EXPECT_TRUE(!has_ended || left.size() == 2);
    for (const auto& [name, bytes] : left) {
      if (name == "key" || name == "key.pub") {
        EXPECT_EQ(bytes.size(), name == "key" ? 129U : 65U) << name;
      }
    }
  });
}

// A file that takes its place before it is synced may be empty afterwards; one that is synced may not, and it
// is in place for certain when its folder is synced, too.
TEST_F(PowerCuts, WhatIsNotSyncedMayBeLost) {
  const auto left_by = [&](const std::string& more, bool when_ended) {
    std::set<std::string> left_in_out;
    ForEachCut("sh -c 'cd " + work_ + " && printf new > new && " + more + "'", {{"out", "old"}},
               [&](bool has_ended, const Contents& left) {
                 if (has_ended >= when_ended) left_in_out.insert(left.at("out"));
               });
    return left_in_out;
  };
  EXPECT_THAT(left_by("mv new out", false), testing::IsSupersetOf({"old", "", "new"}));
  EXPECT_THAT(left_by("sync new && mv new out", false), testing::UnorderedElementsAre("old", "new"));
  EXPECT_THAT(left_by("sync new && mv new out", true), testing::UnorderedElementsAre("old", "new"));
  EXPECT_THAT(left_by("sync new && mv new out && sync .", true), testing::UnorderedElementsAre("new"));
}

// Where a stage's stamp is, its output is whole, whatever is lost; so the next compile makes the same map.
TEST(PowerCutOfCompile, TheNextOneMakesTheSameMap) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers want to be loaded before the library that records";
#endif
  TemporaryFolder folder("power_cut_of_compile_test");
  fs::create_directories(folder / "work");
  const std::string work = fs::canonical(folder / "work");
  WriteSmallRecipe(work + "/small.toml");
  PowerCut disk(work);
  const std::string compile =
      "cairn compile " + work + "/small.toml -o " + work + "/small.cairn --progress none --log-level error";
  const std::vector<DiskCall> calls = Record(work, folder / "log", compile);
  std::mt19937 random(8);
  const auto whole = BytesOf(PowerCut(work).Left(PowerCut::Names::kAll, PowerCut::Bytes::kAll, &random));

  // What a stamp vouches for: the file of its name, or the files of that folder, or the map.
  const auto vouched_for = [](const std::string& stamp) {
    const std::string name = stamp.substr(0, stamp.size() - std::string(".stamp").size());
    return name.ends_with("/map") ? std::string("small.cairn") : name;
  };
  int num_stamps = 0;
  std::vector<PowerCut::Files> some_left;
  for (size_t num_done = 1; num_done <= calls.size(); ++num_done) {
    disk.Do(calls[num_done - 1]);
    const bool is_chosen = random() % calls.size() < 8;
    if (!calls[num_done - 1].other.ends_with(".stamp") && !is_chosen) continue;
    for (const Kept& kept : AllKept()) {
      PowerCut::Files left = disk.Left(kept.names, kept.bytes, &random);
      for (const auto& [stamp, file] : left) {
        if (!stamp.ends_with(".stamp")) continue;
        ++num_stamps;
        const std::string output = vouched_for(stamp);
        for (const auto& [name, bytes] : whole) {
          if (name == output || name.starts_with(output + "/"))
            EXPECT_TRUE(left.contains(name) && left.at(name).bytes == bytes)
                << name << " is not whole where " << stamp << " is, after " << num_done << " calls";
        }
      }
      if (is_chosen && kept.bytes == PowerCut::Bytes::kSome && random() % 8 == 0)
        some_left.push_back(std::move(left));
    }
  }
  EXPECT_TRUE(BytesOf(disk.Left(PowerCut::Names::kAll, PowerCut::Bytes::kAll, &random)) == whole);
  EXPECT_GT(num_stamps, 100);
  std::printf("%zu calls, %d stamps, %zu compiles afterwards\n", calls.size(), num_stamps, some_left.size());
  EXPECT_FALSE(some_left.empty());
  for (const PowerCut::Files& left : some_left) {
    WriteFiles(left, work);
    const ProgramRun run = RunShell(compile);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_TRUE(ReadFile(work + "/small.cairn").value() == whole.at("small.cairn"));
  }
}

}  // namespace
}  // namespace cairn
