// What poses are refused for: each limit, and what is said of it.
#include <limits>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "runtime/localize/accept.h"
#include "runtime/localize/measurement.h"

namespace cairn {
namespace {

// An image of 600 x 300 px, in which cells of the spread are 100 x 50 px, with an inlier at each pixel.
class JudgePoseTest : public testing::Test {
 protected:
  JudgePoseTest() {
    query_.camera.width = 600;
    query_.camera.height = 300;
    options_.min_num_inliers = 5;
    options_.min_num_cells = 4;
    options_.spread_grid = 6;
    pose_.covariance = 1e-6 * Matrix6d::Identity();
    SetPixels({{50, 25}, {150, 25}, {250, 25}, {350, 25}, {450, 25}});
  }

  void SetPixels(const std::vector<Eigen::Vector2f>& pixels) {
    query_.features.keypoints.clear();
    inliers_.clear();
    for (const Eigen::Vector2f& pixel : pixels) {
      inliers_.push_back({.keypoint = static_cast<KeypointIdx>(query_.features.keypoints.size())});
      query_.features.keypoints.push_back({.x = pixel.x(), .y = pixel.y()});
    }
  }

  Verdict Judge(double distance_from_survey_m = 0) const {
    return JudgePose(pose_, inliers_, query_, distance_from_survey_m, options_, "m");
  }

