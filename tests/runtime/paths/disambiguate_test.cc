#include "runtime/paths/disambiguate.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/decompose_views/plan_fixture.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

TEST(Disambiguate, ViewsThatDifferAreToldApartAtOnce) {
  // The right room has a pillar.
  const Views views =
      decompose_views::Decomposed("0,0,8,0\n8,0,8,3\n8,3,0,3\n0,3,0,0\n4,0,4,3\n7,1.5,7,2").views;
  const PlanSpace space(views);
  const auto plan = PlanDisambiguation(space, {{1, 1.5}, 0}, {{5, 1.5}, 0}, {});
  ASSERT_TRUE(plan.ok());
  EXPECT_EQ(plan->kind, 1);
  EXPECT_FALSE(plan->path_a.empty());
}

TEST(Disambiguate, RoomsThatLookTheSameNeedALookAroundTheCorner) {
  //  +-----+-----+    Two elbows; only the right one's arm has a pillar, which is hidden
  //  |  +--+  +--+    from the lower ends.
  //  |  |  |  |
  const std::string left = "0,0,0,5\n0,5,4,5\n4,5,4,4\n4,4,1,4\n1,4,1,0\n1,0,0,0\n";
  const std::string right =
      "10,0,10,5\n10,5,14,5\n14,5,14,4\n14,4,11,4\n11,4,11,0\n11,0,10,0\n13,4.3,13,4.7\n";
  const Views views = decompose_views::Decomposed(left + right).views;
  const PlanSpace space(views);
  const auto plan = PlanDisambiguation(space, {{0.5, 0.5}, 1.57}, {{10.5, 0.5}, 1.57}, {.radius_m = 0.1});
  ASSERT_TRUE(plan.ok());
  EXPECT_GE(plan->kind, 2);
  ASSERT_GE(plan->path_a.size(), 2u);
  // The same motion in both, free, and up to where one looks into the arm.
  for (size_t i = 0; i < plan->path_a.size(); ++i)
    EXPECT_NEAR((plan->path_b[i] - plan->path_a[i] - Vec2(10, 0)).norm(), 0, 1e-9);
  for (size_t i = 0; i + 1 < plan->path_a.size(); ++i) {
    EXPECT_TRUE(space.IsFree(plan->path_a[i], plan->path_a[i + 1], 0.1));
    EXPECT_TRUE(space.IsFree(plan->path_b[i], plan->path_b[i + 1], 0.1));
  }
  EXPECT_GT(plan->path_a.back().y(), 2);
  EXPECT_FALSE(plan->feature_is_at_a);
}

// Two rooms of 3 m x 3 m that look the same.
const char* const kTwinRooms =
    "0,0,3,0\n3,0,3,3\n3,3,0,3\n0,3,0,0\n10,0,13,0\n13,0,13,3\n13,3,10,3\n10,3,10,0";
// Two elbows; only the right one's arm has a pillar, which is hidden from the lower ends.
const char* const kElbows =
    "0,0,0,5\n0,5,4,5\n4,5,4,4\n4,4,1,4\n1,4,1,0\n1,0,0,0\n"
    "10,0,10,5\n10,5,14,5\n14,5,14,4\n14,4,11,4\n11,4,11,0\n11,0,10,0\n13,4.3,13,4.7\n";

// Whether the regions of two places have a common border.
bool AreNeighbours(const PlanSpace& space, const Vec2& place, const Vec2& other) {
  const FaceIdx face = space.FaceAt(place), other_face = space.FaceAt(other);
  return std::any_of(space.NeighboursBegin(face), space.NeighboursEnd(face),
                     [&](const PlanSpace::Neighbour& neighbour) { return neighbour.face == other_face; });
}

TEST(Disambiguate, PlacesThatNothingTellsApartAreSaidToBeSo) {
  const Views views = decompose_views::Decomposed(kTwinRooms).views;
  const PlanSpace space(views);
  const auto plan = PlanDisambiguation(space, {{1, 1}, 0}, {{11, 1}, 0}, {});
  ASSERT_TRUE(plan.ok());
  EXPECT_EQ(plan->outcome, DisambiguationOutcome::kAlike);
  EXPECT_EQ(plan->kind, 0);
  // The one pose is alike, wherever it is, without a look around.
  const auto same = PlanDisambiguation(space, {{1, 1}, 0}, {{1, 1}, 2 * std::numbers::pi}, {});
  EXPECT_EQ(same->outcome, DisambiguationOutcome::kAlike);
  EXPECT_EQ(same->num_regions, 1);
}

