#include "runtime/laser/interpretation_tree.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/geometry/pose.h"
#include "core/geometry/vector_geometry.h"
#include "runtime/laser/pairing.h"
#include "runtime/laser/place_support.h"
#include "runtime/laser/view_order.h"
#include "tests/decompose_views/plan_fixture.h"
#include "tests/runtime/scans/simulated_scan.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
constexpr double kDegree = std::numbers::pi / 180;

// A flat of three rooms of different shape, with doors, a niche and a pillar.
const char* const kFlat =
    "0,0,9,0\n9,0,9,6\n9,6,0,6\n0,6,0,0\n"
    "4,0,4,2\n4,3,4,6\n4,3.5,6,3.5\n7,3.5,9,3.5\n"
    "1,1,1.5,1\n1.5,1,1.5,1.6\n1.5,1.6,1,1.6\n1,1.6,1,1\n"
    "2,6,2,5.5\n7.5,1,8.2,1.7\n";

struct Flat {
  Views views = decompose_views::Decomposed(kFlat).views;
  ViewSearchIndex index{views};
  FaceLocator locator{views};
};

InterpretationTreeOptions Exact() {
  InterpretationTreeOptions options;
  options.angle_tolerance_deg = 0.01;
  options.position_tolerance_m = 1e-3;
  options.length_tolerance_m = 1e-3;
  return options;
}

bool IsRight(const Interpretation& found, const PlanarPose& pose, double metres, double degrees) {
  return (found.pose.position - pose.position).norm() <= metres &&
         std::abs(WrapAngle(found.pose.heading_rad - pose.heading_rad)) <= degrees * kDegree;
}

TEST(InterpretationTree, BothSearchesListThePlaceOfEveryNoiseFreeScan) {
  const Flat flat;
  int tried = 0;
  for (int seed = 0; seed < 60; ++seed) {
    Random random(seed);
    const auto pose = RandomPose(flat.views, flat.locator, 0.1, &random);
    const auto segments = SimulateScan(flat.views, flat.locator.Find(pose->position), *pose, {}, &random);
    if (segments.size() < 3) continue;
    ++tried;
    std::array<int64_t, 2> nodes{};
    for (const bool vir : {false, true}) {
      InterpretationTreeOptions options = Exact();
      options.search = vir ? "vir" : "standard";
      options.fix_pose_early = seed % 2 == 0;
      const auto result = SearchInterpretations(flat.index, segments, options);
      ASSERT_TRUE(result.ok());
      nodes[vir] = result->num_nodes;
      const bool listed =
          std::any_of(result->solutions.begin(), result->solutions.end(), [&](const Interpretation& found) {
            return found.determined ? IsRight(found, *pose, 0.005, 0.1) : true;
          });
      EXPECT_TRUE(listed) << "seed " << seed << ", " << options.search;
    }
    EXPECT_LT(nodes[1], nodes[0]);
  }
  EXPECT_GT(tried, 30);
}

TEST(InterpretationTree, NullMatchesTakeSegmentsThatBelongToNoWall) {
  const Flat flat;
  Random random(4);
  const PlanarPose pose{{2.5, 2.7}, 0.4};
  auto segments = SimulateScan(flat.views, flat.locator.Find(pose.position), pose, {}, &random);
  segments.push_back({{1.0, -0.35}, {1.2, 0.3}, 1e-6, 1e-6, 10});
  InterpretationTreeOptions options = Exact();
  options.one_segment_per_wall = false;
  EXPECT_TRUE(SearchInterpretations(flat.index, segments, options)->solutions.empty());
  options.max_null_ratio = 0.2;
  const auto result = SearchInterpretations(flat.index, segments, options);
  ASSERT_FALSE(result->solutions.empty());
  EXPECT_TRUE(IsRight(result->solutions[0], pose, 0.005, 0.1));
  EXPECT_EQ(result->solutions[0].labels.back(), -1);
}

