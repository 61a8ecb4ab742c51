#include "pipeline/build/recipe.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/pipeline/program/test_stages.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;

class RecipeTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / fmt::format("recipe_test_{}", getpid());
    fs::create_directories(folder_ / "survey");
  }
  void TearDown() override { fs::remove_all(folder_); }

  Result<Recipe> Read(const std::string& text) const {
    const std::string path = (folder_ / "recipe.toml").string();
    EXPECT_TRUE(WriteFileAtomically(path, text).ok());
    return ReadRecipe(path, TestStages());
  }

  std::string Message(const std::string& text, ErrorCode code = ErrorCode::kInvalidArgument) const {
    const auto recipe = Read(text);
    if (recipe.ok()) return "no error";
    EXPECT_EQ(recipe.error().code, code);
    return recipe.error().message;
  }

  fs::path folder_;
};

TEST_F(RecipeTest, NameAndCaptureAreEnough) {
  for (const char* header : {"[[capture]]", "[capture]"}) {
    const auto recipe = Read(std::string("name = \"kitchen\"\n") + header + "\npath = \"survey\"\n");
    ASSERT_TRUE(recipe.ok()) << recipe.error().message;
    EXPECT_EQ(recipe->name, "kitchen");
    EXPECT_EQ(recipe->seed, 0u);
    ASSERT_EQ(recipe->captures.size(), 1u);
    EXPECT_EQ(recipe->captures[0].path, (folder_ / "survey").string());
    EXPECT_EQ(recipe->captures[0].name, "survey");
    EXPECT_FALSE(recipe->simulated);
    EXPECT_EQ(OptionsToml(recipe->stages[1].table), OptionsToml(TestStages()[1].table));
  }
}

TEST_F(RecipeTest, KeyframesAndCameraAreForFilmsAndBags) {
  ASSERT_TRUE(WriteFileAtomically((folder_ / "walk.mp4").string(), "").ok());
  const std::string film = "name = \"a\"\n[[capture]]\npath = \"walk.mp4\"\n";
  const auto recipe = Read(film + "keyframes = 0.5\ncamera = \"SIMPLE_PINHOLE,640,480,500,320,240\"\n");
  ASSERT_TRUE(recipe.ok()) << recipe.error().message;
  EXPECT_EQ(recipe->captures[0].kind, CaptureKind::kFilm);
  EXPECT_EQ(recipe->captures[0].name, "walk");
  EXPECT_EQ(recipe->captures[0].footage.keyframes, "0.5");
  EXPECT_EQ(recipe->captures[0].footage.camera, "SIMPLE_PINHOLE,640,480,500,320,240");
  EXPECT_EQ(Read(film)->captures[0].footage.keyframes, "auto");
  EXPECT_THAT(Message("name = \"a\"\n[[capture]]\npath = \"survey\"\nkeyframes = \"all\"\n"),
              AllOf(HasSubstr("recipe.toml:2: keyframes is for films and bags"),
                    HasSubstr("survey is a folder of images; leave it out")));
  EXPECT_THAT(Message("name = \"a\"\n[[capture]]\npath = \"survey\"\ncamera = \"PINHOLE,4,4,2,2,2,2\"\n"),
              HasSubstr("leave it out (a folder has its cameras in cameras.txt)"));
  for (const char* keyframes :
       {"0", "-1", "inf", "\"often\"", "\"0.5s\"", "[1, 2]", "\"\"", "true", "\"~\""}) {
    EXPECT_THAT(Message(film + "keyframes = " + keyframes + "\n"), HasSubstr("recipe.toml:4: keyframes: "))
        << keyframes;
  }
  EXPECT_THAT(Message(film + "camera = \"PINHOLE,640\"\n", ErrorCode::kCorrupt),
              HasSubstr("recipe.toml:4: camera"));
}

