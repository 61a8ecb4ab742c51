#include "core/blocks/map_rows.h"

#include <cmath>
#include <functional>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/emit_map/emit_map.h"
#include "tests/core/map/example.h"

namespace cairn {
namespace {

using testing::HasSubstr;
using Change = std::function<void(MapRows&)>;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Three images, stations and appearance nodes, the first of which is kept and linked to both others.
MapRows ValidRows() {
  const EmitExample example = MakeEmitExample();
  MapRows rows = *emit_map::EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                                    {.landmarks = "regions"});
  rows.vocabulary = {};
  rows.appearance = {{.images = {0},
                      .is_kept = true,
                      .links = {{1, 9}, {2, 7}},
                      .entropy = 0.5,
                      .look_alikes = {{1, 0.25}, {2, 1}}},
                     {.images = {1}, .entropy = 0},
                     {.images = {2}, .entropy = 0.1}};
  return rows;
}

// The message about the rows after a change; "" where they are still valid.
std::string Refusal(const Change& change) {
  MapRows rows = ValidRows();
  change(rows);
  const Status status = CheckMapRows(rows);
  if (status.ok()) return "";
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  return status.error().message;
}

TEST(MapRows, ValidRowsAreValidUpToTheirLimits) {
  for (const Change& change : std::vector<Change>{
           [](MapRows&) {},
           [](MapRows& r) { r.stated_pose_sigma_deg = 180; },
           [](MapRows& r) { r.stated_pose_sigma_m = 999.9; },
           [](MapRows& r) { r.covariance_scale = 1; },
           [](MapRows& r) { r.covariance_scale = 999999; },
           [](MapRows& r) { r.appearance[2].entropy = 64; },
           [](MapRows& r) { r.documents = "kept"; },
           [](MapRows& r) {
             r.sessions = {"a", "b"};
           },
           [](MapRows& r) { r.images[0].station = -1; },
           [](MapRows& r) { r.images[0].station = 2; },
           [](MapRows& r) { r.images[0].name = std::string(4096, 'a'); },
           [](MapRows& r) {
             r.images[0].cam_from_world.translation = {2e5, -2e5, 0};
           },
           [](MapRows& r) {
             r.stations[0].position = {-2e5, 2e5};
           },
           [](MapRows& r) { r.stations[0].heading_deg.reset(); },
           [](MapRows& r) { r.stations[0].heading_deg = -720; },
           [](MapRows& r) { r.lower_bound = 2; },
           [](MapRows& r) { r.lower_bound = 0; },
           [](MapRows& r) { r.lower_bound.reset(); },
           [](MapRows& r) { r.regions.push_back({.stations = {0}}); },
           [](MapRows& r) {
             r.landmarks[0].position = {2e5, 0, 0};
           },
           [](MapRows& r) { r.landmarks[0].scale_m = 0; },
           [](MapRows& r) {
             r.appearance[0].links = {{2, 1}};
           },
           [](MapRows& r) {
             r.appearance[1].is_kept = true, r.appearance[1].links = {{2, 1}};
           },
       }) {
    EXPECT_EQ(Refusal(change), "");
  }
}

TEST(MapRows, EverySessionThatSawALandmarkIsNamedOnce) {
  MapRows rows = ValidRows();
  EXPECT_THAT(LandmarkSessions(rows), testing::Each(testing::IsEmpty()));
  rows.sessions = {"day", "night"};
  rows.images[0].name = "night/0.jpg", rows.images[0].landmarks = {0, 1};
  rows.images[1].name = "day/1.jpg", rows.images[1].landmarks = {1, 2};
  rows.images[2].name = "night/2.jpg", rows.images[2].landmarks = {1};
  std::vector<std::vector<int>> expected(rows.landmarks.size());
  expected[0] = {1}, expected[1] = {0, 1}, expected[2] = {0};
  EXPECT_EQ(LandmarkSessions(rows), expected);
  rows.images[0].name = "0.jpg";  // of neither
  expected[0] = {};
  EXPECT_EQ(LandmarkSessions(rows), expected);
}

TEST(MapRows, HeadsThatMakeNoSenseAreRefused) {
  EXPECT_THAT(Refusal([](MapRows& r) { r.stated_pose_sigma_m = -0.1; }),
              HasSubstr("noise of the stated poses"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.stated_pose_sigma_m = 1e3; }),
              HasSubstr("noise of the stated poses"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.stated_pose_sigma_m = kNan; }),
              HasSubstr("noise of the stated poses"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.stated_pose_sigma_deg = -0.1; }),
              HasSubstr("noise of the stated poses"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.stated_pose_sigma_deg = 180.5; }),
              HasSubstr("noise of the stated poses"));
  for (const double scale : {-1.0, 0.99, 1e6, kNan}) {
    EXPECT_THAT(Refusal([&](MapRows& r) { r.covariance_scale = scale; }), HasSubstr("scale of covariances"));
  }
  EXPECT_THAT(Refusal([](MapRows& r) { r.documents = "some"; }), HasSubstr("documents = 'some'"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.floor_from_world.rotation.coeffs() *= 2; }),
              HasSubstr("the rotation of a frame"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.camera_from_given.rotation.coeffs() *= 2; }),
              HasSubstr("the rotation of a frame"));
  for (const double far : {-2.1e5, 1e308}) {
    EXPECT_THAT(Refusal([&](MapRows& r) { r.camera_from_given.translation.y() = far; }),
                HasSubstr("or its place"));
    EXPECT_THAT(Refusal([&](MapRows& r) { r.floor_from_world.translation.z() = far; }),
                HasSubstr("or its place"));
  }
  EXPECT_THAT(Refusal([](MapRows& r) { r.camera_from_given.translation.x() = kNan; }),
              HasSubstr("the rotation of a frame"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.cameras.push_back(r.cameras.back()); }),
              HasSubstr("is out of order"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.self_test["a"] = kNan; }), HasSubstr("'a' is not finite"));
  EXPECT_THAT(Refusal([](MapRows& r) {
                r.sessions = {"a", "b", "a"};
              }),
              HasSubstr("session 'a' is listed twice"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.sessions = {"a/b"}; }), HasSubstr("the name is not valid"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.frame.unit = "foot"; }), HasSubstr("unit 'foot'"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.frame.anchor = GeodeticPosition{91, 0, 0}; }), HasSubstr("anchor"));
  for (const double ratio : {-0.1, 1.0, kNan})
    EXPECT_THAT(Refusal([&](MapRows& r) { r.frame.scale_sigma_ratio = ratio; }), HasSubstr("scale known to"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.frame.scale_centre.y() = kNan; }), HasSubstr("scale known to"));
  for (const Change& change : std::vector<Change>{
           [](MapRows& r) { r.name = "a\nb"; }, [](MapRows& r) { r.writer = "a\nb"; },
           [](MapRows& r) { r.instruction_set = "a\nb"; }, [](MapRows& r) { r.landmark_choice = "a\nb"; },
           [](MapRows& r) { r.algorithm = "a\nb"; }, [](MapRows& r) { r.frame.source = "a\nb"; },
           [](MapRows& r) { r.stage_options["a\nb"] = ""; }, [](MapRows& r) { r.input_hashes["a\nb"] = "1"; },
           [](MapRows& r) { r.input_hashes["a"] = "\n"; }, [](MapRows& r) { r.self_test["a\nb"] = 1; },
           [](MapRows& r) { r.images[1].name = "a\nb"; }}) {
    EXPECT_THAT(Refusal(change), HasSubstr("has a control character"));
  }
}

