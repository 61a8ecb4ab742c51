#include "core/view_regions/derive_views.h"

#include <limits>
#include <optional>
#include <utility>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/decompose_views/plan_fixture.h"

namespace cairn::decompose_views {
namespace {

// A plan of a map may say anything: its regions, or a sentence.
TEST(DeriveViews, PlansThatLieAreRefused) {
  const FloorPlan plan = Decomposed("0,0,6,0\n6,0,6,4\n6,4,0,4\n0,4,0,0\n2,1,4,3\n").views.plan;
  const auto code_of = [&](auto&& change) {
    FloorPlan lying = plan;
    change(&lying);
    NoProgress progress;
    const auto derived = DeriveViews(lying, 1, 256, progress);
    return derived.ok() ? std::optional<ErrorCode>() : derived.error().code;
  };
  EXPECT_EQ(code_of([](FloorPlan*) {}), std::nullopt);
  EXPECT_EQ(code_of([](FloorPlan* p) { std::swap(p->low, p->high); }), ErrorCode::kCorrupt);
  EXPECT_EQ(code_of([](FloorPlan* p) { std::swap(p->low.x, p->high.x); }), ErrorCode::kCorrupt);
  EXPECT_EQ(code_of([](FloorPlan* p) { p->high.x = kMaxGridCoordinate + 1; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code_of([](FloorPlan* p) { p->low.y = -kMaxGridCoordinate - 1; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code_of([](FloorPlan* p) { p->vertices[0].x = p->low.x - 1; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code_of([](FloorPlan* p) { p->vertices[1].y = p->high.y + 1; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code_of([](FloorPlan* p) { p->grid_m = std::numeric_limits<double>::infinity(); }),
            ErrorCode::kCorrupt);
  EXPECT_EQ(code_of([](FloorPlan* p) { p->walls[2].end.x() += 1; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code_of([](FloorPlan* p) { p->walls[2].start.y() += 1; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code_of([](FloorPlan* p) { p->walls.push_back(p->walls[0]); }), ErrorCode::kCorrupt);
  EXPECT_EQ(code_of([](FloorPlan* p) { p->pieces[0].end = 99; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code_of([](FloorPlan* p) { p->walls.resize(kMaxNumDividedWalls + 1, p->walls[0]); }),
            ErrorCode::kUnsupported);
}

// Walls that cross without a vertex there, lie on each other, or are of one vertex twice.
TEST(DeriveViews, AnyPiecesHaveRegionsOrAreRefused) {
  Random random(5);
  int num_derived = 0;
  for (int trial = 0; trial < 200; ++trial) {
    FloorPlan plan;
    plan.grid_m = 0.01;
    plan.closed = trial % 3 == 0;
    plan.low = {-100, -100};
    plan.high = {100, 100};
    for (int i = 0; i < 12; ++i)
      plan.vertices.push_back({random.UniformInt(-100, 100), random.UniformInt(-100, 100)});
    for (int i = 0; i < 10; ++i) {
      PlanPiece piece{static_cast<int32_t>(random.UniformInt(0, 11)),
                      static_cast<int32_t>(random.UniformInt(0, 11)), i};
      if (piece.start == piece.end) piece.end = (piece.end + 1) % 12;
      plan.pieces.push_back(piece);
      plan.walls.push_back({plan.Metres(plan.vertices[piece.start]), plan.Metres(plan.vertices[piece.end])});
    }
    NoProgress progress;
    const auto derived = DeriveViews(plan, 1, 256, progress);
    num_derived += derived.ok() ? 1 : 0;
    if (derived.ok()) EXPECT_TRUE(CheckViews(derived->views, "views").ok()) << trial;
  }
  EXPECT_GT(num_derived, 100);
}

}  // namespace
}  // namespace cairn::decompose_views
