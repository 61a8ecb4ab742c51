#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using namespace std::chrono_literals;

constexpr int kNumImages = 60;

// A capture of the simulator's images beside its recipe, compiled once; each test leaves both as they were,
// or works on copies.
class MakeGraph : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("make_graph_test");
    ASSERT_NO_FATAL_FAILURE(RenderTinySurvey(Path("simulated")));
    CopyCapture(Path("simulated"), Path("survey"), kNumImages);
    WriteRecipe("tiny.toml", "survey");
    const ProgramRun run = Compile("tiny");
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.err, HasSubstr("features.db: not made yet\n"));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string Path(const std::string& name) { return *folder_ / name; }

  static void WriteRecipe(const std::string& name, const std::string& capture) {
    WriteCaptureRecipe(Path(name), {capture});
  }

  static ProgramRun Compile(const std::string& stem, const std::string& arguments = "") {
    return RunShell(
        "cairn compile " + Path(stem + ".toml") + " -o " + Path(stem + ".cairn") + " --threads 2 " +
        (arguments.find("--progress") == std::string::npos ? "--progress lines " : "") + arguments);
  }

  static constexpr char kExtract[] = "--until extract_features";

  using Dates = std::map<std::string, fs::file_time_type>;
  static Dates StampDates(const std::string& stem) {
    Dates dates;
    for (const auto& entry : fs::directory_iterator(Path(stem + ".build"))) {
      if (entry.path().extension() == ".stamp") dates[entry.path().stem().string()] = entry.last_write_time();
    }
    return dates;
  }
  // The rules that have run since.
  static std::vector<std::string> RanSince(const Dates& before, const std::string& stem) {
    std::vector<std::string> ran;
    for (const auto& [name, date] : StampDates(stem)) {
      if (!before.contains(name) || before.at(name) != date) ran.push_back(name);
    }
    return ran;
  }

  static std::string Hash(const std::string& name) { return HashFile(Path(name)).value(); }
  static void SetDate(const std::string& path, std::chrono::seconds from_now) {
    fs::last_write_time(path, fs::file_time_type::clock::now() + from_now);
  }
  // The name of a survey image.
  static std::string Image(const std::string& capture, int idx) {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(Path(capture + "/images")))
      names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return Path(capture + "/images/" + names.at(idx));
  }

  static TemporaryFolder* folder_;
};
TemporaryFolder* MakeGraph::folder_ = nullptr;

TEST_F(MakeGraph, StageThatRunsSaysWhatChanged) {
  const std::string image = Image("survey", 3);
  SetDate(image, 0s);
  const ProgramRun touched = Compile("tiny");
  EXPECT_THAT(touched.err,
              HasSubstr("features.db: images/" + fs::path(image).filename().string() + " changed\n"));
  EXPECT_THAT(touched.err, Not(HasSubstr("matches.db")));
  EXPECT_EQ(Compile("tiny").err, "");

  ReplaceInFile(Path("tiny.toml"), "\nk = 4\n", "\nk = 3\n");
  const ProgramRun changed = Compile("tiny", "--progress json --until decompose_regions");
  EXPECT_THAT(changed.err, HasSubstr("{\"event\": \"run\", \"file\": \"regions.db\", \"reason\": "
                                     "\"options/decompose_regions.toml changed\"}\n"));
  ReplaceInFile(Path("tiny.toml"), "\nk = 3\n", "\nk = 4\n");
  EXPECT_THAT(Compile("tiny", "--progress none").err, Not(HasSubstr("changed")));
}

TEST_F(MakeGraph, ImageNamesWithBlanksAndSignsAreFollowed) {
  CopyCapture(Path("survey"), Path("odd"), 12);
  WriteRecipe("odd.toml", "odd");
  const std::vector<std::string> names = {"a b.jpg",   "a  c.jpg", "ü#(1).jpg", "50%: $x.jpg", "a[1]*?.jpg",
                                          "d;e|f.jpg", "it's.jpg", "x\\ y.jpg", "k=v.jpg"};
  for (size_t i = 0; i < names.size(); ++i) {
    const fs::path image = Image("survey", static_cast<int>(i));
    fs::rename(Path("odd/images/") + image.filename().string(), Path("odd/images/") + names[i]);
    ReplaceInFile(Path("odd/images.txt"), image.filename(), names[i]);
  }
  ASSERT_EQ(Compile("odd", kExtract).exit_code, 0);
  EXPECT_THAT(Compile("odd", kExtract).out, HasSubstr("up to date"));
  for (const std::string& name : names) {
    SetDate(Path("odd/images/") + name, 0s);
    EXPECT_THAT(Compile("odd", kExtract).err, HasSubstr("features.db: images/")) << name;
  }
  for (const std::string& name : names) {
    fs::remove(Path("odd/images/") + name);
    const ProgramRun run = Compile("odd", kExtract);
    EXPECT_EQ(run.exit_code, 0) << name << run.err;
    EXPECT_THAT(run.err, HasSubstr("rejected " + name + ": ")) << name;
  }
  EXPECT_THAT(Compile("odd", kExtract).out, HasSubstr("up to date"));
}

