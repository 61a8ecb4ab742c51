#include <cmath>
#include <filesystem>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/quantiles.h"
#include "core/colmap/colmap_database.h"
#include "core/files/database.h"
#include "runtime/localize/refine.h"
#include "stages/check_map/check_map.h"
#include "tests/recorded_progress.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn::check_map {
namespace {

using testing::HasSubstr;

constexpr int kNumViews = 12;

// Views of a room as features in a database, and one of noise, which is no view of it.  True poses of the
// last three are stated wrongly: two by a metre, one by 20 degrees.
class FiguresTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    room_ = new SyntheticRoom(MakeSyntheticRoom(1));
    room_->rows.stated_pose_sigma_m = 0.02;
    room_->rows.stated_pose_sigma_deg = 0.5;
    map_ = new std::shared_ptr<const Map>(*Map::FromRows(room_->rows));
    images_ = new std::vector<HeldOutImage>(MakeImages());
    report_ = new CheckMapReport(Check({}));
  }
  static void TearDownTestSuite() {
    delete report_;
    delete images_;
    delete map_;
    delete room_;
  }

  static std::vector<HeldOutImage> MakeImages() {
    const std::string path = testing::TempDir() + "/check_map_figures_test.db";
    std::filesystem::remove(path);
    std::vector<HeldOutImage> images;
    Random random(4);
    EXPECT_TRUE(WriteDatabase(path, kColmapSchema, [&](SQLite::Database& database) -> Status {
                  WriteDatabaseCamera(database, room_->camera);
                  for (int i = 0; i <= kNumViews; ++i) {
                    const auto image_id = static_cast<ImageId>(i + 1);
                    const std::string name = fmt::format("{}.png", i);
                    // A place from which the room is recognised.
                    Pose pose;
                    Features features;
                    bool is_found = false;
                    for (int seed = 100 * i; !is_found && seed < 100 * i + 99; ++seed) {
                      pose = RandomPose(random);
                      features = RenderFeatures(*room_, pose, {}, seed);
                      is_found = Localizer(*map_, {}).LocalizeFeatures(features, room_->camera)->has_fix();
                    }
                    EXPECT_TRUE(is_found) << i;
                    if (i == kNumViews)
                      for (Eigen::Index k = 0; k < features.descriptors.rows(); ++k)
                        features.descriptors.row(k) = RandomDescriptor(random);
                    WriteDatabaseImage(database, {image_id, name, 1});
                    WriteDatabaseFeatures(database, image_id, features);
                    HeldOutImage image{.name = name, .camera = room_->camera, .cam_from_world = pose};
                    if (i == 9 || i == 10) image.cam_from_world->translation.x() += 1;
                    if (i == 11) {
                      image.cam_from_world =
                          Pose{
                              Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(20), Eigen::Vector3d::UnitY())),
                              Eigen::Vector3d::Zero()} *
                          pose;
                    }
                    image.features = FeaturesRow{.path = path, .image_id = image_id, .camera = room_->camera};
                    images.push_back(std::move(image));
                  }
                  return Ok();
                }).ok());
    return images;
  }
  static CheckMapReport Check(const CheckMapOptions& options) {
    RecordedProgress progress;
    auto report = CheckMap(*map_, *images_, options, 1, progress);
    EXPECT_TRUE(report.ok()) << report.error().message;
    progress.ExpectAllDone();
    return std::move(*report);
  }
  static double Figure(const std::string& name) { return report_->figures.at(name); }

  static SyntheticRoom* room_;
  static std::shared_ptr<const Map>* map_;
  static std::vector<HeldOutImage>* images_;
  static CheckMapReport* report_;
};
SyntheticRoom* FiguresTest::room_ = nullptr;
std::shared_ptr<const Map>* FiguresTest::map_ = nullptr;
std::vector<HeldOutImage>* FiguresTest::images_ = nullptr;
CheckMapReport* FiguresTest::report_ = nullptr;

TEST_F(FiguresTest, AllViewsOfTheRoomAreFoundAndWhatIsNoneIsNot) {
  EXPECT_EQ(Figure("num_held_out"), 13);
  EXPECT_EQ(Figure("num_localized"), 12);
  EXPECT_DOUBLE_EQ(Figure("localized_ratio"), 12.0 / 13);
  EXPECT_EQ(Figure("num_gross_errors"), 3);
  EXPECT_DOUBLE_EQ(Figure("precision_ratio"), 0.75);
  EXPECT_FALSE(report_->images.back().has_fix());
  // Fixes are within centimetres of the truth.
  EXPECT_DOUBLE_EQ(Figure("within_10cm_5deg_ratio"), 9.0 / 13);
  EXPECT_GT(report_->mean_total_ms, report_->mean_sift_ms);
}