TEST(Disambiguate, GivingUpIsNotThatNothingTellsThemApart) {
  const Views views = decompose_views::Decomposed(kElbows).views;
  const PlanSpace space(views);
  const PlanarPose a{{0.5, 0.5}, 1.57}, b{{10.5, 0.5}, 1.57};
  const auto plan = PlanDisambiguation(space, a, b, {.radius_m = 0.1});
  ASSERT_TRUE(plan.ok());
  ASSERT_EQ(plan->outcome, DisambiguationOutcome::kFound);
  EXPECT_TRUE(plan->is_best);
  ASSERT_GT(plan->num_regions, 3);
  // With one region fewer than the best takes it is not known to be the best, and with few none is found.
  int num_found = 0, num_given_up = 0;
  for (int limit = 1; limit <= plan->num_regions; ++limit) {
    const auto limited = PlanDisambiguation(space, a, b, {.radius_m = 0.1, .max_num_regions = limit});
    ASSERT_TRUE(limited.ok());
    EXPECT_LE(limited->num_regions, limit);
    const bool found = limited->outcome == DisambiguationOutcome::kFound;
    num_found += found;
    num_given_up += limited->outcome == DisambiguationOutcome::kGaveUp;
    EXPECT_EQ(limited->kind > 0, found);
    EXPECT_EQ(limited->is_best, limit == plan->num_regions);
  }
  EXPECT_GT(num_given_up, 0);
  EXPECT_EQ(num_found + num_given_up, plan->num_regions);
  // Twins that are alike are not given up on when all of them was looked at, whatever the limit.
  const Views twins = decompose_views::Decomposed(std::string(kTwinRooms) + "\n0,2,2,2\n10,2,12,2").views;
  const PlanSpace twin_space(twins);
  const PlanarPose left{{1, 1}, 0}, right{{11, 1}, 0};
  const int all = PlanDisambiguation(twin_space, left, right, {})->num_regions;
  ASSERT_GT(all, 2);
  EXPECT_EQ(PlanDisambiguation(twin_space, left, right, {.max_num_regions = all})->outcome,
            DisambiguationOutcome::kAlike);
  EXPECT_EQ(PlanDisambiguation(twin_space, left, right, {.max_num_regions = all - 1})->outcome,
            DisambiguationOutcome::kGaveUp);
}

TEST(Disambiguate, ARobotThatDoesNotFitCannotLookAround) {
  const Views views = decompose_views::Decomposed(kTwinRooms).views;
  const PlanSpace space(views);
  for (const bool swapped : {false, true}) {
    const PlanarPose far{{1, 1}, 0}, near{{11, 0.1}, 0};
    const auto plan = swapped ? PlanDisambiguation(space, near, {{1, 0.1}, 0}, {})
                              : PlanDisambiguation(space, {{1, 0.1}, 0}, near, {});
    ASSERT_FALSE(plan.ok());
    EXPECT_EQ(plan.error().code, ErrorCode::kNoData);
    EXPECT_THAT(plan.error().message,
                testing::HasSubstr(fmt::format(
                    "radius 0.2 m does not fit at ({}, 0.1): a wall is 0.100 m away", swapped ? 11 : 1)));
    // Views that differ already tell them apart without a motion.
    const auto differ =
        swapped ? PlanDisambiguation(space, near, far, {}) : PlanDisambiguation(space, far, near, {});
    ASSERT_TRUE(differ.ok());
    EXPECT_EQ(differ->kind, 1);
  }
}

