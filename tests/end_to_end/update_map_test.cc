#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/blocks/map_rows.h"
#include "core/capture/capture.h"
#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

// A drive through a building: of its images those of even number made an old map, and are gone; of the others
// there are only files, but for every fourth, which is kept to try maps with.
class UpdateMap : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("update_map_test");
    std::ofstream(Path("simulate.toml")) << R"(width_m = 5.5
depth_m = 6
num_rooms = 2
survey = "driven"
step_m = 0.15
image_width_px = 480
image_height_px = 360
horizontal_fov_deg = 80
texel_m = 0.006
num_queries = 0
)";
    ASSERT_EQ(RunShell("cairn stage simulate " + Path("simulate.toml") + " -o " + Path("drive") +
                       " --progress none")
                  .exit_code,
              0);
    for (const char* folder : {"old/images", "tonight"}) fs::create_directories(Path(folder));
    std::vector<Reject> rejects;
    const std::vector<CaptureImage> all = *ReadImagesText(Path("drive/images.txt"), &rejects);
    std::vector<CaptureImage> old, tried;
    for (size_t i = 0; i < all.size() && i < kNumImages; ++i) {
      truth_[all[i].name] = *all[i].cam_from_world;
      const bool is_old = i % 2 == 0, is_tried = i % 8 == 3;
      if (is_old) old.push_back(all[i]);
      if (is_tried) tried.push_back(all[i]);
      num_new_ += !is_old && !is_tried;
      if (is_tried) continue;
      fs::copy_file(Path("drive/images/" + all[i].name),
                    Path((is_old ? "old/images/" : "tonight/") + all[i].name));
    }
    ASSERT_TRUE(WriteImagesText(Path("old/images.txt"), old).ok());
    ASSERT_TRUE(WriteImagesText(Path("tried.txt"), tried).ok());
    fs::copy_file(Path("drive/cameras.txt"), Path("old/cameras.txt"));
    WriteCaptureRecipe(Path("old.toml"), {"old"});
    ReplaceInFile(Path("old.toml"), "max_num_features = 300", "max_num_features = 800");
    const ProgramRun run =
        RunShell("cairn compile " + Path("old.toml") + " -o " + Path("old.cairn") + " --progress none");
    ASSERT_EQ(run.exit_code, 0) << run.err;
    fs::create_directories(Path("without_pixels"));
    for (const char* file : {"old/images.txt", "old/cameras.txt", "old.build/features.db"})
      fs::copy_file(Path(file), Path("without_pixels") / fs::path(file).filename());
    classes_hash_ = HashFile(Path("old.build/classes.db")).value();
    fs::create_directories(Path("elsewhere"));
    fs::rename(Path("old.cairn"), Path("elsewhere/yesterday.cairn"));
    fs::remove_all(Path("old"));
    fs::remove_all(Path("old.build"));
    first_run_ = new ProgramRun(Update("--threads 2"));
  }
  static void TearDownTestSuite() {
    delete folder_;
    delete first_run_;
  }
  static std::string Path(const std::string& name) { return *folder_ / name; }
  static std::string OldMap() { return Path("elsewhere/yesterday.cairn"); }
  static ProgramRun Update(const std::string& more = "", const std::string& new_map = "new.cairn") {
    return RunShell("cairn update-map " + OldMap() + " " + Path("tonight") + " -o " + Path(new_map) +
                    " --progress none " + more);
  }
  // Images of the old map that see a landmark: the others have no feature.
  static size_t NumOld() {
    const auto old = ReadMapRows(OldMap());
    return std::count_if(old->images.begin(), old->images.end(),
                         [](const MapImage& image) { return !image.landmarks.empty(); });
  }
  // Of the images that no map was made of: how many are localized within 10 cm.
  static int NumRight(const std::string& map) {
    const ProgramRun run = RunShell("cairn check " + map + " --json --queries " + Path("tried.txt") +
                                    " --capture " + Path("drive"));
    EXPECT_EQ(run.exit_code, 0) << run.err;
    const auto json = nlohmann::json::parse(run.out);
    int num_right = 0;
    for (const auto& image : json["images"]) num_right += image["reason"] == "none" && image["error_m"] < 0.1;
    return num_right;
  }

  static constexpr size_t kNumImages = 60;
  static TemporaryFolder* folder_;
  static ProgramRun* first_run_;
  static std::map<std::string, Pose> truth_;
  static int num_new_;
  static std::string classes_hash_;
};
TemporaryFolder* UpdateMap::folder_ = nullptr;
ProgramRun* UpdateMap::first_run_ = nullptr;
std::map<std::string, Pose> UpdateMap::truth_;
int UpdateMap::num_new_ = 0;
std::string UpdateMap::classes_hash_;