TEST_F(FiguresTest, ErrorsAreDistancesOfCentresAndAngles) {
  for (const int i : {9, 10}) {
    EXPECT_NEAR(report_->images[i].error_m, 1, 0.1);
    EXPECT_LT(report_->images[i].error_deg, 2);
  }
  EXPECT_NEAR(report_->images[11].error_deg, 20, 1);
  std::vector<double> errors_m, errors_deg, nees, probabilities;
  int within_5cm_5deg = 0, within_10cm_2deg = 0, num_certain = 0, num_certain_wrong = 0;
  for (int i = 0; i < kNumViews; ++i) {
    const HeldOutResult& image = report_->images[i];
    const Pose& found = image.localization.cam_from_world;
    EXPECT_DOUBLE_EQ(image.error_m, CenterErrorM(found, *(*images_)[i].cam_from_world));
    EXPECT_DOUBLE_EQ(image.error_deg, RotationErrorDeg(found, *(*images_)[i].cam_from_world));
    errors_m.push_back(image.error_m);
    errors_deg.push_back(image.error_deg);
    nees.push_back(image.nees);
    probabilities.push_back(image.localization.probability);
    within_5cm_5deg += image.error_m <= 0.05 && image.error_deg <= 5;
    within_10cm_2deg += image.error_m <= 0.1 && image.error_deg <= 2;
    num_certain += probabilities.back() >= 0.99;
    num_certain_wrong += probabilities.back() >= 0.99 && i >= 9;
  }
  EXPECT_EQ(Figure("median_error_m"), Quantile(errors_m, 0.5));
  EXPECT_EQ(Figure("p90_error_m"), Quantile(errors_m, 0.9));
  EXPECT_EQ(Figure("median_error_deg"), Quantile(errors_deg, 0.5));
  EXPECT_EQ(Figure("p90_error_deg"), Quantile(errors_deg, 0.9));
  EXPECT_EQ(Figure("median_nees"), Quantile(nees, 0.5));
  EXPECT_NEAR(Figure("mean_nees"), std::accumulate(nees.begin(), nees.end(), 0.0) / kNumViews, 1e-9);
  EXPECT_NEAR(Figure("mean_probability"),
              std::accumulate(probabilities.begin(), probabilities.end(), 0.0) / kNumViews, 1e-9);
  EXPECT_DOUBLE_EQ(Figure("within_5cm_5deg_ratio"), within_5cm_5deg / 13.0);
  EXPECT_DOUBLE_EQ(Figure("within_10cm_2deg_ratio"), within_10cm_2deg / 13.0);
  EXPECT_EQ(Figure("num_nearly_certain"), num_certain);
  EXPECT_EQ(Figure("num_nearly_certain_gross_errors"), num_certain_wrong);
  // The mean of 12 values of variance 12 has variance 1.
  EXPECT_DOUBLE_EQ(Figure("nees_low"), 6 - 1.96);
  EXPECT_DOUBLE_EQ(Figure("nees_high"), 6 + 1.96);
}

// The squared error over its variance: the fix's own, and that of the truth.
double Nees(const HeldOutResult& image, double truth_sigma_m, double truth_sigma_deg, bool with_scale) {
  const Vector6d error = PerturbationBetween(image.localization.cam_from_world, *image.true_cam_from_world);
  Matrix6d covariance = image.localization.covariance;
  if (with_scale) {
    covariance.bottomRightCorner<3, 3>() -=
        image.localization.scale_sigma_m * image.localization.scale_sigma_m.transpose();
  }
  const double truth_sigma_rad = RadFromDeg(truth_sigma_deg);
  for (int k = 0; k < 6; ++k)
    covariance(k, k) += k < 3 ? truth_sigma_rad * truth_sigma_rad : truth_sigma_m * truth_sigma_m;
  return error.dot(covariance.ldlt().solve(error));
}