TEST(Disambiguate, ARobotMustFitAtBothPlaces) {
  // What stands in its way at one of them is too small to tell them apart.
  const std::string text = std::string(kTwinRooms) + "\n11.4,0.1,11.6,0.1";
  const Views views = decompose_views::Decomposed(text).views;
  const PlanSpace space(views);
  const PlanarPose free{{1.5, 0.25}, 0}, tight{{11.5, 0.25}, 0};
  for (const bool swapped : {false, true}) {
    const auto plan =
        swapped ? PlanDisambiguation(space, tight, free, {}) : PlanDisambiguation(space, free, tight, {});
    ASSERT_FALSE(plan.ok());
    EXPECT_THAT(plan.error().message, testing::HasSubstr("does not fit at (11.5, 0.25): a wall is 0.150 m"));
  }
}

TEST(Disambiguate, APoseMustLieInThePlanAndHaveAHeading) {
  const Views views = decompose_views::Decomposed(kTwinRooms).views;
  const PlanSpace space(views);
  const PlanarPose good{{1, 1}, 0};
  for (const PlanarPose& bad : {PlanarPose{{1000, 1}, 0}, PlanarPose{{std::nan(""), 1}, 0},
                                PlanarPose{{1, 1}, std::nan("")}, PlanarPose{{1, 1}, INFINITY}}) {
    EXPECT_EQ(PlanDisambiguation(space, good, bad, {}).error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(PlanDisambiguation(space, bad, good, {}).error().code, ErrorCode::kInvalidArgument);
  }
  EXPECT_EQ(PlanDisambiguation(space, good, good, {.max_num_regions = 0}).error().code,
            ErrorCode::kInvalidArgument);
}

// A room of 8 m x 4 m, from (x, -2) to (x + 8, 2), and walls in it, relative to (x, 0).
struct Wall {
  Vec2 start, end;
};
std::string RoomAt(double x, const std::vector<Wall>& inside) {
  std::string text = fmt::format("{0},-2,{1},-2\n{1},-2,{1},2\n{1},2,{0},2\n{0},2,{0},-2\n", x, x + 8);
  for (const Wall& wall : inside)
    text += fmt::format("{},{},{},{}\n", x + wall.start.x(), wall.start.y(), x + wall.end.x(), wall.end.y());
  return text;
}

// From a place in one such room and the same in another, 20 m to the right of it, turned to the left of +x.
DisambiguationPlan ToldApart(const std::vector<Wall>& in_a, const std::vector<Wall>& in_b, const Vec2& place,
                             const DisambiguateOptions& options) {
  constexpr double kHeading = 0.3;
  const Views views = decompose_views::Decomposed(RoomAt(0, in_a) + RoomAt(20, in_b)).views;
  const PlanSpace space(views);
  const auto plan = PlanDisambiguation(space, {place, kHeading}, {place + Vec2(20, 0), kHeading}, options);
  EXPECT_TRUE(plan.ok()) << plan.error().message;
  if (!plan.ok()) return {};
  if (plan->kind == 0) return *plan;
  for (size_t i = 0; i < plan->path_a.size(); ++i)
    EXPECT_NEAR((plan->path_b[i] - plan->path_a[i] - Vec2(20, 0)).norm(), 0, 1e-9);
  EXPECT_NEAR((plan->feature_start_b - plan->feature_start_a - Vec2(20, 0)).norm(), 0, 1e-9);
  EXPECT_NEAR((plan->feature_end_b - plan->feature_end_a - Vec2(20, 0)).norm(), 0, 1e-9);
  return *plan;
}

void ExpectFeature(const DisambiguationPlan& plan, bool is_at_a, const Vec2& start, const Vec2& end) {
  EXPECT_EQ(plan.kind, 1);
  EXPECT_EQ(plan.feature_is_at_a, is_at_a);
  EXPECT_NEAR((plan.feature_start_a - start).norm(), 0, 1e-3) << plan.feature_start_a.transpose();
  EXPECT_NEAR((plan.feature_end_a - end).norm(), 0, 1e-3) << plan.feature_end_a.transpose();
}

TEST(Disambiguate, TheRobotGoesUpToOneMetreFromTheNearestFeature) {
  // The second room has a pillar, and one behind it; what they hide of the walls is farther away.
  const Vec2 place(1, 0), low(4, 0.2), high(4, 1.2);
  // Behind the robot both have what is too small to tell anything.
  const Wall small{{0.3, -1}, {0.3, -0.8}};
  const DisambiguationPlan plan = ToldApart({small}, {small, {low, high}, {{6, -1}, {6, 0}}}, place, {});
  ExpectFeature(plan, false, low, high);
  const Vec2 to_middle(3, 0.7);
  ASSERT_EQ(plan.path_a.size(), 2u);
  EXPECT_NEAR((plan.path_a[1] - place - (1 - 1 / to_middle.norm()) * to_middle).norm(), 0, 1e-3);
  EXPECT_NEAR(plan.path_length_m, to_middle.norm() - 1, 1e-3);
  EXPECT_NEAR(plan.distance_m, 1, 1e-3);
  EXPECT_EQ(plan.num_regions, 1);
  // Beside a feature it stays where it is.
  const DisambiguationPlan near = ToldApart({{{1.8, -0.4}, {1.8, 0.4}}}, {}, place, {});
  ExpectFeature(near, true, {1.8, -0.4}, {1.8, 0.4});
  EXPECT_EQ(near.path_length_m, 0);
  EXPECT_NEAR(near.distance_m, 0.8, 1e-3);
}

TEST(Disambiguate, TheRobotGoesTowardsAFeatureAsFarAsItFits) {
  // Through a gap of 0.3 m, too narrow for it, it sees what stands behind: it stops where its circle touches
  // the ends of the gap, 0.132 m before them, at the latest, in steps of a fifth.
  const auto way = [](double gap_x, double pillar_x, double half_m) {
    const std::vector<Wall> gap{{{gap_x, -2}, {gap_x, -0.15}}, {{gap_x, 0.15}, {gap_x, 2}}};
    std::vector<Wall> with_pillar = gap;
    with_pillar.push_back({{pillar_x, -half_m}, {pillar_x, half_m}});
    const DisambiguationPlan plan = ToldApart(gap, with_pillar, {1, 0}, {});
    EXPECT_EQ(plan.kind, 1);
    EXPECT_NEAR(plan.path_length_m + plan.distance_m, pillar_x - 1, 1e-3);
    return plan.path_length_m;
  };
  EXPECT_NEAR(way(3.5, 5, 0.25), 3 * 0.8 * 0.8, 1e-3);           // 2.4 m are 0.1 m before the gap
  EXPECT_NEAR(way(1.7, 7.5, 1), 5.5 * std::pow(0.8, 11), 1e-3);  // of 0.57 m
  // Where it does not fit itself, it cannot move.
  const DisambiguationPlan none = ToldApart({}, {{{4, -1}, {4, 0}}}, {1, -1.9}, {});
  EXPECT_EQ(none.kind, 1);
  EXPECT_EQ(none.path_length_m, 0);
}

TEST(Disambiguate, WallsThatAreNearlyTheSameLookTheSame) {
  // A pillar 3 m ahead; what it hides is out of range.
  const DisambiguateOptions options{.max_range_m = 4};
  const Vec2 place(1, 0), middle(4, 0.2);
  const auto kind = [&](const Vec2& half, const Vec2& moved, double turned_deg) {
    const Vec2 turned = Eigen::Rotation2Dd(turned_deg * std::numbers::pi / 180) * half;
    return ToldApart({{middle - half, middle + half}}, {{middle + moved - turned, middle + moved + turned}},
                     place, options)
        .kind;
  };
  const Vec2 half(0, 0.5);
  EXPECT_NE(kind(half, {0, 0}, 0), 1);
  EXPECT_NE(kind(half, {0.13, 0}, 0), 1);
  EXPECT_EQ(kind(half, {0.17, 0}, 0), 1);
  EXPECT_NE(kind(half, {-0.13, 0}, 0), 1);
  EXPECT_EQ(kind(half, {-0.17, 0}, 0), 1);
  EXPECT_NE(kind(half, {0, 0}, 4.8), 1);
  EXPECT_EQ(kind(half, {0, 0}, 5.2), 1);
  EXPECT_NE(kind(half, {0, 0}, -4.8), 1);
  EXPECT_EQ(kind(half, {0, 0}, -5.2), 1);
  // Along itself as far as what is missing, but for what looks the same, is shorter than a feature.
  EXPECT_NE(kind(half, {0, 0.43}, 0), 1);
  EXPECT_EQ(kind(half, {0, 0.47}, 0), 1);
}

TEST(Disambiguate, AFeatureIsLongEnoughAndInRange) {
  const Vec2 place(1, 0);
  const auto kind = [&](double length_m, double max_range_m) {
    return ToldApart({}, {{{4, -0.5 * length_m}, {4, 0.5 * length_m}}}, place, {.max_range_m = max_range_m})
        .kind;
  };
  EXPECT_EQ(kind(0.31, 4), 1);
  EXPECT_NE(kind(0.29, 4), 1);
  EXPECT_EQ(kind(0.5, 3.01), 1);
  EXPECT_NE(kind(0.5, 2.99), 1);
  // The ends of two walls in line with each other: what is before or behind a wall is not on it.
  const DisambiguateOptions options{.min_feature_m = 0.32, .max_range_m = 1.2};
  const Wall wall{{2, -1}, {2.35, -1}}, before{{1, -1}, {1.9, -1}}, behind{{2.45, -1}, {3.35, -1}};
  ExpectFeature(ToldApart({wall}, {before}, {2.2, 0}, options), true, wall.start, wall.end);
  ExpectFeature(ToldApart({wall}, {behind}, {2.2, 0}, options), true, wall.start, wall.end);
}

TEST(Disambiguate, AFeatureIsThePartOfAWallThatTheOtherPlaceLacks) {
  const Vec2 place(1, 0);
  const Wall whole{{4, -1}, {4, 1}};
  // Up to 0.15 m beside what is there looks the same.
  ExpectFeature(ToldApart({whole}, {{{4, -0.3}, {4, 1}}}, place, {}), true, {4, -1}, {4, -0.45});
  ExpectFeature(ToldApart({whole}, {{{4, -1}, {4, 0.4}}}, place, {}), true, {4, 0.55}, {4, 1});
  ExpectFeature(ToldApart({whole}, {{{4, -1}, {4, -0.5}}, {{4, 0.4}, {4, 1}}}, place, {}), true, {4, -0.35},
                {4, 0.25});
  // Of two gaps the nearer one; of equal ones, that to the right, where the robot looks to the left.
  ExpectFeature(ToldApart({{{4, -0.9}, {4, 1}}}, {{{4, -0.2}, {4, 0.2}}}, place, {}), true, {4, -0.9},
                {4, -0.35});
  ExpectFeature(ToldApart({{{4, -1}, {4, 0.9}}}, {{{4, -0.2}, {4, 0.2}}}, place, {}), true, {4, 0.35},
                {4, 0.9});
}

TEST(Disambiguate, AllRegionsThatTheRobotGetsToAreTried) {
  const std::vector<Wall> screen{{{0, 1}, {5, 1}}};
  const Views views = decompose_views::Decomposed(RoomAt(0, screen) + RoomAt(20, screen)).views;
  const PlanSpace space(views);
  const auto plan = PlanDisambiguation(space, {{1, 0}, 0}, {{21, 0}, 0}, {.radius_m = 0});
  ASSERT_TRUE(plan.ok());
  EXPECT_EQ(plan->outcome, DisambiguationOutcome::kAlike);
  EXPECT_TRUE(plan->is_best);
  int num_inside = 0;
  for (FaceIdx face = 0; face < views.num_faces(); ++face) {
    const Vec2 middle = views.Centroid(face);
    num_inside +=
        std::abs(middle.y()) < 2 && middle.x() > 0 && (middle.x() < 8 || middle.x() > 20) && middle.x() < 28;
  }
  ASSERT_GT(num_inside, 6);
  // The two that the poses lie in are looked from once, before the robot moves.
  EXPECT_EQ(plan->num_regions, num_inside - 1);
  // From the one pose, whichever way round, nowhere else.
  for (const double heading : {0.0, 2 * std::numbers::pi})
    EXPECT_EQ(PlanDisambiguation(space, {{1, 0}, 0}, {{1, 0}, heading}, {.radius_m = 0})->num_regions, 1);
}

TEST(Disambiguate, WhatAMetreOfDistanceCostsIsWeighedAgainstTheWay) {
  const Views views = decompose_views::Decomposed(kElbows).views;
  const PlanSpace space(views);
  const std::vector<double> costs{0, 0.1, 0.5, 1, 2, 10};
  std::vector<DisambiguationPlan> plans;
  size_t num_near = 0;
  for (const double cost : costs) {
    const auto plan = PlanDisambiguation(space, {{0.5, 0.5}, 1.57}, {{10.5, 0.5}, 1.57},
                                         {.radius_m = 0.1, .cost_of_distance = cost});
    ASSERT_TRUE(plan.ok());
    plans.push_back(*plan);
    // One border is crossed, or more.
    const bool is_near = AreNeighbours(space, {0.5, 0.5}, plan->path_a.back()) ||
                         AreNeighbours(space, {10.5, 0.5}, plan->path_b.back());
    if (plan->kind == 2) EXPECT_TRUE(is_near);
    num_near += is_near;
    EXPECT_NEAR(plan->distance_m,
                (0.5 * (plan->feature_start_a + plan->feature_end_a) - plan->path_a.back()).norm(), 1e-9);
  }
  for (size_t i = 0; i + 1 < plans.size(); ++i) {
    EXPECT_LE(plans[i].path_length_m, plans[i + 1].path_length_m + 1e-9);
    EXPECT_GE(plans[i].distance_m, plans[i + 1].distance_m - 1e-9);
  }
  EXPECT_GT(num_near, 0u);
  EXPECT_LT(num_near, plans.size());
  EXPECT_LT(plans.front().path_length_m, plans.back().path_length_m - 0.5);
  EXPECT_GT(plans.front().distance_m, plans.back().distance_m + 0.5);
}

TEST(Disambiguate, OptionsHaveTheirRanges) {
  DisambiguateOptions options;
  std::vector<std::pair<std::string, std::string>> ranges;
  for (const Option& option : DescribeOptions(&options)) ranges.emplace_back(option.name, ValuesText(option));
  using testing::Pair;
  EXPECT_THAT(ranges,
              testing::ElementsAre(Pair("min_feature_m", "0.01 to 100"), Pair("same_wall_m", "1e-06 to 10"),
                                   Pair("same_wall_deg", "1e-06 to 45"), Pair("view_range_m", "0.1 to 10000"),
                                   Pair("radius_m", "0 to 10"), Pair("cost_of_distance", "0 to 1000"),
                                   Pair("max_num_regions", "1 to 1e+09")));
}

// The same plan with a and b exchanged.
void ExpectMirrored(const DisambiguationPlan& plan, const DisambiguationPlan& other) {
  ASSERT_EQ(plan.outcome, other.outcome);
  EXPECT_EQ(plan.kind, other.kind);
  EXPECT_EQ(plan.is_best, other.is_best);
  EXPECT_EQ(plan.num_regions, other.num_regions);
  if (plan.kind == 0) return;
  EXPECT_EQ(plan.path_length_m, other.path_length_m);
  EXPECT_EQ(plan.distance_m, other.distance_m);
  EXPECT_EQ(plan.feature_is_at_a, !other.feature_is_at_a);
  EXPECT_EQ(plan.path_a, other.path_b);
  EXPECT_EQ(plan.path_b, other.path_a);
  EXPECT_EQ(plan.feature_start_a, other.feature_start_b);
  EXPECT_EQ(plan.feature_end_b, other.feature_end_a);
}

TEST(Disambiguate, WhichPoseIsCalledADoesNotMatter) {
  // Twin rooms with something else added outside of the first view, at random: poses that correspond.
  int num_apart[4] = {};
  for (uint64_t seed = 0; seed < 120; ++seed) {
    Random random(MixSeed(24, seed));
    const auto walls_at = [&](double x, bool has_more) {
      std::string walls = fmt::format("{0},0,{1},0\n{0},0,{0},6\n{0},6,{1},6\n{1},6,{1},0\n", x, x + 5);
      // A screen with a passage on the right, and what stands behind it.
      walls += fmt::format("{},3,{},3\n", x, x + 4);
      if (has_more) {
        const double at = random.Uniform(0.5, 3);
        walls += fmt::format("{},4,{},4.6\n", x + at, x + at + random.Uniform(0.3, 1));
      }
      return walls;
    };
    const std::string text = walls_at(0, random.Uniform() < 0.7) + walls_at(10, random.Uniform() < 0.7);
    const Views views = decompose_views::Decomposed(text).views;
    const PlanSpace space(views);
    const Vec2 place(random.Uniform(0.4, 4.6), random.Uniform(0.4, 5.6));
    const double heading = random.Uniform(-3, 3);
    const PlanarPose a{place, heading}, b{place + Vec2(10, 0), heading};
    DisambiguateOptions options;
    options.radius_m = random.Uniform() < 0.3 ? 0 : 0.15;
    if (random.Uniform() < 0.3) options.max_num_regions = static_cast<int>(random.UniformInt(2, 30));
    SCOPED_TRACE(fmt::format("seed {}: {},{}\n{}", seed, place.x(), place.y(), text));
    const auto plan = PlanDisambiguation(space, a, b, options);
    const auto other = PlanDisambiguation(space, b, a, options);
    ASSERT_EQ(plan.ok(), other.ok());
    if (!plan.ok()) continue;
    ExpectMirrored(*plan, *other);
    ++num_apart[plan->kind];
    if (plan->kind == 2) {
      EXPECT_TRUE(AreNeighbours(space, place, plan->path_a.back()) ||
                  AreNeighbours(space, b.position, plan->path_b.back()));
    }
    for (size_t i = 0; i + 1 < plan->path_a.size(); ++i) {
      if (plan->path_a[i] == plan->path_a[i + 1]) continue;
      EXPECT_TRUE(space.IsFree(plan->path_a[i], plan->path_a[i + 1], options.radius_m));
      EXPECT_TRUE(space.IsFree(plan->path_b[i], plan->path_b[i + 1], options.radius_m));
    }
  }
  EXPECT_THAT(num_apart, testing::Each(testing::Gt(3)));
}

// Two elbows 100 m from two others: regions are derived around the poses alone, and the answer is that of
// all.
TEST(Disambiguate, RegionsNearTheTwoPosesAreEnough) {
  std::string text = kElbows;
  for (const PlanWall& wall : decompose_views::Decomposed(kElbows).views.plan.walls) {
    text +=
        fmt::format("\n{},{},{},{}", wall.start.x() + 100, wall.start.y(), wall.end.x() + 100, wall.end.y());
  }
  const Views whole = decompose_views::Decomposed(text).views;
  const PlanarPose a{{0.5, 0.5}, 1.57}, b{{10.5, 0.5}, 1.57}, far_b{{110.5, 0.5}, 1.57};
  NoProgress progress;
  for (const PlanarPose& other : {b, far_b}) {
    const auto near = PlanDisambiguation(whole.plan, a, other, {.radius_m = 0.1}, 1, 1024, progress);
    ASSERT_TRUE(near.ok()) << near.error().message;
    const auto all = PlanDisambiguation(PlanSpace(whole), a, other, {.radius_m = 0.1});
    ASSERT_EQ(near->outcome, all->outcome);
    ASSERT_EQ(near->outcome, DisambiguationOutcome::kFound);
    // Walls that no laser sees from there do not divide the regions: places are not the same ones.
    EXPECT_NEAR(near->path_length_m + 0.1 * near->distance_m, all->path_length_m + 0.1 * all->distance_m,
                0.5);
    EXPECT_EQ(near->feature_is_at_a, all->feature_is_at_a);
  }
  // Nothing tells an elbow from its copy: all regions were looked from.
  const auto alike =
      PlanDisambiguation(whole.plan, a, {{100.5, 0.5}, 1.57}, {.radius_m = 0.1}, 1, 1024, progress);
  ASSERT_TRUE(alike.ok());
  EXPECT_EQ(alike->outcome, DisambiguationOutcome::kAlike);
  for (const double x : {-50.0, std::nan("")}) {
    EXPECT_EQ(PlanDisambiguation(whole.plan, a, {{x, 0.5}, 0}, {}, 1, 1024, progress).error().code,
              ErrorCode::kInvalidArgument);
  }
}

}  // namespace
}  // namespace cairn