TEST_F(RecipeTest, ABagSaysHowItIsImported) {
  ASSERT_TRUE(WriteFileAtomically((folder_ / "drive.bag").string(), "").ok());
  fs::create_directories(folder_ / "run");
  ASSERT_TRUE(WriteFileAtomically((folder_ / "run/run_0.mcap").string(), "").ok());
  const auto recipe = Read(
      "name = \"a\"\n[[capture]]\npath = \"drive.bag\"\ntopic = \"/camera/left/image_raw\"\nodometry = "
      "\"none\"\n"
      "camera_on_robot = [0.25, 0, -1.5, -0.5, 0.5, -0.5, 0.5]\nmax_time_gap_s = 0.05\nkeyframes = \"all\"\n"
      "[[capture]]\npath = \"run\"\ncamera_on_robot = \"-1, 2,3,0,0,0,1\"\nmax_time_gap_s = 0\nimu = "
      "\"/imu/data\"\n"
      "imu_on_camera = [0.1, 0, -0.2, 0, 0, 0.6, 0.8]\n");
  ASSERT_TRUE(recipe.ok()) << recipe.error().message;
  const RecipeCapture &file = recipe->captures[0], &folder = recipe->captures[1];
  EXPECT_EQ(file.kind, CaptureKind::kBag);
  EXPECT_EQ(file.name, "drive");
  EXPECT_THAT(
      FootageWords(file.kind, file.footage),
      ElementsAre("--format", "bag", "--keyframes", "all", "--topic", "/camera/left/image_raw", "--odometry",
                  "none", "--camera-on-robot", "0.25,0,-1.5,-0.5,0.5,-0.5,0.5", "--max-time-gap-s", "0.05"));
  EXPECT_EQ(folder.kind, CaptureKind::kBag);
  EXPECT_EQ(folder.name, "run");
  EXPECT_THAT(
      FootageWords(folder.kind, folder.footage),
      ElementsAre("--format", "bag", "--keyframes", "auto", "--camera-on-robot", "-1,2,3,0,0,0,1", "--imu",
                  "/imu/data", "--imu-on-camera", "0.1,0,-0.2,0,0,0.6,0.8", "--max-time-gap-s", "0"));
  // Compiled where it is, it holds the images of its build folder.
  fs::create_directories(folder_ / "run/run.build/bag-run/images");
  ASSERT_TRUE(WriteFileAtomically((folder_ / "run/run.build/bag-run/images/a.jpg").string(), "").ok());
  EXPECT_EQ(Read("name = \"a\"\n[[capture]]\npath = \"run\"\n")->captures[0].kind, CaptureKind::kBag);
  // With images beside them, it is a folder of images, and keys of bags are not for it.
  ASSERT_TRUE(WriteFileAtomically((folder_ / "run/a.jpg").string(), "").ok());
  const std::string head = "name = \"a\"\n[[capture]]\npath = \"run\"\n";
  EXPECT_EQ(Read(head)->captures[0].kind, CaptureKind::kFolder);
  EXPECT_THAT(Message(head + "topic = \"/a\"\n"), HasSubstr("topic is for bags, and "));
  fs::remove(folder_ / "run/a.jpg");
  fs::create_directories(folder_ / "run/images");
  EXPECT_EQ(Read(head)->captures[0].kind, CaptureKind::kFolder);
}

