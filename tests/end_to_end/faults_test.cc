// The files that commands which write maps leave when any one of their system calls fails.

#include <sys/stat.h>

#include <cerrno>
#include <filesystem>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/delta/map_delta.h"
#include "core/files/file.h"
#include "core/map/map_file.h"
#include "tests/end_to_end/program_run.h"
#include "tests/end_to_end/signed_epochs.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

struct Kind {
  const char* name;
  std::vector<int> errors;
};
// What each kind of call says when it fails.
const std::vector<Kind>& Kinds() {
  static const std::vector<Kind> kinds = {
      {"open", {EMFILE, EACCES}}, {"read", {EIO}}, {"write", {ENOSPC, EIO}}, {"sync", {EIO}},
      {"rename", {EIO}},          {"link", {EIO}}, {"unlink", {EIO}},        {"close", {EIO}}};
  return kinds;
}

class Faults : public SignedEpochs {
 protected:
  Faults() : SignedEpochs("faults_test") {}

  // Runs a command on a fresh folder with `before` in it, and lets one call after the other fail, for all
  // kinds, until there is none left.  `check`: the run and what is in the folder then, less what
  // is temporary.
  void ForEachFault(const std::string& command, const Contents& before,
                    const std::function<void(const ProgramRun&, const Contents&)>& check) {
    int num_sites = 0, num_runs = 0;
    for (const Kind& kind : Kinds()) {
      for (const int& error : kind.errors) {
        for (int at = 1;; ++at) {
          ASSERT_LT(at, 2000);
          FillWork(before);
          const std::string log = folder_ / "log";
          fs::remove(log);
          const ProgramRun run = RunWithFault(kind.name, error, at, log, command);
          if (!fs::exists(log)) {
            EXPECT_EQ(run.exit_code, 0) << run.err;
            if (&error == &kind.errors.front()) num_sites += at - 1;
            break;
          }
          ++num_runs;
          const std::string what =
              fmt::format("{}, {} {} of {}", command, std::strerror(error), at, ReadFile(log).value());
          SCOPED_TRACE(what);
          check(run, WorkThatStays());
          EXPECT_LT(run.exit_code, 64) << run.err;  // no crash
          if (run.exit_code != 0) {
            EXPECT_THAT(run.err, HasSubstr(folder_.string()));  // which file it was
          }
        }
      }
    }
    std::printf("%s: %d calls, %d runs\n", command.c_str(), num_sites, num_runs);
    EXPECT_GT(num_sites, 10);
  }

  // Lets one call of a kind fail, or kills the program before it; `log` is made if there was one.
  template <typename ErrorOrKilled>
  ProgramRun RunWithFault(const std::string& kind, const ErrorOrKilled& error, int at, const std::string& log,
                          const std::string& command) const {
    return RunShell(fmt::format(
        "LD_PRELOAD='{}' FAULT_KIND={} FAULT_ERROR={} FAULT_AT={} FAULT_FOLDER='{}' FAULT_LOG='{}' {}",
        CAIRN_FAULT_LIBRARY, kind, error, at, Scope(), log, command));
  }

  // Calls that may fail: those on the test's own files; all of the program's, where somebody asks for it.
  std::string Scope() const {
    return std::getenv("CAIRN_FAULTS_EVERYWHERE") != nullptr ? "" : folder_.string();
  }
};

TEST_F(Faults, UpdateInPlaceLeavesTheOldOrTheNewMapAndTheRightOneBefore) {
  const std::string older = Bytes("1"), old_map = Bytes("2"), new_map = Bytes("3");
  const std::string command = "cairn update apply " + work_ + "/map " + folder_ / "delta" +
                              " --in-place --public-key " + folder_ / "key.pub";
  ForEachFault(command, {{"map", old_map}, {"map.previous", older}},
               [&](const ProgramRun& run, const Contents& after) {
                 const bool is_new = after.at("map") == new_map;
                 EXPECT_TRUE(is_new || after.at("map") == old_map);
                 EXPECT_TRUE(is_new || run.exit_code != 0);
                 EXPECT_EQ(after.size(), 2U);
                 // A failed exchange back leaves the map itself as the one before.
                 EXPECT_TRUE(after.at("map.previous") == (is_new ? old_map : older));
                 if (is_new && run.exit_code != 0) {
                   EXPECT_THAT(run.err, HasSubstr("is in place; but"));
                 }
               });
}

