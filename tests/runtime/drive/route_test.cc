#include "runtime/drive/route.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "core/geometry/pose.h"
#include "runtime/localize/retrieve.h"
#include "tests/option_limits.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// Images 0 to 6 with a node each, but 5 of none; nodes and links, kept ones in brackets:
//   0 - [1] - [2] - [3] - 4        0 and 4 are linked to each other in the survey, but neither is kept
//   6 alone
MapRows PathRows() {
  MapRows rows;
  Camera camera;
  camera.width = camera.height = 100;
  camera.params = {100, 50, 50};
  rows.cameras = {camera};
  for (int i = 0; i < 7; ++i) {
    rows.images.push_back({.image_id = static_cast<ImageId>(i + 1),
                           .name = std::string("image") + std::to_string(i),
                           .camera_id = 1,
                           .cam_from_world = PoseAt({static_cast<double>(i), 0, 0}, 90)});
    rows.images.back().landmarks = {i % 2};
  }
  rows.landmarks.resize(2);
  rows.descriptors = DescriptorMatrix::Zero(2, kSiftDescriptorDim);
  rows.descriptors.row(0).head(4).setConstant(255);
  rows.descriptors.row(1).tail(4).setConstant(255);
  rows.appearance = {{{0}, false, {{1, 20}}}, {{1}, true, {{2, 20}}}, {{2}, true, {{3, 20}}},
                     {{3}, true, {{4, 20}}},  {{4}, false, {}},       {{6}, true, {}}};
  return rows;
}

TEST(PlanRoute, GoesOverKeptImages) {
  const auto map = *Map::FromRows(PathRows());
  const Result<Route> route = PlanRoute(*map, 0, 4);
  ASSERT_TRUE(route.ok()) << route.error().message;
  EXPECT_THAT(route->images, ElementsAre(0, 1, 2, 3, 4));
  EXPECT_EQ(route->num_links, 4);
  EXPECT_THAT(PlanRoute(*map, 3, 1)->images, ElementsAre(3, 2, 1));
  EXPECT_THAT(PlanRoute(*map, 2, 2)->images, ElementsAre(2));
  EXPECT_EQ(PlanRoute(*map, 2, 2)->num_links, 0);
}

TEST(PlanRoute, DoesNotPassThroughImagesThatAreNotKept) {
  MapRows rows = PathRows();
  rows.appearance[2].is_kept = false;  // linked to 1 and 3, which are kept
  const auto map = *Map::FromRows(rows);
  EXPECT_EQ(PlanRoute(*map, 0, 4).error().code, ErrorCode::kNotFound);
  EXPECT_THAT(PlanRoute(*map, 0, 2)->images, ElementsAre(0, 1, 2));
}

