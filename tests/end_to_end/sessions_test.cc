#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/capture/capture.h"
#include "core/colmap/cameras_text.h"
#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

// Two surveys of one simulated building, by different cameras: every second place each.
class Sessions : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("sessions_test");
    WriteSurvey("day1", 320, 0);
    WriteSurvey("day2", 400, 1);
    WriteRecipe("one.toml", {"day1"});
    WriteRecipe("two.toml", {"day1", "day2"});
    const ProgramRun run = Compile("two", "two");
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("join_captures: 2 sessions, "));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string Path(const std::string& name) { return *folder_ / name; }

  // Keeps the survey images whose place is even or odd, and the queries of the same kind.
  static void WriteSurvey(const std::string& name, int image_width_px, int parity) {
    ASSERT_NO_FATAL_FAILURE(
        RenderTinySurvey(Path(name), "--image-width-px " + std::to_string(image_width_px)));
    for (const char* list : {"images.txt", "queries.txt"}) {
      const std::string path = Path(name) + "/" + list;
      std::vector<Reject> rejects;
      std::vector<CaptureImage> images = ReadImagesText(path, &rejects).value();
      // s012_h3.jpg, q004.jpg: the number of the place.
      std::erase_if(images, [&](const CaptureImage& image) { return (image.name[3] - '0') % 2 != parity; });
      ASSERT_FALSE(images.empty());
      ASSERT_TRUE(WriteImagesText(path, images).ok());
    }
  }

  static void WriteRecipe(const std::string& name, const std::vector<std::string>& captures) {
    WriteCaptureRecipe(Path(name), captures);
  }

  static ProgramRun Compile(const std::string& recipe, const std::string& map, const std::string& more = "") {
    return RunShell("cairn compile " + Path(recipe + ".toml") + " -o " + Path(map + ".cairn") +
                    " --progress none --threads 2 " + more);
  }
  static std::string Hash(const std::string& name) { return HashFile(Path(name)).value(); }

  static TemporaryFolder* folder_;
};
TemporaryFolder* Sessions::folder_ = nullptr;

