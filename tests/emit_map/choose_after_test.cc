#include "stages/emit_map/choose/choose_after.h"

#include <algorithm>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/promise/wall_survey.h"

namespace cairn::emit_map {
namespace {

constexpr int32_t kNone = kNotBefore;
constexpr int kNumThreads = 1;

// A map of a wall of 12 m, made as emit_map makes it, and the same survey again.
class ChooseAfterTest : public testing::Test {
 protected:
  void SetUp() override {
    const PromiseMaker maker(classes_, MatchModel(classes_, {}, kNumThreads), kNumThreads);
    // Half as many again as the promise takes, so that there is something to lose.
    std::vector<size_t> first;
    for (size_t i = 0; i < classes_.classes.size(); i += 5) first.push_back(i);
    keep_ = maker.Complete(first, basis_.model, options_);
    promises_ = maker.Promise(keep_, basis_, options_);
    for (const SurveyImage& image : classes_.images)
      previous_.images.push_back({.image_id = image.image_id,
                                  .name = image.name,
                                  .camera_id = 1,
                                  .cam_from_world = image.cam_from_world});
    previous_.findings.promise = promises_.findings;
    for (size_t i = 0; i < keep_.size(); ++i) {
      matches_.landmark_of_class.push_back(keep_[i] != 0 ? static_cast<int32_t>(previous_.landmarks.size())
                                                         : kNone);
      if (keep_[i] != 0) previous_.landmarks.push_back({.class_id = classes_.classes[i].class_id});
    }
    for (const Promises::Region& region : promises_.regions) {
      MapRegion row;
      for (const size_t i : region.classes) row.landmarks.push_back(matches_.landmark_of_class[i]);
      previous_.regions.push_back(row);
    }
  }

  ChosenAfter After() const {
    return ChooseAfter(classes_, may_keep_, previous_, matches_, options_, kNumThreads);
  }

  // As if a class of these were gone: what the map has of it is of no class, and it may not be kept.
  template <class IsGone>
  size_t Lose(const IsGone& is_gone) {
    size_t num = 0;
    for (size_t i = 0; i < keep_.size(); ++i) {
      if (keep_[i] == 0 || !is_gone(classes_.classes[i])) continue;
      matches_.landmark_of_class[i] = kNone;
      may_keep_[i] = 0;
      classes_.classes[i].observations.clear();
      ++num;
    }
    return num;
  }

  static constexpr double kEnd = 4;  // of what is lost, m along the wall

