#include "pipeline/program/program.h"

#include <sys/mount.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <new>
#include <sstream>
#include <stdexcept>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "core/files/database.h"
#include "core/files/file.h"
#include "core/line/program_version.h"
#include "pipeline/build/build_step.h"
#include "pipeline/build/folder_lock.h"
#include "pipeline/program/json_text.h"
#include "tests/pipeline/program/run_words.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(Program, ExitCodeIsTheErrorCode) {
  for (const ErrorCode code :
       {ErrorCode::kFailed, ErrorCode::kNotFound, ErrorCode::kCorrupt, ErrorCode::kNoData}) {
    const Outcome outcome = RunStage({"stage"}, [code](const CommandEnvironment&) -> Status {
      return Error{code, "a.db: is empty"};
    });
    EXPECT_EQ(outcome.exit_code, static_cast<int>(code));
    EXPECT_EQ(outcome.err, "cairn stage: a.db: is empty\n");
  }
  EXPECT_EQ(RunStage({"stage"}, Nothing).exit_code, 0);
}

TEST(Program, NothingThatCommandsATerminalIsPrinted) {
  const std::string hostile = "a\x1b[2Jb \xc2\x9b\xe2\x80\xae \xff\r";
  const std::string shown = "a\\u001b[2Jb \\u009b\\u202e \\xff\\u000d";
  const auto print = [&](const CommandEnvironment& environment) -> Status {
    *environment.out << hostile << "\n"
                     << "Küche\t\n";
    // A character may be written in parts.
    for (const char c : std::string("\xc3\xbc\xe2\x80\xae\xf0\x9f\xa4\x96")) environment.out->put(c);
    *environment.out << "\xe2\x80" << std::flush << "\n";
    spdlog::warn("{}", hostile);
    return Error{ErrorCode::kNotFound, hostile};
  };
  testing::internal::CaptureStderr();
  const Outcome outcome = RunStage({"stage"}, print);
  const std::string logged = testing::internal::GetCapturedStderr();
  EXPECT_EQ(outcome.out, shown + "\nKüche\t\nü\\u202e🤖\\xe2\\x80\n");
  EXPECT_EQ(outcome.err, "cairn stage: " + shown + "\n");
  EXPECT_EQ(logged, "warning: " + shown + "\n");
  // Words of the command line too.
  EXPECT_EQ(RunStage({"st\x1b[2Jage"}, Nothing).err.find('\x1b'), std::string::npos);
}

TEST(Program, JsonStaysJsonAndSaysTheSame) {
  const nlohmann::json json = {{"name", "a\x1b \x7f \xc2\x9b \xe2\x80\xae \"\\"}};
  const Outcome outcome = RunStage({"stage"}, [&](const CommandEnvironment& environment) {
    *environment.out << json.dump(2);
    return Ok();
  });
  EXPECT_EQ(outcome.out.find('\x7f'), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(outcome.out), json);
  EXPECT_EQ(JsonText({{"name",
                       "K\xfc"
                       "che"}}),
            "{\"name\":\"K\ufffdche\"}");
}

TEST(Program, CommonOptionsReachTheCommand) {
  const Outcome outcome =
      RunStage({"stage", "--threads", "3", "--seed=9", "--progress=none", "--log-level", "error"},
               [](const CommandEnvironment& environment) {
                 *environment.out << environment.num_threads << " " << environment.seed << " "
                                  << environment.seed_given << " " << environment.progress_style;
                 return Ok();
               });
  EXPECT_EQ(outcome.out, "3 9 1 none");
}

TEST(Program, ExceptionsEndWithAMessage) {
  const Outcome out_of_memory = RunStage({"stage", "--memory", "77"},
                                         [](const CommandEnvironment&) -> Status { throw std::bad_alloc(); });
  EXPECT_EQ(out_of_memory.exit_code, 24);
  const Outcome sqlite = RunStage({"stage"}, [](const CommandEnvironment&) -> Status {
    return WithDatabaseErrors("a.db", []() -> Status {
      SQLite::Database database(":memory:", SQLite::OPEN_READWRITE);
      sqlite3_hard_heap_limit64(1);
      const auto lift = std::shared_ptr<void>(nullptr, [](void*) { sqlite3_hard_heap_limit64(0); });
      database.exec("CREATE TABLE t (x)");
      return Ok();
    });
  });
  EXPECT_EQ(sqlite.exit_code, 24);
  EXPECT_THAT(sqlite.err, HasSubstr("--memory"));
  EXPECT_THAT(out_of_memory.err, HasSubstr("out of memory, with --memory 77"));
  const Outcome outcome =
      RunStage({"stage"}, [](const CommandEnvironment&) -> Status { throw std::runtime_error("oops"); });
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("oops"));
}

// A folder with the stamp DIR/x.db.stamp that stages are asked to leave.
class StampTest : public testing::Test {
 protected:
  StampTest() : folder_(fmt::format("{}/stamp_{}", testing::TempDir(), getpid())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~StampTest() override { fs::remove_all(folder_); }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_)) names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
  }
  fs::path folder_;
};

TEST_F(StampTest, FailureLeavesItsCodeForWhoeverStartedTheStageAndNoStamp) {
  RunStage({"stage", "--stamp", Path("x.db.stamp")}, [](const CommandEnvironment&) -> Status {
    return Error{ErrorCode::kNoData, "no \"pairs\""};
  });
  const auto document = nlohmann::json::parse(ReadFile(Path("error.json")).value());
  EXPECT_EQ(document["code"], 6);
  EXPECT_EQ(document["name"], "no_data");
  EXPECT_EQ(document["stage"], "stage");
  EXPECT_EQ(document["message"], "no \"pairs\"");
  EXPECT_THAT(Names(), ElementsAre("error.json", "lock"));
}

