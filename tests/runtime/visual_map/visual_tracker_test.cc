#include "runtime/visual_map/visual_tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/map.h"
#include "stages/emit_map/model_landmarks.h"
#include "tests/core/map/sealed_blocks.h"
#include "tests/runtime/visual_map/visual_room.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// The room with a region for each wall: all places, and k landmarks of that wall.  A camera that looks at it
// sees most of them.
struct RoomOfWalls {
  static constexpr double kHeadings[] = {-std::numbers::pi / 2, std::numbers::pi, std::numbers::pi / 2, 0};
  static constexpr int kNumPoints = 400;
  VisualRoom room{kNumPoints};

  explicit RoomOfWalls(size_t k) {
    room.rows.visual_map = *emit_map::ModelLandmarks(room.classes, room.rows, {}, 2);
    room.rows.regions.resize(4);
    for (int wall = 0; wall < 4; ++wall) {
      MapRegion& region = room.rows.regions[wall];
      std::vector<std::pair<double, LandmarkIdx>> sides[2];  // of the wall's middle; 60 cm away first
      for (size_t i = 0; i < room.points.size(); ++i) {
        const Eigen::Vector3d& point = room.points[i];
        const double away[] = {point.y(), point.x(), 4 - point.y(), 5 - point.x()};
        const double aside = wall % 2 == 0 ? point.x() - 2.5 : point.y() - 2;
        if (away[wall] < 1e-9 && point.z() > 0.3 && point.z() < 1.8)
          sides[aside > 0].emplace_back(std::abs(std::abs(aside) - 0.6), static_cast<LandmarkIdx>(i));
      }
      for (auto& side : sides) {
        std::sort(side.begin(), side.end());
        EXPECT_GE(side.size(), k / 2);
        for (size_t i = 0; i < k / 2; ++i) region.landmarks.push_back(side[i].second);
      }
      std::sort(region.landmarks.begin(), region.landmarks.end());
      for (size_t station = 0; station < room.rows.stations.size(); ++station)
        region.stations.push_back(static_cast<StationIdx>(station));
    }
  }

  Query Look(const Eigen::Vector2d& at, double heading_rad) const {
    Features features;
    const auto seen = room.See(VisualRoom::PoseAt(at, heading_rad));
    features.descriptors.resize(static_cast<Eigen::Index>(seen.size()), kSiftDescriptorDim);
    for (const auto& [point, keypoint] : seen) {
      features.descriptors.row(static_cast<Eigen::Index>(features.keypoints.size())) =
          room.rows.descriptors.row(point);
      features.keypoints.push_back(keypoint);
    }
    return MakeQuery(std::move(features), room.rows.cameras[0], {});
  }
  Query LookAtWall(const Eigen::Vector2d& at, int wall) const { return Look(at, kHeadings[wall]); }

  VisualTracker MakeTracker(const VisualTrackerOptions& options,
                            const VisualMapOptions& map_options = {}) const {
    return *VisualTracker::Make(*Map::FromRows(room.rows), map_options, options);
  }
};

const RoomOfWalls& Walls(size_t k) {
  static const RoomOfWalls four(4), ten(10), forty(40);
  return k == 4 ? four : k == 10 ? ten : forty;
}

const VisualTrackerOptions kVotesAlone{.votes = {.localize_when_lost = false}};
// Where the walls' landmarks are seen from near the middle, and from aside.
const Eigen::Vector2d kPlaces[] = {{2.4, 2.1}, {2.1, 1.9}, {2.9, 2.2}, {2.6, 1.8}};

class CarriedOnTheFloor : public testing::TestWithParam<size_t> {};