TEST_F(Sessions, MapOfTwoKnowsWhichSeesWhat) {
  const ProgramRun run = RunShell("cairn inspect --json " + Path("two.cairn"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto json = nlohmann::json::parse(run.out);
  const auto& sessions = json["sessions"];
  ASSERT_EQ(sessions.size(), 2u);
  EXPECT_EQ(sessions[0]["name"], "day1");
  EXPECT_EQ(sessions[1]["name"], "day2");
  const int shared = sessions[0]["num_landmarks_shared_with"]["day2"].get<int>();
  EXPECT_GT(shared, 100);
  EXPECT_EQ(sessions[1]["num_landmarks_shared_with"]["day1"], shared);
  int num_images = 0, num_landmarks = shared;
  for (const auto& session : sessions) {
    EXPECT_EQ(session["num_landmarks"].get<int>(), session["num_landmarks_of_it_alone"].get<int>() + shared);
    num_images += session["num_images"].get<int>();
    num_landmarks += session["num_landmarks_of_it_alone"].get<int>();
  }
  EXPECT_EQ(num_images, json["num_images"]);
  EXPECT_EQ(num_landmarks, json["num_landmarks"]);
  EXPECT_EQ(json["num_cameras"], 2);
  EXPECT_THAT(RunShell("cairn inspect " + Path("two.cairn")).out,
              ContainsRegex("\n  day1 .* day2 [0-9]+\n  day2 "));
  // Where the captures lie is not in the map.
  EXPECT_EQ(RunShell("grep -c " + folder_->string() + " " + Path("two.cairn")).out, "0\n");
}

TEST_F(Sessions, MapOfTwoLocalizesQueriesOfBoth) {
  EXPECT_THAT(ReadFile(Path("two.build/capture/queries.txt")).value(),
              AllOf(HasSubstr("day1/q"), HasSubstr("day2/q")));
  for (const char* session : {"day1", "day2"}) {
    // Without --camera: the image's size says whose it is.
    const ProgramRun run = RunShell("cairn localize " + Path("two.cairn") + " " + Path(session) +
                                    "/images/q*.jpg -o " + Path("poses.txt"));
    ASSERT_EQ(run.exit_code, 0) << run.err;
    std::vector<Reject> rejects;
    EXPECT_GE(ReadImagesText(Path("poses.txt"), &rejects)->size(), 3u) << session << "\n" << run.out;
  }
}

TEST_F(Sessions, SecondRunDoesNothingAndATouchedListRunsNoStage) {
  EXPECT_THAT(Compile("two", "two").out, HasSubstr("up to date"));
  fs::last_write_time(Path("day2/images.txt"), fs::file_time_type::clock::now());
  const ProgramRun run = Compile("two", "two", "--log-level info");
  EXPECT_THAT(run.out, HasSubstr("join_captures"));
  EXPECT_THAT(run.out, Not(HasSubstr("extract_features:")));
  EXPECT_THAT(Compile("two", "two").out, HasSubstr("up to date"));
}

TEST_F(Sessions, AddedSessionTakesOverTheOldOnesWork) {
  ASSERT_EQ(Compile("one", "grown").exit_code, 0);
  const ProgramRun run = Compile("two", "grown");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const size_t num_old = ReadCapture(Path("day1"))->images.size();
  EXPECT_THAT(run.out, ContainsRegex("extract_features: .*, " + std::to_string(num_old) + " taken over\n"));
  EXPECT_THAT(run.out, ContainsRegex("match_features: .*, [1-9][0-9]* taken over\n"));
  for (const char* file : {"features.db", "matches.db", "unsealed.cairn"})
    EXPECT_EQ(Hash(std::string("grown.build/") + file), Hash(std::string("two.build/") + file)) << file;
  EXPECT_EQ(Hash("grown.cairn"), Hash("two.cairn"));
}

TEST_F(Sessions, RemovedSessionLeavesNothingBehind) {
  WriteRecipe("shrunk.toml", {"day1", "day2"});
  ASSERT_EQ(Compile("shrunk", "shrunk", "--until extract_features").exit_code, 0);
  WriteRecipe("shrunk.toml", {"day1"});
  ASSERT_EQ(Compile("shrunk", "shrunk", "--until extract_features").exit_code, 0);
  ASSERT_EQ(Compile("one", "one", "--until extract_features").exit_code, 0);
  EXPECT_EQ(Hash("shrunk.build/features.db"), Hash("one.build/features.db"));
}

// Nothing is forced: the map is that of the others.
TEST_F(Sessions, ImagesOfAnotherPlaceAreLeftOutWithTheirReason) {
  fs::create_directories(Path("flat"));
  std::ofstream(Path("flat/a.pgm")) << "P5\n64 48\n255\n" << std::string(64 * 48, 'x');
  WriteRecipe("mixed.toml", {"day1", "flat"});
  const ProgramRun run = Compile("mixed", "mixed", "--until reconstruct");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("images of session 'flat' were joined to the other captures"));
  const size_t num_old = ReadCapture(Path("day1"))->images.size();
  EXPECT_EQ(ReadCapture(Path("mixed.build/poses"))->images.size(), num_old);
}

// The survey of a real kitchen, every second image on another day with another camera.
TEST_F(Sessions, HalvesOfAKitchenMakeOneMapThatLocalizesQueriesOfBoth) {
  const std::string kitchen = CAIRN_SOURCE_DIR "/../shared/data/redkitchen";
  if (!fs::exists(kitchen + "/images.txt")) GTEST_SKIP() << "no " << kitchen;
  for (int half = 0; half < 2; ++half) {
    const std::string folder = Path(half == 0 ? "monday" : "tuesday");
    fs::create_directories(folder);
    fs::create_directory_symlink(fs::canonical(kitchen + "/images"), folder + "/images");
    auto cameras = ReadCamerasText(kitchen + "/cameras.txt").value();
    for (auto& [camera_id, camera] : cameras) camera.params[0] += 0.01 * half;
    ASSERT_TRUE(WriteCamerasText(folder + "/cameras.txt", cameras).ok());
    for (const std::string list : {"/images.txt", "/queries.txt"}) {
      std::vector<Reject> rejects;
      std::vector<CaptureImage> images, all = ReadImagesText(kitchen + list, &rejects).value();
      for (size_t i = half; i < all.size(); i += 2) images.push_back(all[i]);
      ASSERT_TRUE(WriteImagesText(folder + list, images).ok());
    }
  }
  std::ofstream(Path("kitchen.toml"))
      << "name = \"kitchen\"\n[[capture]]\npath = \"monday\"\n"
         "[[capture]]\npath = \"tuesday\"\n[filter_visibility]\ncell_size_m = 0.25\n"
         "heading_bin_deg = 30\nmin_num_stations_driven = 2\n[decompose_regions]\n"
         "k = 40\ntau = 0\n[emit_map]\nlandmarks = \"all\"\n";
  ASSERT_EQ(Compile("kitchen", "kitchen", "--log-level error").exit_code, 0);
  const auto json = nlohmann::json::parse(RunShell("cairn inspect --json " + Path("kitchen.cairn")).out);
  EXPECT_EQ(json["num_cameras"], 2);
  const std::string queries = ReadFile(Path("kitchen.build/capture/queries.txt")).value();
  for (const char* session : {"monday", "tuesday"})
    EXPECT_THAT(queries, HasSubstr(std::string(session) + "/frame"));
  // The whole survey as one capture localizes 100 % of the queries.
  EXPECT_GE(json["self_test"]["localized_ratio"].get<double>(), 0.97);
  EXPECT_GE(json["self_test"]["precision_ratio"].get<double>(), 0.97);
}

}  // namespace
}  // namespace cairn
