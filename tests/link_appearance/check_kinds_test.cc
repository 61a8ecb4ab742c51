#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/link_appearance/check_appearance.h"
#include "tests/link_appearance/graphs.h"
#include "tests/link_appearance/matches.h"
#include "tests/recorded_progress.h"

namespace cairn::link_appearance {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::Not;

// Every node linked to every other.
AppearanceGraph CompleteGraph(int num_nodes) {
  std::vector<std::pair<NodeIdx, NodeIdx>> pairs;
  for (int i = 0; i < num_nodes; ++i) {
    for (int k = i + 1; k < num_nodes; ++k) pairs.emplace_back(i, k);
  }
  return GraphOf(num_nodes, pairs);
}

AppearanceCheck CheckOf(const AppearanceGraph& graph, const LinkAppearanceOptions& options,
                        const CheckAppearanceOptions& check_options) {
  RecordedProgress progress;
  const auto check = CheckAppearance(graph, EachNodeLeftOut(graph), options, check_options, 0, 1, progress);
  EXPECT_TRUE(check.ok()) << check.error().message;
  progress.ExpectAllDone();
  return *check;
}

double NumKept(const AppearanceCheck& check, const std::string& name) {
  const auto found = std::find(check.set_names.begin(), check.set_names.end(), name);
  EXPECT_NE(found, check.set_names.end()) << name;
  return check.sets[found - check.set_names.begin()].num_kept;
}

// Of what is left of it any node dominates the others, and so many dominate them so many times.
TEST(CheckAppearance, KindsOfSetsDifferByWhatTheyAskFor) {
  const AppearanceCheck check = CheckOf(CompleteGraph(6), {.num_tries = 5}, {.max_num_dominators = 3});
  EXPECT_THAT(check.set_names, ElementsAre("greedy", "one by one", "improved", "2-fold, improved",
                                           "3-fold, improved", "weighted, improved"));
  EXPECT_DOUBLE_EQ(NumKept(check, "greedy"), 1);
  EXPECT_DOUBLE_EQ(NumKept(check, "improved"), 1);
  EXPECT_DOUBLE_EQ(NumKept(check, "2-fold, improved"), 2);
  EXPECT_DOUBLE_EQ(NumKept(check, "3-fold, improved"), 3);
  // Four links of 30 inliers are as much as one of a hundred.
  EXPECT_GT(NumKept(check, "weighted, improved"), 3);
  EXPECT_DOUBLE_EQ(NumKept(CheckOf(CompleteGraph(6), {.num_tries = 5}, {.weighted_num_inliers = 30}),
                           "weighted, improved"),
                   1);
}

TEST(CheckAppearance, ASetOfAGivenSizeIsCheckedAsSuch) {
  const AppearanceCheck check = CheckOf(CompleteGraph(6), {.num_kept = 4, .num_tries = 5}, {});
  EXPECT_EQ(check.set_names.back(), "exactly 4");
  EXPECT_DOUBLE_EQ(NumKept(check, "exactly 4"), 4);  // of the others, whichever is left out
  EXPECT_DOUBLE_EQ(NumKept(check, "greedy"), 1);
  EXPECT_THAT(check.set_names, Not(Contains("as asked")));
  for (const LinkAppearanceOptions& options :
       {LinkAppearanceOptions{.num_dominators = 2, .num_tries = 5},
        LinkAppearanceOptions{.strong_num_inliers = 2, .num_tries = 5}})
    EXPECT_EQ(CheckOf(CompleteGraph(4), options, {}).set_names.back(), "as asked");
}

//     1
//     |
// 3 - 0 - 2    without a leaf the middle comes first, without the middle the leaf 1
//     |
//     4
TEST(CheckAppearance, CurvesCountTheFirstNodeThatLocatesAnImage) {
  const AppearanceCheck star =
      CheckOf(GraphOf(5, {{0, 1}, {0, 2}, {0, 3}, {0, 4}}), {.num_tries = 0}, {.kept_ratios = {0.25}});
  EXPECT_THAT(star.sizes, ElementsAre(1));
  ASSERT_THAT(star.curve_names, ElementsAre("greedy", "weighted", "2-fold"));
  EXPECT_EQ(star.curves[0][0].num_localized, 5);
  // By one of four nodes a leaf is located by chance in one of four cases, the middle always.
  EXPECT_DOUBLE_EQ(star.curves[0][0].num_by_random, 4 * 0.25 + 1);
}

TEST(CheckAppearance, AllNodesLocateAllThatIsLinked) {
  const AppearanceCheck check = CheckOf(PathGraph(7), {.num_tries = 0}, {.kept_ratios = {1, 0.5, 0.51}});
  EXPECT_THAT(check.sizes, ElementsAre(3, 6));  // ascending, each once
  for (const std::vector<AppearanceFigure>& curve : check.curves) {
    EXPECT_EQ(curve[1].num_localized, 7);
    EXPECT_DOUBLE_EQ(curve[1].num_by_random, 7);
    EXPECT_LT(curve[0].num_localized, 7);
  }
}

TEST(LinkAppearance, TellsHowManyTriesItMakesAndHowManyPartsItBounds) {
  // Two components of more than one node, and one of one.
  const ImageLinks images = ImagesOf(GraphOf(6, {{0, 1}, {1, 2}, {3, 4}}));
  for (const int num_kept : {0, 4}) {
    RecordedProgress progress;
    ASSERT_TRUE(LinkAppearance(images, nullptr, {.num_kept = num_kept, .num_tries = 50}, 0, &progress).ok());
    ASSERT_EQ(progress.tasks.size(), 2U);
    EXPECT_EQ(progress.tasks[0].name, "choose images");
    EXPECT_EQ(progress.tasks[0].total, num_kept == 0 ? 100 : 200);  // once more for a size that is given
    EXPECT_EQ(progress.tasks[1].total, 3);
    EXPECT_GE(progress.tasks[1].num_done, 3);
    EXPECT_TRUE(progress.tasks[1].has_ended);
  }
}

TEST(LinkAppearance, WhatChoosesAllOrOneByOneRefusesWhatItCannotMeet) {
  const ImageLinks images = ImagesOf(PathGraph(3));
  const auto is_refused = [&](const LinkAppearanceOptions& options) {
    return !LinkAppearance(images, nullptr, options, 0).ok();
  };
  EXPECT_FALSE(is_refused({.algorithm = "online"}));
  EXPECT_TRUE(is_refused({.algorithm = "online", .num_dominators = 2}));
  EXPECT_TRUE(is_refused({.algorithm = "online", .strong_num_inliers = 2}));
  EXPECT_TRUE(is_refused({.algorithm = "online", .num_kept = 2}));
  EXPECT_FALSE(is_refused({.algorithm = "all", .num_dominators = 2}));
  EXPECT_TRUE(is_refused({.algorithm = "all", .num_kept = 2}));
  EXPECT_FALSE(is_refused({.max_detour_links = 2}));
  EXPECT_TRUE(is_refused({.max_detour_links = 1}));
}

}  // namespace
}  // namespace cairn::link_appearance