// What extract_features found stands for the images.
TEST_F(UpdateMap, FeaturesAloneGiveTheClassesOfTheirImages) {
  WriteCaptureRecipe(Path("bare.toml"), {"without_pixels"});
  const auto compile = [&] {
    return RunShell("cairn compile " + Path("bare.toml") + " -o " + Path("bare.cairn") + " --progress none");
  };
  const ProgramRun run = compile();
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(HashFile(Path("bare.build/classes.db")).value(), classes_hash_);
  EXPECT_GT(
      nlohmann::json::parse(ReadFile(Path("bare.build/check.json")).value())["localized_ratio"].get<double>(),
      0.5);
  EXPECT_THAT(compile().out, HasSubstr("up to date"));
  // One image's features are damaged: it is left out with the reason, and the others are not done again.
  ASSERT_EQ(RunShell("sqlite3 " + Path("without_pixels/features.db") +
                     " 'UPDATE keypoints SET data = zeroblob(length(data)) WHERE image_id = 7'")
                .exit_code,
            0);
  const ProgramRun again = compile();
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(again.err, HasSubstr("image 7: keypoint 0 has the scale 0"));
  EXPECT_THAT(again.out, HasSubstr("1 rejected, 29 taken over"));
}

TEST_F(UpdateMap, NewImagesAreJoinedToTheLandmarksOfTheMap) {
  ASSERT_EQ(first_run_->exit_code, 0) << first_run_->err;
  EXPECT_THAT(first_run_->out,
              ContainsRegex("update_map: [0-9]+ landmarks of map 'tiny' are [0-9]+ keypoints in "));
  EXPECT_THAT(first_run_->out, HasSubstr("new.toml: the recipe of this"));
  const auto poses = ReadCapture(Path("new.build/poses"));
  ASSERT_TRUE(poses.ok()) << poses.error().message;
  int num_joined = 0;
  for (const CaptureImage& image : poses->images) {
    if (!image.name.starts_with("tonight/")) continue;
    ++num_joined;
    const Pose& truth = truth_.at(image.name.substr(8));
    EXPECT_LT(CenterErrorM(*image.cam_from_world, truth), 0.01) << image.name;
    EXPECT_LT(RotationErrorDeg(*image.cam_from_world, truth), 0.2) << image.name;
  }
  EXPECT_GE(num_joined, 0.9 * num_new_);
  const auto old = ReadMapRows(OldMap()), updated = ReadMapRows(Path("new.cairn"));
  ASSERT_TRUE(old.ok() && updated.ok());
  EXPECT_THAT(updated->sessions, testing::ElementsAre("tiny", "tonight"));
  // Of the old ones those that none of tonight's shows the view of are listed.
  const auto num_tonight =
      std::count_if(updated->images.begin(), updated->images.end(),
                    [](const MapImage& row) { return row.name.starts_with("tonight/"); });
  EXPECT_EQ(num_tonight, num_joined);
  EXPECT_LT(updated->images.size(), NumOld() + num_joined);
  // The frame is that of the map, and what it was made with.
  EXPECT_EQ(updated->name, "tiny");
  EXPECT_EQ(updated->frame.source, old->frame.source);
  EXPECT_LT(updated->floor_from_world.rotation.angularDistance(old->floor_from_world.rotation), 1e-9);
  EXPECT_EQ(updated->landmark_choice, "all");
  EXPECT_EQ(updated->stage_options.at("extract_features"), old->stage_options.at("extract_features"));
}