TEST(InterpretationTree, IdenticalRoomsGiveASolutionEach) {
  // Three rooms of 4 x 3 m without doors: in each, two poses half a turn apart.
  const Views views =
      decompose_views::Decomposed("0,0,12,0\n12,0,12,3\n12,3,0,3\n0,3,0,0\n4,0,4,3\n8,0,8,3").views;
  const ViewSearchIndex index(views);
  const FaceLocator locator(views);
  const PlanarPose pose{{1, 1}, 0};
  Random random(0);
  // The long walls are 12 m: the portion seen does not tell which room it is in.
  const auto segments = SimulateScan(views, locator.Find(pose.position), pose, {}, &random);
  const auto result = SearchInterpretations(index, segments, Exact());
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(result->solutions.size(), 6u);
  InterpretationTreeOptions first = Exact();
  first.first_only = true;
  EXPECT_EQ(SearchInterpretations(index, segments, first)->solutions.size(), 1u);
}

TEST(InterpretationTree, ParallelWallsLeaveThePlaceAlongThemOpen) {
  const Views views = decompose_views::Decomposed("0,0,10,0\n0,2,10,2").views;
  const ViewSearchIndex index(views);
  // In the middle between them, 4 m of each.
  const std::vector<ScanSegment> segments = {{{-2, -1}, {2, -1}, 1e-3, 1e-3, 10},
                                             {{2, 1}, {-2, 1}, 1e-3, 1e-3, 10}};
  const auto result = SearchInterpretations(index, segments, {.sigma_wall_m = 0, .sigma_wall_deg = 0});
  ASSERT_FALSE(result->solutions.empty());
  EXPECT_FALSE(result->solutions[0].determined);
  EXPECT_GT(result->solutions[0].covariance(0, 0), 1);
  EXPECT_LT(result->solutions[0].covariance(1, 1), 1e-4);
}

TEST(InterpretationTree, NoPlaceOutsideThePlanExplainsAScan) {
  const Flat flat;
  // Pieces of one wall, as far off as a robot on the Moon would see them.
  const std::vector<ScanSegment> segments = {{{1e6, 0}, {1e6, 1}, 1e-3, 1e-3, 10},
                                             {{1e6, 1}, {1e6, 2}, 1e-3, 1e-3, 10}};
  for (const char* search : {"vir", "standard"}) {
    const auto result =
        SearchInterpretations(flat.index, segments, {.search = search, .one_segment_per_wall = false});
    ASSERT_TRUE(result.ok());
    EXPECT_TRUE(result->solutions.empty());
  }
}

// Two parallel walls, and pieces of a third beside them that bend by 3 degrees: the lines alone leave the
// place along them to 0.2 m or more, but of each short piece all is seen.
TEST(FitPose, EndsThatLieBeyondTheirWallsPullThePlaceBack) {
  const Views views = decompose_views::Decomposed("0,0,10,0\n4,2,5,2.05\n5.5,2.05,6.5,2").views;
  Interpretation found;
  found.labels = {LabelOf(0, false), LabelOf(1, true), LabelOf(2, true)};
  const PlanarPose pose{{5.2, 1}, 0.1};
  std::vector<ScanSegment> segments;
  for (const LabelIdx label : found.labels) {
    const Vec2 start = LabelStart(views.plan, label), end = LabelEnd(views.plan, label);
    segments.push_back({pose.RobotFromFloor(start), pose.RobotFromFloor(end), 0.005, 0.005, 40});
  }
  // The bend is seen 2 cm too low on one side: by lines alone that is 0.2 m along the wall.
  const Vec2 low = 0.02 * (segments[1].end - segments[1].start).unitOrthogonal();
  segments[1].start += low;
  segments[1].end += low;
  FitPose(views.plan, segments, &found);
  EXPECT_TRUE(found.determined);
  EXPECT_NEAR(found.pose.position.x(), pose.position.x(), 0.05);
  // Without knowing where ends are.
  for (ScanSegment& segment : segments) segment.sigma_end_m = 100;
  FitPose(views.plan, segments, &found);
  EXPECT_GT(std::abs(found.pose.position.x() - pose.position.x()), 0.1);
}

