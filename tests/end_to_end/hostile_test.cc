// Names, values and environments that would have make or a shell run what they say, through the real program,
// the real make and the real shell.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/database.h"
#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Hostile : public testing::Test {
 protected:
  Hostile() : folder_("hostile_test") { WriteTinyRecipe(folder_ / "tiny.toml"); }

  // Runs in the folder.  Whatever is run by make or by a shell of its would leave PWNED there.
  ProgramRun Run(const std::string& command) {
    ProgramRun run = RunShell("cd " + folder_.string() + " && " + command);
    for (const auto& entry : fs::recursive_directory_iterator(folder_.string())) {
      EXPECT_NE(entry.path().filename(), "PWNED") << command << "\n" << run.out << run.err;
    }
    return run;
  }

  TemporaryFolder folder_;
};

// As it stands between single quotes of a shell.
constexpr const char* kHostileNames[] = {"a\n$(shell touch PWNED)\n#",
                                         "a$(shell touch PWNED)",
                                         "a;touch PWNED",
                                         "a`touch PWNED`",
                                         "a|touch PWNED",
                                         "a b: ; touch PWNED",
                                         "a&touch PWNED;",
                                         "a\\",
                                         "a #",
                                         "a\n\ttouch PWNED"};

TEST_F(Hostile, NamesOfRecipesMapsFoldersAndCapturesRunNothing) {
  ASSERT_NO_FATAL_FAILURE(RenderTinySurvey(folder_ / "survey"));
  for (const std::string name : kHostileNames) {
    SCOPED_TRACE(name);
    fs::copy_file(folder_ / "tiny.toml", folder_ / (name + ".toml"));
    // A recipe's own name is in no Makefile: any will do.
    const ProgramRun configured = Run("cairn stage configure '" + name + ".toml' -o a.cairn");
    EXPECT_EQ(configured.exit_code, 0) << configured.err;
    Run("make -f " CAIRN_MAP_RULES " -n BUILD=a.build CAIRN=cairn");
    // Such characters in an output's name are refused, before anything is written.
    for (const char* command : {"compile", "stage configure", "pareto"}) {
      for (const std::string& arguments :
           {"-o '" + name + ".cairn'", "-o b.cairn --build-dir '" + name + "'"}) {
        const ProgramRun run = Run(std::string("cairn ") + command + " tiny.toml " + arguments);
        EXPECT_EQ(run.exit_code, 2) << run.err;
        EXPECT_THAT(run.err, HasSubstr("which Make cannot handle"));
      }
    }
    fs::rename(folder_ / "survey", folder_ / (name + "survey"));
    std::string escaped;
    for (const char c : name)
      escaped += c == '\n' ? "\\n" : c == '\t' ? "\\t" : c == '\\' ? "\\\\" : std::string(1, c);
    WriteCaptureRecipe(folder_ / "capture.toml", {escaped + "survey"});
    const ProgramRun run = Run("cairn compile capture.toml -o b.cairn");
    EXPECT_EQ(run.exit_code, 2) << run.err;
    EXPECT_THAT(run.err, HasSubstr("which Make cannot handle"));
    fs::rename(folder_ / (name + "survey"), folder_ / "survey");
  }
}

TEST_F(Hostile, LaunchersRunNoShell) {
  for (const char* launcher :
       {"$(shell touch PWNED)", "touch PWNED;", "`touch PWNED`", "touch PWNED &", "a\ntouch PWNED"}) {
    const ProgramRun run = Run(std::string("cairn compile tiny.toml -o a.cairn --launch '") + launcher + "'");
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_THAT(run.err, HasSubstr("move what needs a shell into a script"));
  }
}

