#include <filesystem>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::ContainsRegex;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr char kRegionsLine[] = "[0-9]+ regions?, at least [0-9]+ (is|are) needed";

// One map, compiled with two threads, that all tests of the suite look at; each leaves it as it was.
class Compile : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("compile_test");
    WriteTinyRecipe(*folder_ / "tiny.toml");
    const ProgramRun run = CompileTiny();
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("tiny.cairn: compiled\n"));
    EXPECT_THAT(run.out, ContainsRegex(kRegionsLine));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string Path(const std::string& name) { return *folder_ / name; }

  static ProgramRun CompileTiny(const std::string& arguments = "--threads 2") {
    return RunShell("cairn compile " + Path("tiny.toml") + " -o " + Path("tiny.cairn") + " --progress none " +
                    arguments);
  }

  using Dates = std::map<std::string, fs::file_time_type>;
  static Dates StampDates() {
    Dates dates;
    for (const auto& entry : fs::directory_iterator(Path("tiny.build"))) {
      if (entry.path().extension() == ".stamp") dates[entry.path().stem().string()] = entry.last_write_time();
    }
    return dates;
  }
  // The rules that have run since.
  static std::vector<std::string> RanSince(const Dates& before) {
    std::vector<std::string> ran;
    for (const auto& [name, date] : StampDates()) {
      if (!before.contains(name) || before.at(name) != date) ran.push_back(name);
    }
    return ran;
  }

  static std::string Hash(const std::string& name) { return HashFile(Path(name)).value(); }

  static TemporaryFolder* folder_;
};
TemporaryFolder* Compile::folder_ = nullptr;

TEST_F(Compile, SecondRunDoesNothing) {
  const Dates before = StampDates();
  const ProgramRun run = CompileTiny();
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(run.out, Path("tiny.cairn") + ": up to date\n");
  EXPECT_EQ(run.err, "");
  EXPECT_THAT(RanSince(before), IsEmpty());
}

TEST_F(Compile, TouchedImageRunsTheFirstStageOnly) {
  const std::string map = Hash("tiny.cairn");
  const Dates before = StampDates();
  fs::path image;
  for (const auto& entry : fs::recursive_directory_iterator(Path("tiny.build/capture/images"))) {
    if (entry.is_regular_file()) image = entry.path();
  }
  fs::last_write_time(image, fs::file_time_type::clock::now());
  const ProgramRun run = CompileTiny();
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(RanSince(before), ElementsAre("features.db"));
  EXPECT_EQ(Hash("tiny.cairn"), map);
  EXPECT_THAT(CompileTiny().out, HasSubstr("up to date"));
}

TEST_F(Compile, OptionOfOneStageRunsThatStageAndWhatFollows) {
  const std::string map = Hash("tiny.cairn");
  const Dates before = StampDates();
  ReplaceInFile(Path("tiny.toml"), "\nk = 4\n", "\nk = 5\n");
  ASSERT_EQ(CompileTiny().exit_code, 0);
  EXPECT_THAT(RanSince(before), ElementsAre("map", "regions.db", "unsealed.cairn"));
  EXPECT_NE(Hash("tiny.cairn"), map);

  ReplaceInFile(Path("tiny.toml"), "\nk = 5\n", "\nk = 4\n");
  ASSERT_EQ(CompileTiny().exit_code, 0);
  EXPECT_EQ(Hash("tiny.cairn"), map);
}

TEST_F(Compile, CommentInTheRecipeRunsNothing) {
  const Dates before = StampDates();
  ReplaceInFile(Path("tiny.toml"), "name =", "# a comment\nname =");
  ASSERT_EQ(CompileTiny().exit_code, 0);
  EXPECT_THAT(RanSince(before), IsEmpty());
}

TEST_F(Compile, MissingStageFileIsMadeAgain) {
  const std::string world = Hash("tiny.build/world.db");
  const Dates before = StampDates();
  fs::remove(Path("tiny.build/world.db"));
  ASSERT_EQ(CompileTiny().exit_code, 0);
  EXPECT_EQ(Hash("tiny.build/world.db"), world);
  EXPECT_THAT(RanSince(before), testing::Contains("world.db"));
  EXPECT_THAT(RanSince(before), testing::Not(testing::Contains("classes.db")));
}

