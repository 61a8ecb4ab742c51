#include "core/view_regions/node_segments.h"

#include <algorithm>
#include <memory>
#include <set>
#include <tuple>

#include <geos/geom/CoordinateArraySequence.h>
#include <geos/geom/PrecisionModel.h>
#include <geos/noding/NodedSegmentString.h>
#include <geos/noding/snapround/SnapRoundingNoder.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn::decompose_views {
namespace {

using Vec2 = Eigen::Vector2d;

// An edge by its places and tag.
using Edge = std::tuple<GridPoint, GridPoint, int32_t>;

NodedSegments Noded(const std::vector<TaggedSegment>& segments, int num_threads = 1) {
  NoProgress progress;
  auto result = SegmentNoder(segments).Node(num_threads, progress);
  EXPECT_TRUE(result.ok()) << result.error().message;
  return result.ok() ? std::move(*result) : NodedSegments{};
}

std::vector<Edge> Edges(const NodedSegments& noded) {
  std::vector<Edge> edges;
  for (const NodedEdge& edge : noded.edges)
    edges.emplace_back(noded.vertices[edge.start], noded.vertices[edge.end], edge.tag);
  std::sort(edges.begin(), edges.end());
  return edges;
}

// The oracle: GEOS's snap rounding.
std::vector<Edge> EdgesByGeos(const std::vector<TaggedSegment>& segments) {
  using geos::geom::Coordinate;
  using geos::noding::SegmentString;
  std::vector<SegmentString*> input;
  for (const TaggedSegment& segment : segments) {
    auto points = std::make_unique<geos::geom::CoordinateArraySequence>(2, 2);
    points->setAt(Coordinate(segment.start.x(), segment.start.y()), 0);
    points->setAt(Coordinate(segment.end.x(), segment.end.y()), 1);
    input.push_back(new geos::noding::NodedSegmentString(points.release(), &segment));
  }
  const geos::geom::PrecisionModel grid(1.0);
  geos::noding::snapround::SnapRoundingNoder noder(&grid);
  noder.computeNodes(&input);
  const std::unique_ptr<std::vector<SegmentString*>> noded(noder.getNodedSubstrings());
  const auto rounded = [](const Coordinate& c) { return GridPoint{std::llround(c.x), std::llround(c.y)}; };
  std::vector<Edge> edges;
  for (const SegmentString* string : *noded) {
    const auto tag = static_cast<const TaggedSegment*>(string->getData())->tag;
    for (size_t i = 0; i + 1 < string->size(); ++i) {
      const GridPoint start = rounded(string->getCoordinate(i)), end = rounded(string->getCoordinate(i + 1));
      if (start != end) edges.emplace_back(start, end, tag);
    }
    delete string;
  }
  for (const SegmentString* string : input) delete string;
  std::sort(edges.begin(), edges.end());
  return edges;
}

std::vector<TaggedSegment> RandomSegments(int num, double size, double length, uint64_t seed) {
  Random random(seed);
  std::vector<TaggedSegment> segments;
  for (int i = 0; i < num; ++i) {
    const Vec2 start(random.Uniform(-size, size), random.Uniform(-size, size));
    segments.push_back(
        {start, start + Vec2(random.Uniform(-length, length), random.Uniform(-length, length)), i});
  }
  return segments;
}

TEST(SegmentNoder, DividesACrossInItsMiddle) {
  const NodedSegments noded = Noded({{{0, 0}, {10, 10}, 5}, {{10, 0}, {0, 10}, 7}});
  EXPECT_THAT(noded.vertices, testing::ElementsAre(GridPoint{0, 0}, GridPoint{0, 10}, GridPoint{5, 5},
                                                   GridPoint{10, 0}, GridPoint{10, 10}));
  EXPECT_THAT(Edges(noded), testing::ElementsAre(Edge({0, 0}, {5, 5}, 5), Edge({5, 5}, {0, 10}, 7),
                                                 Edge({5, 5}, {10, 10}, 5), Edge({10, 0}, {5, 5}, 7)));
}

TEST(SegmentNoder, AnEndOnASegmentDividesIt) {
  const NodedSegments noded = Noded({{{0, 0}, {9, 0}, 0}, {{4.2, 0}, {4.2, 7}, 1}});
  EXPECT_THAT(Edges(noded), testing::ElementsAre(Edge({0, 0}, {4, 0}, 0), Edge({4, 0}, {4, 7}, 1),
                                                 Edge({4, 0}, {9, 0}, 0)));
}

TEST(SegmentNoder, WhatLiesOnAnotherIsThereTwice) {
  const NodedSegments noded = Noded({{{0, 0}, {9, 0}, 0}, {{6, 0}, {3, 0}, 1}});
  EXPECT_THAT(Edges(noded), testing::ElementsAre(Edge({0, 0}, {3, 0}, 0), Edge({3, 0}, {6, 0}, 0),
                                                 Edge({6, 0}, {3, 0}, 1), Edge({6, 0}, {9, 0}, 0)));
}

TEST(SegmentNoder, ASegmentInOnePixelIsAVertexWithoutEdges) {
  const NodedSegments noded = Noded({{{3.1, 3.2}, {2.9, 3.3}, 0}});
  EXPECT_THAT(noded.vertices, testing::ElementsAre(GridPoint{3, 3}));
  EXPECT_TRUE(noded.edges.empty());
  EXPECT_TRUE(Noded({}).vertices.empty());
}

TEST(SegmentNoder, APixelHasItsLowerAndLeftSidesButNotTheOthers) {
  const auto passes = [](Vec2 start, Vec2 end) { return Passes(MakeSubSegment(start, end), {0, 0}); };
  EXPECT_TRUE(passes({-0.5, -3}, {-0.5, 3}));  // along the left side
  EXPECT_FALSE(passes({0.5, -3}, {0.5, 3}));
  EXPECT_TRUE(passes({-3, -0.5}, {3, -0.5}));
  EXPECT_FALSE(passes({-3, 0.5}, {3, 0.5}));
  EXPECT_TRUE(passes({-1.5, 0.5}, {0.5, -1.5}));   // falls through the lower left corner
  EXPECT_FALSE(passes({-0.5, 1.5}, {1.5, -0.5}));  // the upper right one
  EXPECT_FALSE(passes({-1.5, -0.5}, {0.5, 1.5}));  // rises through the upper left one
  EXPECT_FALSE(passes({-0.5, -1.5}, {1.5, 0.5}));  // the lower right one
  EXPECT_TRUE(passes({-2, -2}, {-0.5, -0.5}));     // ends in the lower left one
  EXPECT_FALSE(passes({-2, -2}, {-0.51, -0.51}));
}

// Coordinates so small that many vertices share pixels, and large ones.
TEST(SegmentNoder, AgreesWithGeos) {
  for (uint64_t seed = 0; seed < 4; ++seed) {
    for (const auto& [size, length] : {std::pair{30.0, 30.0}, {300.0, 80.0}, {2e4, 2e4}, {1e8, 1e8}}) {
      const auto segments = RandomSegments(150, size, length, seed);
      EXPECT_EQ(Edges(Noded(segments)), EdgesByGeos(segments)) << size << " seed " << seed;
    }
  }
}

TEST(SegmentNoder, ManySegmentsThroughOneVertexAgreeWithGeos) {
  std::vector<TaggedSegment> segments = RandomSegments(60, 5e4, 5e4, 9);
  Random random(2);
  for (int i = 0; i < 200; ++i)
    segments.push_back({{100, 200}, {random.Uniform(-5e4, 5e4), random.Uniform(-5e4, 5e4)}, 100 + i});
  EXPECT_EQ(Edges(Noded(segments)), EdgesByGeos(segments));
}

TEST(SegmentNoder, NoTwoEdgesCross) {
  for (const double size : {20.0, 200.0, 5e4}) {
    const NodedSegments noded = Noded(RandomSegments(120, size, size, 17));
    const auto at = [&](int32_t vertex) { return noded.vertices[vertex]; };
    for (const NodedEdge& a : noded.edges) {
      for (const NodedEdge& b : noded.edges) {
        const auto side = [](int64_t area) { return area > 0 ? 1 : area < 0 ? -1 : 0; };
        const bool cross = side(Orientation(at(a.start), at(a.end), at(b.start))) *
                                   side(Orientation(at(a.start), at(a.end), at(b.end))) <
                               0 &&
                           side(Orientation(at(b.start), at(b.end), at(a.start))) *
                                   side(Orientation(at(b.start), at(b.end), at(a.end))) <
                               0;
        ASSERT_FALSE(cross);
      }
    }
  }
}

TEST(SegmentNoder, ThreadsDoNotMatter) {
  const auto segments = RandomSegments(3000, 1e6, 1e5, 4);
  EXPECT_EQ(Edges(Noded(segments, 1)), Edges(Noded(segments, 5)));
  EXPECT_EQ(Noded(segments, 1).vertices, Noded(segments, 5).vertices);
}

TEST(SegmentNoder, CountsTheCrossingsOfPairs) {
  const auto segments = RandomSegments(400, 1e5, 8e4, 21);
  int64_t expected = 0;
  GridPoint low, high;
  for (size_t i = 0; i < segments.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      const auto sub = [&](size_t k) { return MakeSubSegment(segments[k].start, segments[k].end); };
      expected += CrossAt(sub(i), sub(j), &low, &high) ? 1 : 0;
    }
  }
  NoProgress progress;
  const auto count = SegmentNoder(segments).CountCrossings(3, progress);
  ASSERT_TRUE(count.ok());
  EXPECT_GT(expected, 1000);
  EXPECT_EQ(*count, expected);
}

TEST(SegmentNoder, StopsWhenItIsCancelled) {
  class StoppedProgress final : public Progress {
   public:
    void Begin(std::string_view, int64_t total, std::string_view) override { parts = std::max(parts, total); }
    void Advance(int64_t) override { ++advanced; }
    void End() override {}
    bool Cancelled() const override { return advanced >= 10; }
    int64_t parts = 0;
    int advanced = 0;
  };
  StoppedProgress progress;
  const SegmentNoder noder(RandomSegments(3000, 1e6, 1e5, 4));
  EXPECT_EQ(noder.Node(1, progress).error().code, ErrorCode::kCancelled);
  EXPECT_EQ(progress.advanced, 10);
  EXPECT_GT(progress.parts, 100);
}

}  // namespace
}  // namespace cairn::decompose_views