TEST_F(StampTest, StampIsDatedWhenTheStageBeganAndTheReportLiesBesideIt) {
  const Outcome outcome =
      RunStage({"stage", "--stamp", Path("x.db.stamp"), "--threads", "3", "--memory", "512", "--seed", "7"},
               [this](const CommandEnvironment& environment) -> Status {
                 std::this_thread::sleep_for(std::chrono::milliseconds(50));
                 CAIRN_RETURN_IF_ERROR(WriteFileAtomically(Path("input"), "changed while the stage ran"));
                 *environment.out << "12 images\n";
                 environment.report->in = {{"images", 14}};
                 environment.report->out = {{"keypoints", 100}};
                 AddRejects("images", {{"a.jpg", "/x/a.jpg: truncated"}, {"b.jpg", "b.jpg: truncated"}},
                            environment.report);
                 return Ok();
               });
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out, "12 images\n");
  EXPECT_THAT(Names(), ElementsAre("input", "lock", "x.db.report.json", "x.db.stamp"));
  EXPECT_LT(fs::last_write_time(Path("x.db.stamp")), fs::last_write_time(Path("input")));
  const auto report = nlohmann::ordered_json::parse(ReadFile(Path("x.db.report.json")).value());
  EXPECT_EQ(report["stage"], "stage");
  EXPECT_GE(report["seconds"], 0.05);
  EXPECT_GT(report["peak_memory_bytes"], 1 << 20);
  EXPECT_EQ(report["threads"], 3);
  EXPECT_EQ(report["memory_limit_mib"], 512);
  EXPECT_EQ(report["seed"], 7);
  EXPECT_EQ(report["printed"], "12 images\n");
  EXPECT_EQ(report["in"].dump() + report["out"].dump() + report["taken_over"].dump(),
            R"({"images":14}{"keypoints":100}{})");
  EXPECT_EQ(report["rejected"].dump(),
            R"([{"what":"images","reason":"truncated","count":2,"names":["a.jpg","b.jpg"]}])");
}

TEST_F(StampTest, ReportAlsoGoesToAGivenFileWithoutAnyStamp) {
  const Outcome outcome = RunStage({"stage", "--report", Path("mine.json")}, Nothing);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(Names(), ElementsAre("mine.json"));
  EXPECT_EQ(nlohmann::json::parse(ReadFile(Path("mine.json")).value())["stage"], "stage");
}

TEST_F(StampTest, ReportGoesToTheGivenFileAlsoBesideAStamp) {
  const Outcome outcome =
      RunStage({"stage", "--stamp", Path("x.db.stamp"), "--report", Path("mine.json")}, Nothing);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(ReadFile(Path("mine.json")).value())["stage"], "stage");
  EXPECT_FALSE(fs::exists(Path("x.db.report.json")));
}

TEST_F(StampTest, StageOfAnotherBuildIsRefusedWithTheOthersName) {
  const auto lock = FolderLock::Acquire(folder_.string(), "4711@elsewhere");
  ASSERT_TRUE(lock.ok()) << lock.error().message;
  const Outcome outcome = RunStage(
      {"stage", "--stamp", Path("x.db.stamp")},
      [](const CommandEnvironment&) -> Status { return MakeError(ErrorCode::kFailed, "must not run"); });
  EXPECT_EQ(outcome.exit_code, 9);
  EXPECT_THAT(outcome.err, HasSubstr("another build (process 4711@elsewhere) is at work"));
  setenv(kBuildSessionVariable, "4711@elsewhere", 1);
  EXPECT_EQ(RunStage({"stage", "--stamp", Path("x.db.stamp")}, Nothing).exit_code, 0);
  unsetenv(kBuildSessionVariable);
}

TEST_F(StampTest, FullDiskStillLetsAReservedErrorFileSayWhy) {
  const std::string disk = Path("disk");
  fs::create_directories(disk);
  // Room for the folder and one file.
  if (mount("none", disk.c_str(), "tmpfs", 0, "nr_inodes=2") != 0)
    GTEST_SKIP() << "only root can mount a small tmpfs";
  EXPECT_TRUE(ReserveErrorFile(disk).ok());
  EXPECT_FALSE(ReadErrorFile(disk).has_value());
  EXPECT_EQ(WriteFileAtomically(disk + "/other", "").error().code, ErrorCode::kDiskFull);
  EXPECT_TRUE(WriteErrorFile(disk, "stage", {ErrorCode::kIo, "full"}).ok());
  const auto failure = ReadErrorFile(disk);
  umount2(disk.c_str(), MNT_DETACH);
  ASSERT_TRUE(failure.has_value());
  EXPECT_EQ(failure->code, ErrorCode::kIo);
  EXPECT_EQ(failure->message, "full");
}

TEST(Program, InterruptEndsTheCommandWithTheCodeOfCancelled) {
  const Outcome outcome = RunStage({"stage"}, [](const CommandEnvironment& environment) -> Status {
    EXPECT_FALSE(environment.progress->Cancelled());
    std::raise(SIGINT);
    EXPECT_TRUE(environment.progress->Cancelled());
    return MakeError(ErrorCode::kFailed, "interrupted in the middle of something");
  });
  EXPECT_EQ(outcome.exit_code, 10);
  EXPECT_THAT(outcome.err, HasSubstr("stopped on request"));
}

TEST(Program, CommandThatNeverLooksForARequestIsEndedWithinASecond) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EXIT(RunStage({"stage"},
                       [](const CommandEnvironment&) -> Status {
                         std::raise(SIGTERM);
                         while (true) std::this_thread::sleep_for(std::chrono::seconds(1));
                       }),
              testing::ExitedWithCode(10), "");
  EXPECT_GT(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(700));
}

}  // namespace
}  // namespace cairn::pipeline