TEST(InterpretationTree, TooFewSegmentsAreRefused) {
  const Flat flat;
  EXPECT_EQ(SearchInterpretations(flat.index, {}, {}).error().code, ErrorCode::kNoData);
  EXPECT_EQ(SearchInterpretations(flat.index, {{{1, 0}, {1, 1}, 0.01, 0.01, 5}}, {}).error().code,
            ErrorCode::kNoData);
}

TEST(InterpretationTree, AnExhaustedBudgetIsSaid) {
  const Flat flat;
  Random random(4);
  const PlanarPose pose{{2.5, 2.7}, 0.4};
  const auto segments = SimulateScan(flat.views, flat.locator.Find(pose.position), pose, {}, &random);
  InterpretationTreeOptions options = Exact();
  options.max_num_nodes = 3;
  EXPECT_FALSE(SearchInterpretations(flat.index, segments, options)->complete);
}

// Normalised error squared of x, y and heading, mean of 300 scans: 3 where the covariance is right.  Walls
// stand off by as much, each by itself.
double MeanErrorSquared(const InterpretationTreeOptions& options, double wall_m, double wall_deg) {
  const Flat flat;
  const PlanarPose pose{{2.5, 2.7}, 0.4};
  double sum = 0;
  const int num = 300;
  for (int seed = 0; seed < num; ++seed) {
    Random random(seed);
    Interpretation found;
    const FaceIdx face = flat.locator.Find(pose.position);
    auto segments = SimulateScan(flat.views, face, pose, {.sigma_m = 0.02, .min_length_m = 0.3}, &random);
    // The labels in the order of the segments: those of the exact scan with the same portions.
    std::erase_if(segments, [](const ScanSegment& segment) { return segment.num_points < 6; });
    for (ScanSegment& segment : segments) {
      const Eigen::Vector2d middle = segment.Middle(), along = (segment.end - segment.start).normalized();
      const Eigen::Vector2d off = random.Normal(0, wall_m) * Eigen::Vector2d(-along.y(), along.x());
      const Eigen::Rotation2Dd turn(RadFromDeg(random.Normal(0, wall_deg)));
      segment.start = middle + turn * (segment.start - middle) + off;
      segment.end = middle + turn * (segment.end - middle) + off;
    }
    const auto result = SearchInterpretations(flat.index, segments, options);
    EXPECT_FALSE(result->solutions.empty());
    if (result->solutions.empty()) continue;
    found = result->solutions[0];
    Eigen::Vector3d error;
    error << found.pose.position - pose.position, WrapAngle(found.pose.heading_rad - pose.heading_rad);
    sum += error.dot(found.covariance.inverse() * error);
  }
  return sum / num;
}

TEST(InterpretationTree, TheCovarianceTellsTheErrorOfAnExactPlan) {
  const double mean = MeanErrorSquared(
      {.max_null_ratio = 0.2, .one_segment_per_wall = false, .sigma_wall_m = 0, .sigma_wall_deg = 0}, 0, 0);
  EXPECT_GT(mean, 1.5);
  EXPECT_LT(mean, 4.5);
}

TEST(InterpretationTree, TheCovarianceTellsTheErrorOfAPlanThatIsAboutRight) {
  const InterpretationTreeOptions options{.max_null_ratio = 0.2, .one_segment_per_wall = false};
  const double mean = MeanErrorSquared(options, options.sigma_wall_m, options.sigma_wall_deg);
  EXPECT_GT(mean, 1.5);
  EXPECT_LT(mean, 4.5);
}

