#include "core/promise/promise_nodes.h"

#include <algorithm>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/promise/expectation.h"
#include "core/promise/promise_regions.h"
#include "tests/core/promise/wall_survey.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::SizeIs;

// Images at one place that look this way, degrees about the y axis; a point 2 m away, so that views are 0.2 m
// wide.
Classes SurveyOf(const std::vector<double>& headings_deg) {
  Classes classes = WallSurvey(static_cast<int>(headings_deg.size()), 0);
  for (size_t i = 0; i < headings_deg.size(); ++i) {
    classes.images[i].cam_from_world.rotation =
        Eigen::AngleAxisd(RadFromDeg(headings_deg[i]), Eigen::Vector3d::UnitY());
  }
  AddClass({0, 0, 2}, {1}, 3, &classes);
  return classes;
}

std::vector<std::array<int32_t, 2>> ImagesOf(const std::vector<PromiseNode>& nodes) {
  std::vector<std::array<int32_t, 2>> images;
  for (const PromiseNode& node : nodes) images.push_back({node.image, node.other_image});
  return images;
}

std::vector<PromiseNode> NodesOf(const Classes& classes) {
  std::vector<int32_t> all(classes.images.size());
  std::iota(all.begin(), all.end(), 0);
  return PromiseNodes(classes, ViewDistance(classes, {}), all);
}

TEST(PromiseNodes, LieBetweenHeadingsOfOnePlaceThatShareAView) {
  // The camera sees 90 degrees: 80 are bridged, 120 are not.
  const Classes classes = SurveyOf({0, 80, 240});
  const auto nodes = NodesOf(classes);
  ASSERT_THAT(ImagesOf(nodes),
              ElementsAre(std::array{0, 0}, std::array{1, 1}, std::array{2, 2}, std::array{0, 1}));
  EXPECT_NEAR(RotationErrorDeg(nodes[3].cam_from_world, classes.images[0].cam_from_world), 40, 1e-9);
  EXPECT_NEAR(RotationErrorDeg(nodes[3].cam_from_world, classes.images[1].cam_from_world), 40, 1e-9);
  EXPECT_NEAR(CenterErrorM(nodes[3].cam_from_world, classes.images[0].cam_from_world), 0, 1e-12);
}

TEST(PromiseNodes, NothingLiesBetweenHeadingsThatAreNearOrHaveAnotherBetween) {
  const Classes near = SurveyOf({0, 44});
  EXPECT_THAT(NodesOf(near), SizeIs(2));
  const Classes three = SurveyOf({0, 40, 80});
  EXPECT_THAT(NodesOf(three), SizeIs(3));
}

TEST(PromiseNodes, OtherPlacesAndCamerasAreNotBridged) {
  Classes apart = SurveyOf({0, 80});
  apart.images[1].cam_from_world.translation = {0.3, 0, 0};
  EXPECT_THAT(NodesOf(apart), SizeIs(2));
  Classes cameras = SurveyOf({0, 80});
  cameras.cameras.push_back(cameras.cameras[0]);
  cameras.cameras[1].camera_id = 2;
  cameras.images[1].camera_id = 2;
  EXPECT_THAT(NodesOf(cameras), SizeIs(2));
}

TEST(PromiseNodes, NearImagesAreOne) {
  Classes classes = SurveyOf({0, 0, 0});
  classes.images[1].cam_from_world.translation = {0.09, 0, 0};  // half a radius is 0.1 m
  classes.images[2].cam_from_world.translation = {0.11, 0, 0};
  EXPECT_THAT(ImagesOf(NodesOf(classes)), ElementsAre(std::array{0, 0}, std::array{2, 2}));
}

TEST(ImagesApart, AreThoseThatNoneBeforeThemIsNear) {
  Random random(4);
  Classes classes = WallSurvey(80, 0);
  for (SurveyImage& image : classes.images) {
    image.cam_from_world = {
        Eigen::Quaterniond(Eigen::AngleAxisd(random.Uniform(-1, 1), Eigen::Vector3d::UnitY())),
        {random.Uniform(-1, 1), random.Uniform(-1, 1), 0}};
  }
  AddClass({0, 0, 2}, {1}, 3, &classes);
  const ViewDistance distance(classes, {});
  std::vector<int32_t> every_second;
  for (int32_t i = 1; i < 80; i += 2) every_second.push_back(i);
  std::vector<int32_t> apart;
  for (const int32_t i : every_second) {
    if (std::none_of(apart.begin(), apart.end(), [&](int32_t other) { return distance(i, other) < 2; }))
      apart.push_back(i);
  }
  EXPECT_GT(apart.size(), 5);
  EXPECT_LT(apart.size(), 35);
  EXPECT_EQ(ImagesApart(distance, every_second, 2), apart);
}

