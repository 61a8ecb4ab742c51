#include "runtime/paths/floor_pieces.h"

#include <gtest/gtest.h>

#include "tests/decompose_views/plan_fixture.h"
#include "tests/runtime/paths/plan_oracle.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

bool Holds(const ConvexPiece& piece, const Vec2& point) {
  for (size_t i = 0; i < piece.size(); ++i) {
    const Vec2 along = piece[(i + 1) % piece.size()] - piece[i];
    // Edges of no length have no direction.
    if (along.norm() > 1e-7 && Cross(along, point - piece[i]) < 1e-9 * along.norm()) return false;
  }
  return true;
}

int NumHolding(const std::vector<ConvexPiece>& pieces, const Vec2& point) {
  return static_cast<int>(std::count_if(pieces.begin(), pieces.end(),
                                        [&](const ConvexPiece& piece) { return Holds(piece, point); }));
}

TEST(ConvexPiece, IsMeasuredAndCut) {
  const ConvexPiece piece{{0, 0}, {3, 0}, {3, 2}};
  EXPECT_NEAR(AreaOf(piece), 3, 1e-12);
  EXPECT_NEAR((CentroidOf(piece) - Vec2(2, 2.0 / 3)).norm(), 0, 1e-12);
  // Left of x = 1, upwards: a triangle of 1 x 2 / 3.
  const ConvexPiece left = LeftOf(piece, {1, 7}, {0, 2});
  EXPECT_NEAR(AreaOf(left), 1.0 / 3, 1e-12);
  EXPECT_NEAR(CentroidOf(left).x(), 2.0 / 3, 1e-12);
  EXPECT_NEAR(AreaOf(LeftOf(piece, {1, 7}, {0, -1})), 3 - 1.0 / 3, 1e-12);
  EXPECT_TRUE(LeftOf(piece, {0, 0}, {0, 1}).empty());
  EXPECT_EQ(LeftOf(piece, {3, 0}, {0, 1}), piece);
  const std::vector<ConvexPiece> small = Divided({piece}, 0.5);
  EXPECT_NEAR(AreaOf(small), 3, 1e-9);
  for (const ConvexPiece& part : small) {
    for (const Vec2& corner : part) EXPECT_LE((corner - part[0]).cwiseAbs().maxCoeff(), 0.5 + 1e-12);
  }
}

