#include "pipeline/build/recipe_source.h"

#include <unistd.h>

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/database.h"
#include "core/files/file.h"
#include "core/world/world.h"
#include "pipeline/build/recipe.h"
#include "tests/pipeline/program/test_stages.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A folder that is the current one, with the capture `survey/hall A` in it.
class RecipeSourceTest : public testing::Test {
 protected:
  RecipeSourceTest() : before_(fs::current_path()) {
    folder_ = fs::path(testing::TempDir()) / fmt::format("recipe_source_test_{}", getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "survey/hall_A/images");
    Write("survey/hall_A/images/a.png", "");
    fs::current_path(folder_);
  }
  ~RecipeSourceTest() override {
    fs::current_path(before_);
    fs::remove_all(folder_);
  }

  void Write(const std::string& name, const std::string& text) const {
    ASSERT_TRUE(WriteFileAtomically((folder_ / name).string(), text).ok());
  }
  static std::string Message(const std::string& given, const std::string& map = "") {
    const auto source = FindRecipe(given, map);
    if (source.ok()) return "no error";
    EXPECT_THAT(source.error().code, testing::AnyOf(ErrorCode::kInvalidArgument, ErrorCode::kNotFound));
    return source.error().message;
  }

  fs::path before_, folder_;
};

TEST_F(RecipeSourceTest, AFolderIsCompiledByTheRecipeThatIsWrittenForIt) {
  const RecipeSource source = FindRecipe("survey/hall_A/", "").value();
  EXPECT_EQ(source.map, "hall_A.cairn");
  EXPECT_EQ(source.recipe, "hall_A.toml");
  EXPECT_TRUE(source.was_written);
  const Recipe recipe = ReadRecipe(source.recipe, TestStages()).value();
  EXPECT_EQ(recipe.name, "hall_A");
  ASSERT_EQ(recipe.captures.size(), 1u);
  EXPECT_TRUE(fs::equivalent(recipe.captures[0].path, "survey/hall_A"));
  // Again: the same recipe is there already.
  EXPECT_FALSE(FindRecipe("survey/hall_A", "")->was_written);
}

TEST_F(RecipeSourceTest, ACaptureWhoseImagesAreALinkToAFolderIsOne) {
  fs::create_directories("disk/pictures/monday");
  Write("disk/pictures/monday/a.png", "");
  fs::create_directories("survey/hall_B");
  fs::create_directory_symlink(folder_ / "disk/pictures", "survey/hall_B/images");
  EXPECT_EQ(Message("survey/hall_B"), "no error");
  fs::create_directories("survey/hall_C");
  fs::create_directory_symlink("nowhere", "survey/hall_C/images");
  EXPECT_THAT(Message("survey/hall_C"), HasSubstr("a folder without an image"));
}

TEST_F(RecipeSourceTest, TheRecipeLiesBesideTheMap) {
  fs::create_directories("maps");
  const RecipeSource source = FindRecipe("survey/hall_A", "maps/east.cairn").value();
  EXPECT_EQ(source.map, "maps/east.cairn");
  EXPECT_EQ(source.recipe, "maps/east.toml");
  EXPECT_TRUE(fs::equivalent(ReadRecipe(source.recipe, TestStages())->captures[0].path, "survey/hall_A"));
  // From inside of the folder, too.
  fs::current_path("survey/hall_A");
  EXPECT_EQ(FindRecipe(".", "")->map, "hall_A.cairn");
  EXPECT_TRUE(fs::equivalent(ReadRecipe("hall_A.toml", TestStages())->captures[0].path, "."));
}

TEST_F(RecipeSourceTest, AnotherRecipeIsNeverWrittenOver) {
  Write("hall_A.toml", "name = \"mine\"\n");
  EXPECT_THAT(
      Message("survey/hall_A"),
      HasSubstr("hall_A.toml: exists and is not the recipe that compiles survey/hall_A with defaults; "
                "compile it (cairn compile hall_A.toml -o hall_A.cairn), or give another -o"));
  EXPECT_EQ(ReadFile("hall_A.toml").value(), "name = \"mine\"\n");
  fs::remove("hall_A.toml");
  fs::create_symlink("nowhere.toml", "hall_A.toml");  // nor is what a link leads to made
  EXPECT_THAT(Message("survey/hall_A"), HasSubstr("exists and is not the recipe"));
  EXPECT_FALSE(fs::exists("nowhere.toml"));
}

TEST_F(RecipeSourceTest, ARecipeStaysWhatItIs) {
  Write("any.toml", "name = \"any\"\n");
  const RecipeSource source = FindRecipe("any.toml", "").value();
  EXPECT_EQ(source.recipe, "any.toml");
  EXPECT_EQ(source.map, "");
  EXPECT_FALSE(source.was_written);
  EXPECT_EQ(FindRecipe("any.toml", "b.cairn")->map, "b.cairn");
}

