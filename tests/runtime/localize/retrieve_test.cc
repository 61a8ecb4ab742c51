#include "runtime/localize/retrieve.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/localize/match.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

using testing::ElementsAre;

// Three images at three stations; regions {0, 1} and {1, 2}; two landmarks each, one shared.
std::shared_ptr<const Map> SmallMap() {
  MapRows rows;
  Camera camera;
  camera.width = 100;
  camera.height = 100;
  camera.params = {100, 50, 50};
  rows.cameras = {camera};
  for (int i = 0; i < 3; ++i) {
    rows.stations.push_back({.position = {i, 0}});
    rows.images.push_back({.image_id = static_cast<ImageId>(i + 1),
                           .camera_id = 1,
                           .cam_from_world = PoseAt({static_cast<double>(i), 0, 0}, 90),
                           .station = i});
    rows.landmarks.push_back({.position = {static_cast<double>(i), 2, 0}});
  }
  rows.descriptors = DescriptorMatrix::Zero(3, kSiftDescriptorDim);
  rows.images[0].landmarks = {0, 1};
  rows.images[1].landmarks = {0, 1, 2};
  rows.images[2].landmarks = {2};
  rows.regions = {{.stations = {0, 1}, .landmarks = {0, 1}}, {.stations = {1, 2}, .landmarks = {2}}};
  return *Map::FromRows(rows);
}

TEST(Retrieve, RegionsAreOrderedByTheVotesOfTheirCandidates) {
  const auto map = SmallMap();
  EXPECT_THAT(*RegionsOfCandidates(*map, std::vector<Candidate>{{0, 0.5}, {2, 0.4}}, {}), ElementsAre(0, 1));
  EXPECT_THAT(*RegionsOfCandidates(*map, std::vector<Candidate>{{2, 0.5}, {0, 0.4}}, {}), ElementsAre(1, 0));
  EXPECT_THAT(*RegionsOfCandidates(*map, std::vector<Candidate>{{1, 0.5}}, {}),
              ElementsAre(0, 1));  // tie: the smaller index
  // Of region 0 two candidates, of region 1 the better one alone: 0.9 and 0.5.
  EXPECT_THAT(*RegionsOfCandidates(*map, std::vector<Candidate>{{1, 0.5}, {0, 0.4}}, {}), ElementsAre(0, 1));
  EXPECT_THAT(*RegionsOfCandidates(*map, std::vector<Candidate>{{0, 0.5}, {2, 0.3}, {1, 0.1}, {2, 0.3}}, {}),
              ElementsAre(1, 0));
  RetrieveOptions one;
  one.max_num_regions = 1;
  EXPECT_THAT(*RegionsOfCandidates(*map, std::vector<Candidate>{{2, 0.5}, {0, 0.4}}, one), ElementsAre(1));
}

TEST(Retrieve, LandmarksOfRegionsAndImagesAreUnions) {
  const auto map = SmallMap();
  EXPECT_THAT(*LandmarksOfRegions(*map, std::vector{1, 0}), ElementsAre(0, 1, 2));
  EXPECT_THAT(*LandmarksOfImages(*map, std::vector{0, 2}), ElementsAre(0, 1, 2));
  EXPECT_THAT(*LandmarksOfImages(*map, std::vector{2}), ElementsAre(2));
  // No more than may be, of the first images: after one that has too many there is no smaller one.
  EXPECT_THAT(*LandmarksOfImages(*map, std::vector{0, 1, 2}, 3), ElementsAre(0, 1));
  EXPECT_THAT(*LandmarksOfImages(*map, std::vector{0, 1, 2}, 5), ElementsAre(0, 1, 2));
  EXPECT_THAT(*LandmarksOfImages(*map, std::vector{1, 2}, 1), ElementsAre(0, 1, 2))
      << "those of one at least";
}

TEST(Retrieve, NearestViewsAreNearByPlaceAndAngle) {
  const auto map = SmallMap();
  const auto images = [](std::span<const NearView> views) {
    std::vector<int32_t> indices;
    for (const NearView& view : views) indices.push_back(view.image);
    return indices;
  };
  // Cameras at x = 0, 1, 2, all of heading 90 degrees.
  const auto views = *NearestViews(*map, PoseAt({0.9, 0, 0}, 105), 0.5, 15, 2);
  EXPECT_THAT(images(views), ElementsAre(1, 0));
  EXPECT_NEAR(views[0].squared_distance, 0.2 * 0.2 + 1, 1e-9);  // (0.1 / 0.5)^2 + (15 / 15)^2
  EXPECT_NEAR(views[1].squared_distance, 1.8 * 1.8 + 1, 1e-9);
  EXPECT_THAT(images(*NearestViews(*map, PoseAt({3, 0, 0}, 90), 1, 15, 1)), ElementsAre(2));
  EXPECT_THAT(images(*NearestViews(*map, PoseAt({0.5, 0, 0}, 90), 1, 15, 9)),
              ElementsAre(0, 1, 2));  // as far
}