TEST(ConvexPiece, CutThroughItsCornersHasNoneTwice) {
  const ConvexPiece square{{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  EXPECT_EQ(LeftOf(square, {0, 0}, {1, 1}), (ConvexPiece{{0, 0}, {1, 1}, {0, 1}}));
  EXPECT_EQ(LeftOf(square, {0, 0}, {-1, -1}), (ConvexPiece{{0, 0}, {1, 0}, {1, 1}}));
  // Without an area its middle is its first corner.
  EXPECT_EQ(CentroidOf({{1, 1}, {2, 1}, {3, 1}}), Vec2(1, 1));
}

TEST(FloorPieces, CoverTheBoxOnceAndNoWallCrossesThem) {
  for (uint64_t seed = 0; seed < 60; ++seed) {
    Random random(MixSeed(31, seed));
    const PlanOracle oracle(RandomWalls(random, static_cast<int>(random.UniformInt(1, 12)), 6));
    const Views views = decompose_views::Decomposed(oracle.Text()).views;
    const PlanSpace space(views);
    const std::vector<ConvexPiece> pieces = FloorPieces(space);
    double area = 0;
    for (FaceIdx face = 0; face < views.num_faces(); ++face) area += views.Area(face);
    EXPECT_NEAR(AreaOf(pieces), area, 1e-6);
    for (int i = 0; i < 100; ++i)
      EXPECT_LE(NumHolding(pieces, {random.Uniform(-1, 7), random.Uniform(-1, 7)}), 1);
    for (const ConvexPiece& piece : pieces) {
      ASSERT_GE(piece.size(), 3u);
      EXPECT_GT(AreaOf(piece), 0);
      if (AreaOf(piece) < 0.05) continue;
      // From its middle to near each corner.
      const Vec2 middle = CentroidOf(piece);
      for (const Vec2& corner : piece)
        EXPECT_TRUE(space.PassageBetween(middle, corner + 0.01 * (middle - corner)).IsOpen())
            << oracle.Text();
    }
  }
}

TEST(FloorPieces, AreThoseInsideOfAPolygon) {
  const Views views =
      decompose_views::Decomposed(
          decompose_views::PolygonText({{{0, 0}, {6, 0}, {6, 6}, {0, 6}}, {{1, 1}, {1, 5}, {5, 5}, {5, 1}}}))
          .views;
  const std::vector<ConvexPiece> pieces = FloorPieces(PlanSpace(views));
  EXPECT_NEAR(AreaOf(pieces), 36 - 16, 1e-6);
  EXPECT_EQ(NumHolding(pieces, {3, 3}), 0);
  EXPECT_EQ(NumHolding(pieces, {0.5, 3.1}), 1);
}

TEST(LookAround, HidesWhatIsBehindAWall) {
  //  box -1..5 x -1..5; wall from (2, 1) to (2, 3), seen from (0, 2): hidden is the trapezoid behind it, 2 m
  //  wide at the wall, 5 m at x = 5.
  const Views views = decompose_views::Decomposed("2,1,2,3\n0,0,0,0.5\n4,4,4,3.5").views;
  const PlanSpace space(views);
  const LookAround look(space, {0, 2});
  const ConvexPiece floor{{1, -1}, {5, -1}, {5, 4}, {1, 4}};
  EXPECT_TRUE(look.Sees({1.9, 2}));
  EXPECT_FALSE(look.Sees({2.1, 2}));
  EXPECT_TRUE(look.Sees({4, 0.9 - 1}));
  const std::vector<ConvexPiece> hidden = look.Hidden({floor});
  EXPECT_EQ(NumHolding(hidden, {3, 2}), 1);
  EXPECT_EQ(NumHolding(hidden, {1.5, 2}), 0);
  EXPECT_EQ(NumHolding(hidden, {3, 0.4}), 0);
  EXPECT_EQ(NumHolding(hidden, {3, 0.6}), 1);
  // Of a piece that is seen nothing is left; one that is hidden stays as it is.
  EXPECT_TRUE(look.Hidden({{{1, 1}, {1.9, 1}, {1.9, 3}, {1, 3}}}).empty());
  const ConvexPiece behind{{2.5, 1.5}, {3, 1.5}, {3, 2.5}, {2.5, 2.5}};
  EXPECT_EQ(look.Hidden({behind}), std::vector<ConvexPiece>{behind});
}

TEST(LookAround, HidesOfAPieceAroundThePlaceWhatIsBehindAWall) {
  // As above, of the whole box, in which the place lies, and of what is right of it: a trapezoid.
  const Views views = decompose_views::Decomposed("2,1,2,3\n0,0,0,0.5\n4,4,4,3.5").views;
  const PlanSpace space(views);
  const LookAround look(space, {0, 2});
  for (const double left : {-1.0, 0.5}) {
    const std::vector<ConvexPiece> hidden = look.Hidden({{{left, -1}, {5, -1}, {5, 5}, {left, 5}}});
    EXPECT_NEAR(AreaOf(hidden), 0.5 * (2 + 5) * 3, 1e-6);
    EXPECT_EQ(NumHolding(hidden, {4.9, 4}), 1);
    EXPECT_EQ(NumHolding(hidden, {4.9, -0.3}), 1);
  }
}

TEST(LookAround, WhatTwoWallsHideStaysWhole) {
  const Views views = decompose_views::Decomposed("2,1,2,2.5\n2,2.5,2,3\n0,0,0,0.5\n4,4,4,3.5").views;
  const LookAround look(PlanSpace(views), {0, 2});
  const ConvexPiece behind{{2.5, 1.5}, {4, 1.5}, {4, 3}, {2.5, 3}};
  EXPECT_EQ(look.Hidden({behind}), std::vector<ConvexPiece>{behind});
}

TEST(LookAround, LooksInAllDirectionsFromTheBorder) {
  const Views views = decompose_views::Decomposed("1,1,2,2").views;
  const PlanSpace space(views);
  for (const double x : {0.0, 1.3, 3.0}) {
    for (const double y : {0.0, 1.2, 3.0}) {
      const std::vector<BlockedArc> arcs = LookAround(space, {x, y}).arcs();
      EXPECT_EQ(arcs.front().from, -std::numbers::pi);
      EXPECT_EQ(arcs.back().to, std::numbers::pi);
      for (size_t i = 0; i + 1 < arcs.size(); ++i) EXPECT_NEAR(arcs[i].to, arcs[i + 1].from, 1e-9);
      for (const BlockedArc& arc : arcs) EXPECT_GT(arc.Distance(0.5 * (arc.from + arc.to)), 0);
    }
  }
}

TEST(LookAround, WhatIsHiddenIsWhatIsNotSeen) {
  int num_hidden = 0, num_seen = 0;
  for (uint64_t seed = 0; seed < 80; ++seed) {
    Random random(MixSeed(32, seed));
    const PlanOracle oracle(RandomWalls(random, static_cast<int>(random.UniformInt(2, 12)), 6));
    const Views views = decompose_views::Decomposed(oracle.Text()).views;
    const PlanSpace space(views);
    const LookAround first(space, {random.Uniform(-0.9, 6.9), random.Uniform(-0.9, 6.9)});
    const LookAround second(space, {random.Uniform(-0.9, 6.9), random.Uniform(-0.9, 6.9)});
    if (space.FaceAt(first.place()) < 0 || space.FaceAt(second.place()) < 0) continue;
    const std::vector<ConvexPiece> floor = FloorPieces(space);
    const std::vector<ConvexPiece> hidden = second.Hidden(first.Hidden(floor));
    // Pieces are disjoint, and the order of looks does not matter.
    EXPECT_NEAR(AreaOf(hidden), AreaOf(first.Hidden(second.Hidden(floor))), 1e-6);
    for (int i = 0; i < 100; ++i) {
      const Vec2 point(random.Uniform(-0.9, 6.9), random.Uniform(-0.9, 6.9));
      if (space.FaceAt(point) < 0) continue;
      const bool is_seen = oracle.Sees(first.place(), point) || oracle.Sees(second.place(), point);
      EXPECT_EQ(first.Sees(point) || second.Sees(point), is_seen) << oracle.Text();
      EXPECT_EQ(NumHolding(hidden, point), is_seen ? 0 : 1) << oracle.Text() << point.transpose();
      (is_seen ? num_seen : num_hidden) += 1;
    }
  }
  EXPECT_GT(num_seen, 2000);
  EXPECT_GT(num_hidden, 1000);
}

}  // namespace
}  // namespace cairn
