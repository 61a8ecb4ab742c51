#include "pipeline/build/build_folder.h"

#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "pipeline/build/build_files.h"
#include "tests/pipeline/program/test_stages.h"

namespace cairn::pipeline {
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
              .program = "/proc/self/exe",
              .recipe = (folder_ / "kitchen.toml").string()};
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

TEST_F(BuildFolderTest, AFilmIsImportedIntoAFolderOfItsNameAndReconstructed) {
  const std::string film = (folder_ / "walk.mp4").string();
  ASSERT_TRUE(WriteFileAtomically(film, "").ok());
  recipe_.captures = {{.name = "walk",
                       .path = film,
                       .kind = CaptureKind::kFilm,
                       .footage = {.keyframes = "0.5", .camera = "PINHOLE,4,4,2,2,2,2"}}};
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_TRUE(IsReconstructed(recipe_));
  const std::string config = Text("config.mk");
  EXPECT_THAT(config, HasSubstr("\nCAPTURE := " + paths_.build_dir + "/film-walk\n"));
  EXPECT_THAT(config, HasSubstr("\nFOOTAGE := film-walk=" + film + "\n"));
  EXPECT_THAT(config, HasSubstr("\nFOOTAGE_FILES := film-walk=" + film + "\n"));
  EXPECT_THAT(config,
              HasSubstr("\nFOOTAGE_OPTIONS := film-walk=--format film-walk=film film-walk=--keyframes "
                        "film-walk=0.5 film-walk=--camera film-walk=PINHOLE,4,4,2,2,2,2\n"));
  for (const char* name : {"film-walk", "film-walk.stamp", "film-walk.report.json"})
    EXPECT_TRUE(IsBuildFileName(name)) << name;
  EXPECT_FALSE(IsBuildFileName("film.mp4"));
  // Beside a folder it is joined with that one.
  recipe_.captures.push_back({.name = "survey", .path = (folder_ / "survey").string()});
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_THAT(Text("config.mk"), HasSubstr("\nSESSIONS := walk=" + paths_.build_dir + "/film-walk survey="));
}

TEST_F(BuildFolderTest, ABagThatIsAFolderDependsOnTheFilesInIt) {
  const std::string bag = (folder_ / "run").string();
  fs::create_directories(bag);
  for (const char* name : {"/metadata.yaml", "/run_1.mcap", "/run_0.mcap", "/notes of the day.txt"})
    ASSERT_TRUE(WriteFileAtomically(bag + name, "").ok());
  recipe_.captures = {
      {.name = "run", .path = bag + "/", .kind = CaptureKind::kBag, .footage = {.topic = "/left"}}};
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_THAT(Text("config.mk"), HasSubstr("\nCAPTURE := " + paths_.build_dir + "/bag-run\n"));
  EXPECT_THAT(Text("config.mk"), HasSubstr("\nFOOTAGE := bag-run=" + bag + "\n"));
  EXPECT_THAT(Text("config.mk"), HasSubstr("\nFOOTAGE_FILES := bag-run=" + bag + "/metadata.yaml bag-run=" +
                                           bag + "/run_0.mcap bag-run=" + bag + "/run_1.mcap\n"));
  const std::string how = Text("options/bag-run");
  EXPECT_THAT(how, HasSubstr("--topic\n/left\n"));
  EXPECT_EQ(Text("options/odometry"), "run:   \n");
  // A file less is another bag, of which odometry is taken as before.
  fs::remove(bag + "/run_1.mcap");
  const fs::file_time_type date = Date("options/odometry");
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_NE(Text("options/bag-run"), how);
  EXPECT_EQ(Date("options/odometry"), date);
  recipe_.captures[0].footage.odometry = "none";
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_EQ(Text("options/odometry"), "run: none  \n");
  recipe_.captures[0].footage.imu = "/imu";
  recipe_.captures[0].footage.imu_on_camera = "0,0,0,0,0,0,1";
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_EQ(Text("options/odometry"), "run: none  \nrun: imu /imu 0,0,0,0,0,0,1\n");
  for (const char* name : {"bag-run", "bag-run.stamp", "bag-run.report.json"})
    EXPECT_TRUE(IsBuildFileName(name)) << name;
  EXPECT_FALSE(IsBuildFileName("drive.bag"));
  for (const char* name : {"bag-run", "film-walk", "odometry"}) EXPECT_TRUE(IsOptionsFileName(name)) << name;
  EXPECT_FALSE(IsOptionsFileName("bag"));
  // Make cannot depend on such names.
  ASSERT_TRUE(WriteFileAtomically(bag + "/run 2.mcap", "").ok());
  EXPECT_THAT(WriteBuildFolder(recipe_, paths_).error().message,
              testing::AllOf(HasSubstr("run 2.mcap' has a space"), HasSubstr("the file of a film or bag")));
}