TEST_F(RecipeTest, KeysOfBagsAreForBagsAndSayWhatIsWrongWithThem) {
  for (const char* name : {"walk.mp4", "drive.bag"})
    ASSERT_TRUE(WriteFileAtomically((folder_ / name).string(), "").ok());
  const std::string film = "name = \"a\"\n[[capture]]\npath = \"walk.mp4\"\n";
  for (const char* key : {"topic = \"/a\"", "odometry = \"none\"", "camera_on_robot = [0, 0, 0, 0, 0, 0, 1]",
                          "imu = \"/a\"", "imu_on_camera = [0, 0, 0, 0, 0, 0, 1]", "max_time_gap_s = 1"}) {
    EXPECT_THAT(Message(film + key + "\n"),
                AllOf(HasSubstr("is for bags, and "), HasSubstr("walk.mp4 is a film")));
  }
  const std::string bag = "name = \"a\"\n[[capture]]\npath = \"drive.bag\"\n";
  // Nothing that make or a shell would read in its own way.
  for (const char* topic :
       {"", "a b", "~root", "-o", "$(touch x)", "`x`", "a;b", "/a=b", "/a%", "/\\u00e4", "/a\\n"}) {
    EXPECT_THAT(Message(bag + "topic = \"" + topic + "\"\n"), HasSubstr("topic: ")) << topic;
    EXPECT_THAT(Message(bag + "odometry = \"" + topic + "\"\n"), HasSubstr("not a topic's name")) << topic;
    EXPECT_THAT(Message(bag + "imu = \"" + topic + "\"\n"), HasSubstr("not a topic's name")) << topic;
  }
  EXPECT_THAT(Message(bag + "topic = 5\n"), HasSubstr("recipe.toml:4: topic: expected text"));
  EXPECT_THAT(Message(bag + "topic = true\n"), HasSubstr("recipe.toml:4: topic: expected text"));
  EXPECT_THAT(Message(bag + "camera = \"PINHOLE, 4, 4, 2, 2, 2, 2\"\n"), HasSubstr("camera 'PINHOLE, 4"));
  for (const char* place : {"[1, 2, 3]", "[0, 0, 0, 0, 0, 0, 1, 2]", "\"0 0 0 0 0 0 1\"", "1", "\"here\""})
    EXPECT_THAT(Message(bag + "camera_on_robot = " + place + "\n"), HasSubstr("expected seven numbers"))
        << place;
  EXPECT_THAT(Message(bag + "camera_on_robot = [0, 0, 0, 0, 0, 0, \"1\"]\n"), HasSubstr("expected list"));
  EXPECT_THAT(Message(bag + "camera_on_robot = [0, 0, 0, 0, 0, 0, 2]\n", ErrorCode::kCorrupt),
              HasSubstr("camera_on_robot: "));
  EXPECT_THAT(Message(bag + "imu_on_camera = [0, 0, 0]\n"),
              HasSubstr("seven numbers [x, y, z, qx, qy, qz, qw]: where the IMU is in the camera's"));
  EXPECT_THAT(Message(bag + "imu_on_camera = [0, 0, 0, 0, 0, 0, 2]\n", ErrorCode::kCorrupt),
              HasSubstr("imu_on_camera: "));
  for (const char* gap : {"-0.1", "\"long\"", "[1, 2]"})
    EXPECT_THAT(Message(bag + "max_time_gap_s = " + gap + "\n"), HasSubstr("expected seconds, at least 0"))
        << gap;
  EXPECT_THAT(Message(bag + "odometri = \"none\"\n"), HasSubstr("did you mean 'odometry'?"));
}

TEST_F(RecipeTest, StageTablesOverrideDefaults) {
  const auto recipe = Read(
      "name = \"a\"\nseed = 7\n[simulate]\nwidth_m = 12\n"
      "[extract_features]\ncontrast_threshold = 0.5\n[filter_visibility]\nstrict = false\n");
  ASSERT_TRUE(recipe.ok()) << recipe.error().message;
  EXPECT_TRUE(recipe->simulated);
  EXPECT_EQ(recipe->seed, 7u);
  EXPECT_EQ(OptionsToml(recipe->stages[0].table), "width_m = 12\n");
  EXPECT_EQ(OptionsToml(recipe->stages[1].table), "max_num_features = 2000\ncontrast_threshold = 0.5\n");
  EXPECT_EQ(OptionsToml(recipe->stages[2].table), "up = 'auto'\nstrict = false\n");
}

TEST_F(RecipeTest, UpOfTheCaptureReachesTheStageThatLaysOutTheFloor) {
  const auto recipe = Read("name = \"a\"\n[[capture]]\npath = \"survey\"\nup = [0, -1, 0.5]\n");
  ASSERT_TRUE(recipe.ok()) << recipe.error().message;
  EXPECT_THAT(OptionsToml(recipe->stages[2].table), HasSubstr("up = '0,-1,0.5'"));
  EXPECT_THAT(Message("name = \"a\"\n[[capture]]\npath = \"survey\"\nup = [0, 0]\n"),
              HasSubstr("recipe.toml:4: up"));
  EXPECT_THAT(Message("name = \"a\"\n[[capture]]\npath = \"survey\"\nup = [0, 0, 0]\n"),
              HasSubstr("three numbers"));
}