// A metre counts as much as 15 degrees: the first image is half a metre away, the second one turned.
TEST(ImageNearFix, IsTheNearestByPlaceAndAngle) {
  const auto nearest = [](double turned_deg, const Pose& camera_from_given, bool has_fix) {
    MapRows rows;
    Camera camera;
    camera.width = camera.height = 100;
    camera.params = {100, 50, 50};
    rows.cameras = {camera};
    rows.images = {{.image_id = 1, .camera_id = 1, .cam_from_world = PoseAt({0.5, 0, 0}, 90)},
                   {.image_id = 2, .camera_id = 1, .cam_from_world = PoseAt({0, 0, 0}, 90 + turned_deg)}};
    rows.camera_from_given = camera_from_given;
    const Pose found_at = camera_from_given.Inverse() * PoseAt({0, 0, 0}, 90);
    Localization found;
    found.reason = has_fix ? NoFix::kNone : NoFix::kAmbiguous;
    if (has_fix) {
      found.cam_from_world = found_at;
    } else {
      found.possible_poses = {found_at, PoseAt({9, 0, 0}, 90)};
    }
    return *ImageNearFix(**Map::FromRows(rows), found);
  };
  const Pose half_a_metre_ahead{Eigen::Quaterniond::Identity(), {0, 0, 0.5}};
  for (const Pose& camera_from_given : {Pose(), half_a_metre_ahead}) {
    for (const bool has_fix : {true, false}) {
      EXPECT_EQ(nearest(7.25, camera_from_given, has_fix), 1);
      EXPECT_EQ(nearest(7.75, camera_from_given, has_fix), 0);
    }
  }
}

// Each image a block of its own, or nearly: those that cannot be among the nearest are not read.
TEST(Retrieve, NearestViewsAreThoseOfAllImages) {
  const SyntheticRoom room = MakeSyntheticRoom(7);
  const auto map = *Map::FromRows(room.rows);
  Random random(3);
  for (int trial = 0; trial < 50; ++trial) {
    const Pose pose =
        PoseAt({random.Uniform(-6, 6), random.Uniform(-5, 5), random.Uniform(0, 3)}, random.Uniform(0, 360));
    std::vector<std::pair<double, int32_t>> all;
    for (int32_t i = 0; i < map->num_images(); ++i) {
      const Pose survey = (*map->Image(i))->cam_from_world;
      all.emplace_back(
          std::pow(CenterErrorM(survey, pose) / 0.4, 2) + std::pow(RotationErrorDeg(survey, pose) / 15, 2),
          i);
    }
    std::sort(all.begin(), all.end());
    const auto views = *NearestViews(*map, pose, 0.4, 15, 8);
    ASSERT_EQ(views.size(), size_t{8});
    for (size_t k = 0; k < views.size(); ++k) {
      EXPECT_EQ(views[k].image, all[k].second) << trial;
      EXPECT_EQ(views[k].squared_distance, all[k].first);
    }
  }
}

TEST(Retrieve, PriorChoosesImagesByPlaceAndAngle) {
  const auto map = SmallMap();
  RetrieveOptions options;
  options.prior_distance_m = 0.2;
  options.prior_angle_deg = 20;
  const auto near = *RetrieveByPrior(*map, {PoseAt({0.9, 0, 0}, 90), 0.3, 5}, options);
  ASSERT_EQ(near.size(), 2u);  // within 0.2 + 3 * 0.3 = 1.1 m: images 1 and 0
  EXPECT_EQ(near[0].image, 1);
  EXPECT_EQ(near[1].image, 0);
  EXPECT_TRUE(RetrieveByPrior(*map, {PoseAt({0.9, 0, 0}, -90), 0.3, 5}, options)->empty());
  // Within 20 + 3 * 5 = 35 degrees.
  EXPECT_EQ(RetrieveByPrior(*map, {PoseAt({0.9, 0, 0}, 124), 0.3, 5}, options)->size(), 2u);
  EXPECT_TRUE(RetrieveByPrior(*map, {PoseAt({0.9, 0, 0}, 126), 0.3, 5}, options)->empty());
  EXPECT_EQ(RetrieveByPrior(*map, {PoseAt({0.95, 0, 0}, 90), 0.3, 5}, options)->size(), 3u);
  // The nearer scores 1 / (1 + 0.1 m).
  EXPECT_NEAR(near[0].score, 1 / 1.1, 1e-9);
  EXPECT_NEAR(near[1].score, 1 / 1.9, 1e-9);
  options.max_num_candidates = 1;
  const auto one = *RetrieveByPrior(*map, {PoseAt({0.9, 0, 0}, 90), 0.3, 5}, options);
  ASSERT_EQ(one.size(), 1u);
  EXPECT_EQ(one[0].image, 1);
}