TEST_P(CarriedOnTheFloor, IsFoundByTheVoteAloneWithTheModelsOfItsRegion) {
  const RoomOfWalls& walls = Walls(GetParam());
  VisualTrackerOptions options = kVotesAlone;
  options.max_num_tracked_regions = 3;  // of four that are everywhere: it never knows its regions
  VisualTracker tracker = walls.MakeTracker(options);
  for (int i = 0; i < 8; ++i) {
    const int wall = 3 * i % 4;  // turned round, and put elsewhere
    const auto found = tracker.See(walls.LookAtWall(kPlaces[i % 4], wall));
    ASSERT_TRUE(found.ok()) << found.error().message;
    EXPECT_EQ(found->pose.flag, VisualFlag::kNone) << i << ": " << found->pose.message;
    EXPECT_LT((found->pose.position - kPlaces[i % 4]).norm(), 0.05) << i;
    EXPECT_EQ(found->scope, Scope::kVotes) << i;
    ASSERT_FALSE(found->regions.empty());
    EXPECT_EQ(found->regions[0], wall) << i;
    EXPECT_LE(found->pose.num_matches, static_cast<int>(found->regions.size() * GetParam()));
  }
  const auto all = *VisualMap::Load(**Map::FromRows(walls.room.rows));
  const int64_t num_kept = tracker.filter().map().num_model_bytes();
  EXPECT_GT(num_kept, 0);
  EXPECT_LE(num_kept,
            static_cast<int64_t>(1.4 * 4 * static_cast<double>(GetParam()) / RoomOfWalls::kNumPoints *
                                 static_cast<double>(all->num_model_bytes())));
}

INSTANTIATE_TEST_SUITE_P(RegionsOf, CarriedOnTheFloor, testing::Values(4, 10, 40));

TEST(VisualTracker, FollowsByTheRegionsOfItsBelief) {
  // Stations with headings, as of a driven survey: a region is one heading everywhere.
  RoomOfWalls walls = Walls(10);
  MapRows& rows = walls.room.rows;
  std::vector<MapStation> stations;
  for (MapRegion& region : rows.regions) region.stations.clear();
  constexpr int kRegionOfHeading[] = {3, 2, 1, 0};  // looking along x, y, -x, -y
  for (size_t i = 0; i < rows.images.size(); ++i) {
    const int heading = static_cast<int>(i % 4);
    stations.push_back(
        {.position = rows.stations[rows.images[i].station].position, .heading_deg = 90.0 * heading});
    rows.images[i].station = static_cast<StationIdx>(i);
    rows.regions[kRegionOfHeading[heading]].stations.push_back(static_cast<StationIdx>(i));
  }
  rows.stations = stations;
  VisualTracker tracker = walls.MakeTracker(kVotesAlone);
  for (int i = 0; i < 5; ++i) {
    if (i > 0) {
      ASSERT_TRUE(tracker.Move({0.1, 0}, 0).ok());
    }
    const Eigen::Vector2d at(2 + 0.1 * i, 2);
    const auto found = tracker.See(walls.LookAtWall(at, 3));
    ASSERT_TRUE(found.ok());
    EXPECT_EQ(found->pose.flag, VisualFlag::kNone) << found->pose.message;
    EXPECT_LT((found->pose.position - at).norm(), 0.05);
    EXPECT_EQ(found->scope, i == 0 ? Scope::kVotes : Scope::kTrack) << i;
    EXPECT_THAT(found->regions, ElementsAre(3)) << i;
  }
  // Turned round by nobody that counts: its regions are not in view, and the vote finds it.
  ASSERT_TRUE(tracker.Move({0, 0}, 0).ok());
  const auto carried = tracker.See(walls.LookAtWall({2.4, 2}, 1));
  ASSERT_TRUE(carried.ok());
  EXPECT_EQ(carried->scope, Scope::kVotes);
  EXPECT_THAT(carried->regions, ElementsAre(1));
  EXPECT_LT((carried->pose.position - Eigen::Vector2d(2.4, 2)).norm(), 0.05);
  EXPECT_LT(AngleBetweenDeg(carried->pose.heading_deg, 180), 1);
  // And it goes on from there.
  EXPECT_EQ(tracker.See(walls.LookAtWall({2.3, 2}, 1))->scope, Scope::kTrack);
}