TEST_F(MakeGraph, PathsInAnyAlphabetWorkAndBlanksAreRefused) {
  CopyCapture(Path("survey"), Path("Küche/обзор"), 12);
  WriteRecipe("Küche/rezept.toml", "обзор");
  ASSERT_EQ(Compile("Küche/rezept", kExtract).exit_code, 0);
  EXPECT_THAT(Compile("Küche/rezept", kExtract).out, HasSubstr("up to date"));
  const std::string image = fs::directory_iterator(Path("Küche/обзор/images"))->path();
  SetDate(image, 0s);
  EXPECT_THAT(Compile("Küche/rezept", kExtract).err, HasSubstr("features.db: images/"));

  const ProgramRun map =
      RunShell("cairn compile " + Path("tiny.toml") + " -o '" + Path("my map.cairn") + "'");
  EXPECT_EQ(map.exit_code, 2);
  EXPECT_THAT(map.err, HasSubstr("has a space in its path, which Make cannot handle; rename"));
  fs::create_symlink(Path("survey"), Path("my survey"));
  WriteRecipe("blank.toml", "my survey");
  const ProgramRun capture = Compile("blank");
  EXPECT_EQ(capture.exit_code, 2);
  EXPECT_THAT(capture.err, HasSubstr("the capture '" + Path("my survey") + "' has a space"));
}

TEST_F(MakeGraph, ImageDatedInTheFutureRunsTheFirstStageAgainAndEnds) {
  const std::string image = Image("survey", 5);
  SetDate(image, 24h);
  for (int run = 0; run < 2; ++run) {
    const Dates before = StampDates("tiny");
    const ProgramRun skewed = Compile("tiny");
    EXPECT_EQ(skewed.exit_code, 0);
    EXPECT_THAT(skewed.err, HasSubstr("in the future"));
    EXPECT_THAT(RanSince(before, "tiny"), ElementsAre("features.db"));
  }
  SetDate(image, 0s);
  Compile("tiny");
  EXPECT_THAT(Compile("tiny").out, HasSubstr("up to date"));
}

TEST_F(MakeGraph, StageFilesDatedInTheFutureHideNoChange) {
  RunShell("cp -a " + Path("tiny.build") + " " + Path("ahead.build"));
  RunShell("cp -a " + Path("tiny.cairn") + " " + Path("ahead.cairn"));
  CopyCapture(Path("survey"), Path("ahead"), kNumImages);
  WriteRecipe("ahead.toml", "ahead");
  ASSERT_EQ(Compile("ahead").exit_code, 0);
  for (const auto& entry : fs::directory_iterator(Path("ahead.build"))) {
    if (entry.is_regular_file()) SetDate(entry.path(), 24h);
  }
  fs::copy_file(Image("survey", 7), Image("ahead", 8), fs::copy_options::overwrite_existing);
  const std::string features = Hash("ahead.build/features.db");
  const ProgramRun run = Compile("ahead");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("were dated in the future"));
  EXPECT_NE(Hash("ahead.build/features.db"), features);
  const ProgramRun again = Compile("ahead");
  EXPECT_THAT(again.out, HasSubstr("up to date"));
  EXPECT_EQ(again.err, "");
}

