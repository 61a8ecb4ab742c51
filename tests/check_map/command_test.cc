#include "stages/check_map/command.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/capture/capture.h"
#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_database.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "stages/check_map/check_map.h"
#include "tests/ran_command.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn::check_map {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Pair;

namespace fs = std::filesystem;

const SyntheticRoom& Room() {
  static const auto& room = *new SyntheticRoom(MakeSyntheticRoom(1));
  return room;
}

// The map of a room, and a capture of a survey image and four queries there, whose features are in a
// database.
class CheckMapCommandTest : public CommandTest {
 protected:
  void SetUp() override {
    ASSERT_TRUE(WriteMapRows(Room().rows, Path("room.cairn")).ok());
    WriteCapture("capture", Room().camera, false);
  }
  // `is_foreign`: of another place.
  void WriteCapture(const std::string& name, const Camera& camera, bool is_foreign) const {
    fs::create_directories(folder_ / name);
    std::vector<CaptureImage> images;
    const Status status =
        WriteDatabase(Path(name + "/features.db"), kColmapSchema, [&](SQLite::Database& database) -> Status {
          WriteDatabaseCamera(database, camera);
          Random random(3);
          for (int i = 0; i < 5; ++i) {
            const Pose pose = PoseAt({0.5 * i - 1, 0.3 * i - 0.5, 1.2}, 70 * i);
            Features features = RenderFeatures(Room(), pose, {}, i);
            for (Eigen::Index k = 0; k < features.descriptors.rows() && is_foreign; ++k)
              features.descriptors.row(k) = RandomDescriptor(random);
            images.push_back({fmt::format("{}.png", i), 1, pose});
            WriteDatabaseImage(database, {static_cast<ImageId>(i + 1), images.back().name, 1});
            WriteDatabaseFeatures(database, static_cast<ImageId>(i + 1), features);
          }
          return Ok();
        });
    ASSERT_TRUE(status.ok()) << status.error().message;
    ASSERT_TRUE(WriteCamerasText(Path(name + "/cameras.txt"), {{1, camera}}).ok());
    ASSERT_TRUE(WriteImagesText(Path(name + "/images.txt"), {images[0]}).ok());
    ASSERT_TRUE(
        WriteImagesText(Path(name + "/queries.txt"), {images[1], images[2], images[3], images[4]}).ok());
  }
  Ran Run(const std::vector<std::string>& more) const {
    return RunWords(CheckMapCommand(), {Path("room.cairn")}, more);
  }
  std::string Refusal(const std::vector<std::string>& words) const {
    const Ran ran = Run(words);
    return ran.status.ok() ? "" : ran.status.error().message;
  }
};

TEST_F(CheckMapCommandTest, LocalizesTheQueriesOfACaptureInTheMap) {
  const Ran ran = Run({"--queries", Path("capture/queries.txt"), "--details", Path("details.json")});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.out, HasSubstr("map                    room (unsealed)\n"));
  EXPECT_THAT(ran.out, HasSubstr("held-out images        4\nlocalized              4 (100.0 %)\n"));
  EXPECT_THAT(ran.out, HasSubstr("precision              100.0 % (0 wrong fixes)\n"));
  EXPECT_THAT(ran.report.in, ElementsAre(Pair("held-out images", 4)));
  EXPECT_THAT(ran.report.out, ElementsAre(Pair("localized", 4)));
  const nlohmann::json details = nlohmann::json::parse(*ReadFile(Path("details.json")));
  EXPECT_EQ(details["num_localized"], 4);
  EXPECT_FALSE(details.contains("mean_total_ms"));
  const nlohmann::json printed =
      nlohmann::json::parse(Run({"--queries", Path("capture/queries.txt"), "--json"}).out);
  EXPECT_TRUE(printed.contains("mean_total_ms"));
  EXPECT_EQ(printed["map_bytes"], fs::file_size(Path("room.cairn")));
  EXPECT_EQ(printed["images"].size(), 4U);
}

TEST_F(CheckMapCommandTest, SealsTheMapWithItsFiguresOnce) {
  const Ran ran = Run({"--queries", Path("capture/queries.txt"), "-o", Path("sealed.cairn")});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  const Result<MapRows> sealed = ReadMapRows(Path("sealed.cairn"));
  ASSERT_TRUE(sealed.ok());
  EXPECT_TRUE(sealed->sealed);
  EXPECT_EQ(sealed->self_test.at("num_localized"), 4);
  EXPECT_FALSE(sealed->findings.self_test_regions.empty());
  EXPECT_TRUE(sealed->stage_options.contains("check_map"));
  const Ran again = RunWords(CheckMapCommand(), {Path("sealed.cairn"), "-o", Path("twice.cairn")});
  ASSERT_FALSE(again.status.ok());
  EXPECT_THAT(again.status.error().message, HasSubstr("is already sealed"));
  // Without images there is nothing to say of it.
  ASSERT_TRUE(Run({"-o", Path("sealed.cairn")}).status.ok());
  EXPECT_TRUE(ReadMapRows(Path("sealed.cairn"))->self_test.empty());
}

