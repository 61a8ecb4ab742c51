#include "stages/emit_map/learn_fix_noise.h"

#include <cmath>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "core/base/random.h"
#include "runtime/localize/refine.h"

namespace cairn::emit_map {
namespace {

constexpr double kNineOfTen = 10.645;  // of chi-square with 6 degrees of freedom
constexpr double kSpacingM = 0.1;

// How keypoints err: each by itself, px; and all of an image's together, sheared by so much between its
// middle and its edge, as a rolling shutter does, px.
struct Errors {
  double own_px = 1;
  double shear_px = 0;
};

// Images in a row before 400 points, 3 to 6 m ahead.  #: an image, all look up.
//
//      .  . .    .  . .  .
//        .  . .  .   .  .
//       # # # # # # # # #      0.1 m apart
struct SurveyRow {
  Classes classes;
  MapRows rows;
};

Pose PoseOf(double place_m) { return {Eigen::Quaterniond::Identity(), {-place_m, 0, 0}}; }

std::vector<std::optional<Keypoint>> See(const std::vector<Eigen::Vector3d>& points, const Camera& camera,
                                         const Pose& cam_from_world, const Errors& errors, Random& random) {
  const double shear = errors.shear_px * random.Normal(0, 1);
  std::vector<std::optional<Keypoint>> keypoints;
  for (const Eigen::Vector3d& point : points) {
    const auto pixel = ImageFromCamera(camera, cam_from_world * point);
    std::optional<Keypoint>& keypoint = keypoints.emplace_back();
    if (!pixel || !(pixel->x() > 0 && pixel->x() < 640 && pixel->y() > 0 && pixel->y() < 480)) continue;
    keypoint.emplace();
    keypoint->scale = 1;
    keypoint->x = static_cast<float>(pixel->x() + errors.own_px * random.Normal(0, 1) +
                                     shear * (pixel->y() - 240) / 240);
    keypoint->y = static_cast<float>(pixel->y() + errors.own_px * random.Normal(0, 1));
  }
  return keypoints;
}

SurveyRow MakeRow(int num_images, int num_points, const Errors& errors, uint64_t seed) {
  Random random(seed);
  SurveyRow row;
  row.rows.cameras = {{1, CameraModel::kSimplePinhole, 640, 480, {500, 320, 240}}};
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < num_points; ++i) {
    points.emplace_back(random.Uniform(-4, num_images * kSpacingM + 4), random.Uniform(-2.5, 2.5),
                        random.Uniform(3, 6));
    FeatureClass feature;
    feature.class_id = i + 1;
    feature.position = points.back();
    row.classes.classes.push_back(feature);
    MapLandmark landmark;
    landmark.class_id = i + 1;
    row.rows.landmarks.push_back(landmark);
  }
  for (int image = 0; image < num_images; ++image) {
    SurveyImage survey_image;
    survey_image.image_id = image + 1;
    survey_image.camera_id = 1;
    survey_image.cam_from_world = PoseOf(image * kSpacingM);
    row.classes.images.push_back(survey_image);
    const auto keypoints = See(points, row.rows.cameras[0], survey_image.cam_from_world, errors, random);
    for (int i = 0; i < num_points; ++i) {
      if (!keypoints[i]) continue;
      row.classes.classes[i].observations.push_back(
          {survey_image.image_id, static_cast<KeypointIdx>(i), *keypoints[i]});
    }
  }
  return row;
}

// Which part of new images, placed by points that are exact, lies within the nine-of-ten bound of the
// covariance.
double PartWithinBound(const SurveyRow& row, const Errors& errors, const RefineOptions& options,
                       uint64_t seed) {
  Random random(seed);
  std::vector<Eigen::Vector3d> points;
  for (const FeatureClass& feature : row.classes.classes) points.push_back(feature.position);
  constexpr int kNum = 300;
  int num_within = 0;
  for (int i = 0; i < kNum; ++i) {
    const Pose truth =
        PoseOf(random.Uniform(1, kSpacingM * static_cast<double>(row.classes.images.size()) - 1));
    PooledVector<PoseMeasurement> measurements;
    Features features;
    for (const auto& keypoint : See(points, row.rows.cameras[0], truth, errors, random))
      features.keypoints.push_back(keypoint ? *keypoint : Keypoint{});
    const Query query = MakeQuery(features, row.rows.cameras[0], {});
    for (size_t k = 0; k < points.size(); ++k) {
      if (features.keypoints[k].scale == 1)
        measurements.push_back({points[k], Eigen::Matrix3d::Zero(), *query.rays[k]});
    }
    const auto refined = RefinePoseWithCovariance(measurements, truth, options);
    if (!refined) continue;
    const Vector6d error = PerturbationBetween(refined->cam_from_world, truth);
    num_within += error.dot(refined->covariance.ldlt().solve(error)) < kNineOfTen ? 1 : 0;
  }
  return static_cast<double>(num_within) / kNum;
}

RefineOptions OptionsOf(const FixNoise& noise) {
  return {.covariance_scale = noise.covariance_scale, .keypoint_correlation = noise.keypoint_correlation};
}

// factor = 1.5 (1 + n / 2 * 0.02)
TEST(FitFixNoise, FindsTheLine) {
  const FixNoise noise = FitFixNoise({{20, 1.8}, {80, 2.7}, {320, 6.3}});
  EXPECT_DOUBLE_EQ(noise.covariance_scale, 1.5);
  EXPECT_DOUBLE_EQ(noise.keypoint_correlation, 0.02);
}

// Of factors that fall, their mean: (10 * 3 + 40 * 2) / 50 = 2.2.
TEST(FitFixNoise, FactorsThatFallAreTheirMeanByInliers) {
  const FixNoise noise = FitFixNoise({{10, 3}, {40, 2}});
  EXPECT_DOUBLE_EQ(noise.covariance_scale, 2.2);
  EXPECT_EQ(noise.keypoint_correlation, 0);
}

// Through (0, 1): slope = sum w x (y - 1) / sum w x^2 = (100 * -0.5 + 10000 * 2) / (1000 + 1000000) =
// 0.01993.
TEST(FitFixNoise, NoCovarianceBecomesNarrower) {
  const FixNoise noise = FitFixNoise({{10, 0.5}, {100, 3}});
  EXPECT_EQ(noise.covariance_scale, 1);
  EXPECT_DOUBLE_EQ(noise.keypoint_correlation, 0.03986);
  EXPECT_EQ(FitFixNoise({{50, 0.3}}).covariance_scale, 1);
  EXPECT_EQ(FitFixNoise({{50, 0.3}}).keypoint_correlation, 0);
}

TEST(FitFixNoise, OneNumberOfInliersGivesAScaleAndLimitsHold) {
  EXPECT_DOUBLE_EQ(FitFixNoise({{50, 2.3456}}).covariance_scale, 2.346);
  EXPECT_EQ(FitFixNoise({{50, 2.3456}}).keypoint_correlation, 0);
  EXPECT_EQ(FitFixNoise({{50, 1e9}}).covariance_scale, 1e5);
  EXPECT_EQ(FitFixNoise({{1, 2}, {2, 1000}}).keypoint_correlation, 1);
}

TEST(LearnFixNoise, IndependentKeypointsNeedNoWiderCovariance) {
  const SurveyRow row = MakeRow(120, 900, {}, 1);
  const auto noise = LearnFixNoise(row.classes, row.rows, 2);
  ASSERT_TRUE(noise);
  EXPECT_LT(noise->covariance_scale, 1.2);
  EXPECT_LT(noise->keypoint_correlation, 0.002);
}

TEST(LearnFixNoise, LandmarksAreWhereTheOtherImagesPutThem) {
  SurveyRow row = MakeRow(120, 900, {}, 1);
  for (FeatureClass& feature : row.classes.classes) feature.position += Eigen::Vector3d(0.02, -0.01, 0.03);
  const auto noise = LearnFixNoise(row.classes, row.rows, 2);
  ASSERT_TRUE(noise);
  EXPECT_LT(noise->covariance_scale, 1.3);
  EXPECT_LT(noise->keypoint_correlation, 0.005);
}

TEST(LearnFixNoise, NineOfTenNewImagesLieWithinTheirBoundWhereKeypointsErrTogether) {
  const Errors errors{.own_px = 1, .shear_px = 1.5};
  const SurveyRow row = MakeRow(240, 1500, errors, 2);
  const auto noise = LearnFixNoise(row.classes, row.rows, 2);
  ASSERT_TRUE(noise);
  EXPECT_LT(PartWithinBound(row, errors, {}, 3), 0.6);
  EXPECT_NEAR(PartWithinBound(row, errors, OptionsOf(*noise), 3), 0.9, 0.06);
}

TEST(LearnFixNoise, FewerKeypointsNeedLessWhereTheyErrTogether) {
  const Errors errors{.own_px = 1, .shear_px = 1.5};
  const auto noise =
      LearnFixNoise(MakeRow(240, 1500, errors, 2).classes, MakeRow(240, 1500, errors, 2).rows, 2);
  ASSERT_TRUE(noise);
  EXPECT_LT(noise->covariance_scale, 1.5);        // of few keypoints
  EXPECT_GT(noise->keypoint_correlation, 0.002);  // which grows by 1 with 1000 at least
}

TEST(LearnFixNoise, SameForAnyNumberOfThreads) {
  const SurveyRow row = MakeRow(60, 600, {.own_px = 1, .shear_px = 1}, 4);
  const auto one = LearnFixNoise(row.classes, row.rows, 1), three = LearnFixNoise(row.classes, row.rows, 3);
  ASSERT_TRUE(one && three);
  EXPECT_EQ(one->covariance_scale, three->covariance_scale);
  EXPECT_EQ(one->keypoint_correlation, three->keypoint_correlation);
}

TEST(LearnFixNoise, TwoRunsOrFewKeypointsSayNothing) {
  const SurveyRow three_runs = MakeRow(36, 900, {}, 5), two_runs = MakeRow(24, 900, {}, 5);
  EXPECT_TRUE(LearnFixNoise(three_runs.classes, three_runs.rows, 1));
  EXPECT_FALSE(LearnFixNoise(two_runs.classes, two_runs.rows, 1));
  const SurveyRow few_points = MakeRow(36, 60, {}, 5);
  EXPECT_FALSE(LearnFixNoise(few_points.classes, few_points.rows, 1));
  EXPECT_FALSE(LearnFixNoise({}, {}, 1));
}

}  // namespace
}  // namespace cairn::emit_map