TEST_F(FiguresTest, NormalisedErrorsCountHowWellTheTruthIsKnown) {
  const CheckMapReport stated = Check({.truth_sigma_m = 0.1, .truth_sigma_deg = 2}),
                       exact = Check({.truth_sigma_m = 0, .truth_sigma_deg = 0});
  for (int i = 0; i < kNumViews; ++i) {
    const auto expect = [&](const CheckMapReport& report, double sigma_m, double sigma_deg) {
      const double expected = Nees(report.images[i], sigma_m, sigma_deg, true);
      EXPECT_NEAR(report.images[i].nees, expected, 1e-6 * expected);
    };
    expect(*report_, 0.02, 0.5);  // as the survey's poses err
    expect(stated, 0.1, 2);
    expect(exact, 0, 0);
  }
}

TEST_F(FiguresTest, AFitOfTheFramesLeavesTheErrorsOfFixesThatAgree) {
  EXPECT_NEAR(Figure("similarity_scale"), 1, 0.02);
  EXPECT_LT(Figure("similarity_median_error_m"), 0.1);
  EXPECT_LE(Figure("similarity_median_error_m"), Figure("similarity_p90_error_m"));
  EXPECT_LE(Figure("similarity_median_error_deg"), Figure("similarity_p90_error_deg"));
  EXPECT_GT(Figure("similarity_p90_error_m"), 0.5);  // two of twelve are a metre off
  EXPECT_LT(Figure("rig_offset_m"), 0.2);
  EXPECT_LT(Figure("rig_offset_deg"), 5);
}

TEST_F(FiguresTest, ImagesWithoutATruePoseHaveNoErrors) {
  std::vector<HeldOutImage> images = *images_;
  for (HeldOutImage& image : images) image.cam_from_world.reset();
  NoProgress progress;
  const auto report = CheckMap(*map_, images, {}, 1, progress);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->figures.at("num_localized"), 12);
  EXPECT_FALSE(report->figures.contains("similarity_scale"));
  for (const HeldOutResult& image : report->images) EXPECT_EQ(image.error_m, 0);
}

TEST_F(FiguresTest, OfASparseMapCountWhatRetrievalFinds) {
  CheckMapReport sparse, full;
  sparse.images.resize(3);
  full.images.resize(3);
  for (HeldOutResult& image : full.images) {
    image.localization.reason = NoFix::kNone;
    image.localization.scope = Scope::kImages;
  }
  full.images[0].localization.scope = Scope::kAll;
  full.images[1].localization.reason = NoFix::kTooFewMatches;
  full.figures = {{"num_localized", 2}, {"localized_ratio", 0.5}};
  AddFullFigures(full, &sparse);
  EXPECT_EQ(sparse.figures, (std::map<std::string, double>{{"num_by_retrieval", 0},
                                                           {"all_images_num_by_retrieval", 1},
                                                           {"all_images_num_localized", 2},
                                                           {"all_images_localized_ratio", 0.5}}));
}

TEST_F(FiguresTest, TheGateAsksForTheRatiosItIsGiven) {
  const auto message = [&](double localized, double precision) {
    const Status status =
        CheckGate(*report_, {.min_localized_ratio = localized, .min_precision_ratio = precision});
    return status.ok() ? "" : status.error().message;
  };
  EXPECT_EQ(message(0.92, 0.75), "");
  EXPECT_EQ(message(0.93, 0), "below the gate: localized_ratio is 0.923, at least 0.930 is required");
  EXPECT_EQ(message(0, 0.76), "below the gate: precision_ratio is 0.750, at least 0.760 is required");
  CheckMapReport none;
  none.why_none = "too short";
  EXPECT_THAT(CheckGate(none, {.min_localized_ratio = 0.5}).error().message,
              HasSubstr("at least 0.500 is required, but there are no held-out images and no left-out runs: "
                        "too short;"));
  // A ratio that is asked for and was not measured is not reached.
  none.images.resize(1);
  EXPECT_THAT(CheckGate(none, {.min_precision_ratio = 0.5}).error().message,
              HasSubstr("precision_ratio is 0.000"));
}

TEST_F(FiguresTest, CanBeStopped) {
  RecordedProgress progress("localizing");
  const auto report = CheckMap(*map_, *images_, {}, 1, progress);
  ASSERT_FALSE(report.ok());
  EXPECT_EQ(report.error().code, ErrorCode::kCancelled);
  EXPECT_EQ(progress.tasks[0].num_done, 0);
}

}  // namespace
}  // namespace cairn::check_map