// A landmark of the old map is one of the new where one lies within 2 cm and looks like it.
TEST_F(UpdateMap, LandmarksOfTheMapAreInTheNewOne) {
  ASSERT_EQ(first_run_->exit_code, 0) << first_run_->err;
  const auto old = ReadMapRows(OldMap()), updated = ReadMapRows(Path("new.cairn"));
  ASSERT_TRUE(old.ok() && updated.ok());
  size_t num_there = 0;
  for (const MapLandmark& landmark : old->landmarks) {
    num_there += std::any_of(
        updated->landmarks.begin(), updated->landmarks.end(),
        [&](const MapLandmark& other) { return (other.position - landmark.position).norm() < 0.02; });
  }
  EXPECT_GE(num_there, 0.9 * old->landmarks.size());
}

TEST_F(UpdateMap, NewMapLocalizesAtLeastWhatTheOldOneDoes) {
  ASSERT_EQ(first_run_->exit_code, 0) << first_run_->err;
  const int by_old = NumRight(OldMap());
  EXPECT_GT(by_old, 4);
  EXPECT_GE(NumRight(Path("new.cairn")), by_old);
}

// Robots that have the old map are sent what changed: what still holds has its bytes and numbers, where a few
// images are new.
TEST_F(UpdateMap, WhatHoldsOfTheOldMapStaysAsItIs) {
  ASSERT_EQ(first_run_->exit_code, 0) << first_run_->err;
  EXPECT_THAT(ReadFile(Path("new.toml")).value(),
              ContainsRegex("emit_map.\nprevious = \"new.build/map-yesterday/.map.cairn\""));
  EXPECT_EQ(HashFile(Path("new.build/map-yesterday/.map.cairn")).value(), HashFile(OldMap()).value());
  fs::create_directories(Path("few"));
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(Path("tonight")))
    names.insert(entry.path().filename().string());
  for (const std::string& name : names) {
    if (std::distance(names.begin(), names.find(name)) < 5)
      fs::copy_file(Path("tonight/" + name), Path("few/" + name));
  }
  const auto update = [&](const std::string& more, const std::string& map) {
    const ProgramRun run = RunShell("cairn update-map " + OldMap() + " " + Path("few") + " -o " + Path(map) +
                                    " --progress none " + more);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return ReadMapRows(Path(map)).value();
  };
  const MapRows old = ReadMapRows(OldMap()).value();
  const auto num_same = [&](const MapRows& rows, bool at_one_place) {
    std::map<ClassId, const MapLandmark*> landmarks;
    for (const MapLandmark& landmark : rows.landmarks) landmarks[landmark.class_id] = &landmark;
    return std::count_if(old.landmarks.begin(), old.landmarks.end(), [&](const MapLandmark& landmark) {
      const auto found = landmarks.find(landmark.class_id);
      return found != landmarks.end() && (!at_one_place || found->second->position == landmark.position);
    });
  };
  const double num_old = static_cast<double>(old.landmarks.size());
  EXPECT_GE(num_same(update("", "few.cairn"), true), 0.8 * num_old);
  EXPECT_THAT(ReadFile(Path("few.toml")).value(), HasSubstr("previous"));
  EXPECT_LT(num_same(update("--anew", "anew.cairn"), true), 0.1 * num_old);
  EXPECT_THAT(ReadFile(Path("anew.toml")).value(), Not(HasSubstr("previous")));
  // Of as many new as old ones, each landmark is where both have it, but has the number that it had.
  const MapRows updated = ReadMapRows(Path("new.cairn")).value();
  EXPECT_GE(num_same(updated, false), 0.8 * num_old);
  EXPECT_LT(num_same(updated, true), 0.5 * num_old);
}

TEST_F(UpdateMap, PreviousMapThatCannotBeTakenIsRefused) {
  const auto compile = [&](const std::string& previous) {
    WriteCaptureRecipe(Path("bare.toml"), {"without_pixels"});
    ReplaceInFile(Path("bare.toml"), "[emit_map]\n", "[emit_map]\nprevious = \"" + previous + "\"\n");
    return RunShell("cairn compile " + Path("bare.toml") + " -o " + Path("bare.cairn") + " --progress none");
  };
  const ProgramRun missing = compile("nowhere.cairn");
  EXPECT_EQ(missing.exit_code, 3);
  EXPECT_THAT(missing.err, HasSubstr("[emit_map] previous = \"nowhere.cairn\": there is no "));
  std::ofstream(Path("text.cairn")) << "no map";
  const ProgramRun text = compile("text.cairn");
  EXPECT_EQ(text.exit_code, 13) << text.err;
  EXPECT_THAT(text.err, HasSubstr("text.cairn"));
  fs::copy_file(OldMap(), Path("bare.cairn"), fs::copy_options::overwrite_existing);
  const ProgramRun itself = compile("bare.cairn");
  EXPECT_EQ(itself.exit_code, 2) << itself.err;
  EXPECT_THAT(itself.err, HasSubstr("is the map that is compiled"));
}

