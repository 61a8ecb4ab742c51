#include "pipeline/build/make_words.h"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/line/child_environment.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A folder in which make runs, and in which nothing is to appear.
class MakeWords : public testing::Test {
 protected:
  MakeWords() : folder_(fmt::format("{}/make_words_{}", testing::TempDir(), getpid())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "run");
  }
  ~MakeWords() override { fs::remove_all(folder_); }

  // What the real make prints for a Makefile.
  std::string Make(const std::string& makefile) {
    EXPECT_TRUE(WriteFileAtomically((folder_ / "Makefile").string(), makefile).ok());
    const std::string out = (folder_ / "out").string();
    const std::string command = fmt::format(
        "cd {0}/run && env -u MAKEFLAGS make --silent -f ../Makefile > {1} 2>&1", folder_.string(), out);
    EXPECT_EQ(std::system(command.c_str()), 0) << ReadFile(out).value();
    EXPECT_TRUE(fs::is_empty(folder_ / "run")) << "something ran";
    return ReadFile(out).value();
  }

  fs::path folder_;
};

TEST_F(MakeWords, WhatPassesArrivesAsItIsInRulesAndInTheShell) {
  MakeVariables variables;
  std::vector<std::string> names, passed;
  for (int c = 1; c < 256; ++c) {
    const std::string path = fmt::format("/a{}b", static_cast<char>(c));
    if (!variables.Set(fmt::format("V{}", c), "the map", {path}).ok()) continue;
    names.push_back(fmt::format("V{}", c));
    passed.push_back(path);
  }
  // Letters and digits, what is not ASCII, and + , - . / @ ^ _ ~
  EXPECT_EQ(passed.size(), 26u + 26u + 10u + 128u + 9u);
  std::string makefile = variables.MakefileText() + "all:";
  for (const std::string& name : names) makefile += " $(" + name + ")";
  makefile += "\n\t@:\n";
  for (const std::string& name : names)
    makefile += fmt::format("$({0}): ; @printf '%s %s\\n' '$@' $({0})\n", name);
  std::string expected;
  for (const std::string& path : passed) expected += path + " " + path + "\n";
  EXPECT_EQ(Make(makefile), expected);
}

TEST_F(MakeWords, WhatMakeOrAShellWouldReadOtherwiseIsRefusedWithASentence) {
  for (const char c : std::string(" \t\n\r\v\f\x01\x1b\x7f$#%:;&|<>()[]{}*?'\"`\\=!")) {
    MakeVariables variables;
    const std::string path = fmt::format("/maps/a{}b.cairn", c);
    for (const Status& status :
         {CheckMakePath("the map", path), variables.Set("MAP", "the map", {"/fine", path}),
          variables.SetPairs("MAP", "the map", {{path, "b"}}),
          variables.SetPairs("MAP", "the map", {{"a", path}})}) {
      ASSERT_FALSE(status.ok()) << path;
      EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
      EXPECT_THAT(status.error().message, HasSubstr("in its path, which Make cannot handle; rename"));
    }
    EXPECT_EQ(variables.MakefileText(), "");  // nothing of it is kept
  }
  EXPECT_THAT(CheckMakePath("the map", "a\n$(shell touch PWNED)\n#").error().message,
              HasSubstr("a line break"));
  EXPECT_THAT(CheckMakePath("the map", "a\x1b[31m").error().message, HasSubstr("a control character"));
}

TEST_F(MakeWords, OtherValuesAreNoPaths) {
  EXPECT_TRUE(CheckMakeWord("topic", "/camera/image_raw").ok());
  EXPECT_TRUE(CheckMakeWord("topic", "a~b").ok());
  EXPECT_THAT(CheckMakeWord("topic", "a b").error().message,
              "topic 'a b' has a space, which Make cannot handle; write it without");
  EXPECT_THAT(CheckMakeWord("topic", "~root").error().message, HasSubstr("has '~' at its beginning"));
}