TEST(MapRows, ImagesThatMakeNoSenseAreRefused) {
  EXPECT_THAT(Refusal([](MapRows& r) { r.images[1].image_id = r.images[0].image_id; }),
              HasSubstr("is out of order"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.images[2].camera_id = 99; }),
              HasSubstr("has camera 99, which the map lacks"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.images[2].cam_from_world.translation.z() = kNan; }),
              HasSubstr("pose is not valid"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.images[2].cam_from_world.translation.z() = -2.01e5; }),
              HasSubstr("pose is not valid"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.images[2].cam_from_world.rotation.coeffs().setZero(); }),
              HasSubstr("pose is not valid"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.images[2].station = -2; }), HasSubstr("station -2 of 3"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.images[2].station = 3; }), HasSubstr("station 3 of 3"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.images[0].name = std::string(4097, 'a'); }),
              HasSubstr("a name of 4097 bytes"));
  for (const std::vector<LandmarkIdx>& landmarks :
       {std::vector<LandmarkIdx>{1, 1},
        {1, 0},
        {-1, 0},
        {0, static_cast<LandmarkIdx>(ValidRows().landmarks.size())}})
    EXPECT_THAT(Refusal([&](MapRows& r) { r.images[0].landmarks = landmarks; }),
                HasSubstr("not ascending below"));
}