// Two equal rooms beside each other; the left one has a screen.  What is seen behind where the screen stands
// tells the right room, though neither room has a wall there.
TEST(InterpretationTree, WhatLiesBehindAWallSpeaksAgainstAPose) {
  const Views views =
      decompose_views::Decomposed(
          "0,0,4,0\n4,0,4,3\n4,3,0,3\n0,3,0,0\n10,0,14,0\n14,0,14,3\n14,3,10,3\n10,3,10,0\n1.6,1.6,2.6,1.6")
          .views;
  const ViewSearchIndex index(views);
  // From (12, 1) in the right room: two long walls and a cupboard 1.2 m ahead.
  const std::vector<ScanSegment> segments = {{{-2, -1}, {2, -1}, 1e-3, 1e-3, 50},
                                             {{2, -1}, {2, 2}, 1e-3, 1e-3, 50},
                                             {{-2, 2}, {-2, -1}, 1e-3, 1e-3, 50},
                                             {{0.5, 1.2}, {-0.3, 1.2}, 1e-3, 1e-3, 50}};
  const auto result =
      SearchInterpretations(index, segments, {.max_null_ratio = 0.3, .one_segment_per_wall = false});
  ASSERT_TRUE(result.ok());
  const auto in_room = [&](double x) {
    return std::find_if(result->solutions.begin(), result->solutions.end(), [&](const Interpretation& found) {
      return (found.pose.position - Eigen::Vector2d(x, 1)).norm() < 0.1 &&
             std::abs(found.pose.heading_rad) < 0.1;
    });
  };
  ASSERT_NE(in_room(2), result->solutions.end());
  ASSERT_NE(in_room(12), result->solutions.end());
  EXPECT_NEAR(in_room(12)->hidden_length_m, 0, 1e-9);
  EXPECT_GT(in_room(2)->hidden_length_m, 0.5);
  EXPECT_LT(in_room(12), in_room(2));
}

// The complete tree of the same constraints is the oracle: what it puts first, the pairs that fix the
// pose find.
TEST(InterpretationTree, PairsThatFixThePoseFindWhatTheWholeTreeFinds) {
  const Flat flat;
  int tried = 0, found = 0;
  int64_t fewer = 0;
  for (int seed = 0; seed < 60; ++seed) {
    Random random(seed);
    const auto pose = RandomPose(flat.views, flat.locator, 0.2, &random);
    const auto segments = SimulateScan(
        flat.views, flat.locator.Find(pose->position), *pose,
        {.sigma_m = 0.02, .missing_ratio = 0.2, .spurious_ratio = 0.1, .min_length_m = 0.3}, &random);
    if (segments.size() < 4) continue;
    InterpretationTreeOptions options{.max_null_ratio = 0.25, .one_segment_per_wall = false};
    options.fix_pose_early = false;
    const auto whole = SearchInterpretations(flat.index, segments, options);
    if (whole->solutions.empty() || !whole->solutions[0].determined) continue;
    ++tried;
    for (const char* search : {"vir", "standard"}) {
      options.search = search;
      options.fix_pose_early = true;
      const auto pairs = SearchInterpretations(flat.index, segments, options);
      found +=
          std::any_of(pairs->solutions.begin(), pairs->solutions.end(), [&](const Interpretation& solution) {
            return IsRight(solution, whole->solutions[0].pose, 0.1, 2);
          });
      if (options.search == "vir") fewer += whole->num_nodes - pairs->num_nodes;
    }
  }
  EXPECT_GT(tried, 30);
  EXPECT_EQ(found, 2 * tried);
  EXPECT_GT(fewer, 0);
}

TEST(InterpretationTree, ASegmentBehindAWallIsNoneOfItsSegments) {
  // A room of 4 x 3 m; behind its right wall, 0.15 m farther, a cupboard's.
  const Views views =
      decompose_views::Decomposed("0,0,4,0\n4,0,4,3\n4,3,0,3\n0,3,0,0\n4.15,0.5,4.15,2.5").views;
  const ViewSearchIndex index(views);
  const std::vector<ScanSegment> segments = {{{-2, -1}, {2, -1}, 1e-3, 1e-3, 50},
                                             {{2, 2}, {-2, 2}, 1e-3, 1e-3, 50},
                                             {{2.05, -0.4}, {2.05, 0.9}, 1e-3, 1e-3, 50},
                                             {{-2, 1.9}, {-2, -0.9}, 1e-3, 1e-3, 50}};
  const auto result = SearchInterpretations(index, segments, {.one_segment_per_wall = false});
  ASSERT_FALSE(result->solutions.empty());
  const auto upright =
      std::find_if(result->solutions.begin(), result->solutions.end(), [](const Interpretation& found) {
        return IsRight(found, PlanarPose{{2, 1}, 0}, 0.05, 2);
      });
  ASSERT_NE(upright, result->solutions.end());  // the room upside down is another
  EXPECT_EQ(WallOf(upright->labels[2]), 1);
}