TEST_F(MakeWords, LaunchersAreWordsAndNothingElse) {
  MakeVariables variables;
  ASSERT_TRUE(
      variables.SetLauncher("LAUNCH", "--launch", "  srun -n1  --mem=4G -wnode[1-4] env A=b:50%  ").ok());
  EXPECT_EQ(variables.MakefileText(), "LAUNCH := srun -n1 --mem=4G -wnode[1-4] env A=b:50%\n");
  EXPECT_EQ(variables.CommandWords(),
            std::vector<std::string>{"LAUNCH=srun -n1 --mem=4G -wnode[1-4] env A=b:50%"});
  EXPECT_EQ(Make(variables.MakefileText() + "all: ; @printf '[%s]' $(LAUNCH)\n"),
            "[srun][-n1][--mem=4G][-wnode[1-4]][env][A=b:50%]");
  for (const char* words :
       {"$(shell touch PWNED)", "a; touch PWNED", "a\ntouch PWNED", "a | b", "a & b", "a > b", "a < b",
        "`touch PWNED`", "'a b'", "\"a b\"", "a\\ b", "a #b", "(a)", "a*", "!a", "a?"}) {
    const Status status = variables.SetLauncher("LAUNCH", "--launch", words);
    ASSERT_FALSE(status.ok()) << words;
    EXPECT_THAT(status.error().message, HasSubstr("move what needs a shell into a script")) << words;
  }
}

// Every variable that map.mk, machinery.mk or make itself reads from its environment, where nothing sets it.
TEST(ChildEnvironment, NoVariableOfMakeOrOfTheRulesIsPassedOn) {
  std::set<std::string> variables = {"MAKEFILES", "MAKEFLAGS",      "GNUMAKEFLAGS", "MFLAGS",   "MAKELEVEL",
                                     "MAKE",      "SHELL",          "MAKESHELL",    "BASH_ENV", "ENV",
                                     "IFS",       "CDPATH",         "VPATH",        "SUFFIXES", "RM",
                                     "CC",        "BASH_FUNC_awk%%"};
  const std::string rules = ReadFile(CAIRN_SOURCE_DIR "/pipeline/build/map.mk").value() +
                            ReadFile(CAIRN_SOURCE_DIR "/pipeline/build/machinery.mk").value();
  const std::regex reference(R"(\$\(([A-Za-z_]+)\)|\n(?:ifdef |ifndef )?([A-Z_]+)(?:\n| [:?+]?=))");
  for (std::sregex_iterator it(rules.begin(), rules.end(), reference), end; it != end; ++it)
    variables.insert((*it)[1].matched ? (*it)[1].str() : (*it)[2].str());
  EXPECT_GT(variables.size(), 60u);
  EXPECT_TRUE(variables.contains("LAUNCH") && variables.contains("RECIPE"));
  for (const std::string& variable : variables) EXPECT_FALSE(IsPassedOn(variable)) << variable;
}

TEST(ChildEnvironment, ProgramsFindTheirPlacesLanguageAndScheduler) {
  for (const char* variable : {"PATH", "HOME", "TMPDIR", "LANG", "LC_ALL", "LD_LIBRARY_PATH",
                               "QT_QPA_PLATFORM", "SLURM_CONF", "MUNGE_SOCKET", "OMP_NUM_THREADS"}) {
    EXPECT_TRUE(IsPassedOn(variable)) << variable;
  }
  EXPECT_FALSE(IsPassedOn("XPATH"));
  EXPECT_FALSE(IsPassedOn("PATH_"));
}

TEST(ChildEnvironment, WhatIsAddedStandsInPlaceOfWhatIsThere) {
  setenv("QT_QPA_PLATFORM", "xcb", 1);
  setenv("LAUNCH", "touch PWNED;", 1);
  setenv("SLURM_CONF", "/etc/slurm", 1);
  const std::vector<std::string> entries =
      ChildEnvironment({"QT_QPA_PLATFORM=offscreen", "CAIRN_BUILD_SESSION=1"});
  for (const char* variable : {"QT_QPA_PLATFORM", "LAUNCH", "SLURM_CONF"}) unsetenv(variable);
  EXPECT_THAT(entries, testing::IsSupersetOf(
                           {"QT_QPA_PLATFORM=offscreen", "CAIRN_BUILD_SESSION=1", "SLURM_CONF=/etc/slurm"}));
  EXPECT_THAT(entries, testing::Not(testing::Contains("QT_QPA_PLATFORM=xcb")));
  EXPECT_THAT(entries, testing::Not(testing::Contains(testing::StartsWith("LAUNCH="))));
}

}  // namespace
}  // namespace cairn::pipeline