TEST_F(Compile, CleanBuildWithOneThreadElsewhereGivesTheSameBytes) {
  fs::create_directories(Path("elsewhere"));
  WriteTinyRecipe(Path("elsewhere/other.toml"));
  const ProgramRun run = RunShell("cd " + Path("elsewhere") +
                                  " && cairn compile other.toml -o map.cairn --build-dir b --threads 1 -j 2");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  for (const char* file : {"features.db", "matches.db", "classes.db", "world.db", "regions.db",
                           "vocabulary.db", "unsealed.cairn"}) {
    EXPECT_EQ(Hash(std::string("elsewhere/b/") + file), Hash(std::string("tiny.build/") + file)) << file;
  }
  EXPECT_EQ(Hash("elsewhere/map.cairn"), Hash("tiny.cairn"));
}

TEST_F(Compile, InterruptEndsWithItsCodeAndTheNextRunFinishes) {
  fs::create_directories(Path("interrupted"));
  const std::string command =
      "cairn compile " + Path("tiny.toml") + " -o " + Path("interrupted/tiny.cairn") + " --progress none";
  EXPECT_EQ(RunShell("timeout --preserve-status -s INT 2 " + command).exit_code, 10);
  EXPECT_FALSE(fs::exists(Path("interrupted/tiny.cairn")));
  const ProgramRun run = RunShell(command);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(Hash("interrupted/tiny.cairn"), Hash("tiny.cairn"));
}

TEST_F(Compile, UntilStopsAfterAStage) {
  const std::string target = " -o " + Path("until.cairn") + " --progress none --until ";
  const ProgramRun run = RunShell("cairn compile " + Path("tiny.toml") + target + "extract-features");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(fs::exists(Path("until.build/features.db")));
  EXPECT_FALSE(fs::exists(Path("until.build/matches.db")));
  const ProgramRun wrong = RunShell("cairn compile " + Path("tiny.toml") + target + "extract-feature");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("did you mean extract_features?"));
}

TEST_F(Compile, OneMakefileCanIncludeTheRulesOfManyMaps) {
  fs::create_directories(Path("many"));
  ASSERT_TRUE(WriteFileAtomically(Path("many/Makefile"),
                                  "all: first second\n"
                                  "CAIRN := " CAIRN_PROGRAM "\nRECIPE := ../tiny.toml\n"
                                  "MAP := a.cairn\nBUILD := a.build\ninclude " CAIRN_MAP_RULES "\n"
                                  "MAP := b.cairn\nBUILD := b.build\ninclude " CAIRN_MAP_RULES "\n"
                                  "first: a.build/features.db\nsecond: b.build/features.db\n")
                  .ok());
  const std::string make =
      "unset MAKEFLAGS MAKELEVEL; make --no-print-directory PROGRESS=none -C " + Path("many");
  const ProgramRun plan = RunShell(make + " a.build/config.mk b.build/config.mk && " + make + " -n");
  EXPECT_THAT(plan.out, HasSubstr("extract-features"));
  EXPECT_FALSE(fs::exists(Path("many/a.build/features.db")));
  const ProgramRun run = RunShell(make);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(Hash("many/a.build/features.db"), Hash("tiny.build/features.db"));
  EXPECT_EQ(Hash("many/b.build/features.db"), Hash("tiny.build/features.db"));
  EXPECT_EQ(RunShell(make).out, "make: Nothing to be done for 'all'.\n");
}

TEST_F(Compile, MapLocalizesItsQueries) {
  const ProgramRun inspect = RunShell("cairn inspect " + Path("tiny.cairn"));
  ASSERT_EQ(inspect.exit_code, 0) << inspect.err;
  EXPECT_THAT(inspect.out, HasSubstr("tiny"));
  EXPECT_THAT(inspect.out, ContainsRegex(kRegionsLine));
  const std::string images = Path("tiny.build/capture/images/");
  const std::string names =
      RunShell("awk 'NF == 10 && !/^#/ {print $10}' " + Path("tiny.build/capture/queries.txt")).out;
  const std::string query = names.substr(0, names.find('\n'));
  const ProgramRun localize =
      RunShell("cairn localize " + Path("tiny.cairn") + " " + images + query + " -o " + Path("poses.txt"));
  ASSERT_EQ(localize.exit_code, 0) << localize.err;
  EXPECT_THAT(localize.out, HasSubstr(query));
  EXPECT_TRUE(fs::exists(Path("poses.txt")));
}

}  // namespace
}  // namespace cairn