TEST_F(MakeGraph, BuildFolderOfAnotherProgramIsMadeAgainNotRead) {
  RunShell("cp -a " + Path("tiny.build") + " " + Path("older.build"));
  RunShell("cp -a " + Path("tiny.toml") + " " + Path("older.toml"));
  std::vector<std::string> hashes;
  const std::vector<std::string> files = {"features.db", "matches.db",    "classes.db",    "world.db",
                                          "regions.db",  "vocabulary.db", "appearance.db", "unsealed.cairn"};
  for (size_t i = 0; i < files.size(); ++i) {
    hashes.push_back(Hash("tiny.build/" + files[i]));
    const std::string path = Path("older.build/" + files[i]);
    if (i % 2 == 0) {
      std::ofstream(path) << "of a version that wrote something else";
    } else {  // SQLite, with tables that this version does not know
      fs::remove(path);
      RunShell("python3 -c \"import sqlite3; d = sqlite3.connect('" + path +
               "'); d.execute('CREATE TABLE images (nothing)'); d.execute('PRAGMA user_version = 1'); "
               "d.commit()\"");
    }
  }
  std::ofstream(Path("older.build/options/program")) << "another program\n";
  const ProgramRun run = Compile("older");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("features.db: the program changed"));
  for (size_t i = 0; i < files.size(); ++i) EXPECT_EQ(Hash("older.build/" + files[i]), hashes[i]) << files[i];
  EXPECT_EQ(Hash("older.cairn"), Hash("tiny.cairn"));
}

TEST_F(MakeGraph, RunInOnePartRemovesWhatAKilledOneInPartsLeft) {
  const std::vector<std::string> outputs = {Path("tiny.build/features"), Path("tiny.build/matches")};
  for (const std::string& output : outputs) {
    std::ofstream(output + "-1-1of6.db") << "a shard";
    fs::remove(output + ".db.stamp");
  }
  EXPECT_EQ(Compile("tiny").exit_code, 0);
  for (const std::string& output : outputs) EXPECT_FALSE(fs::exists(output + "-1-1of6.db")) << output;
}

// The shell in which a rule runs gives way to the stage: make knows no other child to stop.
TEST_F(MakeGraph, WhoStopsACompileStopsItsStages) {
  for (const char* const arguments : {"", "--shards 2 --shard-images 8"}) {
    fs::remove_all(Path("stopped.build"));
    fs::copy_file(Path("tiny.toml"), Path("stopped.toml"), fs::copy_options::overwrite_existing);
    const std::string stage = "'[s]tage extract-features.*" + Path("stopped.build") + "'";
    const ProgramRun run = RunShell(
        fmt::format("cairn compile {} -o {} {} & until pgrep -f {} > {}; do sleep 0.01; done; kill -TERM $!; "
                    "wait $!; echo code $?; "
                    "for i in $(seq 50); do pgrep -f {} || break; sleep 0.1; done",
                    Path("stopped.toml"), Path("stopped.cairn"), arguments, stage, Path("pids"), stage));
    EXPECT_THAT(run.out, testing::EndsWith("code 10\n")) << "stages that live on: " << run.out << run.err;
  }
  EXPECT_EQ(Compile("stopped").exit_code, 0);
  EXPECT_EQ(Hash("stopped.cairn"), Hash("tiny.cairn"));
}

// Compiles with a launcher that runs `change` beside the first stage: before, or after it has read
// the images.
class ChangingCapture : public MakeGraph {
 protected:
  static ProgramRun CompileWhile(const std::string& before, const std::string& after) {
    std::ofstream(Path("launch.sh")) << "case \"$3\" in extract-features) " << before
                                     << ";; esac\n\"$@\" || exit\ncase \"$3\" in extract-features) " << after
                                     << ";; esac\n";
    RunShell("cairn stage configure " + Path("changing.toml") + " -o " + Path("changing.cairn"));
    return RunShell("make --silent -f " CAIRN_MAP_RULES " BUILD=" + Path("changing.build") +
                    " CAIRN=" CAIRN_PROGRAM " LAUNCH='sh " + Path("launch.sh") + "' " +
                    Path("changing.build/matches.db"));
  }
  static void StartAgain() {
    fs::remove_all(Path("changing"));
    fs::remove_all(Path("changing.build"));
    CopyCapture(Path("survey"), Path("changing"), 20);
    WriteRecipe("changing.toml", "changing");
  }
  // The bytes that the capture as it is now gives in a clean build.
  static std::string CleanHash() {
    fs::remove_all(Path("clean.build"));
    fs::copy_file(Path("changing.toml"), Path("clean.toml"), fs::copy_options::overwrite_existing);
    EXPECT_EQ(Compile("clean", "--until match_features").exit_code, 0);
    return Hash("clean.build/matches.db");
  }
};

