#include "core/promise/landmark_order.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/promise/pose_information.h"
#include "tests/core/promise/wall_survey.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

std::vector<size_t> All(const Classes& classes) {
  std::vector<size_t> pool(classes.classes.size());
  std::iota(pool.begin(), pool.end(), size_t{0});
  return pool;
}

std::vector<size_t> OrderLandmarks(const Classes& classes, const ExpectedMatches& matches,
                                   const std::vector<size_t>& pool, const LandmarkOrderOptions& options,
                                   int num_threads) {
  return LandmarkOrder(classes, matches, pool, options, num_threads).First(pool.size());
}

// Class i is expected in these views, with these probabilities.
ExpectedMatches MatchesOf(const Classes& classes, std::vector<std::vector<ExpectedMatch>> of_class) {
  ExpectedMatches matches;
  for (size_t i = 0; i < classes.images.size(); ++i) matches.views.push_back(static_cast<int32_t>(i));
  matches.depth = 2;
  matches.of_class = std::move(of_class);
  return matches;
}

TEST(LandmarkOrder, ServesViewsThatHaveNothingBeforeThoseThatHaveSome) {
  // Three classes at one place in view 0, one in view 1: it comes second, not last.
  Classes classes = WallSurvey(2, 5);
  for (int i = 0; i < 3; ++i) AddClass({0, 0, 2}, {1}, 3, &classes);
  AddClass({5, 0, 2}, {2}, 3, &classes);
  const auto matches = MatchesOf(classes, {{{0, 0.9F}}, {{0, 0.9F}}, {{0, 0.9F}}, {{1, 0.9F}}});
  EXPECT_THAT(OrderLandmarks(classes, matches, All(classes), {}, 1), ElementsAre(0, 3, 1, 2));
}

TEST(LandmarkOrder, LikelyNearSmallAndWellKnownOnesComeFirst) {
  const auto first = [](const std::function<void(Classes*)>& change, float probability) {
    Classes classes = WallSurvey(1, 1);
    for (int i = 0; i < 2; ++i) AddClass({0, 0, 2}, {1}, 3, &classes);
    change(&classes);
    return OrderLandmarks(classes, MatchesOf(classes, {{{0, 0.5F}}, {{0, probability}}}), All(classes), {},
                          1)[0];
  };
  EXPECT_EQ(first([](Classes*) {}, 0.5F), 0U);  // a tie: the smaller position
  EXPECT_EQ(first([](Classes*) {}, 0.6F), 1U);
  EXPECT_EQ(first([](Classes* c) { c->classes[0].position.z() = 3; }, 0.5F), 1U);
  EXPECT_EQ(first([](Classes* c) { c->classes[0].observations[0].keypoint.scale = 9; }, 0.5F), 1U);
  EXPECT_EQ(first([](Classes* c) { c->classes[0].reprojection_error_px = 2; }, 0.5F), 1U);
  EXPECT_EQ(first([](Classes* c) { c->classes[0].covariance *= 1e6; }, 0.5F), 1U);
}

TEST(LandmarkOrder, ScaleIsThatWithWhichTheViewWouldSeeIt) {
  // Seen with scale 8 from 1 m and with scale 2 from 4 m: the same size.  A larger one comes last.
  Classes classes = WallSurvey(3, 0);
  classes.images[1].cam_from_world.translation = {0, 0, -1};
  classes.images[2].cam_from_world.translation = {0, 0, 2};
  AddClass({0, 0, 2}, {2}, 9, &classes);
  AddClass({0, 0, 2}, {3}, 2, &classes);
  AddClass({0, 0, 2}, {2}, 8, &classes);
  const auto matches = MatchesOf(classes, {{{0, 0.5F}}, {{0, 0.5F}}, {{0, 0.5F}}});
  EXPECT_THAT(OrderLandmarks(classes, matches, All(classes), {}, 1), ElementsAre(1, 2, 0));
}

// The sum that the header states, from scratch.
double Value(const Classes& classes, const ExpectedMatches& matches, const std::vector<size_t>& chosen,
             const LandmarkOrderOptions& options) {
  double sum = 0;
  for (size_t view = 0; view < matches.views.size(); ++view) {
    Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
    const double rough_rad = RadFromDeg(30), rough_m = 0.5 * matches.depth;
    for (int i = 0; i < 3; ++i) {
      information(i, i) = 1 / (rough_rad * rough_rad);
      information(i + 3, i + 3) = 1 / (rough_m * rough_m);
    }
    double expected = 0;
    for (const size_t i : chosen) {
      for (const ExpectedMatch& match : matches.of_class[i]) {
        if (match.view != static_cast<int32_t>(view)) continue;
        expected += match.probability;
        const FeatureClass& row = classes.classes[i];
        const double sigma_px =
            std::hypot(options.keypoints.sigma_px,
                       options.keypoints.sigma_per_scale * row.observations[0].keypoint.scale);
        const auto root = InformationRoot(row, classes.images[matches.views[view]].cam_from_world,
                                          sigma_px / 200, match.probability);
        information += root->transpose() * *root;
      }
    }
    const Eigen::Matrix<double, 6, 6> covariance = information.inverse();
    sum += options.enough_matches * (1 - std::exp(-expected / options.enough_matches)) -
           std::log(covariance.bottomRightCorner<3, 3>().trace());
  }
  return sum;
}