TEST(VisualTracker, WhereTheRegionIsRightTheResultIsThatOfAllModels) {
  const RoomOfWalls& walls = Walls(40);
  const auto map = *Map::FromRows(walls.room.rows);
  const auto all = *VisualMap::Load(*map);
  for (const int budget_mib : {64, 0}) {
    const auto some = *VisualMap::Open(map, {.model_budget_mib = budget_mib});
    EXPECT_EQ(some->num_model_bytes(), 0);
    EXPECT_THAT(some->ModelsOf(3), IsEmpty());
    for (int i = 0; i < 4; ++i) {
      const Query query = walls.Look(kPlaces[i], 0.3 * i);
      const auto seen = *some->Match(query);
      const auto expected = EstimateVisualPose(*all, *all->Match(query));
      const auto found = EstimateVisualPose(*some, seen);
      ASSERT_TRUE(found.ok()) << found.error().message;
      EXPECT_EQ(found->num_matches, expected->num_matches);
      EXPECT_EQ(found->position, expected->position);
      EXPECT_EQ(found->covariance, expected->covariance);
      EXPECT_EQ(found->at_place, expected->at_place);
    }
    if (budget_mib == 0) {
      EXPECT_EQ(some->num_model_bytes(), 0);
    } else {
      EXPECT_GT(some->num_model_bytes(), 0);
      EXPECT_LT(some->num_model_bytes(), all->num_model_bytes());
    }
  }
}

TEST(VisualTracker, MatchesAmongTheLandmarksAskedForOnly) {
  const RoomOfWalls& walls = Walls(10);
  const auto map = *Map::FromRows(walls.room.rows);
  const Query query = walls.LookAtWall({2.4, 2.1}, 0);
  const std::vector<LandmarkIdx>& asked = walls.room.rows.regions[0].landmarks;
  for (const auto& visual : {*VisualMap::Open(map), *VisualMap::Load(*map)}) {
    const auto some = *visual->MatchAmong(query, asked);
    EXPECT_GE(some.size(), 7u);
    for (const SeenLandmark& match : some)
      EXPECT_TRUE(std::binary_search(asked.begin(), asked.end(), match.landmark));
    EXPECT_GT(visual->Match(query)->size(), some.size());
  }
}

TEST(VisualTracker, WithoutOdometryTheBeliefWidens) {
  const RoomOfWalls& walls = Walls(40);
  const Query blank = MakeQuery({}, walls.room.rows.cameras[0], {});
  const auto entropy_after = [&](const VisualTrackerOptions& options, bool stands) {
    VisualTracker tracker = walls.MakeTracker(options);
    EXPECT_EQ(tracker.See(walls.LookAtWall({2.4, 2.1}, 0))->pose.flag, VisualFlag::kNone);
    if (stands) {
      EXPECT_TRUE(tracker.Move({0, 0}, 0).ok());
    }
    return tracker.See(blank)->pose.entropy;
  };
  const double stands = entropy_after({}, true), drives = entropy_after({}, false);
  EXPECT_GT(drives, stands + 0.5);
  EXPECT_GT(entropy_after({.unknown_way_sigma_m = 1}, false), drives);
}

TEST(VisualTracker, WithoutAVoteAllLandmarksCountOrTheReasonIsSaid) {
  RoomOfWalls walls = Walls(10);
  for (MapRegion& region : walls.room.rows.regions) region.landmarks.clear();
  const Query query = walls.LookAtWall({2.4, 2.1}, 0);
  const auto all = walls.MakeTracker({}).See(query);
  ASSERT_TRUE(all.ok()) << all.error().message;
  EXPECT_EQ(all->pose.flag, VisualFlag::kNone);
  EXPECT_EQ(all->scope, Scope::kAll);
  EXPECT_THAT(all->regions, IsEmpty());
  EXPECT_LT((all->pose.position - Eigen::Vector2d(2.4, 2.1)).norm(), 0.05);
  const auto none = walls.MakeTracker(kVotesAlone).See(query);
  ASSERT_TRUE(none.ok());
  EXPECT_EQ(none->pose.flag, VisualFlag::kTooFewMatches);
  EXPECT_THAT(none->pose.message, HasSubstr("landmarks in view belongs to a region"));
}