  Classes classes_ = RandomWallSurvey(60, 0.2, 1500, 0.9, 0.7, 11);
  PromiseBasis basis_{.model = {.match_ratio = 0.8, .shape = 8, .error_ratio = 1.2},
                      .left_out = {{0.9, 7, 6, 0.95}}};
  PromiseOptions options_{.terms = {}, .max_region_landmarks = 90};
  std::vector<char> keep_;
  std::vector<char> may_keep_ = std::vector<char>(classes_.classes.size(), 1);
  Promises promises_;
  MapRows previous_;
  PreviousMatches matches_;
};

TEST_F(ChooseAfterTest, NothingChangesWhereNothingDid) {
  ASSERT_GT(promises_.regions.size(), 1U);
  const ChosenAfter after = After();
  EXPECT_EQ(after.keep, keep_);
  EXPECT_EQ(after.promises.findings.nodes, promises_.findings.nodes);
  EXPECT_EQ(after.promises.findings.model, basis_.model);
  EXPECT_EQ(after.promises.findings.left_out, basis_.left_out) << "what was tried then";
  ASSERT_EQ(after.promises.regions.size(), promises_.regions.size());
  for (size_t r = 0; r < promises_.regions.size(); ++r) {
    EXPECT_EQ(after.promises.regions[r].classes, promises_.regions[r].classes);
    EXPECT_EQ(after.promises.regions[r].images, promises_.regions[r].images);
  }
  EXPECT_EQ(after.promises.regions_lower_bound >= 1, true);
}

TEST_F(ChooseAfterTest, WhatIsGoneIsReplacedThereAndNowhereElse) {
  const size_t num_lost = Lose([](const FeatureClass& gone) { return gone.position.x() < kEnd; });
  ASSERT_GT(num_lost, 20U);
  const ChosenAfter after = After();
  size_t num_new = 0;
  for (size_t i = 0; i < keep_.size(); ++i) {
    const bool was_kept = matches_.landmark_of_class[i] != kNone;
    EXPECT_TRUE(!was_kept || after.keep[i] == 1) << i;
    EXPECT_TRUE(may_keep_[i] != 0 || after.keep[i] == 0) << i;
    if (was_kept || after.keep[i] == 0) continue;
    ++num_new;
    EXPECT_LT(classes_.classes[i].position.x(), kEnd + 2) << "images see 2 m to each side";
  }
  EXPECT_GT(num_new, 0U);
  // Where there was more than enough, enough comes: 20 matches, or nine tenths of what there were.
  for (size_t node = 0; node < promises_.findings.nodes.size(); ++node) {
    const double before = promises_.findings.nodes[node].num_matches / basis_.model.match_ratio;
    const double now = after.promises.findings.nodes[node].num_matches / basis_.model.match_ratio;
    EXPECT_GE(now, std::min(20.0, 0.9 * before) - 0.7) << node;
  }
}

TEST_F(ChooseAfterTest, NewLandmarksAreOfTheRegionsThatExpectThem) {
  Lose([](const FeatureClass& gone) { return gone.position.x() < kEnd; });
  const ChosenAfter after = After();
  ASSERT_EQ(after.promises.regions.size(), promises_.regions.size());
  std::set<size_t> of_regions;
  for (size_t r = 0; r < promises_.regions.size(); ++r) {
    const std::vector<size_t>& classes = after.promises.regions[r].classes;
    EXPECT_TRUE(std::is_sorted(classes.begin(), classes.end()));
    of_regions.insert(classes.begin(), classes.end());
    for (const size_t i : promises_.regions[r].classes) {
      EXPECT_EQ(std::binary_search(classes.begin(), classes.end(), i), may_keep_[i] != 0)
          << "those that are left stay";
    }
    for (const size_t i : classes) EXPECT_EQ(after.keep[i], 1);
  }
  for (size_t i = 0; i < keep_.size(); ++i) {
    const bool is_new = after.keep[i] != 0 && matches_.landmark_of_class[i] == kNone;
    EXPECT_TRUE(!is_new || of_regions.contains(i)) << i;
  }
}

TEST_F(ChooseAfterTest, RegionsThatGrowOutOfBoundsAreDividedAnew) {
  Lose([](const FeatureClass& gone) { return gone.position.x() < kEnd; });
  size_t most = 0;
  for (const MapRegion& region : previous_.regions) most = std::max(most, region.landmarks.size());
  // All that is kept would come into the region of one node.
  options_.max_region_landmarks = 30;
  for (MapRegion& region : previous_.regions) region.landmarks.resize(1);
  const ChosenAfter after = After();
  EXPECT_GT(after.promises.regions.size(), promises_.regions.size());
}

TEST_F(ChooseAfterTest, PlacesTheMapDidNotKnowGetAsMuchAsOthers) {
  // The earlier survey ended half way.
  const double middle = 6;
  for (size_t i = 0; i < keep_.size(); ++i) {
    if (classes_.classes[i].position.x() > middle + 2.5) matches_.landmark_of_class[i] = kNone;
  }
  std::vector<NodePromise>& nodes = previous_.findings.promise->nodes;
  std::erase_if(nodes, [&](const NodePromise& node) {
    return classes_.images[node.image].cam_from_world.Center().x() > middle;
  });
  const ChosenAfter after = After();
  double least = 1e9;
  for (const NodePromise& node : after.promises.findings.nodes) {
    if (classes_.images[node.image].cam_from_world.Center().x() > middle + 2.5)
      least = std::min(least, node.num_matches);
  }
  EXPECT_GE(least / basis_.model.match_ratio, 19);
  for (const Promises::Region& region : after.promises.regions) EXPECT_FALSE(region.classes.empty());
}

TEST_F(ChooseAfterTest, ALandmarkIsStillThereWhereItsClassMayBeKept) {
  may_keep_ = {1, 1, 0, 1, 1};
  matches_.landmark_of_class = {7, kNone, 3, 0, 5};
  EXPECT_THAT(StillThere(may_keep_, matches_), testing::ElementsAre(3, 4, 0)) << "in the earlier map's order";
}

TEST(IsMostlyNew, CountsImagesOfSessionsThatTheEarlierMapDoesNotHave) {
  Classes classes;
  MapRows previous;
  const auto images = [&](const std::string& session, int num) {
    for (int i = 0; i < num; ++i) classes.images.push_back({.name = session + "/" + std::to_string(i)});
  };
  previous.images.resize(20);
  classes.sessions = {"a", "b", "c"};
  images("a", 15);  // five of the past are not in it
  images("b", 5);
  EXPECT_FALSE(IsMostlyNew(classes, previous)) << "5 of 25";
  images("b", 1);
  EXPECT_TRUE(IsMostlyNew(classes, previous)) << "6 of 26";
  previous.sessions = {"a", "b"};
  EXPECT_FALSE(IsMostlyNew(classes, previous));
  images("c", 6);
  EXPECT_TRUE(IsMostlyNew(classes, previous));
  classes.sessions.clear();
  EXPECT_FALSE(IsMostlyNew(classes, previous)) << "images of no session";
}

}  // namespace
}  // namespace cairn::emit_map