  Query query_;
  PooledVector<Correspondence> inliers_;
  RefinedPose pose_;
  AcceptOptions options_;
};

TEST_F(JudgePoseTest, InliersAreCounted) {
  EXPECT_EQ(Judge().reason, NoFix::kNone);
  EXPECT_EQ(Judge().message, "");
  inliers_.pop_back();
  EXPECT_EQ(Judge().reason, NoFix::kTooFewInliers);
  EXPECT_EQ(Judge().message, "4 inliers, at least 5 are needed");
}

TEST_F(JudgePoseTest, InliersSpreadOverCells) {
  SetPixels({{50, 25}, {150, 25}, {250, 25}, {350, 25}, {351, 26}});
  EXPECT_EQ(Judge().reason, NoFix::kNone);
  SetPixels({{50, 25}, {150, 25}, {250, 25}, {251, 25}, {250, 26}});
  EXPECT_EQ(Judge().reason, NoFix::kPoorSpread);
  EXPECT_EQ(Judge().message, "inliers in 3 cells of the image, at least 4 are needed");
}

TEST_F(JudgePoseTest, CellsEndWhereTheNextOnesBegin) {
  // Each pair of pixels has the edge of two cells between them.
  for (const auto& [a, b] : std::vector<std::pair<Eigen::Vector2f, Eigen::Vector2f>>{
           {{99, 25}, {100, 25}}, {{499, 25}, {500, 25}}, {{50, 49}, {50, 50}}, {{50, 249}, {50, 250}}}) {
    options_.min_num_cells = 2;
    SetPixels({a, b, a, b, a});
    EXPECT_EQ(Judge().reason, NoFix::kNone) << a.transpose();
    SetPixels({a, a, a, a, a});
    EXPECT_EQ(Judge().reason, NoFix::kPoorSpread) << a.transpose();
  }
  // Outside there are no others.
  SetPixels({{-500, 25}, {0, -300}, {99, 49}, {-1, -1}, {1, 1}});
  EXPECT_EQ(Judge().message, "inliers in 1 cells of the image, at least 2 are needed");
  SetPixels({{600, 300}, {9000, 300}, {601, 9000}, {600, 301}, {650, 300}});
  EXPECT_EQ(Judge().message, "inliers in 1 cells of the image, at least 2 are needed");
}

TEST_F(JudgePoseTest, CellsOfEachImageOfARigCount) {
  SetPixels({{50, 25}, {150, 25}});
  const std::vector<Query> images(2, query_);
  const PooledVector<Correspondence> inliers = {{.keypoint = 0},
                                                {.keypoint = 1},
                                                {.keypoint = 0, .image = 1},
                                                {.keypoint = 1, .image = 1},
                                                {.keypoint = 1, .image = 1}};
  const Sighting rig{std::span<const Query>(images)};
  EXPECT_EQ(JudgePose(pose_, inliers, rig, 0, options_, "m").reason, NoFix::kNone);
  options_.min_num_cells = 5;
  EXPECT_EQ(JudgePose(pose_, inliers, rig, 0, options_, "m").message,
            "inliers in 4 cells of the image, at least 5 are needed");
}

TEST_F(JudgePoseTest, PlaceAndRotationAreCertainInTheWorstDirection) {
  options_.max_sigma_m = 0.5;
  options_.max_sigma_deg = 5;
  pose_.covariance.diagonal() << 0, RadFromDeg(5) * RadFromDeg(5) * (1 - 1e-9), 0, 0, 0, 0.25;
  EXPECT_EQ(Judge().reason, NoFix::kNone);
  pose_.covariance(5, 5) = 0.36;
  EXPECT_EQ(Judge().reason, NoFix::kUncertain);
  EXPECT_EQ(Judge().message, "standard deviation 0.600 m and 5.00 degrees, at most 0.5 and 5 are allowed");
  pose_.covariance(5, 5) = 0;
  pose_.covariance(1, 1) = RadFromDeg(6) * RadFromDeg(6);
  EXPECT_EQ(Judge().reason, NoFix::kUncertain);
  for (const int i : {0, 3}) {
    pose_.covariance = Matrix6d::Zero();
    pose_.covariance(i, i) = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(Judge().reason, NoFix::kUncertain);
  }
}

TEST_F(JudgePoseTest, UpIsWhereItWasSensed) {
  const auto sense = [&](double angle_rad) {
    query_.up = UpMeasurement{.in_rig = {std::sin(angle_rad), 0, std::cos(angle_rad)},
                              .in_world = Eigen::Vector3d::UnitZ(),
                              .sigma_rad = RadFromDeg(2)};
  };
  options_.max_up_sigmas = 4;
  sense(RadFromDeg(7.9));
  EXPECT_EQ(Judge().reason, NoFix::kNone);
  sense(RadFromDeg(8.5));
  EXPECT_EQ(Judge().reason, NoFix::kTilted);
  EXPECT_TRUE(
      Judge().message.starts_with("up is 8.5 degrees off the sensed one, at most 8.0 are allowed; if"))
      << Judge().message;
  query_.up.reset();
  EXPECT_EQ(Judge().reason, NoFix::kNone);
}

TEST_F(JudgePoseTest, TheSurveyIsNear) {
  options_.max_distance_from_survey_m = 3;
  EXPECT_EQ(Judge(3).reason, NoFix::kNone);
  EXPECT_EQ(Judge(3.26).reason, NoFix::kFarFromSurvey);
  EXPECT_EQ(Judge(3.26).message, "3.3 m from the nearest survey image, at most 3 are allowed");
  options_.max_distance_from_survey_m = 0.5;
  EXPECT_EQ(Judge(0.6).reason, NoFix::kFarFromSurvey);
  options_.max_distance_from_survey_m = 0;
  EXPECT_EQ(Judge(1000).reason, NoFix::kNone);
}

TEST(AreFarApart, ByPlaceOrByAngle) {
  const AcceptOptions accept{.second_pose_distance_m = 0.5, .second_pose_angle_deg = 15};
  const auto turned = [](double angle_deg) {
    return Pose{Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(angle_deg), Eigen::Vector3d::UnitX())),
                {0, 0, 0}};
  };
  const Pose here;
  EXPECT_FALSE(AreFarApart(here, here, accept));
  EXPECT_FALSE(AreFarApart(here, {Eigen::Quaterniond::Identity(), {0, 0.5, 0}}, accept));
  EXPECT_TRUE(AreFarApart(here, {Eigen::Quaterniond::Identity(), {0, 0.51, 0}}, accept));
  EXPECT_FALSE(AreFarApart(here, turned(14.9), accept));
  EXPECT_TRUE(AreFarApart(here, turned(15.1), accept));
}