TEST_F(UpdateMap, SelfTestIsOfTheNewImagesAlone) {
  ASSERT_EQ(first_run_->exit_code, 0) << first_run_->err;
  const auto check = nlohmann::json::parse(ReadFile(Path("new.build/check.json")).value());
  ASSERT_FALSE(check["images"].empty());
  for (const auto& image : check["images"])
    EXPECT_THAT(image["name"].get<std::string>(), testing::StartsWith("tonight/"));
}

TEST_F(UpdateMap, AgainNothingIsDoneAndAnyNumberOfThreadsGivesTheSameMap) {
  ASSERT_EQ(first_run_->exit_code, 0) << first_run_->err;
  EXPECT_THAT(Update().out, HasSubstr("up to date"));
  EXPECT_THAT(RunShell("cairn compile " + Path("new.toml") + " -o " + Path("new.cairn")).out,
              HasSubstr("up to date"));
  ASSERT_EQ(Update("--threads 1", "again.cairn").exit_code, 0);
  EXPECT_EQ(HashFile(Path("again.cairn")).value(), HashFile(Path("new.cairn")).value());
}

TEST_F(UpdateMap, UpdatedMapIsUpdatedAgainAndKeepsTheSessionsThatItShows) {
  ASSERT_EQ(first_run_->exit_code, 0) << first_run_->err;
  const ProgramRun run = RunShell("cairn update-map " + Path("new.cairn") + " " + Path("tonight") + " -o " +
                                  Path("third.cairn") + " --progress none --until reconstruct");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string recipe = ReadFile(Path("third.toml")).value();
  EXPECT_THAT(recipe, HasSubstr("path = \"third.build/map-new/tonight\"\nname = \"tonight\""));
  EXPECT_THAT(recipe, HasSubstr("path = \"tonight\"\nname = \"tonight-2\""));
  const MapRows updated = ReadMapRows(Path("new.cairn")).value();
  const bool shows_tiny = std::any_of(updated.images.begin(), updated.images.end(),
                                      [](const MapImage& row) { return row.name.starts_with("tiny/"); });
  EXPECT_EQ(recipe.find("path = \"third.build/map-new/tiny\"\nname = \"tiny\"") != std::string::npos,
            shows_tiny);
  EXPECT_THAT(run.out, HasSubstr("images of tonight-2 are joined to the other captures"));
  // What cairn made there, it removes.
  ASSERT_EQ(RunShell("cairn clean " + Path("third.build")).exit_code, 0);
  EXPECT_FALSE(fs::exists(Path("third.build")));
}

TEST_F(UpdateMap, WhatIsNoMapOrNoSurveyIsRefusedBeforeAnythingIsWritten) {
  const auto refused = [&](const std::string& words, int exit_code, const std::string& message) {
    const ProgramRun run = RunShell("cairn update-map " + words + " --progress none");
    EXPECT_EQ(run.exit_code, exit_code) << run.err;
    EXPECT_THAT(run.err, HasSubstr(message));
  };
  const std::string output = " -o " + Path("refused.cairn");
  std::ofstream(Path("text.cairn")) << "no map";
  fs::create_directories(Path("empty"));
  refused(Path("text.cairn") + " " + Path("tonight") + output, 13, "text.cairn");
  refused(Path("none.cairn") + " " + Path("tonight") + output, 3, "none.cairn");
  refused(OldMap() + " " + Path("empty") + output, 2,
          "a folder without an image; what is new is a film, a ROS bag or the folder of a capture");
  refused(OldMap() + " " + Path("none") + output, 3, "no such file or folder");
  refused(OldMap() + " " + Path("old.toml") + output, 2, "neither the folder of a capture nor a film");
  refused(OldMap() + " " + Path("tonight") + " -o " + Path("refused.map"), 2, "a map's name ends in .cairn");
  refused(OldMap() + " " + Path("tonight") + " -o " + OldMap(), 2, "yesterday.cairn");
  for (const char* name : {"refused.build", "refused.toml", "refused.cairn"})
    EXPECT_FALSE(fs::exists(Path(name))) << name;
  std::ofstream(Path("taken.toml")) << "name = \"mine\"\n";
  refused(OldMap() + " " + Path("tonight") + " -o " + Path("taken.cairn"), 2,
          "taken.toml: exists and is not the recipe that updates ");
  EXPECT_EQ(ReadFile(Path("taken.toml")).value(), "name = \"mine\"\n");
}