TEST_F(Faults, FirstUpdateInPlaceLeavesNoMapBeforeWhereItFails) {
  const std::string command = "cairn update apply " + work_ + "/map " + folder_ / "delta" + " --in-place";
  ForEachFault(command, {{"map", Bytes("2")}}, [&](const ProgramRun& run, const Contents& after) {
    const bool is_new = after.at("map") == Bytes("3");
    EXPECT_TRUE(is_new || (after.at("map") == Bytes("2") && run.exit_code != 0));
    EXPECT_EQ(after.count("map.previous"), is_new ? 1U : 0U);
    if (is_new) {
      EXPECT_TRUE(after.at("map.previous") == Bytes("2"));
    }
  });
}

// Whatever fails, or wherever the robot stops, a map that the ring trusts is in place, and the next update
// and the way back work.
class RingFaults : public Faults {
 protected:
  // Puts the files in the work folder, and kills the program before one call after the other, for all kinds.
  void ForEachKill(const std::string& command, const std::function<void()>& check) {
    int num_kills = 0;
    for (const char* kind : {"open", "write", "sync", "rename", "link", "unlink", "close"}) {
      for (int at = 1;; ++at) {
        ASSERT_LT(at, 2000);
        FillWork(before_);
        fs::remove(folder_ / "log");
        const ProgramRun run = RunWithFault(kind, "killed", at, folder_ / "log", command);
        if (!fs::exists(folder_ / "log")) {
          EXPECT_EQ(run.exit_code, 0) << run.err;
          break;
        }
        ++num_kills;
        SCOPED_TRACE(fmt::format("{}, killed before {} {}", command, at, ReadFile(folder_ / "log").value()));
        EXPECT_NE(run.exit_code, 0);
        check();
      }
    }
    std::printf("%s: %d kills\n", command.c_str(), num_kills);
    EXPECT_GT(num_kills, 10);
  }

  RingEpochs ring_ = RingEpochs(folder_);
  Contents before_ = ring_.before();
};

TEST_F(RingFaults, KilledUpdateLeavesATrustedMapAndTheNextOneWorks) {
  ForEachKill(ring_.apply(), [&] {
    const uint64_t epoch = ring_.TrustedEpoch("map");
    EXPECT_TRUE(epoch == 2 || epoch == 3) << epoch;
    // The map before is gone for no moment, though it may be that of the update that did not come about.
    const uint64_t before = ring_.TrustedEpoch("map.previous");
    EXPECT_TRUE(before == 1 || before == 2) << before;
    EXPECT_TRUE(epoch == 2 || before == 2);
    const ProgramRun again = RunShell(ring_.apply());
    EXPECT_EQ(again.exit_code, 0) << again.err;
    EXPECT_EQ(ring_.TrustedEpoch("map"), 3U);
    EXPECT_EQ(ring_.TrustedEpoch("map.previous"), 2U);
    EXPECT_EQ(Work().size(), 3U);  // nothing temporary stays
    EXPECT_EQ(RunShell(ring_.rollback()).exit_code, 0);
    EXPECT_EQ(ring_.TrustedEpoch("map"), 2U);
    EXPECT_EQ(ring_.TrustedEpoch("map.previous"), 3U);
  });
}

TEST_F(RingFaults, KilledRollbackLeavesBothMapsTrusted) {
  ForEachKill(ring_.rollback(), [&] {
    const uint64_t epoch = ring_.TrustedEpoch("map");
    EXPECT_TRUE(epoch == 1 || epoch == 2) << epoch;
    EXPECT_EQ(ring_.TrustedEpoch("map.previous"), 3 - epoch);
  });
}

TEST_F(RingFaults, FailedUpdateLeavesATrustedMapAndTheRightOneBefore) {
  ForEachFault(ring_.apply(), before_, [&](const ProgramRun& run, const Contents& after) {
    const uint64_t epoch = ring_.TrustedEpoch("map");
    EXPECT_TRUE(epoch == 3 || (epoch == 2 && run.exit_code != 0)) << epoch;
    EXPECT_EQ(ring_.TrustedEpoch("map.previous"), epoch - 1);
    EXPECT_EQ(after.size(), 3U);
    if (epoch == 3 && run.exit_code != 0) {
      EXPECT_THAT(run.err, HasSubstr("is in place; but"));
    }
  });
}

TEST_F(RingFaults, KilledAcceptLeavesTheOldRingOrTheNewOne) {
  const std::string next = folder_ / "next.ring", bob = folder_ / "bob";
  Run("cairn keys make alice=" + folder_ / "key.pub" + " bob=" + bob + ".pub --threshold 2 --after " +
      folder_ / "ring" + " -o " + next);
  for (const std::string& key : {folder_ / "key", bob}) Run("cairn keys sign " + next + " --key " + key);
  before_ = {{"robot.ring", Bytes("ring")}};
  const std::string accept = "cairn keys accept " + work_ + "/robot.ring " + next;
  ForEachKill(accept, [&] {
    const std::string ring = ReadFile(work_ + "/robot.ring").value();
    EXPECT_TRUE(ring == Bytes("ring") || ring == Bytes("next.ring"));
    EXPECT_EQ(RunShell(accept).exit_code, 0);
    EXPECT_EQ(ReadFile(work_ + "/robot.ring").value(), Bytes("next.ring"));
  });
}