TEST(Ambiguous, SharesProbabilityByOdds) {
  Localization before;
  before.possible_probabilities = {1};
  before.num_matches = 7;
  // 3 / (1 + 3 + 5 + 1), 5 / 10
  const Localization found = Ambiguous(before, {Pose(), Pose()}, {3, 5}, 1, "why");
  EXPECT_EQ(found.reason, NoFix::kAmbiguous);
  EXPECT_EQ(found.message, "why");
  EXPECT_EQ(found.num_matches, 7);
  EXPECT_EQ(found.possible_poses.size(), size_t{2});
  ASSERT_EQ(found.possible_probabilities.size(), size_t{2});
  EXPECT_DOUBLE_EQ(found.possible_probabilities[0], 0.3);
  EXPECT_DOUBLE_EQ(found.possible_probabilities[1], 0.5);
  EXPECT_DOUBLE_EQ(found.probability, 0.8);
}

// What BetterOf compares: how far each came, and what it found.
Localization Found(NoFix reason, int num_matches, int num_inliers, double x_m = 0) {
  Localization found;
  found.reason = reason;
  found.num_matches = num_matches;
  found.num_inliers = found.num_unguided_inliers = num_inliers;
  found.cam_from_world.translation.x() = -x_m;
  if (found.has_fix()) found.probability = 0.9;
  return found;
}

TEST(BetterOf, TwoThatSayNothing) {
  const AcceptOptions accept;
  const Localization first = Found(NoFix::kTooFewMatches, 5, 4), fewer = Found(NoFix::kNoPose, 9, 3),
                     more_matches = Found(NoFix::kNoPose, 6, 4), as_many = Found(NoFix::kNoPose, 5, 4);
  EXPECT_EQ(BetterOf(first, fewer, accept).reason, NoFix::kTooFewMatches);
  EXPECT_EQ(BetterOf(fewer, first, accept).reason, NoFix::kTooFewMatches);
  EXPECT_EQ(BetterOf(first, more_matches, accept).num_matches, 6);
  EXPECT_EQ(BetterOf(more_matches, first, accept).num_matches, 6);
  EXPECT_EQ(BetterOf(first, as_many, accept).reason, NoFix::kNoPose) << "the later one";
}

TEST(BetterOf, AFixIsBetterThanNone) {
  const AcceptOptions accept;
  const Localization none = Found(NoFix::kNoPose, 90, 80), fix = Found(NoFix::kNone, 9, 8);
  EXPECT_TRUE(BetterOf(none, fix, accept).has_fix());
  EXPECT_TRUE(BetterOf(fix, none, accept).has_fix());
}

TEST(BetterOf, AFixAmongAllLandmarksDecidesForOneOfSeveralPlaces) {
  const AcceptOptions accept;
  const Localization ambiguous =
      DecideAmong({Found(NoFix::kNone, 40, 40), Found(NoFix::kNone, 40, 40, 5)}, 1, accept);
  ASSERT_EQ(ambiguous.reason, NoFix::kAmbiguous);
  Localization fix = Found(NoFix::kNone, 40, 40, 5);
  fix.scope = Scope::kAll;
  EXPECT_TRUE(BetterOf(ambiguous, fix, accept).has_fix());
  EXPECT_EQ(BetterOf(fix, ambiguous, accept).reason, NoFix::kAmbiguous) << "the landmarks of the second";
  fix.scope = Scope::kImages;
  EXPECT_EQ(BetterOf(ambiguous, fix, accept).reason, NoFix::kAmbiguous);
  // Of two fixes at one place the one with more.
  EXPECT_EQ(BetterOf(Found(NoFix::kNone, 9, 8), Found(NoFix::kNone, 20, 18), accept).num_matches, 20);
}

TEST(NoFixName, EachHasItsOwn) {
  std::set<std::string> names;
  for (int reason = 0; reason <= static_cast<int>(NoFix::kOverBudget); ++reason)
    names.insert(NoFixName(static_cast<NoFix>(reason)));
  EXPECT_EQ(names.size(), static_cast<size_t>(NoFix::kOverBudget) + 1);
  EXPECT_STREQ(NoFixName(NoFix::kPoorSpread), "poor_spread");
}