TEST_F(ChangingCapture, ImageReplacedWhileTheStageRunsIsSeenByTheNextRun) {
  StartAgain();
  const ProgramRun run =
      CompileWhile(":", "sleep 0.05; cp " + Image("survey", 30) + " " + Image("changing", 4));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string before = Hash("changing.build/matches.db");
  const ProgramRun next = Compile("changing", "--until match_features");
  ASSERT_EQ(next.exit_code, 0) << next.err;
  EXPECT_THAT(next.err, HasSubstr("features.db: images/"));
  EXPECT_NE(Hash("changing.build/matches.db"), before);
  EXPECT_EQ(Hash("changing.build/matches.db"), CleanHash());
  EXPECT_THAT(Compile("changing", "--until match_features").out, HasSubstr("up to date"));
}

TEST_F(ChangingCapture, ImageRemovedWhileTheStageRunsIsRejectedNowOrNextTime) {
  for (const bool is_before : {true, false}) {
    StartAgain();
    const std::string remove = "sleep 0.05; rm -f " + Image("changing", 4);
    const ProgramRun run = CompileWhile(is_before ? remove : ":", is_before ? ":" : remove);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    const ProgramRun next = Compile("changing", "--until match_features");
    ASSERT_EQ(next.exit_code, 0) << next.err;
    EXPECT_THAT(run.err + next.err, HasSubstr("no such file, but the image list names it"));
    EXPECT_EQ(Hash("changing.build/matches.db"), CleanHash());
    EXPECT_THAT(Compile("changing", "--until match_features").out, HasSubstr("up to date"));
  }
}

// A Makefile of one's own that includes the rules once per map.
class ManyMaps : public MakeGraph {
 protected:
  static std::string Make(const std::string& arguments) {
    return "unset MAKEFLAGS MAKELEVEL; timeout 120 make --no-print-directory -C " + Path("many") + " " +
           arguments;
  }
  static void WriteMakefile() {
    fs::create_directories(Path("many"));
    WriteRecipe("many/a.toml", "../survey");
    WriteRecipe("many/b.toml", "../survey");
    ReplaceInFile(Path("many/b.toml"), "\nk = 4\n", "\nk = 3\n");
    std::ofstream(Path("many/Makefile"))
        << "all: a.cairn b.cairn\nCAIRN := " CAIRN_PROGRAM
           "\nTHREADS := 1\n"
           "BUILD := a.build\nRECIPE := a.toml\nMAP := a.cairn\ninclude " CAIRN_MAP_RULES
           "\nBUILD := b.build\nRECIPE := b.toml\nMAP := b.cairn\ninclude " CAIRN_MAP_RULES "\n";
  }
};

TEST_F(ManyMaps, AreMadeSideBySideFromOneMakefile) {
  WriteMakefile();
  const ProgramRun run = RunShell(Make("-j 2 PROGRESS=lines"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(Hash("many/a.cairn"), Hash("tiny.cairn"));
  EXPECT_NE(Hash("many/b.cairn"), Hash("tiny.cairn"));
  const ProgramRun again = RunShell(Make("-j 2"));
  EXPECT_EQ(again.out, "make: Nothing to be done for 'all'.\n");
  EXPECT_EQ(again.err, "");

  ReplaceInFile(Path("many/b.toml"), "\nk = 3\n", "\nk = 2\n");
  const ProgramRun plan = RunShell(Make("-n"));
  EXPECT_THAT(plan.out, HasSubstr("'regions.db: options/decompose_regions.toml changed'"));
  EXPECT_THAT(plan.out, Not(HasSubstr("match-features")));
  EXPECT_THAT(plan.out, Not(HasSubstr("a.build")));

  SetDate(Path("many/a.toml"), 24h);
  const ProgramRun skewed = RunShell(Make("a.cairn"));
  EXPECT_EQ(skewed.exit_code, 0) << skewed.err;  // 124: it would have gone on for ever
  EXPECT_THAT(skewed.err, HasSubstr("in the future"));

  // A program that is another one although it is older than all that was made.
  ReplaceInFile(Path("many/b.build/config.mk"), "PROGRAM := ", "PROGRAM := 1");
  std::ofstream(Path("many/b.build/options/program")) << "another program\n";
  EXPECT_THAT(RunShell(Make("b.build/features.db")).err, HasSubstr("features.db: the program changed"));
}

}  // namespace
}  // namespace cairn