TEST(VisualTracker, WhatItCannotUseIsAnError) {
  const RoomOfWalls& walls = Walls(10);
  const auto code = [](const MapRows& rows, const VisualTrackerOptions& options = {},
                       const VisualFilterOptions& filter = {}) {
    const auto tracker = VisualTracker::Make(*Map::FromRows(rows), {}, options, filter);
    return tracker.ok() ? static_cast<ErrorCode>(0) : tracker.error().code;
  };
  const MapRows& rows = walls.room.rows;
  EXPECT_EQ(code(rows), static_cast<ErrorCode>(0));
  EXPECT_EQ(code(VisualRoom(3).rows), ErrorCode::kNotFound);
  EXPECT_EQ(code(rows, {.tracked_ratio = 2}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(rows, {.votes = {.min_num_votes = 0}}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(rows, {}, {.kidnapped_ratio = -1}), ErrorCode::kInvalidArgument);
  MapRows without = rows;
  without.regions.clear();
  EXPECT_EQ(code(without), static_cast<ErrorCode>(0));
  EXPECT_EQ(code(without, kVotesAlone), ErrorCode::kInvalidArgument);

  VisualTracker tracker = walls.MakeTracker({});
  ASSERT_TRUE(tracker.See(walls.LookAtWall({2.4, 2.1}, 0)).ok());
  const std::vector<double> before = tracker.filter().AtPlaces();
  Camera small = rows.cameras[0];
  small.width = 320;
  EXPECT_EQ(tracker.See(MakeQuery({}, small, {})).error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(tracker.Move({std::nan(""), 0}, 0).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(tracker.filter().AtPlaces(), before);
}

TEST(VisualMap, ADamagedPartIsAnErrorWhereItIsNeeded) {
  const std::string path = testing::TempDir() + "/visual_blocks.cairn";
  ASSERT_TRUE(WriteMapRows(Walls(10).room.rows, path).ok());
  const std::string bytes = *ReadFile(path);
  const std::vector<BlockContents> blocks = BlocksOf(*MapFile::Open(path, {}));
  size_t second = 0;  // of the blocks of models: landmarks from 256 on
  for (size_t i = 0; i < blocks.size(); ++i) {
    if (blocks[i].kind == BlockKind::kLandmarkModels) second = i;
  }
  ASSERT_EQ(blocks[second].count, RoomOfWalls::kNumPoints - 256u);
  const auto see_last = [&](const std::vector<BlockContents>& written) {
    EXPECT_TRUE(WriteSealedBlocks(bytes, written, path).ok());
    const auto visual = VisualMap::Open(*Map::Open(path));
    EXPECT_TRUE(visual.ok());
    // What does not need it is as it was.
    EXPECT_TRUE(EstimateVisualPose(**visual, {{3, {100, 100, 1}}, {255, {300, 200, 1}}}).ok());
    const auto found = EstimateVisualPose(**visual, {{3, {100, 100, 1}}, {256, {300, 200, 1}}});
    EXPECT_EQ(VisualMap::Load(**Map::Open(path)).ok(), found.ok());
    return found.ok() ? std::string() : found.error().message;
  };
  EXPECT_EQ(see_last(blocks), "");
  std::vector<BlockContents> damaged = blocks;
  damaged[second].bytes.resize(damaged[second].bytes.size() / 2);
  EXPECT_THAT(see_last(damaged), HasSubstr("make no sense"));
  // Of another survey: the focal length stands behind the camera's number, a byte.
  damaged = blocks;
  damaged[second].bytes[1] ^= 1;
  EXPECT_THAT(see_last(damaged), HasSubstr("its camera and headings are not those of the block before"));
}

}  // namespace
}  // namespace cairn
