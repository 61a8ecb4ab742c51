#include "pipeline/build_folder.h"

#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "pipeline/build_files.h"
#include "tests/pipeline/test_stages.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class BuildFolderTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / fmt::format("build_folder_test_{}", getpid());
    fs::create_directories(folder_ / "survey");
    recipe_.name = "kitchen";
    recipe_.captures = {{.name = "survey", .path = (folder_ / "survey").string()}};
    recipe_.stages = TestStages();
    paths_ = {.build_dir = (folder_ / "kitchen.build").string(),
              .map = (folder_ / "kitchen.cairn").string(),
              .program = "/proc/self/exe"};
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string Text(const std::string& name) const { return ReadFile(paths_.build_dir + "/" + name).value(); }
  fs::file_time_type Date(const std::string& name) const {
    return fs::last_write_time(paths_.build_dir + "/" + name);
  }

  fs::path folder_;
  Recipe recipe_;
  BuildPaths paths_;
};

TEST_F(BuildFolderTest, OptionsAreRewrittenOnlyWhenTheirContentChanges) {
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_EQ(Text("options/extract_features.toml"), "max_num_features = 2000\ncontrast_threshold = 0.02\n");
  EXPECT_EQ(Text("options/name"), "kitchen\n");
  const std::vector<std::string> files = {"options/extract_features.toml",
                                          "options/filter_visibility.toml",
                                          "options/seed",
                                          "options/name",
                                          "options/capture",
                                          "config.mk"};
  std::vector<fs::file_time_type> dates;
  for (const std::string& file : files) dates.push_back(Date(file));

  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  ASSERT_TRUE(SetOption(recipe_.stages[1].table[0], "500").ok());
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_EQ(Text("options/extract_features.toml"), "max_num_features = 500\ncontrast_threshold = 0.02\n");
  EXPECT_NE(Date(files[0]), dates[0]);
  for (size_t i = 1; i < files.size(); ++i) EXPECT_EQ(Date(files[i]), dates[i]) << files[i];
}

TEST_F(BuildFolderTest, ConfigurationNamesCaptureAndQueries) {
  ASSERT_TRUE(WriteFileAtomically(recipe_.captures[0].path + "/images.txt", "").ok());
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_THAT(Text("config.mk"), HasSubstr("CAPTURE := " + recipe_.captures[0].path + "\n"));
  EXPECT_THAT(Text("config.mk"), HasSubstr("QUERIES := \n"));
  ASSERT_TRUE(WriteFileAtomically(recipe_.captures[0].path + "/queries.txt", "").ok());
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_THAT(Text("config.mk"), HasSubstr("QUERIES := " + recipe_.captures[0].path + "/queries.txt\n"));
}

TEST_F(BuildFolderTest, SimulatedCaptureLiesInTheBuildFolder) {
  recipe_.captures.clear();
  recipe_.simulated = true;
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_THAT(Text("config.mk"),
              HasSubstr("CAPTURE := " + paths_.build_dir + "/capture\nSIMULATED := yes\n"));
}

TEST_F(BuildFolderTest, AFolderWithFilesThatWouldBeOverwrittenIsNoPlaceToBuild) {
  const auto check = [&] { return CheckBuildFolder(paths_.build_dir); };
  EXPECT_TRUE(check().ok());  // none yet
  fs::create_directories(paths_.build_dir + "/options");
  ASSERT_TRUE(WriteFileAtomically(paths_.build_dir + "/lock", "").ok());
  ASSERT_TRUE(WriteFileAtomically(paths_.build_dir + "/notes.txt", "mine").ok());
  EXPECT_TRUE(
      check().ok());  // as a build leaves it that is killed early, beside a file that is nobody's business
  for (const char* name : {"features.db", "capture", "error.json", "config.mk", "world.db.tmp-7"}) {
    ASSERT_TRUE(WriteFileAtomically(paths_.build_dir + "/" + name, "mine").ok());
    const Status status = check();
    ASSERT_FALSE(status.ok()) << name;
    EXPECT_THAT(status.error().message, HasSubstr(std::string("its ") + name + " would be overwritten"));
    fs::remove(paths_.build_dir + "/" + name);
  }
  paths_.recipe = "/maps/kitchen.toml";
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  ASSERT_TRUE(WriteFileAtomically(paths_.build_dir + "/features.db", "").ok());
  EXPECT_TRUE(check().ok());
}

TEST(BuildFiles, NamesAreThoseThatABuildWrites) {
  for (const char* name :
       {"features.db", "matches-1-2of3.db.stamp", "poses", "capture.stamp", "map.report.json",
        "features.db.reuse", "lock", "matches.begun", "images.d", "regions.db.tmp-12"})
    EXPECT_TRUE(IsBuildFileName(name)) << name;
  for (const char* name : {"notes.txt", "notes.tmp-2024", "features.db.bak", "my-features.db", "pareto", ""})
    EXPECT_FALSE(IsBuildFileName(name)) << name;
  for (const char* name : {"seed", "emit_map.toml", "simulate.toml", "name.tmp-1"})
    EXPECT_TRUE(IsOptionsFileName(name)) << name;
  for (const char* name : {"notes", "mine.toml", "seed.toml", "notes.tmp-2024", "emit_map"})
    EXPECT_FALSE(IsOptionsFileName(name)) << name;
}

TEST_F(BuildFolderTest, PathsThatMakeCannotCarryAreRefusedWithASentence) {
  paths_.build_dir = (folder_ / "my maps/kitchen.build").string();
  const Status status = WriteBuildFolder(recipe_, paths_);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(status.error().message, HasSubstr("has a space in its path, which Make cannot carry; rename"));
  EXPECT_FALSE(CheckMakePath("the map", "/maps/50%.cairn").ok());
  EXPECT_FALSE(CheckMakePath("the map", "/maps/$HOME.cairn").ok());
  EXPECT_TRUE(CheckMakePath("the map", "/maps/Küche+Flur_2,b-1~@.cairn").ok());
}

}  // namespace
}  // namespace cairn
