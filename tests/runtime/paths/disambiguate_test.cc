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
    EXPECT_THAT(plan.error().message, testing::HasSubstr("does not fit"));
    // Views that differ already tell them apart without a motion.
    const auto differ =
        swapped ? PlanDisambiguation(space, near, far, {}) : PlanDisambiguation(space, far, near, {});
    ASSERT_TRUE(differ.ok());
    EXPECT_EQ(differ->kind, 1);
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