// Places along a line, each over these segments (letters):
//   0    1    2    3    4    5
//   aaaaaaaaaaa    aaaaaa
//        bbbbbbbbbbbbbb
//             c                (at one place)
TEST(PlacesWithSupport, CountsEachSegmentOnce) {
  const std::vector<PlaceStretch> stretches = {
      {0, 2, 0, 0}, {0.5, 1.5, 0, 2}, {3, 4, 0, 4}, {1, 3.5, 1, 0}, {2, 2, 2, 0}};
  const auto places = PlacesWithSupport(stretches, 2);
  ASSERT_EQ(places.size(), 3u);
  EXPECT_EQ(places[0].low, 1);
  EXPECT_EQ(places[0].high, 2);
  EXPECT_EQ(places[0].num_segments, 2);
  EXPECT_EQ(places[1].low, 2);
  EXPECT_EQ(places[1].high, 2);
  EXPECT_EQ(places[1].num_segments, 3);
  EXPECT_EQ(places[2].low, 3);
  EXPECT_EQ(places[2].high, 3.5);
  EXPECT_TRUE(PlacesWithSupport(stretches, 4).empty());
  EXPECT_TRUE(PlacesWithSupport({}, 1).empty());

  const auto best = BestSupported(places);
  ASSERT_EQ(best.size(), 2u);
  EXPECT_EQ(best[0].num_segments, 3);
  EXPECT_EQ(best[1].low, 3);
  const auto over = StretchesOver(stretches, 1.2);  // the middles of a's are at 1 and 1
  ASSERT_EQ(over.size(), 2u);
  EXPECT_EQ(over[0].label, 0);
  EXPECT_EQ(over[1].segment, 1);
  EXPECT_EQ(StretchesOver(stretches, 3.2).front().label, 4);
}

TEST(StretchesAlong, HoldThePlaceOfEveryNoisyScan) {
  const Flat flat;
  int tried = 0, held = 0;
  for (int seed = 0; seed < 100; ++seed) {
    Random random(seed);
    const auto pose = RandomPose(flat.views, flat.locator, 0.2, &random);
    const FaceIdx face = flat.locator.Find(pose->position);
    const auto segments =
        SimulateScan(flat.views, face, *pose, {.sigma_m = 0.02, .min_length_m = 0.3}, &random);
    InterpretationTreeOptions options;
    options.sigma_wall_m = options.sigma_wall_deg = 0;
    const PairingTable table(flat.views.plan, segments, options);
    // The walls that the segments were taken from: those that they lie on at the true pose.
    std::vector<LabelIdx> labels;
    for (const ScanSegment& segment : segments) {
      LabelIdx own = -1;
      for (const LabelIdx label : flat.views.LabelSet(face)) {
        const Vec2 from = LabelStart(flat.views.plan, label), to = LabelEnd(flat.views.plan, label);
        const Vec2 start = pose->FloorFromRobot(segment.start), end = pose->FloorFromRobot(segment.end);
        if ((to - from).dot(end - start) > 0 &&
            PointToSegment(start, from, to) + PointToSegment(end, from, to) < 0.15)
          own = label;
      }
      labels.push_back(own);
    }
    for (int first = 0; first < static_cast<int>(segments.size()); ++first) {
      if (labels[first] < 0) continue;
      const Pairing& pairing = table.Of(first, labels[first]);
      const double place = table.Along(labels[first]).dot(pose->position - pairing.from);
      for (int other = 0; other < static_cast<int>(segments.size()); ++other) {
        if (other == first || labels[other] < 0) continue;
        ++tried;
        const auto stretches = StretchesAlong(table, first, labels[first], {other},
                                              [&](LabelIdx label) { return label == labels[other]; });
        held += stretches.size() == 1 && stretches[0].low <= place && place <= stretches[0].high;
      }
    }
  }
  EXPECT_GT(tried, 2000);
  EXPECT_GE(held, 0.999 * tried);
}

