#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

// A survey of 24 images; every command is a process of its own.
class TakeOver : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("take_over_test");
    ASSERT_NO_FATAL_FAILURE(RenderTinySurvey(Path("simulated")));
    CopyCapture(Path("simulated"), Path("survey"), 24);
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string Path(const std::string& name) { return *folder_ / name; }

  static ProgramRun Extract(const std::string& output, const std::string& arguments = "") {
    return RunShell("cairn stage extract-features " + Path("survey") + " -o " + Path(output) + " " +
                    arguments);
  }
  static ProgramRun Match(const std::string& output, const std::string& arguments = "") {
    return RunShell("cairn stage match-features " + Path("features.db") + " --capture " + Path("survey") +
                    " --num-frustum-seeds 3 --num-frustum-scouts 1 -o " + Path(output) + " " + arguments);
  }
  // "--reuse A --reuse B"
  static std::string Reuse(const std::vector<std::string>& names) {
    std::string arguments;
    for (const std::string& name : names) arguments += " --reuse " + Path(name);
    return arguments;
  }

  static TemporaryFolder* folder_;
};

TemporaryFolder* TakeOver::folder_ = nullptr;

TEST_F(TakeOver, OneProcessTakesOverWhatAnotherOneDid) {
  EXPECT_THAT(Extract("features.db").out, HasSubstr("24 images"));
  EXPECT_THAT(Extract("features.db").out, HasSubstr(", 24 taken over"));
  EXPECT_THAT(Extract("features.db").out, HasSubstr(", 24 taken over"));
  EXPECT_THAT(Match("matches.db").out, HasSubstr(", 0 taken over"));
  const std::string again = Match("matches.db").out;
  const size_t tried = again.find("images, ") + 8;
  EXPECT_THAT(again,
              HasSubstr(", " + again.substr(tried, again.find(" pairs tried") - tried) + " taken over"));
  EXPECT_THAT(Match("matches.db", "--no-reuse").out, HasSubstr(", 0 taken over"));
}

TEST_F(TakeOver, ShardsMergeToTheSameBytes) {
  ASSERT_EQ(Extract("features.db", "--no-reuse").exit_code, 0);
  ASSERT_EQ(Match("matches.db", "--no-reuse").exit_code, 0);
  std::vector<std::string> features, matches;
  for (const char* i : {"1", "2", "3"}) {
    features.push_back(std::string("features") + i + ".db");
    const ProgramRun run = Extract(features.back(), std::string("--shard ") + i + "/3");
    EXPECT_THAT(run.out, HasSubstr(std::string("shard ") + i + "/3: 8 images"));
  }
  EXPECT_THAT(Extract("merged.db", Reuse(features)).out, HasSubstr("24 taken over"));
  EXPECT_EQ(*HashFile(Path("merged.db")), *HashFile(Path("features.db")));
  for (const char* round : {"a", "b", "c", "d", "e", "f", "g", "h"}) {
    const std::string known = Reuse(matches);
    bool is_done = false;
    for (const char* i : {"1", "2"}) {
      matches.push_back(std::string(round) + i + ".db");
      const ProgramRun run = Match(matches.back(), known + " --shard " + i + "/2");
      ASSERT_EQ(run.exit_code, 0) << run.err;
      is_done = run.out.find("nothing to do") != std::string::npos;
    }
    if (is_done) break;
  }
  EXPECT_GE(matches.size(), 6u) << "seeds, pairs that they predict, nothing";
  const ProgramRun merged = Match("merged_matches.db", Reuse(matches));
  EXPECT_EQ(*HashFile(Path("merged_matches.db")), *HashFile(Path("matches.db"))) << merged.err;
  EXPECT_THAT(merged.out, Not(HasSubstr(", 0 taken over")));
}

TEST_F(TakeOver, PlannedShardsMergeToTheSameBytes) {
  ASSERT_EQ(Extract("features.db", "--no-reuse").exit_code, 0);
  ASSERT_EQ(Match("matches.db", "--no-reuse").exit_code, 0);
  EXPECT_THAT(Match("plan.db", "--plan 3").out,
              HasSubstr("plan for 3 shards: round 1 of pairs (frustum): too little"));
  EXPECT_THAT(Match("plan.db", "--plan 2 --shard-images 1").out,
              HasSubstr("plan for 2 shards: seeds of images: 23 left to 2 of them"));
  std::vector<std::string> files = {"plan.db"};
  for (const char* i : {"1", "2"}) {
    files.push_back(std::string("seeds") + i + ".db");
    EXPECT_THAT(Match(files.back(), "--planned " + Path("plan.db") + " --shard " + i + "/2").out,
                HasSubstr(std::string("shard ") + i + "/2: seeds of 1"));
  }
  const std::string known = Reuse(files);
  EXPECT_THAT(Match("plan2.db", "--plan 2 --shard-images 1" + known).out, HasSubstr("left to 2 of them"));
  files.emplace_back("plan2.db");
  for (const char* i : {"1", "2"}) {
    files.push_back(std::string("pairs") + i + ".db");
    EXPECT_THAT(Match(files.back(), "--planned " + Path("plan2.db") + " --shard " + i + "/2" + known).out,
                HasSubstr(std::string("shard ") + i + "/2: pairs (frustum): "));
  }
  const ProgramRun merged = Match("merged_matches.db", Reuse(files));
  EXPECT_EQ(*HashFile(Path("merged_matches.db")), *HashFile(Path("matches.db"))) << merged.err;
  EXPECT_THAT(merged.out, Not(HasSubstr(", 0 taken over")));
  const ProgramRun other = Match("bad.db", "--planned " + Path("plan2.db") + " --shard 1/3");
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("a plan for 2 shards, but this is one of 3"));
}

TEST_F(TakeOver, BadArgumentsAreRefused) {
  for (const char* shard : {"0/3", "4/3", "x", "3", "1/3/3"}) {
    const ProgramRun run = Extract("bad.db", std::string("--shard ") + shard);
    EXPECT_EQ(run.exit_code, 2) << shard;
    EXPECT_THAT(run.err, HasSubstr("expected I/N"));
  }
  ASSERT_EQ(Extract("features.db").exit_code, 0);
  const ProgramRun own = Extract("features.db", Reuse({"features.db"}) + " --shard 1/2");
  EXPECT_EQ(own.exit_code, 2);
  EXPECT_THAT(own.err, HasSubstr("is also the output"));
  EXPECT_EQ(Extract("bad.db", Reuse({"absent.db"})).exit_code, 3);
  EXPECT_EQ(Extract("bad.db", Reuse({"simulated.toml"})).exit_code, 4);
  EXPECT_EQ(Extract("bad.db", Reuse({"features.db"}) + " --no-reuse").exit_code, 2);
  EXPECT_THAT(Match("bad.db", "--planned " + Path("features.db")).err, HasSubstr("--shard I/N"));
  EXPECT_EQ(Match("bad.db", "--plan 2 --shard 1/2").exit_code, 2);
  EXPECT_EQ(Match("bad.db", "--plan 0").exit_code, 2);
  EXPECT_EQ(Match("bad.db", "--plan 2 --shard-images 0").exit_code, 2);
  EXPECT_FALSE(fs::exists(Path("bad.db")));
}

}  // namespace
}  // namespace cairn