// A robot drives by the old map, is killed on the way, drives on, and brings its log home.
TEST_F(UpdateMap, RobotsLogIsASession) {
  std::ofstream names(Path("names.txt"));
  for (const auto& entry : fs::directory_iterator(Path("tonight"))) names << entry.path().string() << "\n";
  names.close();
  const std::string localize = "cairn localize " + OldMap() + " --log " + Path("robot") + " --progress none ";
  // After its fifth answer.
  EXPECT_EQ(RunShell(localize + "- < " + Path("names.txt") + " > " + Path("answers") +
                     " & pid=$!; until [ \"$(wc -l < " + Path("answers") +
                     ")\" -ge 5 ]; do sleep 0.02; done; kill -9 $pid; wait $pid")
                .exit_code,
            137);
  const auto cut = ReadCapture(Path("robot"));
  ASSERT_TRUE(cut.ok()) << cut.error().message;
  EXPECT_GE(cut->images.size(), 1u);
  const ProgramRun run = RunShell(localize + "--list " + Path("names.txt"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, ContainsRegex("[0-9]+ frames were added to the log "));
  const auto log = ReadCapture(Path("robot"));
  ASSERT_TRUE(log.ok()) << log.error().message;
  EXPECT_GT(log->images.size(), cut->images.size());
  EXPECT_LT(log->images.size(), static_cast<size_t>(num_new_));  // those of a place are kept once
  EXPECT_EQ(log->features.size(), log->images.size());
  const ProgramRun update = RunShell("cairn update-map " + OldMap() + " " + Path("robot") + " -o " +
                                     Path("by_robot.cairn") + " --progress none --until group_classes");
  ASSERT_EQ(update.exit_code, 0) << update.err;
  EXPECT_THAT(ReadFile(Path("by_robot.toml")).value(), HasSubstr("name = \"robot\"\nframe = \"register\""));
  EXPECT_THAT(update.out,
              HasSubstr(fmt::format("{0} of {0} images of robot are joined", log->images.size())));
  // With the map's own captures, as stated poses.
  std::ofstream(Path("stated.toml")) << "name = \"stated\"\n[[capture]]\npath = \"robot\"\n"
                                     << TinyStageOptions();
  EXPECT_EQ(RunShell("cairn compile " + Path("stated.toml") + " -o " + Path("stated.cairn") +
                     " --progress none --until match_features")
                .exit_code,
            0);
}

// Nothing is forced: the map is the old one's landmarks alone, and who would put it in its place is told.
TEST_F(UpdateMap, ImagesOfAnotherPlaceAreLeftOutAndUpdateNothing) {
  fs::create_directories(Path("other"));
  for (int i = 0; i < 3; ++i)
    std::ofstream(Path(fmt::format("other/{}.pgm", i))) << "P5\n64 48\n255\n" << std::string(64 * 48, 'x');
  const ProgramRun run = RunShell("cairn update-map " + OldMap() + " " + Path("other") + " -o " +
                                  Path("with_other.cairn") + " --progress none --until reconstruct");
  ASSERT_EQ(run.exit_code, 6) << run.err;
  EXPECT_THAT(run.err, HasSubstr("images of session 'other' were joined to the other captures"));
  EXPECT_THAT(run.err, HasSubstr("there is nothing to update it by; keep it"));
  EXPECT_EQ(ReadCapture(Path("with_other.build/poses"))->images.size(), NumOld());
  EXPECT_EQ(RunShell("cairn update-map " + OldMap() + " " + Path("other") + " -o " +
                     Path("with_other.cairn") + " --progress none --until match-features")
                .exit_code,
            0);
}

}  // namespace
}  // namespace cairn