TEST(MapRows, StationsAndRegionsThatMakeNoSenseAreRefused) {
  EXPECT_THAT(Refusal([](MapRows& r) { r.stations[1].position.y() = kNan; }),
              HasSubstr("station 1: its place is not finite"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.stations[1].position.y() = 2.01e5; }),
              HasSubstr("station 1: its place"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.stations[2].heading_deg = kNan; }),
              HasSubstr("station 2: its place"));
  for (const std::vector<std::pair<StationIdx, StationIdx>>& edges :
       {std::vector<std::pair<StationIdx, StationIdx>>{{-1, 1}},
        {{1, 1}},
        {{2, 1}},
        {{1, 3}},
        {{0, 1}, {0, 1}},
        {{1, 2}, {0, 1}}})
    EXPECT_THAT(Refusal([&](MapRows& r) { r.station_edges = edges; }), HasSubstr("edge "));
  EXPECT_THAT(Refusal([](MapRows& r) { r.uncovered_limit = -1; }), HasSubstr("-1 stations uncovered"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.lower_bound = -1; }), HasSubstr("a lower bound of -1"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.lower_bound = 3; }), HasSubstr("2 regions with a lower bound of 3"));
  EXPECT_THAT(Refusal([](MapRows& r) {
                r.findings.promise.reset();
                r.regions.resize(4, r.regions[0]);
              }),
              HasSubstr("4 regions of 3 stations"));
  EXPECT_THAT(Refusal([](MapRows& r) {
                r.findings.promise = MapPromise{.nodes = std::vector<NodePromise>(3)};
                r.regions.resize(4, r.regions[0]);
              }),
              HasSubstr("4 regions of 3 promises"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.regions[1].stations.clear(); }),
              HasSubstr("region 1 has no station"));
  EXPECT_THAT(Refusal([](MapRows& r) {
                r.regions[1].stations = {2, 1};
              }),
              HasSubstr("region 1: its stations or landmarks"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.regions[1].stations = {3}; }),
              HasSubstr("region 1: its stations or landmarks"));
  EXPECT_THAT(Refusal([](MapRows& r) {
                r.regions[0].landmarks = {0, 99};
              }),
              HasSubstr("region 0: its stations or landmarks"));
}

TEST(MapRows, AppearanceThatMakesNoSenseIsRefused) {
  EXPECT_THAT(Refusal([](MapRows& r) { r.appearance[1].images.clear(); }), HasSubstr("node 1: its images"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.appearance[1].images = {3}; }), HasSubstr("node 1: its images"));
  EXPECT_THAT(Refusal([](MapRows& r) {
                r.appearance[1].images = {0, 1};
              }),
              HasSubstr("image 0 is of two appearance nodes"));
  using Links = std::vector<MapAppearanceNode::Link>;
  for (const Links& links : {Links{{0, 9}}, Links{{3, 9}}, Links{{-1, 9}}, Links{{1, 0}}, Links{{1, -3}},
                             Links{{2, 9}, {1, 9}}, Links{{1, 9}, {1, 9}}})
    EXPECT_THAT(Refusal([&](MapRows& r) { r.appearance[0].links = links; }), HasSubstr("makes no sense"));
  EXPECT_THAT(Refusal([](MapRows& r) {
                r.appearance[1].links = {{2, 5}};
              }),
              HasSubstr("node 1: link 0 makes no sense"));
  EXPECT_THAT(
      Refusal([](MapRows& r) { r.documents = "kept", r.appearance[0] = {.images = {0}, .entropy = 0}; }),
      HasSubstr("none is kept"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.appearance[2].entropy.reset(); }),
              HasSubstr("node 2: some nodes have an entropy"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.appearance[2].entropy = -0.1; }),
              HasSubstr("node 2: an entropy of -0.1"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.appearance[2].entropy = 1e6; }), HasSubstr("node 2: an entropy of"));
  EXPECT_THAT(Refusal([](MapRows& r) {
                for (MapAppearanceNode& node : r.appearance) node.entropy.reset();
              }),
              HasSubstr("node 0: an entropy of"));
  using LookAlikes = std::vector<MapAppearanceNode::LookAlike>;
  for (const LookAlikes& others :
       {LookAlikes{{0, 0.5}}, LookAlikes{{3, 0.5}}, LookAlikes{{1, 0}}, LookAlikes{{1, 1.01}},
        LookAlikes{{1, 1.5}}, LookAlikes{{1, kNan}}, LookAlikes{{2, 0.5}, {1, 0.5}}})
    EXPECT_THAT(Refusal([&](MapRows& r) { r.appearance[0].look_alikes = others; }),
                HasSubstr("makes no sense"));
}

TEST(MapRows, LandmarksThatMakeNoSenseAreRefused) {
  EXPECT_THAT(Refusal([](MapRows& r) { r.landmarks[1].position.z() = kNan; }),
              HasSubstr("landmark 1: its position"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.landmarks[1].covariance(0, 1) = kNan; }),
              HasSubstr("landmark 1: its position"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.landmarks[1].covariance(2, 2) = -1e-9; }),
              HasSubstr("landmark 1: its position"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.landmarks[1].scale_m = -1; }),
              HasSubstr("landmark 1: its position"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.landmarks[1].scale_m = 2.01e5; }), HasSubstr("more than 200 km"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.landmarks[1].position.x() = -2.01e5; }),
              HasSubstr("more than 200 km"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.landmarks.pop_back(); }), testing::Not(""));
  EXPECT_THAT(Refusal([](MapRows& r) { r.vocabulary.document_ids = {3}; }),
              HasSubstr("knows image 3, which the map lacks"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.vocabulary.document_ids = {99}; }), HasSubstr("knows image 99"));
  EXPECT_THAT(Refusal([](MapRows& r) { r.documents = "kept", r.vocabulary.document_ids = {2}; }),
              HasSubstr("knows image 2, which is not kept"));
}

}  // namespace
}  // namespace cairn
