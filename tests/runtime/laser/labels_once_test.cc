// What a search for interpretations tries, counted by hand; and that no wall has two segments where that is
// so.
#include <gtest/gtest.h>

#include "runtime/laser/interpretation_tree.h"
#include "tests/decompose_views/plan_fixture.h"
#include "tests/runtime/scans/simulated_scan.h"

namespace cairn {
namespace {

// Two pieces of the lower wall of a room, and one of the right wall.
TEST(InterpretationTree, AWallHasTwoSegmentsOnlyWhereThatIsAllowed) {
  const Views views = decompose_views::Decomposed("0,0,4,0\n4,0,4,3\n4,3,0,3\n0,3,0,0").views;
  const ViewSearchIndex index(views);
  const std::vector<ScanSegment> segments = {{{-1.9, -1}, {-0.1, -1}, 1e-3, 1e-3, 50},
                                             {{0.1, -1}, {1.8, -1}, 1e-3, 1e-3, 50},
                                             {{2, -0.9}, {2, 1.8}, 1e-3, 1e-3, 50}};
  for (const bool early : {false, true}) {
    InterpretationTreeOptions options{.search = "standard", .fix_pose_early = early};
    EXPECT_TRUE(SearchInterpretations(index, segments, options)->solutions.empty()) << early;
    options.one_segment_per_wall = false;
    EXPECT_FALSE(SearchInterpretations(index, segments, options)->solutions.empty()) << early;
  }
}

// The same where the walls are parallel, which leave the place along them open.
TEST(InterpretationTree, AParallelWallHasTwoSegmentsOnlyWhereThatIsAllowed) {
  const Views views = decompose_views::Decomposed("0,0,10,0\n10,2,0,2").views;
  const ViewSearchIndex index(views);
  const std::vector<ScanSegment> segments = {{{-3, -1}, {1, -1}, 1e-3, 1e-3, 50},
                                             {{3, 1}, {1, 1}, 1e-3, 1e-3, 50},
                                             {{0, 1}, {-2, 1}, 1e-3, 1e-3, 50}};
  InterpretationTreeOptions options{.search = "standard"};
  EXPECT_TRUE(SearchInterpretations(index, segments, options)->solutions.empty());
  options.one_segment_per_wall = false;
  EXPECT_FALSE(SearchInterpretations(index, segments, options)->solutions.empty());
}

// A corner of walls of 4 and 3 m, both seen whole: the longer segment is tried with 4 labels, of which 2 are
// long enough, and below each of these the other one with the 3 that are left.
TEST(InterpretationTree, TriesEachLabelOnce) {
  const Views views = decompose_views::Decomposed("0,0,4,0\n4,0,4,3").views;
  const ViewSearchIndex index(views);
  const std::vector<ScanSegment> segments = {{{-2, -1}, {2, -1}, 1e-3, 1e-3, 50},
                                             {{2, -1}, {2, 2}, 1e-3, 1e-3, 50}};
  const auto found = SearchInterpretations(index, segments, {.search = "standard", .fix_pose_early = false});
  EXPECT_EQ(found->num_nodes, 4 + 2 * 3);
  EXPECT_EQ(found->num_expanded, 2 + 1);  // of those below, one agrees
  EXPECT_TRUE(found->complete);
  EXPECT_FALSE(found->solutions.empty());
}

// All four walls of a room, seen whole: in their order they are two ways around, half a turn apart.
TEST(InterpretationTree, InOrderEachWayIsWalkedOnce) {
  const Views views = decompose_views::Decomposed("0,0,4,0\n4,0,4,3\n4,3,0,3\n0,3,0,0").views;
  const ViewSearchIndex index(views);
  const PlanarPose pose{{1.5, 1}, 0.4};
  std::vector<ScanSegment> segments;
  for (const PlanWall& wall : views.plan.walls)
    segments.push_back({pose.RobotFromFloor(wall.start), pose.RobotFromFloor(wall.end), 1e-3, 1e-3, 10});
  const auto found = SearchInterpretations(index, segments, {});
  EXPECT_EQ(found->num_nodes, 2 * 4);
  EXPECT_EQ(found->num_expanded, 2 * 4);
  EXPECT_EQ(found->solutions.size(), 2U);
  const auto early = SearchInterpretations(index, segments, {.search = "standard"});
  EXPECT_GT(early->num_expanded, 4);
  EXPECT_EQ(early->solutions.size(), 2U);
}

// Searched in groups, the better ranked first, candidates lead to the same in the end.
TEST(InterpretationTree, GroupsOfCandidatesFindWhatAllAtOnceDo) {
  const Views views =
      decompose_views::Decomposed("0,0,9,0\n9,0,9,6\n9,6,0,6\n0,6,0,0\n4,0,4,2\n4,3,4,6\n7.5,1,8.2,1.7")
          .views;
  const ViewSearchIndex index(views);
  const FaceLocator locator(views);
  int tried = 0;
  for (int seed = 0; seed < 30; ++seed) {
    Random random(seed);
    const auto pose = RandomPose(views, locator, 0.2, &random);
    const auto segments = SimulateScan(views, locator.Find(pose->position), *pose,
                                       {.sigma_m = 0.01, .min_length_m = 0.3}, &random);
    if (segments.size() < 4) continue;
    InterpretationTreeOptions options{.max_null_ratio = 0.2, .max_missing_ratio = 0.2};
    const auto at_once = SearchInterpretations(index, segments, options);
    options.rank_growth = 3;
    const auto in_groups = SearchInterpretations(index, segments, options);
    ASSERT_EQ(at_once->num_candidates, in_groups->num_candidates);
    ASSERT_EQ(at_once->solutions.empty(), in_groups->solutions.empty());
    if (at_once->solutions.empty()) continue;
    ++tried;
    EXPECT_LT((at_once->solutions[0].pose.position - in_groups->solutions[0].pose.position).norm(), 0.1)
        << seed;
  }
  EXPECT_GT(tried, 8);
}

}  // namespace
}  // namespace cairn