// Measurements that show where their landmarks are, in an image of 100 x 100 px with a focal length of 64 px.
PooledVector<PoseMeasurement> SeenAt(const std::vector<double>& columns_px, int image = 0) {
  PooledVector<PoseMeasurement> measurements;
  for (const double column : columns_px) {
    PoseMeasurement measurement;
    measurement.ray.ray = {column / 64, 0};
    measurement.ray.pixel_from_ray = 64 * Eigen::Matrix2d::Identity();
    measurement.point = 2 * measurement.ray.ray.homogeneous();
    measurement.image = image;
    measurements.push_back(measurement);
  }
  return measurements;
}

Query HundredPixels() {
  Query query;
  query.camera.width = query.camera.height = 100;
  return query;
}

TEST(ChanceOfInlier, IsTheShareOfPairsThatAreClose) {
  // Of six pairs, (0, 8) and (8, 0) are 8 px apart.
  const Query query = HundredPixels();
  EXPECT_DOUBLE_EQ(ChanceOfInlier(SeenAt({0, 8, 40}), Pose(), 8, query), 2.0 / 6);
  const double disc = M_PI * 7 * 7 / (100 * 100);
  EXPECT_DOUBLE_EQ(ChanceOfInlier(SeenAt({0, 8, 40}), Pose(), 7, query), disc);
  EXPECT_DOUBLE_EQ(ChanceOfInlier(SeenAt({0, 1}), Pose(), 90, query), 1) << "no more than certain";
  // What is behind the camera is no landmark that could be hit.
  auto behind = SeenAt({0, 8, 40, 1});
  behind[3].point = -behind[3].point;
  EXPECT_DOUBLE_EQ(ChanceOfInlier(behind, Pose(), 8, query), 2.0 / 6);
}

TEST(ChanceOfInlier, KeypointsMeetLandmarksOfTheirImageOnly) {
  const std::vector<Query> images(2, HundredPixels());
  const Sighting rig{std::span<const Query>(images)};
  auto measurements = SeenAt({0, 8, 40});
  const auto others = SeenAt({0, 1}, 1);
  measurements.insert(measurements.end(), others.begin(), others.end());
  // Six pairs in the first image, two in the second one.
  EXPECT_DOUBLE_EQ(ChanceOfInlier(measurements, Pose(), 8, rig), 4.0 / 8);
  // The disc is of one image.
  EXPECT_DOUBLE_EQ(ChanceOfInlier(SeenAt({0, 40}), Pose(), 8, rig), M_PI * 64 / (100 * 100));
}

TEST(ChanceOfInlier, OfManyMatchesSomeAreLookedAt) {
  // Every second one alone: they are 8 px apart and more, and between them all crowd at one place.
  std::vector<double> columns_px;
  for (int i = 0; i < 400; ++i) columns_px.push_back(i % 2 == 0 ? 4000 + 8 * i : 0);
  const Query query = HundredPixels();
  const double disc = M_PI * 5 * 5 / (100 * 100);
  EXPECT_DOUBLE_EQ(ChanceOfInlier(SeenAt(columns_px), Pose(), 5, query), disc);
  columns_px.pop_back();  // 399: all
  EXPECT_NEAR(ChanceOfInlier(SeenAt(columns_px), Pose(), 5, query), 199.0 * 198 / (399.0 * 398), 1e-12);
}

TEST(Log10ChancePoses, TwoMatchesDetermineAPoseWhereUpIsKnown) {
  // C(10, 2) = 45, C(8, 4) = 70
  EXPECT_NEAR(Log10ChancePoses(10, 6, 1e-2, 2), std::log10(45 * 70 * 1e-8), 1e-9);
  EXPECT_GT(Log10ChancePoses(10, 2, 1e-2, 2), 1e9);
  EXPECT_LT(Log10ChancePoses(10, 3, 1e-2, 2), 1e9);
}

}  // namespace
}  // namespace cairn