TEST(LandmarkOrder, IsAsGoodAsTakingWhatAddsMostEachTimeForAnyNumberOfThreads) {
  constexpr size_t kNumClasses = 60;
  Random random(5);
  for (int trial = 0; trial < 3; ++trial) {
    Classes classes = WallSurvey(4, 0.5);
    std::vector<std::vector<ExpectedMatch>> of_class;
    for (size_t i = 0; i < kNumClasses; ++i) {
      // Seen from 2 m in all views: the scale is the same everywhere.
      AddClass({3 * random.Uniform() - 1, 2 * random.Uniform() - 1, 2}, {1}, 3, &classes);
      of_class.emplace_back();
      for (int view = 0; view < 4; ++view) {
        if (random.Uniform() < 0.6)
          of_class.back().push_back({view, static_cast<float>(0.1 + 0.8 * random.Uniform())});
      }
    }
    // What class i looks like from view 0 is what it looks like from all: a size of zero.
    for (FeatureClass& row : classes.classes) row.observations[0].keypoint.scale = 0;
    const ExpectedMatches matches = MatchesOf(classes, of_class);
    const LandmarkOrderOptions options{.enough_matches = 2};
    const std::vector<size_t> order = OrderLandmarks(classes, matches, All(classes), options, 1);
    EXPECT_EQ(OrderLandmarks(classes, matches, All(classes), options, 3), order);
    for (const size_t num_kept : {0, 50}) {
      LandmarkOrderOptions keeping = options;
      keeping.max_num_kept_sights = num_kept;
      EXPECT_EQ(OrderLandmarks(classes, matches, All(classes), keeping, 2), order);
    }
    ASSERT_EQ(order.size(), kNumClasses);
    // Beside the best next one each time: gains that grew since they were computed are overlooked.
    std::vector<size_t> greedy;
    while (greedy.size() < 48) {
      double best_value = -1e9;
      size_t best = 0;
      for (size_t i = 0; i < kNumClasses; ++i) {
        if (std::find(greedy.begin(), greedy.end(), i) != greedy.end()) continue;
        std::vector<size_t> with = greedy;
        with.push_back(i);
        const double value = Value(classes, matches, with, options);
        if (value > best_value) best_value = value, best = i;
      }
      greedy.push_back(best);
    }
    EXPECT_EQ(order[0], greedy[0]);
    EXPECT_EQ(order[1], greedy[1]);
    const double none = Value(classes, matches, {}, options);
    for (const int n : {16, 32, 48}) {
      const double of_greedy = Value(classes, matches, {greedy.begin(), greedy.begin() + n}, options) - none;
      EXPECT_GT(Value(classes, matches, {order.begin(), order.begin() + n}, options) - none,
                0.97 * of_greedy);
    }
  }
}

TEST(LandmarkOrder, OrdersThePoolAlone) {
  Classes classes = WallSurvey(1, 1);
  for (int i = 0; i < 4; ++i) AddClass({0.1 * i, 0, 2}, {1}, 3, &classes);
  const auto matches = MatchesOf(classes, {{{0, 0.2F}}, {{0, 0.4F}}, {}, {{0, 0.9F}}});
  EXPECT_THAT(OrderLandmarks(classes, matches, {0, 2, 3}, {}, 1), ElementsAre(3, 0, 2));
  EXPECT_THAT(OrderLandmarks(classes, matches, {}, {}, 1), IsEmpty());
}

TEST(LandmarkOrder, ThoseThatAMapHasComeFirstAndOthersAreOrderedByWhatTheyGive) {
  // Two at a place in view 0, and two in view 1: whichever of one view is there, the other view's come next.
  Classes classes = WallSurvey(2, 5);
  for (int i = 0; i < 2; ++i) AddClass({0, 0, 2}, {1}, 3, &classes);
  for (int i = 0; i < 2; ++i) AddClass({5, 0, 2}, {2}, 3, &classes);
  const auto matches = MatchesOf(classes, {{{0, 0.9F}}, {{0, 0.9F}}, {{1, 0.8F}}, {{1, 0.8F}}});
  LandmarkOrderOptions options;
  EXPECT_THAT(OrderLandmarks(classes, matches, All(classes), options, 1), ElementsAre(0, 2, 1, 3));
  options.first = {3};
  EXPECT_THAT(OrderLandmarks(classes, matches, All(classes), options, 1), ElementsAre(3, 0, 1, 2));
  options.first = {2, 1};
  EXPECT_THAT(OrderLandmarks(classes, matches, All(classes), options, 1), ElementsAre(2, 1, 0, 3));
  EXPECT_THAT(LandmarkOrder(classes, matches, {1, 2, 3}, options, 1).First(3), ElementsAre(2, 1, 3));
  options.first = {0, 1, 2, 3};
  EXPECT_THAT(LandmarkOrder(classes, matches, All(classes), options, 1).First(3), ElementsAre(0, 1, 2));
}

// An observation in an image that the survey lacks has no size, and a camera that it lacks no focal length.
TEST(LandmarkOrder, ObservationsOfUnknownImagesDoNotCount) {
  Classes classes = WallSurvey(1, 1);
  AddClass({0, 0, 2}, {1, 5}, 3, &classes);
  AddClass({0, 0, 2}, {5}, 3, &classes);
  EXPECT_THAT(OrderLandmarks(classes, MatchesOf(classes, {{{0, 0.5F}}, {{0, 0.5F}}}), All(classes), {}, 1),
              ElementsAre(1, 0));
}

}  // namespace
}  // namespace cairn