TEST_F(BuildFolderTest, OdometryAndImusOfFoldersAreNoted) {
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_EQ(Text("options/odometry"), "");
  ASSERT_TRUE(WriteFileAtomically(recipe_.captures[0].path + "/odometry.txt", "").ok());
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_EQ(Text("options/odometry"), "survey\n");
  ASSERT_TRUE(WriteFileAtomically(recipe_.captures[0].path + "/imu.csv", "").ok());
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_EQ(Text("options/odometry"), "survey\nsurvey: imu\n");
}

TEST_F(BuildFolderTest, ConfigurationNamesCaptureAndQueries) {
  ASSERT_TRUE(WriteFileAtomically(recipe_.captures[0].path + "/images.txt", "").ok());
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_THAT(Text("config.mk"), HasSubstr("CAPTURE := " + recipe_.captures[0].path + "\n"));
  const std::string list = recipe_.captures[0].path + "/queries.txt";
  EXPECT_THAT(Text("config.mk"), HasSubstr("QUERIES := \nLEFT_OUT := yes\n"));
  EXPECT_EQ(Text("options/queries"), "left_out\n");
  ASSERT_TRUE(WriteFileAtomically(list, " \n# nothing\n").ok());  // holds nothing out
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_THAT(Text("config.mk"), HasSubstr("QUERIES := \nLEFT_OUT := yes\n"));
  ASSERT_TRUE(WriteFileAtomically(list, "# one\n1 1 0 0 0 0 0 0 1 a.jpg\n").ok());
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_THAT(Text("config.mk"), HasSubstr("QUERIES := " + list + "\nLEFT_OUT := no\n"));
  EXPECT_EQ(Text("options/queries"), list + "\n");
}

TEST_F(BuildFolderTest, CapturesWithoutPosesInTheFrameOfOthersAreRegistered) {
  const auto add = [&](const std::string& name, bool has_poses) {
    const std::string path = (folder_ / name).string();
    fs::create_directories(path);
    if (has_poses) ASSERT_TRUE(WriteFileAtomically(path + "/images.txt", "").ok());
    recipe_.captures.push_back({.name = name, .path = path});
  };
  int hold_out_every = 0;
  recipe_.stages.push_back({.stage = "reconstruct",
                            .table = {{.name = "hold_out_every", .value = &hold_out_every, .help = ""}},
                            .options = nullptr});
  recipe_.captures.clear();
  add("old", true);
  add("robot2", true);
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_FALSE(IsReconstructed(recipe_));
  EXPECT_THAT(Text("config.mk"), HasSubstr("\nRECONSTRUCTED := no\nREGISTERED := no\n"));
  const std::string without = Text("options/capture");
  // Of another frame, as the recipe says; its own held-out images are no queries of the map.
  recipe_.captures[1].is_registered = true;
  ASSERT_TRUE(
      WriteFileAtomically(recipe_.captures[1].path + "/queries.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n").ok());
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_TRUE(IsReconstructed(recipe_));
  EXPECT_TRUE(IsRegistered(recipe_).value());
  EXPECT_THAT(Text("config.mk"), HasSubstr("\nRECONSTRUCTED := yes\nREGISTERED := yes\n"));
  EXPECT_THAT(Text("config.mk"), HasSubstr("\nSESSIONS_REGISTERED := robot2\n"));
  EXPECT_EQ(Text("options/capture"), without + "registered robot2\n");
  EXPECT_EQ(Text("options/queries"), "left_out\n");
  // Without poses: so or so.  Those of the posed one are kept.
  add("tonight", false);
  recipe_.captures[1].is_registered = false;
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_THAT(Text("config.mk"), HasSubstr("\nREGISTERED := yes\n"));
  EXPECT_THAT(Text("config.mk"), HasSubstr("\nSESSIONS_REGISTERED := \n"));
  EXPECT_EQ(Text("options/queries"), paths_.build_dir + "/poses/queries.txt\n");
  // None has the frame.
  recipe_.captures[0].is_registered = recipe_.captures[1].is_registered = true;
  EXPECT_THAT(WriteBuildFolder(recipe_, paths_).error().message,
              HasSubstr("every capture with poses is to be registered"));
  // A capture that was joined before says it itself.
  recipe_.captures.resize(1);
  EXPECT_FALSE(IsRegistered(recipe_).value());
  ASSERT_TRUE(WriteFileAtomically(recipe_.captures[0].path + "/register.txt", "tonight\n").ok());
  EXPECT_TRUE(IsRegistered(recipe_).value());
  EXPECT_TRUE(IsReconstructed(recipe_));
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
  EXPECT_TRUE(check().ok());  // as an early killed build leaves it, with a file that is not cairn's
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

// Make would do what it says, and a recipe beside it makes it no better.
TEST_F(BuildFolderTest, DependenciesThatNoStageWroteAreRefused) {
  fs::create_directories(paths_.build_dir);
  ASSERT_TRUE(WriteFileAtomically(paths_.build_dir + "/recipe", "x\n").ok());
  EXPECT_TRUE(CheckBuildFolder(paths_.build_dir).ok());
  const std::string dependencies = paths_.build_dir + "/images.d";
  ASSERT_TRUE(WriteFileAtomically(dependencies, "CAPTURE_IMAGES += \\\n  /a/1.png\n/a/%: ;\n").ok());
  EXPECT_TRUE(CheckBuildFolder(paths_.build_dir).ok());
  ASSERT_TRUE(WriteFileAtomically(dependencies, "X := $(shell touch /tmp/x)\n").ok());
  const Status status = CheckBuildFolder(paths_.build_dir);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(status.error().message, HasSubstr("images.d: is not as extract-features writes it"));
  fs::remove(dependencies);
  fs::create_symlink("/nowhere", dependencies);
  EXPECT_FALSE(CheckBuildFolder(paths_.build_dir).ok());
}

TEST_F(BuildFolderTest, LinksThatLeadOutAreNotFollowed) {
  fs::create_directories(paths_.build_dir);
  fs::create_directory_symlink(testing::TempDir(), paths_.build_dir + "/options");
  const Status status = WriteBuildFolder(recipe_, paths_);
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message, HasSubstr("options: is a link"));
}