TEST(Retrieve, CovisibleLandmarksComeFromTheImagesThatShareMost) {
  const auto map = SmallMap();
  MatchOptions one;
  one.guided_num_images = 1;
  EXPECT_THAT(*CovisibleLandmarks(*map, std::vector{0, 1}, one),
              ElementsAre(0, 1));  // images 0 and 1 tie: the smaller index
  EXPECT_THAT(*CovisibleLandmarks(*map, std::vector{0, 1, 2}, one), ElementsAre(0, 1, 2));
  MatchOptions two;
  two.guided_num_images = 2;
  EXPECT_THAT(*CovisibleLandmarks(*map, std::vector{0}, two), ElementsAre(0, 1, 2));
}

TEST(Retrieve, RegionWithMostOfTheLandmarksIsFound) {
  const auto map = SmallMap();
  EXPECT_EQ(*RegionWithMost(*map, std::vector{0, 1, 2}), 0);
  EXPECT_EQ(*RegionWithMost(*map, std::vector{1, 2}), 0);  // tie: the smaller index
  EXPECT_EQ(*RegionWithMost(*map, std::vector{2}), 1);
  EXPECT_EQ(*RegionWithMost(*map, {}), -1);
}

TEST(Retrieve, DistanceFromSurveyIsThatOfTheNearestImage) {
  const SyntheticRoom room = MakeSyntheticRoom(1);
  const auto map = *Map::FromRows(room.rows);
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d place(random.Uniform(-9, 9), random.Uniform(-9, 9), random.Uniform(-2, 4));
    double nearest = 1e9;
    for (const MapImage& image : room.rows.images) {
      nearest = std::min(nearest, (image.cam_from_world.Center() - place).norm());
    }
    EXPECT_EQ(*DistanceFromSurvey(*map, place), nearest);
  }
}

// The best candidate for a view of the room.
void ExpectCandidateFromNearby(const SyntheticRoom& room, const MapRows& rows) {
  const auto map = *Map::FromRows(rows);
  const Pose pose = PoseAt({0.2, 0.1, 1.2}, 92);
  const Query query = MakeQuery(RenderFeatures(room, pose, {}, 1), room.camera, {});
  const auto candidates = *RetrieveByWords(*map, query, {});
  ASSERT_FALSE(candidates.empty());
  EXPECT_LE(candidates[0].score, 1);
  EXPECT_LT(CenterErrorM(rows.images[candidates[0].image].cam_from_world, pose), 2);
  EXPECT_LT(RotationErrorDeg(rows.images[candidates[0].image].cam_from_world, pose), 46);
}

TEST(Retrieve, WordsFindTheImageTakenFromNearby) {
  const SyntheticRoom room = MakeSyntheticRoom(1);
  ExpectCandidateFromNearby(room, room.rows);
}

TEST(Retrieve, LandmarksAsWordsFindTheImageTakenFromNearby) {
  const SyntheticRoom room = MakeSyntheticRoom(1);
  MapRows rows = room.rows;
  rows.vocabulary = {};
  ExpectCandidateFromNearby(room, rows);
}

TEST(Retrieve, WordsOfABlockedMapScoreAsThoseOfTheWholeVocabulary) {
  const SyntheticRoom room = MakeSyntheticRoom(1);
  const auto map = *Map::FromRows(room.rows);
  const Query query = MakeQuery(RenderFeatures(room, PoseAt({0, 0, 1.2}, 30), {}, 2), room.camera, {});
  const auto candidates = *RetrieveByWords(*map, query, {});
  const auto scored = QueryVocabulary(room.rows.vocabulary, query.features.descriptors, 20);
  ASSERT_FALSE(candidates.empty());
  for (size_t i = 0; i < candidates.size(); ++i) {
    EXPECT_EQ(candidates[i].image, scored[i].document);
    EXPECT_NEAR(candidates[i].score, scored[i].score, 1e-6);
  }
}

}  // namespace
}  // namespace cairn
