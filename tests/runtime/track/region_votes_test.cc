#include "runtime/track/region_votes.h"

#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/map/landmark_set.h"
#include "runtime/track/region_tracker.h"
#include "tests/option_limits.h"
#include "tests/runtime/localize/region_room.h"

namespace cairn {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<LandmarkIdx> Range(LandmarkIdx first, LandmarkIdx count) {
  std::vector<LandmarkIdx> range(count);
  std::iota(range.begin(), range.end(), first);
  return range;
}

// Four regions with landmarks of their own, and two that no region has.
//   region   landmarks   in one image at most
//   0          0 ..  3     4
//   1          4 .. 23    10: halves, as a camera sees that looks ahead or back
//   2         24 .. 53    30
//   3       none
//   -         54, 55
std::shared_ptr<const Map> FourRegions() {
  MapRows rows;
  Camera camera;
  camera.width = camera.height = 100;
  camera.params = {100, 50, 50};
  rows.cameras = {camera};
  rows.landmarks.resize(56);
  rows.descriptors = DescriptorMatrix::Zero(56, kSiftDescriptorDim);
  const std::vector<std::vector<LandmarkIdx>> in_view = {Range(0, 4), Range(4, 10), Range(14, 10),
                                                         Range(24, 30)};
  for (const std::vector<LandmarkIdx>& landmarks : in_view) {
    const auto image_id = static_cast<ImageId>(rows.images.size() + 1);
    rows.images.push_back({.image_id = image_id,
                           .name = std::to_string(image_id),
                           .camera_id = camera.camera_id,
                           .landmarks = landmarks});
  }
  rows.stations.resize(4);
  rows.regions = {{{0}, Range(0, 4)}, {{1}, Range(4, 20)}, {{2}, Range(24, 30)}, {{3}, {}}};
  return *Map::FromRows(rows);
}

const VoteOptions kHalf{.min_vote_ratio = 0.5};

Vote VoteOf(const std::vector<LandmarkIdx>& seen, const VoteOptions& options = kHalf) {
  return *VoteForRegions(*FourRegions(), seen, options);
}

TEST(VoteForRegions, CountsAgainstWhatOneImageCanShow) {
  const auto map = FourRegions();
  EXPECT_EQ(*MostInView(*map, 0), 4);
  EXPECT_EQ(*MostInView(*map, 1), 10);
  EXPECT_EQ(*MostInView(*map, 2), 30);
  EXPECT_EQ(*MostInView(*map, 3), 0);
  // Half of four and of ten; of thirty seven are enough.
  EXPECT_THAT(VoteOf(Range(0, 2)).regions, ElementsAre(0));
  EXPECT_THAT(VoteOf(Range(4, 5)).regions, ElementsAre(1));
  EXPECT_THAT(VoteOf(Range(4, 4)).regions, IsEmpty());
  EXPECT_THAT(VoteOf(Range(24, 7)).regions, ElementsAre(2));
  EXPECT_THAT(VoteOf(Range(24, 6)).regions, IsEmpty());
  // A fifth: six of thirty; one landmark is none.
  EXPECT_THAT(VoteOf(Range(24, 6), {}).regions, ElementsAre(2));
  EXPECT_THAT(VoteOf(Range(24, 5), {}).regions, IsEmpty());
  EXPECT_THAT(VoteOf(Range(0, 1), {}).regions, IsEmpty());
}

TEST(VoteForRegions, MoreVotesThanAnyRegionHasAskForItsPart) {
  const VoteOptions options{.min_num_votes = 100, .min_vote_ratio = 0.7};
  EXPECT_THAT(VoteOf(Range(24, 21), options).regions, ElementsAre(2));
  EXPECT_THAT(VoteOf(Range(24, 20), options).regions, IsEmpty());
  EXPECT_THAT(VoteOf(Range(4, 7), options).regions, ElementsAre(1));
  EXPECT_THAT(VoteOf(Range(4, 6), options).regions, IsEmpty());
  // And one asks for two.
  EXPECT_THAT(VoteOf(Range(24, 1), {.min_num_votes = 1}).regions, IsEmpty());
  EXPECT_THAT(VoteOf(Range(24, 2), {.min_num_votes = 1}).regions, ElementsAre(2));
}

TEST(VoteForRegions, MostVotesComeFirstAndNoMoreThanAsked) {
  std::vector<LandmarkIdx> seen = Range(24, 9);  // eight of region 1, nine of 2
  for (const LandmarkIdx landmark : Range(4, 8)) seen.push_back(landmark);
  EXPECT_THAT(VoteOf(seen).regions, ElementsAre(2, 1));
  EXPECT_THAT(VoteOf(seen, {.min_vote_ratio = 0.5, .max_num_voted_regions = 1}).regions, ElementsAre(2));
  // A large region with too few votes does not stand before a small one with enough.
  seen = Range(24, 6);
  for (const LandmarkIdx landmark : Range(4, 5)) seen.push_back(landmark);
  EXPECT_THAT(VoteOf(seen).regions, ElementsAre(1));
}

TEST(VoteForRegions, WithoutCandidatesSaysWhatWasFoundAndNeeded) {
  EXPECT_EQ(VoteOf(Range(24, 6)).message, "region 2 has 6 of its landmarks in view, at least 7 are needed");
  EXPECT_EQ(VoteOf(Range(0, 1)).message, "region 0 has 1 of its landmarks in view, at least 2 are needed");
  EXPECT_EQ(VoteOf(Range(54, 2)).message, "none of the 2 landmarks in view belongs to a region");
  EXPECT_EQ(VoteOf({}).message, "none of the 0 landmarks in view belongs to a region");
  EXPECT_THAT(VoteOf(Range(0, 4)).message, IsEmpty());
}

TEST(VoteForRegions, OptionsOutOfTheirRangeAreRefused) {
  ExpectLimits<VoteOptions>({{"min_num_votes", "1", "0"},
                             {"min_vote_ratio", "0.001", "0.0009", "1", "1.001"},
                             {"max_num_voted_regions", "1", "0"}});
}

const RegionTrackerOptions kVotesAlone{.votes = {.localize_when_lost = false}};

// A robot that follows by its prediction, is carried to a region's middle, and has its vote alone there.
struct Carried {
  int num_fixes = 0, num_right = 0;
  // Places among whose candidates theirs is; candidates, and those that look within 45 degrees of its way.
  int num_voted_right = 0, num_voted = 0, num_voted_towards = 0;
  std::vector<Localization> found;
};

Carried CarryThroughRegions(const RegionRoom& regions, const RegionTrackerOptions& options) {
  const auto map = *Map::FromRows(regions.room.rows);
  RegionTracker tracker(map, {}, options);
  Carried carried;
  for (size_t i = 0; i < regions.middles.size(); ++i) {
    const auto region = static_cast<RegionIdx>(29 * i % regions.middles.size());  // far from the one before
    const Pose& truth = regions.middles[region];
    auto found = tracker.TrackFeatures(RenderFeatures(regions.room, truth, {.detection_ratio = 0.9}, 700 + i),
                                       regions.room.camera);
    EXPECT_TRUE(found.ok());
    carried.num_voted_right += std::count(found->voted_regions.begin(), found->voted_regions.end(), region);
    for (const RegionIdx voted : found->voted_regions) {
      ++carried.num_voted;
      const int turns = std::abs(voted % 8 - region % 8);  // regions of one place follow their headings
      carried.num_voted_towards += std::min(turns, 8 - turns) <= 1 ? 1 : 0;
    }
    carried.num_fixes += found->has_fix() ? 1 : 0;
    carried.num_right += found->has_fix() && CenterErrorM(found->cam_from_world, truth) < 0.1 ? 1 : 0;
    carried.found.push_back(*std::move(found));
  }
  return carried;
}

class KidnappedRobot : public testing::TestWithParam<size_t> {};

TEST_P(KidnappedRobot, IsFoundByTheVoteAlone) {
  const RegionRoom regions(GetParam());
  const Carried carried = CarryThroughRegions(regions, kVotesAlone);
  const auto num_places = static_cast<int>(carried.found.size());
  int num_tracked = 0;
  for (const Localization& found : carried.found) {
    num_tracked += found.scope == Scope::kTrack ? 1 : 0;
    if (found.scope == Scope::kTrack) continue;
    EXPECT_EQ(found.scope, Scope::kVotes);
    EXPECT_LE(found.voted_regions.size(), 6u);
    EXPECT_LE(found.num_matches, static_cast<int>(6 * GetParam()));  // of these regions, no others
    if (!found.has_fix()) {
      EXPECT_THAT(found.message, HasSubstr("needed"));
    }
  }
  EXPECT_EQ(carried.num_fixes, carried.num_right);
  EXPECT_LE(num_tracked, 2);
  // Up to nine regions look the same way, over each other's places; six win at most.
  EXPECT_GE(carried.num_voted, num_places);
  EXPECT_GE(carried.num_voted_towards, 0.95 * carried.num_voted);
  EXPECT_GE(carried.num_voted_right, 0.4 * num_places);
  // Regions of four landmarks fix a pose where several are in view.
  EXPECT_GE(carried.num_right, GetParam() == 4 ? 0.2 * num_places : 0.9 * num_places);
}

INSTANTIATE_TEST_SUITE_P(RegionsOf, KidnappedRobot, testing::Values(4, 10, 40));

TEST(KidnappedRobot, SureVotesAreTakenAtOnceOthersAreComparedWithTheWholeMap) {
  const Carried forty = CarryThroughRegions(RegionRoom(40), {});
  int num_voted = 0;
  for (const Localization& found : forty.found) {
    num_voted += found.scope == Scope::kVotes ? 1 : 0;
    if (found.scope == Scope::kVotes) {
      EXPECT_GE(found.num_unguided_inliers, LocalizerOptions().sure_num_unguided_inliers);
    }
  }
  EXPECT_GE(num_voted, static_cast<int>(0.9 * static_cast<double>(forty.found.size())));
  const RegionRoom ten(10);
  const Carried alone = CarryThroughRegions(ten, kVotesAlone);
  const Carried compared = CarryThroughRegions(ten, {});
  EXPECT_EQ(compared.num_fixes, compared.num_right);
  EXPECT_GE(compared.num_right, alone.num_right);
}

TEST(KidnappedRobot, ARegionOfFourLandmarksIsVotedForAndAPoseSaysWhatItLacks) {
  RegionRoom regions(4);
  regions.room.rows.regions.resize(1);
  const auto map = *Map::FromRows(regions.room.rows);
  RegionTracker tracker(map, {}, kVotesAlone);
  const auto found = tracker.TrackFeatures(
      RenderFeatures(regions.room, regions.middles[0], {.detection_ratio = 1}, 1), regions.room.camera);
  ASSERT_TRUE(found.ok());
  EXPECT_THAT(found->voted_regions, ElementsAre(0));
  EXPECT_EQ(found->reason, NoFix::kTooFewMatches);
  EXPECT_THAT(found->message, HasSubstr("4 matches with 4 landmarks, at least 7 are needed"));
  EXPECT_EQ(found->scope, Scope::kVotes);
}

TEST(KidnappedRobot, WithoutAVoteTheReasonIsSaid) {
  RegionRoom regions(10);
  const auto see = [&](const MapRows& rows, const LocalizerOptions& options) {
    RegionTracker tracker(*Map::FromRows(rows), options, kVotesAlone);
    return *tracker.TrackFeatures(RenderFeatures(regions.room, regions.middles[0], {}, 1),
                                  regions.room.camera);
  };
  const Localization many = see(regions.room.rows, {.fall_back_max_num_landmarks = 10});
  EXPECT_EQ(many.reason, NoFix::kNoCandidates);
  EXPECT_THAT(many.message, HasSubstr("too many to vote, at most 10 may"));
  EXPECT_GT(many.num_features, 0);
  MapRows rows = regions.room.rows;
  rows.regions.clear();
  const Localization none = see(rows, {});
  EXPECT_EQ(none.reason, NoFix::kNoCandidates);
  EXPECT_THAT(none.message, HasSubstr("landmarks in view belongs to a region"));
  EXPECT_THAT(none.voted_regions, IsEmpty());
}

}  // namespace
}  // namespace cairn