TEST_F(RecipeTest, GateSetsWhatAMapMustReach) {
  const auto recipe = Read("name = \"a\"\n[simulate]\n[gate]\nmin_localized_ratio = 0.9\n");
  ASSERT_TRUE(recipe.ok()) << recipe.error().message;
  EXPECT_EQ(OptionsToml(recipe->stages[3].table), "min_localized_ratio = 0.9\ngross_error_m = 0.5\n");
  EXPECT_THAT(Message("name = \"a\"\n[simulate]\n[gate]\ngross_error_m = 1\n"),
              HasSubstr("recipe.toml:4: unknown"));
}

TEST_F(RecipeTest, UnknownKeysNameLineAndNearestValidOne) {
  EXPECT_THAT(Message("nme = \"a\"\n"), HasSubstr("recipe.toml:1: unknown key 'nme'; did you mean 'name'?"));
  EXPECT_THAT(Message("name = \"a\"\n[extract_feature]\n"),
              HasSubstr("recipe.toml:2: unknown table 'extract_feature'; did you mean 'extract_features'?"));
  EXPECT_THAT(Message("name = \"a\"\n[extract_features]\nmax_features = 3\n"),
              HasSubstr("recipe.toml:3: unknown option 'max_features'"));
  EXPECT_THAT(Message("name = \"a\"\n[[capture]]\npath = \"survey\"\nfloorplan = \"x\"\n"),
              HasSubstr("recipe.toml:4: unknown key of [[capture]] 'floorplan'; did you mean 'floor_plan'?"));
}

TEST_F(RecipeTest, ValuesOutOfRangeOrOfAnotherTypeNameTheLine) {
  EXPECT_THAT(Message("name = \"a\"\n[extract_features]\nmax_num_features = 0\n"),
              HasSubstr("recipe.toml:3: "));
  EXPECT_THAT(Message("name = \"a\"\n[extract_features]\nmax_num_features = \"many\"\n"),
              HasSubstr("expected an integer, found 'many'"));
  EXPECT_THAT(Message("name = 3\n"), HasSubstr("recipe.toml:1: name: expected a text"));
  EXPECT_THAT(Message("name = \"a\"\nseed = -1\n"), HasSubstr("recipe.toml:2: seed: expected an integer"));
  EXPECT_THAT(Message("name = \"a\"\nextract_features = 1\n"), HasSubstr("expected a table"));
  EXPECT_THAT(Message("name = \"a\"\ncapture = [1]\n"), HasSubstr("expected a table"));
}

TEST_F(RecipeTest, WhatIsMissingIsSaid) {
  EXPECT_THAT(Message(""), HasSubstr("no name; add a line such as"));
  EXPECT_THAT(Message("name = \"a\"\n"), HasSubstr("no capture; add [[capture]]"));
  EXPECT_THAT(Message("name = \"a\"\n[[capture]]\n"), HasSubstr("[[capture]] has no path"));
  EXPECT_THAT(Message("name = \"a\"\n[simulate]\n[[capture]]\npath = \"survey\"\n"), HasSubstr("both"));
  EXPECT_THAT(Message("name = \"a\"\n[[capture]]\npath = \"elsewhere\"\n", ErrorCode::kNotFound),
              HasSubstr("recipe.toml:3: path = 'elsewhere': there is no "));
  EXPECT_THAT(Message("name = \n", ErrorCode::kCorrupt), HasSubstr("recipe.toml:1: not TOML"));
  const auto recipe = ReadRecipe((folder_ / "none.toml").string(), TestStages());
  EXPECT_EQ(recipe.error().code, ErrorCode::kNotFound);
}

