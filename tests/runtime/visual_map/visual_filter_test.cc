#include "runtime/visual_map/visual_filter.h"

#include <gtest/gtest.h>

#include "runtime/map/map.h"
#include "runtime/visual_map/visual_disagreement.h"
#include "stages/emit_map/model_landmarks.h"
#include "tests/runtime/visual_map/visual_room.h"

namespace cairn {
namespace {

struct SurveyedRoom {
  VisualRoom room;
  std::shared_ptr<const VisualMap> visual;

  SurveyedRoom() {
    room.rows.visual_map = *emit_map::ModelLandmarks(room.classes, room.rows, {}, 1);
    visual = *VisualMap::Load(**Map::FromRows(room.rows));
  }
};

const SurveyedRoom& FilterRoom() {
  static const SurveyedRoom surveyed;
  return surveyed;
}

double EntropyOf(const std::vector<double>& shares) {
  double entropy = 0;
  for (const double share : shares) entropy -= share > 0 ? share * std::log(share) : 0;
  return entropy;
}

Eigen::Vector2d MeanOf(const std::vector<double>& shares) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (size_t i = 0; i < shares.size(); ++i) mean += shares[i] * FilterRoom().visual->places()[i];
  return mean;
}

std::vector<SeenLandmark> FirstOf(std::vector<SeenLandmark> seen, size_t count) {
  seen.resize(std::min(seen.size(), count));
  return seen;
}

TEST(VisualFilter, StartsKnowingNothing) {
  const std::vector<double> belief = VisualFilter(FilterRoom().visual).AtPlaces();
  for (const double share : belief) EXPECT_NEAR(share, 1.0 / 63, 1e-12);
}

TEST(VisualFilter, DrivesAlongWithTheRobotAndGrowsUnsure) {
  VisualFilter filter(FilterRoom().visual);
  const Eigen::Vector2d start(2, 2);
  ASSERT_TRUE(filter.See(FilterRoom().room.SeenLandmarks(VisualRoom::PoseAt(start, 0))).ok());
  EXPECT_LT((MeanOf(filter.AtPlaces()) - start).norm(), 0.1);
  const double before = EntropyOf(filter.AtPlaces());
  // Half a metre ahead, looking along x; then a quarter turn and half a metre to what is now the right.
  ASSERT_TRUE(filter.Move({0.5, 0}, std::numbers::pi / 2).ok());
  EXPECT_LT((MeanOf(filter.AtPlaces()) - Eigen::Vector2d(2.5, 2)).norm(), 0.1);
  ASSERT_TRUE(filter.Move({0, -0.5}, 0).ok());
  EXPECT_LT((MeanOf(filter.AtPlaces()) - Eigen::Vector2d(3, 2)).norm(), 0.12);
  EXPECT_GT(EntropyOf(filter.AtPlaces()), before + 0.5);
}

TEST(VisualFilter, ViewsThatAloneDoNotTellDoSoTogether) {
  VisualFilter filter(FilterRoom().visual);
  Eigen::Vector2d at(1.75, 2);
  double first = 0;
  for (int step = 0; step < 6; ++step) {
    if (step > 0) {
      ASSERT_TRUE(filter.Move({0.25, 0}, 0).ok());
      at.x() += 0.25;
    }
    const auto seen = FirstOf(FilterRoom().room.SeenLandmarks(VisualRoom::PoseAt(at, 0)), 2);
    ASSERT_TRUE(filter.See(seen).ok());
    if (step == 0) first = EntropyOf(filter.AtPlaces());
  }
  EXPECT_LT(EntropyOf(filter.AtPlaces()), first);
  EXPECT_LT((MeanOf(filter.AtPlaces()) - at).norm(), 0.3);
}

TEST(VisualFilter, FindsARobotThatWasCarriedAway) {
  VisualFilter filter(FilterRoom().visual);
  for (int i = 0; i < 5; ++i)
    ASSERT_TRUE(filter.See(FilterRoom().room.SeenLandmarks(VisualRoom::PoseAt({1.6, 1.4}, 0))).ok());
  for (int i = 0; i < 2; ++i)
    ASSERT_TRUE(filter.See(FilterRoom().room.SeenLandmarks(VisualRoom::PoseAt({3.3, 2.6}, 3))).ok());
  EXPECT_LT((MeanOf(filter.AtPlaces()) - Eigen::Vector2d(3.3, 2.6)).norm(), 0.2);
}

TEST(VisualFilter, OdometryThatIsNoNumberIsAnError) {
  VisualFilter filter(FilterRoom().visual);
  EXPECT_EQ(filter.Move({std::nan(""), 0}, 0).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(filter.Move({0, 0}, std::nan("")).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(filter.Move({1e200, 0}, 0).error().code, ErrorCode::kInvalidArgument);  // its square is infinite
  ASSERT_TRUE(filter.Move({1000, 0}, 0).ok());  // out of the survey: nothing is known again
  for (const double share : filter.AtPlaces()) EXPECT_NEAR(share, 1.0 / 63, 1e-12);
}

// Its kernel had as many bins as its standard deviation, 5 % of 1e12 rad: more than can be counted, and all
// was forgotten.
TEST(VisualFilter, ATurnOfManyCirclesLeavesTheHeadingOpenAndThePlaceKnown) {
  VisualFilter filter(FilterRoom().visual);
  ASSERT_TRUE(filter.See(FilterRoom().room.SeenLandmarks(VisualRoom::PoseAt({2, 2}, 0))).ok());
  const std::vector<double> before = filter.AtPlaces();
  ASSERT_TRUE(filter.Move({0, 0}, 1e12).ok());
  const std::vector<double> after = filter.AtPlaces();
  for (size_t place = 0; place < before.size(); ++place) {
    EXPECT_NEAR(after[place], before[place], 1e-6) << place;
    const double share = filter.AtHeading(static_cast<int32_t>(place), 200, 45);
    EXPECT_NEAR(share, after[place] * 19 / 72, 0.01) << place;  // bins of 5 degrees
  }
}

TEST(Compare, PutsAFixInSpaceOnTheFloor) {
  Localization localization;
  localization.reason = NoFix::kNone;
  localization.cam_from_world = VisualRoom::PoseAt({2, 1}, 0.5);
  localization.covariance.setZero();
  localization.covariance.bottomRightCorner<3, 3>() = 0.04 * Eigen::Matrix3d::Identity();
  const FloorFix fix = FloorFixOf(localization, {});
  EXPECT_LT((fix.position - Eigen::Vector2d(2, 1)).norm(), 1e-9);
  EXPECT_NEAR(fix.heading_deg, DegFromRad(0.5), 1e-9);
  EXPECT_NEAR(fix.covariance(0, 0), 0.04, 1e-5);
  EXPECT_NEAR(fix.covariance(1, 1), 0.04, 1e-5);
  EXPECT_NEAR(fix.covariance(0, 1), 0, 1e-5);
  EXPECT_NEAR(fix.covariance(2, 2), 0, 1e-5);
}

// What both share, as estimates by one map, does not excuse a contradiction.
TEST(Compare, LeavesTheErrorOfTheMapsScaleOut) {
  Localization localization;
  localization.reason = NoFix::kNone;
  localization.cam_from_world = VisualRoom::PoseAt({2, 1}, 0);
  localization.covariance = 0.01 * Matrix6d::Identity();
  VisualPose pose;
  pose.position = {2.3, 1};
  pose.covariance = Eigen::Vector3d(0.08, 0.01, 1).asDiagonal();
  const double before = Compare(FloorFixOf(localization, {}), pose).mahalanobis;
  localization.scale_sigma_m = {0.5, 0.1, 0.3};
  localization.covariance.bottomRightCorner<3, 3>() +=
      localization.scale_sigma_m * localization.scale_sigma_m.transpose();
  pose.scale_sigma_m = {0.3, 0.4};
  pose.covariance.topLeftCorner<2, 2>() += pose.scale_sigma_m * pose.scale_sigma_m.transpose();
  EXPECT_NEAR(Compare(FloorFixOf(localization, {}), pose).mahalanobis, before, 1e-6);
}

TEST(Compare, CountsDistancesInStandardDeviations) {
  FloorFix fix{{2, 1}, 359, Eigen::Vector3d(0.01, 0.01, 0.01).asDiagonal()};
  VisualPose pose;
  pose.position = {2.3, 1};
  pose.heading_deg = 1;
  pose.covariance = Eigen::Vector3d(0.08, 0.01, 1).asDiagonal();
  const Disagreement disagreement = Compare(fix, pose);
  EXPECT_NEAR(disagreement.distance_m, 0.3, 1e-12);
  EXPECT_NEAR(disagreement.angle_deg, 2, 1e-12);
  EXPECT_NEAR(disagreement.mahalanobis, std::sqrt(1 + RadFromDeg(2) * RadFromDeg(2) / 1.01), 1e-9);
}

}  // namespace
}  // namespace cairn
