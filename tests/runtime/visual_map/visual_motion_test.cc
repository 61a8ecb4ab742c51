// How the belief of a visual filter moves: against a sum over all places and headings.
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/geometry/pose.h"
#include "runtime/visual_map/visual_filter.h"
#include "tests/runtime/visual_map/surveyed_room.h"

namespace cairn {
namespace {

constexpr int kNumHeadingBins = 72;
constexpr double kBinWidthRad = 2 * std::numbers::pi / kNumHeadingBins;

using Belief = std::vector<std::vector<double>>;  // per place and heading

Belief BeliefOf(const VisualFilter& filter) {
  Belief belief(filter.map().places().size(), std::vector<double>(kNumHeadingBins));
  for (size_t place = 0; place < belief.size(); ++place) {
    for (int bin = 0; bin < kNumHeadingBins; ++bin)
      belief[place][bin] = filter.AtHeading(static_cast<int32_t>(place), 5.0 * bin, 1);
  }
  return belief;
}

// Each place and heading goes the way from there, to all places and headings around where that ends.
Belief MovedBy(const VisualFilter& filter, const Eigen::Vector2d& way_m, double way_variance, double turn_rad,
               double turn_variance) {
  const Belief before = BeliefOf(filter);
  const auto& places = filter.map().places();
  Belief after(before.size(), std::vector<double>(kNumHeadingBins, 0));
  double all = 0;
  for (int bin = 0; bin < kNumHeadingBins; ++bin) {
    std::vector<double> turned(kNumHeadingBins);
    double sum_turned = 0;
    for (int to = 0; to < kNumHeadingBins; ++to) {
      const double off = std::remainder((to - bin) * kBinWidthRad - turn_rad, 2 * std::numbers::pi);
      sum_turned += turned[to] = std::exp(-0.5 * off * off / turn_variance);
    }
    const Eigen::Vector2d way = Eigen::Rotation2Dd(bin * kBinWidthRad) * way_m;
    for (size_t from = 0; from < places.size(); ++from) {
      std::vector<double> reached(places.size());
      double sum = 0;
      for (size_t to = 0; to < places.size(); ++to) {
        const double squared = (places[to] - places[from] - way).squaredNorm();
        if (squared > 9 * way_variance) continue;
        sum += reached[to] = std::exp(-0.5 * squared / way_variance);
      }
      if (sum == 0) continue;  // it left the survey
      for (size_t to = 0; to < places.size(); ++to) {
        for (int k = 0; k < kNumHeadingBins; ++k) {
          const double share = before[from][bin] * reached[to] / sum * turned[k] / sum_turned;
          after[to][k] += share;
          all += share;
        }
      }
    }
  }
  for (auto& of_place : after)
    for (double& share : of_place) share /= all;
  return after;
}

// Half of the sum of differences.
double Apart(const Belief& a, const Belief& b) {
  double sum = 0;
  for (size_t place = 0; place < a.size(); ++place) {
    for (int bin = 0; bin < kNumHeadingBins; ++bin) sum += 0.5 * std::abs(a[place][bin] - b[place][bin]);
  }
  return sum;
}

// A filter that has seen one image.
VisualFilter AfterOneLook(const VisualFilterOptions& options, double heading_rad) {
  VisualFilter filter(Clean().visual, options);
  EXPECT_TRUE(filter.See(Clean().room.SeenLandmarks(VisualRoom::PoseAt({2.4, 2.1}, heading_rad))).ok());
  return filter;
}

TEST(VisualFilter, MovesAsOdometrySaysAndErrs) {
  const double cell = VisualRoom::kSpacingM * VisualRoom::kSpacingM / 12,
               bin = kBinWidthRad * kBinWidthRad / 12;
  const VisualFilterOptions options{.odometry_way_ratio = 0.3,
                                    .odometry_turn_ratio = 0.2,
                                    .odometry_sigma_m = 0.1,
                                    .odometry_sigma_deg = 4,
                                    .kidnapped_ratio = 0.2};
  struct Motion {
    Eigen::Vector2d way_m;
    double turn_rad;
  };
  for (const Motion& motion : {Motion{{0.6, 0}, 0}, {{0.3, -0.4}, 0.7}, {{-0.5, 0.1}, -2.9}, {{0, 0}, 3.3}}) {
    VisualFilter filter = AfterOneLook(options, 1.2);
    const double length = motion.way_m.norm(), turn = std::remainder(motion.turn_rad, 2 * std::numbers::pi);
    const double way_variance = std::pow(0.3 * length, 2) + 0.1 * 0.1 + (length > 0 ? cell : 0);
    const double turn_variance = std::pow(0.2 * motion.turn_rad, 2) + std::pow(RadFromDeg(4), 2) + bin;
    const Belief expected = MovedBy(filter, motion.way_m, way_variance, turn, turn_variance);
    ASSERT_TRUE(filter.Move(motion.way_m, motion.turn_rad).ok());
    EXPECT_LT(Apart(BeliefOf(filter), expected), 0.006) << motion.way_m.transpose() << " " << motion.turn_rad;
  }
}

TEST(VisualFilter, WandersAsFarAsItMay) {
  VisualFilter filter = AfterOneLook({}, -0.5);
  const Belief expected =
      MovedBy(filter, {0, 0}, 0.3 * 0.3, 0, 0.15 * 0.15 + kBinWidthRad * kBinWidthRad / 12);
  ASSERT_TRUE(filter.Wander(0.3, 0.15).ok());
  EXPECT_LT(Apart(BeliefOf(filter), expected), 0.006);
  const Belief before = BeliefOf(filter);
  for (const auto& [sigma_m, sigma_rad] : {std::pair(-0.1, 0.1), {0.1, -0.1}, {0.1, std::nan("")}})
    EXPECT_EQ(filter.Wander(sigma_m, sigma_rad).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(Apart(BeliefOf(filter), before), 0);
  EXPECT_TRUE(filter.Wander(0, 0).ok());
}

// A robot that may be anywhere after each image knows what the last image says.
TEST(VisualFilter, WhoIsCarriedAwayForSureKnowsTheLastImageAlone) {
  VisualFilter filter = AfterOneLook({.kidnapped_ratio = 1}, 1.2), fresh(Clean().visual);
  const auto seen = Clean().room.SeenLandmarks(VisualRoom::PoseAt({3, 1.6}, 2));
  ASSERT_TRUE(filter.See(seen).ok());
  ASSERT_TRUE(fresh.See(seen).ok());
  EXPECT_LT(Apart(BeliefOf(filter), BeliefOf(fresh)), 1e-9);
}

TEST(VisualFilter, SaysWhereItIsOnTheMeanAndHowUnsure) {
  VisualFilter filter = AfterOneLook({.kidnapped_ratio = 0.3}, 1.2);
  const auto seen = Clean().room.SeenLandmarks(VisualRoom::PoseAt({3, 1.6}, 2));
  const VisualPose pose = *filter.See({seen.begin(), seen.begin() + 1});  // of one landmark: flagged
  ASSERT_NE(pose.flag, VisualFlag::kNone);
  const auto& places = filter.map().places();
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double entropy = 0;
  for (size_t i = 0; i < places.size(); ++i) {
    mean += pose.at_place[i] * places[i];
    if (pose.at_place[i] > 0) entropy -= pose.at_place[i] * std::log(pose.at_place[i]);
  }
  Eigen::Matrix2d spread = VisualRoom::kSpacingM * VisualRoom::kSpacingM / 12 * Eigen::Matrix2d::Identity();
  for (size_t i = 0; i < places.size(); ++i)
    spread += pose.at_place[i] * (places[i] - mean) * (places[i] - mean).transpose();
  EXPECT_EQ(pose.at_place, filter.AtPlaces());
  EXPECT_LT((pose.mean - mean).norm(), 1e-9);
  EXPECT_LT((pose.position - mean).norm(), 1e-9);
  EXPECT_NEAR(pose.entropy, entropy, 1e-9);
  EXPECT_EQ(pose.elsewhere, 0);
  EXPECT_LT(
      (pose.covariance.topLeftCorner<2, 2>() - pose.scale_sigma_m * pose.scale_sigma_m.transpose() - spread)
          .norm(),
      1e-9);
}

}  // namespace
}  // namespace cairn