TEST_F(RecipeTest, FloorPlansAreOnePerMap) {
  fs::create_directories(folder_ / "other");
  for (const char* plan : {"a.txt", "b.txt"}) std::ofstream(folder_ / plan) << "0,0,1,0\n";
  const std::string first = "name = \"a\"\n[[capture]]\npath = \"survey\"\nfloor_plan = \"a.txt\"\n";
  const std::string second = "[[capture]]\npath = \"other\"\n";
  const auto recipe = Read(first + second + "floor_plan = \"./a.txt\"\n");
  ASSERT_TRUE(recipe.ok()) << recipe.error().message;
  EXPECT_EQ(recipe->captures[1].floor_plan_path, (folder_ / "a.txt").string());
  EXPECT_TRUE(Read(first + second).ok());
  EXPECT_THAT(Message(first + second + "floor_plan = \"b.txt\"\n"), HasSubstr("a map has one plan"));
  EXPECT_EQ(Read("name = \"a\"\n[simulate]\nfloor_plan = \"p.json\"\n")->simulated_floor_plan, "p.json");
  EXPECT_THAT(Message("name = \"a\"\n[simulate]\nfloor_plan = \"../p.json\"\n"),
              HasSubstr("recipe.toml:3: [simulate] floor_plan: expected the name of a file"));
}

TEST_F(RecipeTest, SeveralCapturesAreSessionsWithNames) {
  fs::create_directories(folder_ / "second survey");
  const auto recipe = Read(
      "name = \"a\"\n[[capture]]\npath = \"survey\"\nup = [0, 0, 1]\n"
      "[[capture]]\npath = \"second survey\"\n[[capture]]\npath = \".\"\nname = \"third\"\nup = \"auto\"\n");
  ASSERT_TRUE(recipe.ok()) << recipe.error().message;
  ASSERT_EQ(recipe->captures.size(), 3u);
  EXPECT_EQ(recipe->captures[0].name, "survey");
  EXPECT_EQ(recipe->captures[1].name, "second_survey");
  EXPECT_EQ(recipe->captures[2].name, "third");
  EXPECT_EQ(recipe->up, "0,0,1");
}

TEST_F(RecipeTest, CapturesThatContradictEachOtherAreRefused) {
  const std::string first = "name = \"a\"\n[[capture]]\npath = \"survey\"\nup = [0, 0, 1]\n";
  fs::create_directories(folder_ / "other/survey");
  EXPECT_THAT(Message(first + "[[capture]]\npath = \"survey\"\nname = \"b\"\n"),
              HasSubstr("recipe.toml:5: the folder " + (folder_ / "survey").string() + " is given twice"));
  EXPECT_THAT(
      Message(first + "[[capture]]\npath = \"other/survey\"\n"),
      HasSubstr("recipe.toml:5: two captures are named 'survey' (the name of the folder); give this one "
                "another, such as name = \"survey-2\""));
  EXPECT_THAT(Message(first + "[[capture]]\npath = \"other/survey\"\nname = \"survey\"\n"),
              HasSubstr("two captures are named 'survey'; give"));
  EXPECT_THAT(Message(first + "[[capture]]\npath = \"other\"\nup = [0, 1, 0]\n"),
              HasSubstr("recipe.toml:5: up differs from that of a capture above"));
  EXPECT_THAT(Message(first + "[[capture]]\npath = \"other\"\nname = \"a/b\"\n"),
              HasSubstr("recipe.toml:7: name = "));
  EXPECT_THAT(Message(first + "[[capture]]\npath = \"other\"\nnme = \"b\"\n"),
              HasSubstr("recipe.toml:7: unknown key of [[capture]] 'nme'; did you mean 'name'?"));
}

TEST_F(RecipeTest, NamesThatCannotBeFileNamesAreRefused) {
  for (const char* name : {"", "a b", "../a", ".a", "-a", "a/b", "ä"}) {
    EXPECT_THAT(Message(std::string("name = \"") + name + "\"\n"), HasSubstr("recipe.toml:1: name = "))
        << name;
  }
}

TEST_F(RecipeTest, ReferenceListsEveryOptionWithItsDefault) {
  const std::string page = RecipeReference(TestStages());
  EXPECT_THAT(page, HasSubstr("| `max_num_features` | `2000` | at least 1 | most features |"));
  EXPECT_THAT(page, HasSubstr("| `strict` | `true` | true, false | strict |"));
  EXPECT_THAT(page, HasSubstr("## `[simulate]`"));
}

}  // namespace
}  // namespace cairn::pipeline
