#include <algorithm>
#include <cmath>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_blocks.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/track/region_tracker.h"
#include "tests/runtime/localize/room_drive.h"

namespace cairn {
namespace {

constexpr double kApartM = 30;

// The room, and others like it, each 30 m from the one before, that words and regions do not lead to, as the
// survey knows.
MapRows RoomsAlike(int num_rooms) {
  MapRows rows = Room().rows;
  const auto num_images = static_cast<int32_t>(rows.images.size());
  const auto num_landmarks = static_cast<LandmarkIdx>(rows.landmarks.size());
  rows.descriptors = Room().rows.descriptors.replicate(num_rooms, 1);
  for (int room = 1; room < num_rooms; ++room) {
    const Pose from_other{Eigen::Quaterniond::Identity(), {-kApartM * room, 0, 0}};
    for (LandmarkIdx i = 0; i < num_landmarks; ++i) {
      rows.landmarks.push_back(rows.landmarks[i]);
      rows.landmarks.back().position.x() += kApartM * room;
    }
    for (int32_t i = 0; i < num_images; ++i) {
      MapImage other = rows.images[i];
      other.image_id += room * num_images;
      other.cam_from_world = other.cam_from_world * from_other;
      other.station = -1;
      for (LandmarkIdx& landmark : other.landmarks) landmark += room * num_landmarks;
      rows.images.push_back(std::move(other));
    }
  }
  for (int32_t i = 0; i < num_rooms * num_images; ++i)
    rows.appearance.push_back({.images = {i}, .is_kept = true, .entropy = 0.7});
  for (int32_t i = 0; i < num_images; ++i) {
    for (int room = 1; room < num_rooms; ++room)
      rows.appearance[i].look_alikes.push_back({room * num_images + i, 1});
  }
  return rows;
}

TEST(Localizer, WithholdsAFixUntilTheLookAlikeIsExcluded) {
  MapRows rows = RoomsAlike(2);
  const Pose truth = PoseAt({1, 0.5, 1.2}, 20);
  const Features features = RenderFeatures(Room(), truth, {}, 3);
  LocalizerOptions options;
  options.fall_back_to_all = false;
  const auto localize = [&](const std::optional<PosePrior>& prior) {
    return *Localizer(*Map::FromRows(rows), options).LocalizeFeatures(features, Room().camera, prior);
  };
  const Localization withheld = localize(std::nullopt);
  EXPECT_EQ(withheld.reason, NoFix::kAmbiguous);
  ASSERT_EQ(withheld.possible_poses.size(), size_t{2});  // in the room and in its twin
  EXPECT_LT(std::min(CenterErrorM(withheld.possible_poses[0], truth),
                     CenterErrorM(withheld.possible_poses[1], truth)),
            0.1);
  EXPECT_NEAR(CenterErrorM(withheld.possible_poses[0], withheld.possible_poses[1]), kApartM, 0.2);
  const Localization with_prior = localize(PosePrior{truth, 1, 10});
  ASSERT_TRUE(with_prior.has_fix()) << with_prior.message;
  EXPECT_LT(CenterErrorM(with_prior.cam_from_world, truth), 0.1);
  EXPECT_EQ(localize(PosePrior{truth, 12, 10}).reason, NoFix::kAmbiguous) << "30 m are within the prior";
  options.exclude_look_alikes = false;
  EXPECT_TRUE(localize(std::nullopt).has_fix());
  options.exclude_look_alikes = true;
  // A twin that differs in two thirds of its landmarks explains the image less well, but not a hundred times
  // less likely; one that differs in nine tenths does.
  Random random(9);
  const auto differ = [&](int of_ten) {
    for (Eigen::Index i = rows.descriptors.rows() / 2; i < rows.descriptors.rows(); ++i) {
      if (i % 10 < of_ten) rows.descriptors.row(i) = RandomDescriptor(random);
    }
  };
  differ(7);
  const Localization less_well = localize(std::nullopt);
  EXPECT_EQ(less_well.reason, NoFix::kAmbiguous);
  ASSERT_EQ(less_well.possible_poses.size(), size_t{2});
  EXPECT_LT(CenterErrorM(less_well.possible_poses[0], truth), 0.1);
  EXPECT_GT(less_well.possible_probabilities[0], 0.6);
  options.min_look_alike_odds = 1;
  EXPECT_TRUE(localize(std::nullopt).has_fix());
  options.min_look_alike_odds = 100;
  differ(9);
  EXPECT_TRUE(localize(std::nullopt).has_fix());
}

// Whatever it may take: the check is never what is left out.
TEST(Localizer, ABudgetMakesNoFixOfLookAlikes) {
  const auto map = *Map::FromRows(RoomsAlike(2));
  const Features features = RenderFeatures(Room(), PoseAt({1, 0.5, 1.2}, 20), {}, 3);
  int num_ambiguous = 0, num_over = 0;
  for (double budget_ms = 0.5; budget_ms < 60; budget_ms *= 1.15) {
    LocalizerOptions options;
    options.budget_ms = budget_ms;
    const Localization found = *Localizer(map, options).LocalizeFeatures(features, Room().camera);
    EXPECT_LE(found.work_ms, budget_ms + 1e-9);
    EXPECT_FALSE(found.has_fix()) << budget_ms;
    num_ambiguous += found.reason == NoFix::kAmbiguous ? 1 : 0;
    num_over += found.reason == NoFix::kOverBudget ? 1 : 0;
  }
  EXPECT_GE(num_ambiguous, 5);
  EXPECT_GE(num_over, 5);
}

// Of a twin in which most landmarks have changed places few matches are right: samples that are cut short
// find no pose there, and what was not found is not excluded.
TEST(Localizer, ALookAlikeForWhichNoWorkIsLeftIsNotExcluded) {
  struct Twin {
    int moved_of_ten;
    int view;
  };
  for (const auto [moved_of_ten, view] : {Twin{6, 2}, Twin{7, 5}, Twin{6, 5}, Twin{7, 14}}) {
    MapRows rows = RoomsAlike(2);
    const DescriptorMatrix before = rows.descriptors;
    std::vector<Eigen::Index> moved;
    for (Eigen::Index i = before.rows() / 2; i < before.rows(); ++i) {
      if ((i * 7) % 10 < moved_of_ten) moved.push_back(i);
    }
    for (size_t k = 0; k < moved.size(); ++k)
      rows.descriptors.row(moved[k]) = before.row(moved[(k + 17) % moved.size()]);
    const auto map = *Map::FromRows(rows);
    constexpr double kDetected[] = {0.12, 0.2, 0.35};
    const Features features = RenderFeatures(Room(), PoseAt({1 - 0.1 * view, 0.5, 1.2}, 20 + 7 * view),
                                             {.detection_ratio = kDetected[view % 3]}, view);
    const Localization any = *Localizer(map).LocalizeFeatures(features, Room().camera);
    if (any.has_fix()) continue;
    ASSERT_EQ(any.reason, NoFix::kAmbiguous) << any.message;
    for (double budget_ms = 0.5 * any.work_ms; budget_ms < 1.1 * any.work_ms; budget_ms *= 1.005) {
      LocalizerOptions options;
      options.budget_ms = budget_ms;
      const Localization found = *Localizer(map, options).LocalizeFeatures(features, Room().camera);
      EXPECT_FALSE(found.has_fix()) << moved_of_ten << " " << view << " " << budget_ms;
    }
  }
}

// What is matched leads to the room and to the second one, each with half of what it shows; the third is like
// the first.
TEST(Localizer, NamesAllPlacesThatLookAlikeWhereItIsOneOfTwo) {
  MapRows rows = RoomsAlike(3);
  const Eigen::Index num_landmarks = rows.descriptors.rows() / 3;
  Random random(13);
  for (Eigen::Index i = 0; i < num_landmarks; ++i) {
    const bool differs_in_second = random.Uniform() < 0.5;
    for (const int room : {0, 1, 2}) {
      if (differs_in_second == (room == 1))
        rows.descriptors.row(room * num_landmarks + i) = RandomDescriptor(random);
    }
  }
  std::vector<LandmarkIdx> of_two(2 * num_landmarks);
  std::iota(of_two.begin(), of_two.end(), 0);
  const Pose truth = PoseAt({1, 0.5, 1.2}, 20);
  const auto rooms_of = [&](bool exclude_look_alikes) {
    LocalizerOptions options;
    options.exclude_look_alikes = exclude_look_alikes;
    const Localizer localizer(*Map::FromRows(rows), options);
    const Query query = *localizer.QueryFromFeatures(RenderFeatures(Room(), truth, {}, 3), Room().camera);
    const Localization found = *localizer.LocalizeAmong(query, Scope::kVotes, of_two, std::nullopt);
    EXPECT_EQ(found.reason, NoFix::kAmbiguous) << found.message;
    std::vector<long> rooms;
    for (const Pose& pose : found.possible_poses)
      rooms.push_back(std::lround((pose.Center() - truth.Center()).x() / kApartM));
    std::sort(rooms.begin(), rooms.end());
    return rooms;
  };
  EXPECT_THAT(rooms_of(false), testing::ElementsAre(0, 1));
  EXPECT_THAT(rooms_of(true), testing::ElementsAre(0, 1, 2));
}

// The twin's landmarks look a little different, so that the visible ones vote for the room; alone they match.
TEST(RegionTracker, WithholdsAVotedFixUntilTheLookAlikeIsExcluded) {
  MapRows rows = RoomsAlike(2);
  Random random(11);
  for (Eigen::Index i = rows.descriptors.rows() / 2; i < rows.descriptors.rows(); ++i) {
    for (int d = 0; d < kSiftDescriptorDim; ++d) {
      const double value = random.Normal(rows.descriptors(i, d), 16);
      rows.descriptors(i, d) = static_cast<uint8_t>(std::clamp(value, 0.0, 255.0));
    }
  }
  const auto map = *Map::FromRows(rows);
  const Pose truth = PoseAt({1, 0.5, 1.2}, 20);
  const auto track = [&](RegionTracker* tracker, const Pose& pose) {
    return *tracker->TrackFeatures(RenderFeatures(Room(), pose, {}, 3), Room().camera);
  };
  LocalizerOptions options;
  options.fall_back_to_all = false;
  RegionTracker careful(map, options);
  EXPECT_EQ(track(&careful, truth).reason, NoFix::kAmbiguous);
  options.exclude_look_alikes = false;
  RegionTracker careless(map, options);
  const Localization fix = track(&careless, truth);
  EXPECT_TRUE(fix.has_fix()) << fix.message;
  EXPECT_EQ(fix.scope, Scope::kVotes);
}

TEST(Map, ListsLookAlikesAtBothPlaces) {
  std::vector<std::vector<MapAppearanceNode::LookAlike>> all = {{{1, 0.5}, {3, 0.25}}, {{2, 0.75}}, {}, {}};
  CompleteLookAlikes(&all);
  using List = std::vector<MapAppearanceNode::LookAlike>;
  EXPECT_THAT(all, testing::ElementsAre(List{{1, 0.5}, {3, 0.25}}, List{{0, 0.5}, {2, 0.75}}, List{{1, 0.75}},
                                        List{{0, 0.25}}));
}

}  // namespace
}  // namespace cairn
