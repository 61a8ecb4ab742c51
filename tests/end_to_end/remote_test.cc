// Captures, build folders and maps on a file server: slow, without locks, and with calls that fail
// (tests/remote/remote_folder.py).
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Remote : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>("remote_test");
    fs::create_directory(*folder_ / "server");
    WriteSmallRecipe(*folder_ /
                     "server/survey.toml");  // a compile through the server takes three times as long
    const ProgramRun rendered =
        RunShell(fmt::format("cairn stage simulate {0}.toml -o {0}", *folder_ / "server/survey"));
    ASSERT_EQ(rendered.exit_code, 0) << rendered.err;
    WriteCaptureRecipe(*folder_ / "server/map.toml", {"survey"});
    const ProgramRun local = RunShell(
        fmt::format("cairn compile {} -o {}", *folder_ / "server/map.toml", *folder_ / "local.cairn"));
    ASSERT_EQ(local.exit_code, 0) << local.err;
    fs::create_directory(*folder_ / "place");
  }
  static void TearDownTestSuite() {
    RunShell("umount " + *folder_ / "place");
    folder_.reset();
  }

  void SetUp() override {
    if (access("/dev/fuse", R_OK | W_OK) != 0 || geteuid() != 0) GTEST_SKIP() << "no FUSE for this user here";
  }
  void TearDown() override { Unmount(); }

  static void Mount(const std::string& arguments) {
    const std::string place = *folder_ / "place";
    const ProgramRun run = RunShell(fmt::format(
        "{{ {} {}/tests/remote/remote_folder.py {} {} --counts {} {} > {} 2>&1 & }}; for i in $(seq 100); do "
        "mountpoint -q {} && exit; sleep 0.1; done; cat {} >&2; exit 1",
        CAIRN_PYTHON, CAIRN_SOURCE_DIR, *folder_ / "server", place, *folder_ / "counts", arguments,
        *folder_ / "log", place, *folder_ / "log"));
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }
  // Returns how many calls of each kind there were.
  static std::map<std::string, int> Unmount() {
    fs::remove(*folder_ / "counts");
    const ProgramRun run =
        RunShell(fmt::format("mountpoint -q {0} || exit 0; umount {0}; for i in $(seq 100); do [ -s {1} ] && "
                             "exit; sleep 0.1; done; exit 1",
                             *folder_ / "place", *folder_ / "counts"));
    EXPECT_EQ(run.exit_code, 0) << run.err;
    const auto text = ReadFile(*folder_ / "counts");
    return text.ok() ? nlohmann::json::parse(*text).get<std::map<std::string, int>>()
                     : std::map<std::string, int>();
  }

  static ProgramRun Compile() {
    return RunShell(
        fmt::format("cairn compile {} -o {}", *folder_ / "place/map.toml", *folder_ / "place/map.cairn"));
  }
  static void StartAgain() {
    fs::remove_all(*folder_ / "server/map.build");
    fs::remove(*folder_ / "server/map.cairn");
  }
  static void ExpectSameBytesAsLocal() {
    for (const char* file : {"features.db", "matches.db", "classes.db", "regions.db"}) {
      EXPECT_EQ(HashFile(*folder_ / ("server/map.build/" + std::string(file))).value(),
                HashFile(*folder_ / ("local.build/" + std::string(file))).value())
          << file;
    }
    EXPECT_EQ(HashFile(*folder_ / "server/map.cairn").value(), HashFile(*folder_ / "local.cairn").value());
  }

  static std::unique_ptr<TemporaryFolder> folder_;
};
std::unique_ptr<TemporaryFolder> Remote::folder_;

TEST_F(Remote, ASlowServerWithoutLocksGivesTheSameMap) {
  StartAgain();
  ASSERT_NO_FATAL_FAILURE(Mount("--delay-ms 0.2 --no-locks"));
  const ProgramRun run = Compile();
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const ProgramRun again = Compile();
  EXPECT_THAT(again.out, HasSubstr("up to date")) << again.err;
  const ProgramRun located = RunShell(fmt::format("cairn localize {} {}/survey/images/*00_h0.jpg",
                                                  *folder_ / "place/map.cairn", *folder_ / "place"));
  EXPECT_THAT(located.out, HasSubstr("\"fix\":true")) << located.err;
  Unmount();
  ExpectSameBytesAsLocal();
}

TEST_F(Remote, ACallThatFailsIsSaidAndTheNextRunMakesTheSameMap) {
  StartAgain();
  ASSERT_NO_FATAL_FAILURE(Mount(""));
  ASSERT_EQ(Compile().exit_code, 0);
  const std::map<std::string, int> counts = Unmount();
  // "lost": done, and reported as if it were not.
  const std::vector<std::pair<std::string, std::string>> faults = {
      {"fail write", "ENOSPC"}, {"fail write", "EIO"},     {"fail flush", "EDQUOT"},  {"fail fsync", "EIO"},
      {"fail rename", "EIO"},   {"lost rename", "ENOENT"}, {"fail create", "EACCES"}, {"fail open", "ESTALE"},
      {"fail read", "EIO"},     {"fail mkdir", "EIO"},     {"lost unlink", "ENOENT"}};
  int num_failed = 0;
  for (size_t i = 0; i < faults.size(); ++i) {
    const auto& [what, error] = faults[i];
    const std::string how = what.substr(0, 4), kind = what.substr(5);
    ASSERT_TRUE(counts.contains(kind)) << kind;
    const double part = i % 2 == 0 ? 0.3 : 0.9;
    const int number = std::max(1, static_cast<int>(part * counts.at(kind)));
    SCOPED_TRACE(fmt::format("--{} {}:{}:{}", how, kind, number, error));
    StartAgain();
    ASSERT_NO_FATAL_FAILURE(Mount(fmt::format("--{} {}:{}:{}", how, kind, number, error)));
    const ProgramRun run = Compile();
    Unmount();
    EXPECT_LT(run.exit_code, 64) << run.err;  // no crash
    if (run.exit_code != 0) {
      ++num_failed;
      EXPECT_THAT(run.err, HasSubstr((*folder_ / "place"))) << "which file it was";
    }
    ASSERT_NO_FATAL_FAILURE(Mount(""));
    const ProgramRun next = Compile();
    Unmount();
    ASSERT_EQ(next.exit_code, 0) << next.err << "\nafter: " << run.err;
    ExpectSameBytesAsLocal();
  }
  EXPECT_GT(num_failed, 5);
}

}  // namespace
}  // namespace cairn
