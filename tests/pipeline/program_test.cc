#include "pipeline/program.h"

#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <sstream>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/file.h"

namespace cairn {
namespace {

using testing::HasSubstr;

struct Outcome {
  int exit_code = 0;
  std::string out, err;
};

// Runs the program with one command, `stage`, that does `run`.
Outcome RunStage(const std::vector<std::string>& words,
                 std::function<Status(const CommandEnvironment&)> run) {
  const std::vector<Command> commands = {{.name = "stage",
                                          .summary = "Does what the test says",
                                          .add_arguments = [](CLI::App&) {},
                                          .run = std::move(run)}};
  std::vector<const char*> argv = {"cairn"};
  for (const std::string& word : words) argv.push_back(word.c_str());
  std::ostringstream out, err;
  const int exit_code = RunProgram(commands, static_cast<int>(argv.size()), argv.data(), out, err);
  return {exit_code, out.str(), err.str()};
}

Status Nothing(const CommandEnvironment&) { return Ok(); }

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

TEST(Program, UsageErrorsExitWithTwoAndSayWhereHelpIs) {
  for (const std::vector<std::string>& words : {std::vector<std::string>{},
                                                {"stge"},
                                                {"stage", "--frobnicate"},
                                                {"stage", "--threads", "-1"},
                                                {"stage", "--progress", "dots"}}) {
    const Outcome outcome = RunStage(words, Nothing);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr("--help"));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
}

TEST(Program, HelpAndVersionAreOnEverySubcommand) {
  EXPECT_THAT(RunStage({"--help"}, Nothing).out, HasSubstr("Does what the test says"));
  EXPECT_THAT(RunStage({"stage", "--help"}, Nothing).out, HasSubstr("--threads"));
  EXPECT_EQ(RunStage({"stage", "--version"}, Nothing).out, std::string("cairn ") + ProgramVersion() + "\n");
  EXPECT_EQ(RunStage({"stage", "--help"}, Nothing).exit_code, 0);
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
  EXPECT_THAT(RunStage({"stage"}, [](const CommandEnvironment&) -> Status { throw std::bad_alloc(); }).err,
              HasSubstr("out of memory"));
  const Outcome outcome =
      RunStage({"stage"}, [](const CommandEnvironment&) -> Status { throw std::runtime_error("oops"); });
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("oops"));
}

TEST(Program, ErrorFileKeepsTheCodeForWhoeverStartedTheStage) {
  const std::string path = fmt::format("{}/error_{}.json", testing::TempDir(), getpid());
  setenv(kErrorFileVariable, path.c_str(), 1);
  RunStage({"stage"}, [](const CommandEnvironment&) -> Status {
    return Error{ErrorCode::kNoData, "no \"pairs\""};
  });
  unsetenv(kErrorFileVariable);
  const auto document = nlohmann::json::parse(ReadFile(path).value());
  EXPECT_EQ(document["code"], 6);
  EXPECT_EQ(document["name"], "no_data");
  EXPECT_EQ(document["stage"], "stage");
  EXPECT_EQ(document["message"], "no \"pairs\"");
}

TEST(Program, ResultsAreAlsoWrittenToAFile) {
  const std::string path = fmt::format("{}/results_{}.txt", testing::TempDir(), getpid());
  const Outcome outcome = RunStage({"stage", "--results", path}, [](const CommandEnvironment& environment) {
    *environment.out << "12 images\n";
    return Ok();
  });
  EXPECT_EQ(outcome.out, "12 images\n");
  EXPECT_EQ(ReadFile(path).value(), "12 images\n");
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

}  // namespace
}  // namespace cairn