TEST(BuildFiles, NamesAreThoseThatABuildWrites) {
  for (const char* name :
       {"features.db", "matches-1-2of3.db.stamp", "matches-2-plan-8-64.db.shards",
        "matches-2-plan-8-64.stamp", "poses", "capture.stamp", "map.report.json", "features.db.reuse",
        "classes.db.solved", "lock", "matches.begun", "images.d", "regions.db.tmp-12"})
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
  EXPECT_THAT(status.error().message, HasSubstr("has a space in its path, which Make cannot handle; rename"));
  EXPECT_FALSE(fs::exists(folder_ / "my maps"));  // nothing is written first
}

// Every value of config.mk is refused where make would read it as something else.
TEST_F(BuildFolderTest, NoValueOfTheConfigurationEscapesTheCheck) {
  const std::string hostile = (folder_ / "a\n$(shell touch PWNED)\n#").string();
  fs::create_directories(hostile);
  const auto expect_refused = [&](const Recipe& recipe, const BuildPaths& paths, const std::string& what) {
    const Status status = WriteBuildFolder(recipe, paths);
    ASSERT_FALSE(status.ok()) << what;
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument) << status.error().message;
    EXPECT_THAT(status.error().message, testing::StartsWith(what));
    EXPECT_FALSE(fs::exists(paths_.build_dir + "/config.mk")) << what;
  };
  BuildPaths paths = paths_;
  paths.build_dir = hostile;
  expect_refused(recipe_, paths, "the build folder");
  paths = paths_;
  paths.map = hostile + ".cairn";
  expect_refused(recipe_, paths, "the map");
  paths = paths_;
  paths.program = hostile;
  expect_refused(recipe_, paths, "the program");
  Recipe recipe = recipe_;
  recipe.name = "$(shell touch PWNED)";
  expect_refused(recipe, paths_, "the name");
  recipe = recipe_;
  recipe.captures[0].path = hostile;
  expect_refused(recipe, paths_, "the capture");
  recipe = recipe_;
  recipe.captures[0].queries_path = hostile;
  expect_refused(recipe, paths_, "the list of queries");
  recipe = recipe_;
  recipe.captures[0].floor_plan_path = hostile;
  expect_refused(recipe, paths_, "the floor plan");
  recipe = recipe_;
  recipe.captures.push_back({.name = "second", .path = hostile});
  expect_refused(recipe, paths_, "the capture");
  recipe.captures[1].path = recipe.captures[0].path;
  recipe.captures[1].queries_path = hostile;
  expect_refused(recipe, paths_, "the list of queries");
}

TEST_F(BuildFolderTest, RecipesOfAnyNameAreNoPartOfTheMakefile) {
  paths_.recipe = (folder_ / "a\n$(shell touch PWNED)\n# my.toml").string();
  ASSERT_TRUE(WriteBuildFolder(recipe_, paths_).ok());
  EXPECT_EQ(Text("config.mk").find("PWNED"), std::string::npos);
  EXPECT_EQ(ConfiguredRecipe(paths_.build_dir), paths_.recipe);
  EXPECT_EQ(ConfiguredMap(paths_.build_dir), paths_.map);
  EXPECT_EQ(ConfiguredRecipe(folder_.string()), "");
}

}  // namespace
}  // namespace cairn::pipeline
