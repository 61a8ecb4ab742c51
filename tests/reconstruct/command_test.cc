#include "stages/reconstruct/command.h"

#include <filesystem>
#include <fstream>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/colmap/colmap_database.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "stages/reconstruct/reconstruct.h"
#include "stages/reconstruct/verdict/verdict_text.h"
#include "tests/ran_command.h"
#include "tests/reconstruct/synthetic_survey.h"

namespace cairn::reconstruct {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Pair;
using testing::StartsWith;

namespace fs = std::filesystem;

// A capture of ten images without files, in a database with their matches.
class ReconstructCommandTest : public CommandTest {
 protected:
  void SetUp() override {
    fs::create_directories(folder_ / "capture");
    const Status status =
        WriteDatabase(Path("matches.db"), kColmapSchema, [&](SQLite::Database& database) -> Status {
          for (const auto& [camera_id, camera] : survey_.input.cameras) WriteDatabaseCamera(database, camera);
          for (size_t i = 0; i < survey_.input.images.size(); ++i) {
            Features features;
            features.keypoints.assign(survey_.input.keypoints[i].begin(), survey_.input.keypoints[i].end());
            features.descriptors.resize(std::ssize(features.keypoints), kSiftDescriptorDim);
            features.descriptors.setZero();
            WriteDatabaseImage(database, survey_.input.images[i]);
            WriteDatabaseFeatures(database, survey_.input.images[i].image_id, features);
          }
          for (const TwoViewGeometry& geometry : survey_.input.geometries)
            WriteDatabaseTwoViewGeometry(database, geometry);
          return Ok();
        });
    ASSERT_TRUE(status.ok()) << status.error().message;
    fs::copy_file(Path("matches.db"), Path("capture/features.db"));
  }
  // Every image's true place; that of the fourth is ten metres too high.
  void WriteControlPoints() const {
    std::ofstream file(Path("capture/points.txt"));
    for (size_t i = 0; i < survey_.input.images.size(); ++i) {
      const Eigen::Vector3d centre = survey_.cams_from_world[i].Center();
      file << fmt::format("{} {} {} {}\n", survey_.input.images[i].name, centre.x(), centre.y(),
                          centre.z() + (i == 3 ? 10 : 0));
    }
  }
  // reconstruct matches.db --capture CAPTURE -o poses WORDS...
  Ran Run(const std::vector<std::string>& more) const {
    return RunWords(
        ReconstructCommand(),
        {Path("matches.db"), "--capture", Path("capture"), "-o", Path("poses"), "--mapper", "global"}, more);
  }
  ReconstructResult Reconstructed(ReconstructOptions options) const {
    options.mapper.mapper = "global";
    fs::create_directories(folder_ / "work");
    NoProgress progress;
    auto result = Reconstruct(*ReadMapperInput(Path("matches.db")), *ReadCapture(Path("capture")), options,
                              Path("work"), 1, progress);
    EXPECT_TRUE(result.ok()) << result.error().message;
    return std::move(*result);
  }

  const SyntheticSurvey survey_ = MakeSyntheticSurvey(10, 12);
};

TEST_F(ReconstructCommandTest, SaysWhatWasRegisteredAndHowWellItFitsWhatIsKnown) {
  WriteControlPoints();
  const ReconstructResult result = Reconstructed({.control_points = "points.txt", .hold_out_every = 5});
  double sum = 0, most = 0;
  for (const AlignmentResidual& residual : result.residuals) {
    sum += residual.residual_m;
    most = std::max(most, residual.residual_m);
  }
  ASSERT_EQ(result.residuals.size(), 10U);
  const Ran ran = Run({"--control-points", "points.txt", "--hold-out-every", "5"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  const Camera& camera = result.cameras.at(1);
  std::string expected = fmt::format(
      "reconstruct: 10 of 10 images registered (2 held out), {} points, error {:.2f} px, models of 10 "
      "images\n"
      "reconstruct: camera 1: {} {:.2f}\n"
      "reconstruct: scale from control_points (+- {:.1f} %), residual mean {:.3f} m, max {:.3f} m over 10; "
      "off: image03.jpg ({:.2f} m)\n",
      result.num_points, result.mean_error_px, CameraModelName(camera.model), fmt::join(camera.params, " "),
      result.frame.scale_sigma_ratio / 0.01, sum / 10, most, most);
  for (const ScaleFound& scale : result.scales) {
    expected += fmt::format("reconstruct: images' places span {:.4g} m (+- {:.1f} %) by {}\n", scale.span_m,
                            scale.sigma_ratio / 0.01, scale.told_by);
  }
  for (const std::string& line : VerdictLines(result.verdict)) expected += "reconstruct: " + line + "\n";
  EXPECT_EQ(ran.out, expected + "reconstruct: seen from above: " + Path("poses/reconstruction.svg") + "\n");
  EXPECT_THAT(ran.report.in, ElementsAre(Pair("images", 10)));
  EXPECT_THAT(ran.report.out, ElementsAre(Pair("images", 8), Pair("held out", 2),
                                          Pair("loops", std::ssize(result.verdict.loops))));

  const nlohmann::json json = nlohmann::json::parse(*ReadFile(Path("poses/reconstruction.json")));
  EXPECT_EQ(json["num_images"], 8);
  EXPECT_EQ(json["num_queries"], 2);
  EXPECT_EQ(json["model_sizes"], nlohmann::json({10}));
  EXPECT_EQ(json["scale_from"], "control_points");
  ASSERT_EQ(json["residuals"].size(), 10U);
  EXPECT_EQ(json["residuals"][3]["is_off"], true);
  EXPECT_FALSE(json.contains("sessions"));
}

TEST_F(ReconstructCommandTest, WritesACaptureWithPosesAndNothingElse) {
  const Ran ran = Run({"--scale-from", "none"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.out, HasSubstr("reconstruct: no scale: the unit is arbitrary\n"));
  EXPECT_THAT(ran.out, Not(HasSubstr("residual mean")));
  std::set<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(Path("poses")))
    names.insert(entry.path().filename());
  EXPECT_THAT(names, ElementsAre(".cairn-folder", "cameras.txt", "features.db", "frame.json", "images",
                                 "images.txt", "reconstruction.json", "reconstruction.svg"));
  EXPECT_TRUE(fs::is_symlink(Path("poses/features.db")));
  const Result<Capture> poses = ReadCapture(Path("poses"));
  ASSERT_TRUE(poses.ok()) << poses.error().message;
  EXPECT_TRUE(poses->has_poses);
  EXPECT_EQ(poses->images.size(), 10U);
  EXPECT_TRUE(poses->frame->is_reconstructed);
}

TEST_F(ReconstructCommandTest, ImagesThatNothingJoinsAreRejectedWithAWarning) {
  SQLite::Database(Path("capture/features.db"), SQLite::OPEN_READWRITE)
      .exec("INSERT INTO images(image_id, name, camera_id) VALUES (77, 'lonely.jpg', 1)");
  fs::copy_file(Path("capture/features.db"), Path("matches.db"), fs::copy_options::overwrite_existing);
  const Ran ran = Run({"--scale-from", "none"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.out, StartsWith("reconstruct: 10 of 11 images registered (0 held out), "));
  EXPECT_THAT(ran.said, HasSubstr("rejected lonely.jpg: "));
  EXPECT_THAT(ran.report.in, ElementsAre(Pair("images", 11)));
  ASSERT_EQ(ran.report.rejected.size(), 1U);
}

}  // namespace
}  // namespace cairn::reconstruct