TEST(PlanRoute, SaysWhyThereIsNone) {
  const auto map = *Map::FromRows(PathRows());
  EXPECT_THAT(PlanRoute(*map, 0, 6).error().message,
              HasSubstr("no path over kept images leads from image0 to image6"));
  EXPECT_THAT(PlanRoute(*map, 0, 5).error().message, HasSubstr("image5 is not in the appearance graph"));
  EXPECT_EQ(PlanRoute(*map, 0, 7).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(PlanRoute(*map, -1, 0).error().code, ErrorCode::kInvalidArgument);
  MapRows rows = PathRows();
  rows.appearance.clear();
  EXPECT_THAT(PlanRoute(**Map::FromRows(rows), 0, 1).error().message, HasSubstr("has no appearance graph"));
}

TEST(PlanRoute, PlacesThatAreLikeNoOtherCostNothingAndTheFewestLinksAreTaken) {
  MapRows rows = PathRows();
  for (MapAppearanceNode& node : rows.appearance) node.entropy = 0, node.is_kept = true;
  rows.appearance[0].links = {{1, 20}, {2, 20}};  // 0 - 2 as well: 1 is a detour
  const auto map = *Map::FromRows(rows);
  for (const auto& [from, to] : {std::pair(0, 4), std::pair(4, 0)}) {
    const Result<Route> route = PlanRoute(*map, from, to, {.weight = "entropy"});
    ASSERT_TRUE(route.ok()) << route.error().message;
    EXPECT_EQ(route->num_links, 3);
    EXPECT_EQ(route->cost, 0);
  }
  EXPECT_THAT(PlanRoute(*map, 1, 4, {.weight = "entropy"})->images, ElementsAre(1, 2, 3, 4));
}

// Nodes 0 to 4 a metre apart, of entropy ln 2: of a way of four links each costs
//   1 m + 0.1 (2 m + 20 m / 2)
TEST(PlanRoute, RiskIsExpectedMetres) {
  MapRows rows = PathRows();
  for (MapAppearanceNode& node : rows.appearance) node.entropy = std::log(2.0);
  for (int i = 0; i < 7; ++i) rows.images[i].cam_from_world = PoseAt({static_cast<double>(i), 0, 0}, 0);
  const auto map = *Map::FromRows(rows);
  const RouteOptions options{
      .weight = "risk", .lost_ratio = 0.1, .faint_link_inliers = 0.1, .look_anew_m = 2, .wrong_place_m = 20};
  EXPECT_NEAR(PlanRoute(*map, 0, 4, options)->cost, 4 * (1 + 0.1 * (2 + 20 * 0.5)), 1e-9);
  // Links of 20 matches, of which one in e is not found again: lost at 0.1 + 0.9 / e of them.
  RouteOptions faint = options;
  faint.faint_link_inliers = 20;
  EXPECT_NEAR(PlanRoute(*map, 0, 4, faint)->cost, 4 * (1 + (0.1 + 0.9 / std::exp(1)) * (2 + 20 * 0.5)), 1e-9);
  rows.appearance[2].entropy = 0;  // a mean over both ends: two links are half as ambiguous
  EXPECT_NEAR(PlanRoute(**Map::FromRows(rows), 0, 4, options)->cost,
              2 * (1 + 0.1 * (2 + 20 * 0.5)) + 2 * (1 + 0.1 * (2 + 20 * 0.25)), 1e-9);
  rows.frame.unit = "arbitrary";
  for (MapImage& image : rows.images) image.cam_from_world.translation *= 7;
  EXPECT_NEAR(PlanRoute(**Map::FromRows(rows), 0, 4, options)->cost,
              2 * (1 + 0.1 * (2 + 20 * 0.5)) + 2 * (1 + 0.1 * (2 + 20 * 0.25)), 1e-9)
      << "without scale a link is a metre";
}

TEST(PlanRoute, ATurnCountsAsTheWayDrivenMeanwhile) {
  MapRows rows = PathRows();
  for (MapAppearanceNode& node : rows.appearance) node.entropy = 0;
  for (int i = 0; i < 7; ++i) rows.images[i].cam_from_world = PoseAt({0, 0, 0}, 60 * i);  // on the spot
  const auto map = *Map::FromRows(rows);
  const RouteOptions options{.weight = "risk", .lost_ratio = 0, .faint_link_inliers = 0.1};
  EXPECT_NEAR(PlanRoute(*map, 0, 2, options)->cost, 2 * 0.5 * RadFromDeg(60), 1e-6);
}

// A metre sideways, and a metre ahead with half a metre sideways, of which 0.4 m are approached.
TEST(PlanRoute, WhoMovesSidewaysRetreatsAndComesIn) {
  MapRows rows = PathRows();
  for (MapAppearanceNode& node : rows.appearance) node.entropy = 0;
  const std::vector<Eigen::Vector3d> places = {{0, 0, 0}, {0, 1, 0}, {1, 1.5, 0}};
  for (size_t i = 0; i < places.size(); ++i) rows.images[i].cam_from_world = PoseAt(places[i], 0);
  const auto map = *Map::FromRows(rows);
  const RouteOptions options{.weight = "risk", .lost_ratio = 0, .faint_link_inliers = 0.1};
  EXPECT_NEAR(PlanRoute(*map, 0, 1, options)->cost, 1 + 4 * 1, 1e-6);
  EXPECT_NEAR(PlanRoute(*map, 1, 2, options)->cost, std::sqrt(1.25) + 4 * (0.5 - 0.4), 1e-6);
  EXPECT_NEAR(PlanRoute(*map, 2, 1, options)->cost, std::sqrt(1.25) + 4 * (0.5 - 0.4), 1e-6);
}

// On a line: 0 - 1 - 4 is short and leads by a twin, 0 - 2 - 3 - 4 begins backwards and is longer by a metre.
TEST(PlanRoute, TheDearerAWrongPlaceTheLongerTheDetour) {
  MapRows rows = PathRows();
  const std::vector<Eigen::Vector3d> places = {{0, 0, 0}, {1, 0, 0}, {-0.5, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  for (size_t i = 0; i < places.size(); ++i) rows.images[i].cam_from_world = PoseAt(places[i], 0);
  for (MapAppearanceNode& node : rows.appearance) node.entropy = 0, node.is_kept = true;
  rows.appearance[1].entropy = std::log(2.0);
  rows.appearance[0].links = {{1, 100}, {2, 100}};
  rows.appearance[1].links = {{4, 100}};
  rows.appearance[2].links = {{3, 100}};
  rows.appearance[3].links = {{4, 100}};
  const auto map = *Map::FromRows(rows);
  RouteOptions options{.weight = "risk", .lost_ratio = 0.1, .look_anew_m = 0};
  // 0.1 wrong_place_m (1/4 + 1/4) against a metre; links of 100 matches are not faint.
  options.wrong_place_m = 19;
  EXPECT_THAT(PlanRoute(*map, 0, 4, options)->images, ElementsAre(0, 1, 4));
  options.wrong_place_m = 21;
  EXPECT_THAT(PlanRoute(*map, 0, 4, options)->images, ElementsAre(0, 2, 3, 4));
  EXPECT_EQ(PlanRoute(*map, 0, 4, {.weight = "risk", .lost_ratio = 2}).error().code,
            ErrorCode::kInvalidArgument);
}

TEST(PlanRoute, SeveralImagesOfOnePlaceNeedNoLink) {
  MapRows rows = PathRows();
  rows.appearance[4].images = {4, 5};
  const auto map = *Map::FromRows(rows);
  EXPECT_THAT(PlanRoute(*map, 4, 5)->images, ElementsAre(4, 5));
  EXPECT_EQ(PlanRoute(*map, 4, 5)->num_links, 0);
}

TEST(PoseOfImage, IsWhatAFixOfItsPixelsStates) {
  MapRows rows = PathRows();
  rows.camera_from_given = {Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY())),
                            {0.1, 0, 0}};
  const auto map = *Map::FromRows(rows);
  const Pose camera = map->head().camera_from_given * *PoseOfImage(*map, 3);  // of the map's own camera
  EXPECT_LT(CenterErrorM(camera, rows.images[3].cam_from_world), 1e-9);
  EXPECT_NEAR(camera.rotation.angularDistance(rows.images[3].cam_from_world.rotation), 0, 1e-7);
  EXPECT_EQ(PoseOfImage(*map, 7).error().code, ErrorCode::kInvalidArgument);
}

TEST(Retrieve, SparseMapsLeadToKeptImagesAlone) {
  MapRows rows = PathRows();
  Features features;
  features.keypoints = {{50, 50, 2, 0}, {20, 20, 2, 0}};
  features.descriptors = rows.descriptors;
  const Query query = MakeQuery(std::move(features), rows.cameras[0], {});
  const auto images = [&](const MapRows& of) {
    std::vector<int32_t> found;
    const auto map = *Map::FromRows(of);
    const Result<PooledVector<Candidate>> candidates = RetrieveByWords(*map, query, {});
    for (const Candidate& candidate : *candidates) found.push_back(candidate.image);
    std::sort(found.begin(), found.end());
    return found;
  };
  EXPECT_THAT(images(rows), ElementsAre(0, 1, 2, 3, 4, 5, 6));
  rows.documents = "kept";
  EXPECT_THAT(images(rows), ElementsAre(1, 2, 3, 6));
}

TEST(PlanRoute, OptionsHaveTheirRanges) {
  ExpectLimits<RouteOptions>({{"lost_ratio", "0", "-0.001", "1", "1.001"},
                              {"faint_link_inliers", "0.1", "0.09"},
                              {"look_anew_m", "0", "-0.001"},
                              {"wrong_place_m", "0", "-0.001"}});
}

}  // namespace
}  // namespace cairn
