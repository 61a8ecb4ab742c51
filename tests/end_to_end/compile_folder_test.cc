#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

TEST(CompileFolder, WritesTheRecipeThatItUsesAndNeverOverAnother) {
  TemporaryFolder folder("compile_folder_test");
  ASSERT_NO_FATAL_FAILURE(RenderTinySurvey(folder / "survey"));
  fs::create_directories(folder / "maps");
  const auto compile = [&](const std::string& arguments) {
    return RunShell("cd " + folder.string() + "/maps && cairn compile " + arguments +
                    " --until extract_features --progress none");
  };
  const ProgramRun first = compile("../survey");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out,
              HasSubstr("survey.toml: the recipe of ../survey, with defaults; to change something, "
                        "edit it and compile it\n"));
  EXPECT_TRUE(fs::exists(folder / "maps/survey.build/features.db"));
  const ProgramRun again = compile("../survey");
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(again.out, testing::AllOf(HasSubstr("up to date"), testing::Not(HasSubstr("the recipe of"))));
  // The recipe alone says the same.
  EXPECT_THAT(compile("survey.toml").out, HasSubstr("up to date"));
  std::ofstream(folder / "maps/survey.toml", std::ios::app) << "[extract_features]\nmax_num_features = 300\n";
  const ProgramRun edited = compile("../survey");
  EXPECT_EQ(edited.exit_code, 2);
  EXPECT_THAT(edited.err,
              HasSubstr("compile it (cairn compile survey.toml -o survey.cairn), or give another -o"));
  EXPECT_EQ(compile("survey.toml").exit_code, 0);
}

// What no stage reads is told, not refused: one recipe may serve several captures.
TEST(CompileFolder, KeysThatNothingReadsAreTold) {
  TemporaryFolder folder("unread_keys_test");
  WriteTinyRecipe(folder / "tiny.toml",
                  "[match_features]\npairs = \"exhaustive\"\nnum_retrieved = 3\n"
                  "[reconstruct]\nhold_out_every = 5\n");
  const ProgramRun run =
      RunShell("cairn stage configure " + (folder / "tiny.toml") + " -o " + (folder / "tiny.cairn"));
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err,
              HasSubstr("[match_features] num_retrieved is only read where pairs is auto or retrieval"));
  EXPECT_THAT(run.err,
              HasSubstr("[reconstruct] hold_out_every is not read: the capture has poses of its own"));
}

}  // namespace
}  // namespace cairn