TEST_F(Hostile, EnvironmentOfTheCallerDoesNotReachMake) {
  std::ofstream(folder_ / "evil.mk") << "$(shell touch PWNED)\n";
  std::ofstream(folder_ / "evil.sh") << "touch PWNED\n";
  const std::string touch = "'$(shell touch PWNED)'";
  const std::string environment =
      "MAKEFILES=$PWD/evil.mk MAKEFLAGS='--eval=$(shell touch PWNED)' GNUMAKEFLAGS='--eval=$(shell touch "
      "PWNED)' "
      "LAUNCH='touch PWNED;' SHELL=$PWD/evil.sh BASH_ENV=$PWD/evil.sh ENV=$PWD/evil.sh MAKE=./evil.sh "
      "SESSION_LIST=" +
      touch + " RECIPE=" + touch + " FRAME=" + touch + " VIEWS=" + touch + " SHARD_ROUNDS=" + touch +
      " SHARD_IMAGES=" + touch + " CAIRN_FLAGS=" + touch + " CAPTURE_LISTS=" + touch +
      " SHARDS=3 BUILD=/nowhere CAIRN=/bin/false ";
  const ProgramRun run = Run(environment + "cairn compile tiny.toml -o a.cairn --until simulate");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(fs::exists(folder_ / "a.build/capture/images.txt"));
}

// A list of held-out images is part of a capture, which may be somebody else's.
TEST_F(Hostile, NamesOfHeldOutImagesRunNothing) {
  ASSERT_NO_FATAL_FAILURE(RenderTinySurvey(folder_ / "survey"));
  const std::string image = fs::recursive_directory_iterator(folder_ / "survey/images")->path().string();
  std::ofstream queries(folder_ / "survey/queries.txt", std::ios::app);
  for (const char* name : {"x\\;>PWNED", "x\\", "y\\;touch${IFS}PWNED", "y\\", "z\\;./evil.sh", "z\\",
                           "$(shell ./evil.sh)", "a;b", "a#b", "a\x1b[31mb"}) {
    const fs::path copy = folder_ / ("survey/images/" + std::string(name));
    fs::create_directories(copy.parent_path());
    fs::copy_file(image, copy, fs::copy_options::overwrite_existing);
    queries << "9" << queries.tellp() << " 1 0 0 0 0 0 0 1 " << name << "\n\n";
  }
  queries.close();
  std::ofstream(folder_ / "evil.sh") << "#!/bin/sh\ntouch " << folder_.string() << "/PWNED\n";
  fs::permissions(folder_ / "evil.sh", fs::perms::owner_all);
  WriteCaptureRecipe(folder_ / "capture.toml", {"survey"});
  Run("cairn stage configure capture.toml -o map.cairn --build-dir a.build");
  // What the last rule depends on is read by every run of make.
  const ProgramRun run =
      Run("cairn compile capture.toml -o map.cairn --build-dir a.build --until extract_features");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(run.err.find('\x1b'), std::string::npos) << run.err;
  // The rule that depends on them runs, with a program that does nothing.
  const ProgramRun stamp =
      Run("make -k -f " CAIRN_MAP_RULES " BUILD=$PWD/a.build CAIRN=true $PWD/a.build/map.stamp");
  EXPECT_THAT(stamp.err, HasSubstr("map.cairn: not made yet")) << stamp.out;
}

// Bytes per table come from SQLite's own dbstat, in whose place a map could put a view.
TEST_F(Hostile, InspectRunsNoViewOfAMap) {
  fs::copy_file(GOLDEN_DIR "/map_2.3.cairn", folder_ / "a.cairn");
  SQLite::Database(folder_ / "a.cairn", SQLite::OPEN_READWRITE)
      .exec("CREATE VIEW dbstat AS SELECT 'PLANTED' AS name, 1 AS pgsize");
  for (const char* command : {"cairn inspect a.cairn", "cairn inspect a.cairn --json"}) {
    const ProgramRun run = Run(command);
    EXPECT_NE(run.exit_code, 0);
    EXPECT_EQ(run.out.find("PLANTED"), std::string::npos) << run.out;
  }
}

}  // namespace
}  // namespace cairn