TEST(PoseBetween, TurnsInEqualSteps) {
  const Pose a{Eigen::Quaterniond::Identity(), {0, 0, 0}};
  Pose b{Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(90), Eigen::Vector3d::UnitZ())), {}};
  b.translation = -(b.rotation * Eigen::Vector3d(2, 0, 0));
  const Pose third = PoseBetween(a, b, 1, 3);
  EXPECT_NEAR(RotationErrorDeg(a, third), 30, 1e-9);
  EXPECT_NEAR((third.Center() - Eigen::Vector3d(1, 0, 0)).norm(), 0, 1e-12);
}

TEST(ExpectationOf, CountsTheKeptAndStatesTheirAccuracy) {
  Classes classes = WallSurvey(2, 1);
  for (int i = 0; i < 20; ++i) AddClass({0.2 * (i % 5) - 0.4, 0.2 * (i / 5) - 0.3, 2}, {1, 2}, 1, &classes);
  const LandmarkSights sights(classes, {});
  std::vector<ClassMatch> matches;
  for (uint32_t i = 0; i < 20; ++i) matches.push_back({i, 0.5F});
  const Pose pose = classes.images[0].cam_from_world;
  const auto expect = [&](size_t num, double depth) {
    std::vector<char> keep(20, 0);
    std::fill_n(keep.begin(), num, 1);
    return ExpectationOf(sights, matches, keep, pose, 200, depth);
  };
  EXPECT_DOUBLE_EQ(expect(8, 2).num_matches, 4);
  EXPECT_GT(expect(8, 2).sigma_m, expect(20, 2).sigma_m);
  EXPECT_GT(expect(20, 2).sigma_m, 0.001);
  EXPECT_LT(expect(20, 2).sigma_m, 0.2);
  // Without landmarks: half the distance along each axis.
  EXPECT_NEAR(expect(0, 2).sigma_m, std::sqrt(3.0), 1e-9);
  EXPECT_NEAR(expect(0, 4).sigma_m, 2 * std::sqrt(3.0), 1e-9);
}

// Nodes in a row, 1 m apart; node n needs two landmarks of its own.
struct Row {
  std::vector<PromiseNode> nodes;
  std::vector<std::vector<ExpectedMatch>> of_class;
  CoverProblem problem;
};
Row MakeRow(int num_nodes) {
  Row row;
  for (int n = 0; n < num_nodes; ++n) {
    PromiseNode node{.image = n, .other_image = n};
    node.cam_from_world.translation = {-static_cast<double>(n), 0, 0};
    row.nodes.push_back(node);
    for (int i = 0; i < 3; ++i) row.of_class.push_back({{n, 0.5F}});
  }
  row.problem.demands.assign(num_nodes, 1);
  return row;
}

TEST(DivideNodes, RegionsKeepPromisesAndHaveSoManyLandmarks) {
  Row row = MakeRow(12);
  row.problem.of_class = &row.of_class;
  std::vector<char> keep(row.of_class.size(), 1);
  keep[0] = 0;  // node 0 has two left
  const PromiseRegions divided = DivideNodes(row.nodes, 0.2, 15, row.problem, keep, 6, 24);
  EXPECT_EQ(divided.lower_bound, 4);
  std::vector<int> times(12, 0);
  for (const PromiseRegion& region : divided.regions) {
    EXPECT_LE(region.classes.size(), 6U);
    EXPECT_TRUE(std::is_sorted(region.classes.begin(), region.classes.end()));
    std::vector<double> given(12, 0);
    for (const size_t i : region.classes) {
      EXPECT_EQ(keep[i], 1);
      given[row.of_class[i][0].view] += 0.5;
    }
    for (const int32_t node : region.nodes) {
      EXPECT_GE(given[node], 1);
      ++times[node];
    }
  }
  EXPECT_EQ(times, std::vector<int>(12, 1));
  EXPECT_LE(divided.regions.size(), 5U);
}

TEST(DivideNodes, ANodeThatNeedsMoreHasARegionOfItsOwn) {
  Row row = MakeRow(3);
  row.problem.of_class = &row.of_class;
  row.problem.demands[1] = 1.5;
  const std::vector<char> keep(row.of_class.size(), 1);
  const PromiseRegions divided = DivideNodes(row.nodes, 0.2, 15, row.problem, keep, 2, 7);
  ASSERT_THAT(divided.regions, SizeIs(3));
  EXPECT_EQ(divided.lower_bound, 3);  // ceil(7 / 3): regions have three landmarks at most
}

TEST(DivideNodes, OneRegionWhereThereIsRoomAndItIsFilled) {
  Row row = MakeRow(4);
  row.problem.of_class = &row.of_class;
  const std::vector<char> keep(row.of_class.size(), 1);
  const PromiseRegions divided = DivideNodes(row.nodes, 0.2, 15, row.problem, keep, 100, 8);
  ASSERT_THAT(divided.regions, SizeIs(1));
  EXPECT_THAT(divided.regions[0].classes, SizeIs(12));  // 8 are needed
  EXPECT_THAT(divided.regions[0].nodes, ElementsAre(0, 1, 2, 3));
  EXPECT_EQ(divided.lower_bound, 1);
}

}  // namespace
}  // namespace cairn