TEST_F(RecipeSourceTest, WhatIsNoRecipeIsNamedAsWhatItIs) {
  EXPECT_THAT(Message("nothing"), HasSubstr("nothing: no such file or folder; compile takes a recipe"));
  EXPECT_THAT(Message("survey/hall_A/images/a.png"),
              HasSubstr("a.png: an image, not a recipe; to compile its folder: cairn compile " +
                        (folder_ / "survey/hall_A/images").string()));
  ASSERT_TRUE(WriteWorldDatabase(World(), "world.db").ok());
  EXPECT_THAT(Message("world.db"), HasSubstr("world.db: a database of COLMAP or of a stage, not a recipe"));
  SQLite::Database("a.cairn", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE)
      .exec("PRAGMA application_id = 1668443504; PRAGMA user_version = 3000; CREATE TABLE meta (key, value)");
  EXPECT_THAT(Message("a.cairn"), HasSubstr("a.cairn: a compiled map; `cairn inspect` shows it"));
  fs::create_directories("a.build/options");
  Write("a.build/config.mk", "");
  EXPECT_THAT(Message("a.build"), HasSubstr("the build folder of a map, not a capture"));
  fs::create_directories("empty");
  EXPECT_THAT(Message("empty"), HasSubstr("a folder without an image"));
  Write("empty/recipe.toml", "");
  EXPECT_THAT(Message("empty"), HasSubstr("did you mean the recipe empty/recipe.toml?"));
  EXPECT_THAT(Message("/dev/null"), HasSubstr("neither a file nor a folder"));
  EXPECT_FALSE(fs::exists("empty.toml"));
}

TEST_F(RecipeSourceTest, NothingIsWrittenWhereTheMapCouldNotBe) {
  EXPECT_THAT(Message("survey/hall_A", "hall.map"), HasSubstr("a map's name ends in .cairn"));
  EXPECT_THAT(Message("survey/hall_A", "my hall.cairn"), HasSubstr("which Make cannot handle"));
  fs::rename("survey/hall_A", "survey/hall A");
  EXPECT_THAT(Message("survey/hall A"), HasSubstr("which Make cannot handle"));
  for (const auto& entry : fs::directory_iterator(".")) EXPECT_NE(entry.path().extension(), ".toml");
}

TEST_F(RecipeSourceTest, AFilmIsCompiledByARecipeOfItsNameWithoutTheSuffix) {
  Write("survey/Walk 1.MOV", "");
  Write("survey/walk.v2.mp4", "");
  const RecipeSource source = FindRecipe("survey/walk.v2.mp4", "").value();
  EXPECT_EQ(source.map, "walk.v2.cairn");
  EXPECT_TRUE(source.was_written);
  const Recipe recipe = ReadRecipe(source.recipe, TestStages()).value();
  ASSERT_EQ(recipe.captures.size(), 1u);
  EXPECT_EQ(recipe.captures[0].name, "walk.v2");
  EXPECT_EQ(recipe.captures[0].kind, CaptureKind::kFilm);
  EXPECT_TRUE(fs::equivalent(recipe.captures[0].path, "survey/walk.v2.mp4"));
  EXPECT_THAT(Message("survey/Walk 1.MOV"), HasSubstr("has a space"));
}

TEST_F(RecipeSourceTest, ABagIsCompiledByARecipeOfItsName) {
  Write("drive.v2.bag", "");
  const RecipeSource file = FindRecipe("drive.v2.bag", "").value();
  EXPECT_EQ(file.map, "drive.v2.cairn");
  EXPECT_TRUE(file.was_written);
  EXPECT_EQ(ReadRecipe(file.recipe, TestStages())->captures[0].kind, CaptureKind::kBag);
  fs::create_directories("rosbag2_2024_05_01-10_00_00");
  Write("rosbag2_2024_05_01-10_00_00/metadata.yaml", "rosbag2_bagfile_information:\n");
  const RecipeSource folder = FindRecipe("rosbag2_2024_05_01-10_00_00/", "").value();
  EXPECT_EQ(folder.map, "rosbag2_2024_05_01-10_00_00.cairn");
  const Recipe recipe = ReadRecipe(folder.recipe, TestStages()).value();
  EXPECT_EQ(recipe.captures[0].kind, CaptureKind::kBag);
  EXPECT_TRUE(fs::equivalent(recipe.captures[0].path, "rosbag2_2024_05_01-10_00_00"));
  // A folder of images that has a bag in it, too, is a capture.
  Write("survey/hall_A/drive.bag", "");
  EXPECT_EQ(ReadRecipe(FindRecipe("survey/hall_A", "")->recipe, TestStages())->captures[0].kind,
            CaptureKind::kFolder);
  Write("drive 1.bag", "");
  EXPECT_THAT(Message("drive 1.bag"), HasSubstr("has a space"));
}

}  // namespace
}  // namespace cairn::pipeline