// On such a file system the map before is a copy, and as private as it was.
TEST_F(Faults, UpdateWithoutHardLinksKeepsTheMapBeforeToo) {
  WriteFile(work_ + "/map", Bytes("2"));
  chmod((work_ + "/map").c_str(), 0640);
  const ProgramRun run =
      RunWithFault("link", EPERM, 1, folder_ / "log",
                   "cairn update apply " + work_ + "/map " + folder_ / "delta" + " --in-place");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(fs::exists(folder_ / "log"));  // a link was tried
  EXPECT_EQ(Work(), (Contents{{"map", Bytes("3")}, {"map.previous", Bytes("2")}}));
  EXPECT_EQ(fs::status(work_ + "/map.previous").permissions(), fs::perms{0640});
}

// The old file has the size of the new one, as maps and keys of one place mostly have.
TEST_F(Faults, OutputIsTheOldOneOrTheWholeNewOne) {
  const std::string one = folder_ / "unsigned", key = " --key " + folder_ / "key";
  struct Case {
    std::string command, expected;
  };
  for (const Case& each :
       {Case{"cairn update apply " + folder_ / "2" + " " + folder_ / "delta", "3"},
        Case{"cairn sign " + one + key + " --epoch 3", "3"},
        Case{"cairn sign " + one + key + " --after " + folder_ / "2", "3"},
        Case{"cairn update delta " + folder_ / "2" + " " + folder_ / "3" + key, "delta"}}) {
    const std::string expected = Bytes(each.expected), old_bytes(expected.size(), 'x');
    ForEachFault(each.command + " -o " + work_ + "/out", {{"out", old_bytes}},
                 [&](const ProgramRun& run, const Contents& after) {
                   const bool is_new = after.at("out") == expected;
                   EXPECT_TRUE(is_new || (after.at("out") == old_bytes && run.exit_code != 0));
                   if (is_new && run.exit_code != 0) {
                     EXPECT_THAT(run.err, HasSubstr("is in place; but"));
                   }
                 });
  }
}

TEST_F(Faults, RollbackExchangesBothMapsOrNone) {
  const std::string command = "cairn update rollback " + work_ + "/map --public-key " + folder_ / "key.pub";
  ForEachFault(command, {{"map", Bytes("2")}, {"map.previous", Bytes("1")}},
               [&](const ProgramRun& run, const Contents& after) {
                 const bool is_back = after.at("map") == Bytes("1");
                 EXPECT_TRUE(is_back || run.exit_code != 0);
                 EXPECT_TRUE(after.at("map") == Bytes(is_back ? "1" : "2"));
                 EXPECT_TRUE(after.at("map.previous") == Bytes(is_back ? "2" : "1"));
                 if (is_back && run.exit_code != 0) {
                   EXPECT_THAT(run.err, HasSubstr("is in place; but"));
                 }
               });
}

TEST_F(Faults, KeysAreAPairOrNotThere) {
  ForEachFault("cairn keygen " + work_ + "/key", {}, [&](const ProgramRun& run, const Contents& after) {
    EXPECT_EQ(after.count("key"), after.count("key.pub"));
    EXPECT_TRUE(run.exit_code != 0 || after.count("key") == 1);
    if (after.count("key") == 1) {
      EXPECT_EQ(after.at("key").size(), 129U);
      EXPECT_EQ(after.at("key").substr(64, 64), after.at("key.pub").substr(0, 64));
    }
  });
}

// The last thing that can fail is to say so.
TEST_F(Faults, FullStandardOutputIsSaidWithWhatIsDone) {
  fs::copy_file(folder_ / "2", work_ + "/map");
  const ProgramRun run =
      RunShell("cairn update apply " + work_ + "/map " + folder_ / "delta" + " --in-place >/dev/full");
  EXPECT_EQ(run.exit_code, static_cast<int>(ErrorCode::kIo));
  EXPECT_THAT(run.err, HasSubstr("standard output cannot be written"));
  EXPECT_THAT(run.err, HasSubstr("its files are written"));
  EXPECT_EQ(ReadFile(work_ + "/map").value(), Bytes("3"));
}

}  // namespace
}  // namespace cairn