// An elbow of different walls: in a region that sees all six, only one way keeps their order.
TEST(LabelsInOrder, KeepsTheOrderInWhichWallsAreSeen) {
  const Views views = decompose_views::Decomposed(
                          decompose_views::PolygonText({{{0, 0}, {6, 0}, {6, 2}, {2, 2}, {2, 5}, {0, 5}}}))
                          .views;
  const FaceLocator locator(views);
  const PlanarPose pose{{1, 1}, 0.4};
  const FaceIdx face = locator.Find(pose.position);
  Random random(5);
  std::vector<ScanSegment> segments = SimulateScan(views, face, pose, {}, &random);
  ASSERT_EQ(segments.size(), 6u);
  const auto ways = [&] {
    return LabelsInOrder(views, face, segments, SegmentsInOrder(segments), 0.01,
                         [](int, LabelIdx) { return true; });
  };
  // Directions alone: turned by a right angle no sequence of left and right corners is the same.
  ASSERT_TRUE(ways().has_value());
  ASSERT_EQ(ways()->size(), 1u);
  for (size_t i = 0; i < segments.size(); ++i) {
    const Vec2 start = pose.FloorFromRobot(segments[i].start);
    const LabelIdx label = ways()->front()[i];
    const Vec2 from = LabelStart(views.plan, label), to = LabelEnd(views.plan, label);
    EXPECT_NEAR(PointToSegment(start, from, to), 0, 1e-9);
  }
  std::swap(segments[0].start, segments[1].start);
  std::swap(segments[0].end, segments[1].end);
  EXPECT_EQ(ways()->size(), 1u);  // the order is by direction, not by index
  const auto none = LabelsInOrder(views, face, segments, SegmentsInOrder(segments), 0.01,
                                  [](int segment, LabelIdx) { return segment != 3; });
  EXPECT_TRUE(none->empty());
}

TEST(InterpretationTree, InTheOrderOfAViewAPairingEachIsNearlyAll) {
  const Flat flat;
  double nodes = 0, segments_seen = 0;
  for (int seed = 0; seed < 40; ++seed) {
    Random random(seed);
    const auto pose = RandomPose(flat.views, flat.locator, 0.1, &random);
    const auto segments = SimulateScan(flat.views, flat.locator.Find(pose->position), *pose, {}, &random);
    if (segments.size() < 3) continue;
    InterpretationTreeOptions options = Exact();
    options.fix_pose_early = false;
    nodes += static_cast<double>(SearchInterpretations(flat.index, segments, options)->num_nodes);
    segments_seen += static_cast<double>(segments.size());
  }
  EXPECT_LT(nodes, 2 * segments_seen);
}

TEST(ViewSearchIndex, SetsOfRegionsAreThoseOfTheLabels) {
  const Flat flat;
  for (FaceIdx face = 0; face < flat.views.num_faces(); face += 7) {
    const auto labels = flat.views.LabelSet(face);
    for (LabelIdx label = 0; label < flat.views.plan.num_labels(); ++label) {
      const bool seen = std::binary_search(labels.begin(), labels.end(), label);
      FaceSet one{{{face / 64, uint64_t{1} << (face % 64)}}};
      EXPECT_EQ(Intersects(flat.index.FacesOf(label), one), seen);
      EXPECT_EQ(Intersection(flat.index.FacesOf(label), one).Count(), seen ? 1 : 0);
      for (const LabelIdx other : labels) EXPECT_TRUE(!seen || flat.index.SeenTogether(label, other));
    }
  }
}

TEST(DirectionSpectrum, DoesNotDependOnTheHeading) {
  const auto a = DirectionSpectrum({0.1, 0.7, 2.0, -1}), b = DirectionSpectrum({1.1, 1.7, 3.0, 0});
  for (size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(std::abs(a[i]), std::abs(b[i]), 1e-5);
}

}  // namespace
}  // namespace cairn
