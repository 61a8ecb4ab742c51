#include "stages/decompose_views/plan/clean_plan.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/vector_geometry.h"
#include "tests/decompose_views/plan_fixture.h"

namespace cairn::decompose_views {
namespace {

using testing::HasSubstr;

CleanPlanResult Cleaned(const std::string& text, const CleanPlanOptions& options = {}) {
  NoProgress progress;
  auto result = CleanPlan(Parsed(text), options, progress);
  EXPECT_TRUE(result.ok()) << result.error().message;
  return result.ok() ? std::move(*result) : CleanPlanResult{};
}

Error ErrorOf(const std::string& text) {
  NoProgress progress;
  const auto result = CleanPlan(Parsed(text), {}, progress);
  EXPECT_FALSE(result.ok());
  return result.ok() ? Error{} : result.error();
}

int Count(const CleanPlanResult& result, PlanChangeKind kind) {
  return static_cast<int>(std::count_if(result.changes.begin(), result.changes.end(),
                                        [&](const PlanChange& change) { return change.kind == kind; }));
}

TEST(CleanPlan, LeavesACleanPlanAlone) {
  const auto result = Cleaned("0,0,4,0\n4,0,4,3\n4,3,0,3\n0,3,0,0");
  EXPECT_TRUE(result.changes.empty());
  EXPECT_EQ(result.plan.num_walls(), 4);
  EXPECT_EQ(result.plan.vertices.size(), 4u);
}

TEST(CleanPlan, DropsWallsWithoutLengthAndDuplicates) {
  const auto result = Cleaned("0,0,4,0\n1,1,1,1\n4,0,0,0\n0,0,4,0");
  EXPECT_EQ(Count(result, PlanChangeKind::kNoLength), 1);
  EXPECT_EQ(Count(result, PlanChangeKind::kDuplicate), 2);
  EXPECT_EQ(result.plan.num_walls(), 1);
}

TEST(CleanPlan, MovesEndsTogetherWithinTheToleranceAndSaysHowFar) {
  const auto result = Cleaned("0,0,4,0\n4.003,0.004,4,3\n5,0,6,0\n6.02,0,6,3");
  ASSERT_EQ(Count(result, PlanChangeKind::kEndMoved), 1);
  EXPECT_EQ(result.changes[0].line, 2);
  EXPECT_NEAR(result.changes[0].moved_m, 0.005, 1e-6);
  // 2 cm are too far.
  EXPECT_EQ(result.plan.vertices.size(), 3u + 4u);
}

// Every end near to the inside of a wall is moved onto it, however many walls there are and wherever.
TEST(CleanPlan, EndsNearToAnyOfManyWallsLieOnThem) {
  Random random(7);
  std::string text;
  std::vector<int> lines;  // of walls that end 3 mm short of a long one
  int line = 0;
  for (int i = 0; i < 40; ++i) {
    const double y = 5 * i;
    text += fmt::format("0,{},200,{}\n", y, y + 1);
    ++line;
    for (int k = 0; k < 30; ++k) {
      const double x = 1 + 6.5 * k + random.Uniform(0, 5);
      text += fmt::format("{},{},{},{}\n", x, y + x / 200 + 0.003, x, y + x / 200 + 2);
      lines.push_back(++line);
    }
  }
  const auto result = Cleaned(text);
  EXPECT_EQ(Count(result, PlanChangeKind::kEndOnWall), std::ssize(lines));
  std::vector<int> moved;
  for (const PlanChange& change : result.changes) {
    if (change.kind != PlanChangeKind::kEndOnWall) continue;
    moved.push_back(change.line);
    EXPECT_NEAR(change.moved_m, 0.003, 1e-4);
  }
  EXPECT_EQ(moved, lines);
}

TEST(CleanPlan, TooManyWallsAreRefusedAtOnce) {
  InputPlan input;
  for (int i = 0; i < 200'001; ++i) input.segments.push_back({{i, 0}, {i + 0.5, 0}, i + 1});
  NoProgress progress;
  const auto refused = CleanPlan(input, {}, progress);
  EXPECT_EQ(refused.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(refused.error().message, HasSubstr("200001 walls; at most 200000"));
  InputPlan closed;
  closed.rings.resize(2);
  for (int i = 0; i < 100'001; ++i) {
    for (auto& ring : closed.rings) ring.emplace_back(i, 0);
  }
  EXPECT_EQ(CleanPlan(closed, {}, progress).error().code, ErrorCode::kUnsupported);
}

TEST(CleanPlan, DividesWallsWhereOthersTouchOrCrossThem) {
  //        |            One wall ends 4 mm short of the horizontal one, another
  //  ------+------      crosses it: three pieces of one wall.
  //     |  |
  const auto result = Cleaned("0,0,4,0\n1,-1,1,-0.004\n2,-1,2,1");
  EXPECT_EQ(Count(result, PlanChangeKind::kEndOnWall), 1);
  EXPECT_EQ(Count(result, PlanChangeKind::kCrossing), 1);
  EXPECT_EQ(result.plan.num_walls(), 3);
  EXPECT_EQ(result.plan.pieces.size(), 3u + 1u + 2u);
}

TEST(CleanPlan, KeepsWhatTwoWallsShareOnce) {
  const auto result = Cleaned("0,0,4,0\n3,0,6,0.001");
  EXPECT_EQ(Count(result, PlanChangeKind::kOverlap), 1);
  ASSERT_EQ(result.plan.num_walls(), 1);
  EXPECT_NEAR(result.plan.walls[0].Length(), 6, 1e-3);
}

TEST(CleanPlan, JoinsWallsThatContinueEachOther) {
  // A point 3 mm beside the line goes, one of 20 mm stays.
  const auto result = Cleaned("0,0,1,0.003\n1,0.003,2,0\n2,0,3,0.02\n3,0.02,4,0");
  EXPECT_EQ(Count(result, PlanChangeKind::kPointRemoved), 1);
  EXPECT_EQ(result.plan.num_walls(), 3);
}

TEST(CleanPlan, AWallIsOneWallOnBothSidesOfADoorpost) {
  //  ------+------   Two pieces, one wall: its upper side is one label.
  //        |
  const auto result = Cleaned("0,0,2,0\n2,0,4,0\n2,0,2,-1");
  EXPECT_EQ(result.plan.num_walls(), 2);
  EXPECT_EQ(result.plan.pieces.size(), 3u);
}

// Walls that run almost along each other share pieces and part again: each wall is one line, on which all of
// its pieces lie.
TEST(CleanPlan, PiecesLieOnTheirWalls) {
  int num_shared = 0;
  for (int seed = 0; seed < 40; ++seed) {
    Random random(seed);
    std::string text;
    for (int i = 0; i < 25; ++i) {
      const double x = random.Uniform(0, 10), y = random.Uniform(0, 10), angle = random.Uniform(0, 6.2832);
      const double length = random.Uniform(1, 6);
      const double dx = length * std::cos(angle), dy = length * std::sin(angle);
      text += fmt::format("{},{},{},{}\n", x, y, x + dx, y + dy);
      // Another that begins on it and ends a little beside it.
      if (i % 2 == 0)
        text += fmt::format("{},{},{},{}\n", x + 0.3 * dx, y + 0.3 * dy, x + 1.4 * dx - 0.06 * dy,
                            y + 1.4 * dy + 0.06 * dx);
    }
    CleanPlanOptions options;
    options.snap_m = 0.05;
    options.simplify_m = 0.03;
    const auto result = Cleaned(text, options);
    num_shared += Count(result, PlanChangeKind::kOverlap);
    for (const PlanPiece& piece : result.plan.pieces) {
      const PlanWall& wall = result.plan.walls[piece.wall];
      const Eigen::Vector2d along = (wall.end - wall.start).normalized();
      for (const int32_t vertex : {piece.start, piece.end}) {
        const Eigen::Vector2d offset = result.plan.Metres(result.plan.vertices[vertex]) - wall.start;
        EXPECT_LT(std::abs(Cross(along, offset)), 0.035) << "seed " << seed << ", wall " << piece.wall;
        EXPECT_GT(along.dot(offset), -1e-6);
        EXPECT_LT(along.dot(offset), wall.Length() + 1e-6);
      }
    }
  }
  EXPECT_GT(num_shared, 20);
}

TEST(CleanPlan, CoordinatesFarFromTheOriginLoseNothing) {
  const auto near = Cleaned("0,0,4,0\n4,0,4.12345,3"),
             far = Cleaned("1e6,2e6,1000004,2e6\n1000004,2e6,1000004.12345,2000003");
  ASSERT_EQ(near.plan.vertices.size(), far.plan.vertices.size());
  for (size_t i = 0; i < near.plan.vertices.size(); ++i) {
    const Eigen::Vector2d shift =
        far.plan.Metres(far.plan.vertices[i]) - near.plan.Metres(near.plan.vertices[i]);
    EXPECT_NEAR(shift.x(), 1e6, 1e-9 * 1e6);
    EXPECT_NEAR(shift.y(), 2e6, 1e-9 * 1e6);
  }
}

TEST(CleanPlan, RefusesWhatDoesNotFitTheGrid) {
  NoProgress progress;
  const auto input = ParsePlan("0,0,1e8,0", "plan", {.units = "m"});
  ASSERT_TRUE(input.ok());
  const auto result = CleanPlan(*input, {}, progress);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(result.error().message, HasSubstr("--grid-m"));
}

TEST(CleanPlan, RefusesInvalidPolygonsAndSaysWhere) {
  // Crossing itself at (1, 1).
  const Error crossing = ErrorOf(PolygonText({{{0, 0}, {2, 2}, {2, 0}, {0, 2}}}));
  EXPECT_EQ(crossing.code, ErrorCode::kCorrupt);
  EXPECT_THAT(crossing.message, HasSubstr("Self-intersection at (1, 1)"));
  // A hole outside, and one that overlaps the ring.
  EXPECT_EQ(ErrorOf(PolygonText({{{0, 0}, {4, 0}, {4, 4}, {0, 4}}, {{5, 5}, {6, 5}, {6, 6}, {5, 6}}})).code,
            ErrorCode::kCorrupt);
  EXPECT_EQ(ErrorOf(PolygonText({{{0, 0}, {4, 0}, {4, 4}, {0, 4}}, {{3, 3}, {6, 3}, {6, 6}, {3, 6}}})).code,
            ErrorCode::kCorrupt);
  // All points in one line.
  EXPECT_EQ(ErrorOf(PolygonText({{{0, 0}, {1, 0}, {4, 0}}})).code, ErrorCode::kCorrupt);
}

TEST(CleanPlan, RefusesAPlanWithoutLength) {
  EXPECT_EQ(ErrorOf("1,1,1,1\n2,2,2,2.000001").code, ErrorCode::kNoData);
}

}  // namespace
}  // namespace cairn::decompose_views