TEST_F(CheckMapCommandTest, AGateThatIsNotPassedSealsNothing) {
  const Ran ran = Run({"--queries", Path("capture/queries.txt"), "-o", Path("sealed.cairn"),
                       "--gross-error-m", "0.000001", "--min-precision-ratio", "0.5"});
  EXPECT_EQ(ran.status.error().code, ErrorCode::kGate);
  EXPECT_FALSE(fs::exists(Path("sealed.cairn")));
}

// The map knows the camera better than the capture states it, unless it must be another one.
TEST_F(CheckMapCommandTest, TakesTheMapsCameraWhereTheFocalLengthIsStatedWithinATenth) {
  const auto median_error_m = [&](double focal_ratio) {
    Camera camera = Room().camera;
    camera.params[0] *= focal_ratio;
    WriteCapture("stated", camera, false);
    const Ran ran = Run({"--queries", Path("stated/queries.txt"), "--json"});
    EXPECT_TRUE(ran.status.ok()) << ran.status.error().message;
    const nlohmann::json json = nlohmann::json::parse(ran.out);
    return json.contains("median_error_m") ? json["median_error_m"].get<double>() : 1e9;
  };
  const double exact = median_error_m(1);
  EXPECT_EQ(median_error_m(1.095), exact);
  EXPECT_EQ(median_error_m(1 / 1.095), exact);
  EXPECT_GT(median_error_m(1.12), 5 * exact);
  EXPECT_GT(median_error_m(1 / 1.12), 5 * exact);
}

TEST_F(CheckMapCommandTest, ImagesOfAnotherPlaceAreCountedByThemselves) {
  WriteCapture("elsewhere", Room().camera, true);
  const Ran ran = Run({"--foreign", Path("elsewhere")});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.out, HasSubstr("other places           5 images, 0 false fixes"));
  EXPECT_THAT(ran.out, Not(HasSubstr("held-out images")));
  EXPECT_THAT(Run({"--foreign", Path("capture")}).out,
              HasSubstr("other places           5 images, 5 false fixes"));
}

TEST_F(CheckMapCommandTest, QueriesOfAnUnknownCameraAreCorrupt) {
  ASSERT_TRUE(WriteImagesText(Path("queries.txt"), {{"1.png", 7, Pose()}}).ok());
  EXPECT_THAT(Refusal({"--queries", Path("queries.txt"), "--capture", Path("capture")}),
              HasSubstr("image 1.png has camera 7, which cameras.txt lacks"));
}

TEST_F(CheckMapCommandTest, WarnsOfImagesThatCannotBeTried) {
  SQLite::Database(Path("capture/features.db"), SQLite::OPEN_READWRITE)
      .exec("DELETE FROM keypoints WHERE image_id = 3");
  const Ran ran = Run({"--queries", Path("capture/queries.txt")});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.said, HasSubstr("not tried: 2.png: "));
  ASSERT_EQ(ran.report.rejected.size(), 1U);
  EXPECT_EQ(ran.report.rejected[0].names, (std::vector<std::string>{"2.png"}));
  EXPECT_THAT(ran.report.out, ElementsAre(Pair("localized", 3)));
}

TEST_F(CheckMapCommandTest, RefusesWhatNothingReads) {
  EXPECT_EQ(Refusal({}), "");
  EXPECT_THAT(Refusal({"--capture", Path("capture")}),
              HasSubstr("is used for the images of --queries or --left-out only"));
  EXPECT_THAT(Refusal({"--left-out", Path("runs")}), HasSubstr("give --capture, which has the images"));
  EXPECT_THAT(Refusal({"--scans", Path("scans.log")}), HasSubstr("was taken with held-out image i"));
  EXPECT_THAT(Refusal({"--scans", Path("scans.log"), "--queries", Path("capture/queries.txt")}),
              HasSubstr("has no floor plan to locate them in"));
  EXPECT_THAT(Refusal({"--min-localized-ratio", "0.5"}), HasSubstr("is a gate for held-out images"));
  EXPECT_THAT(Refusal({"--queries", Path("capture/queries.txt"), "--scan-x-m", "0.5"}),
              HasSubstr("is the pose of the laser of --scans"));
  EXPECT_EQ(Refusal({"--queries", Path("capture/queries.txt"), "--min-localized-ratio", "0.5"}), "");
  EXPECT_EQ(Refusal({"-o", Path("sealed.cairn"), "--min-region-held-out", "4"}), "");
}

}  // namespace
}  // namespace cairn::check_map
