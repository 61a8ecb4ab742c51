#include "core/view_regions/arrangement.h"

#include <algorithm>
#include <numeric>

#include "core/base/parallel.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr int64_t kItemsPerBlock = 4096;

// Half-edge 2e runs along edge e, 2e + 1 against it.
class FaceWalker {
 public:
  FaceWalker(Arrangement* arrangement, const std::vector<int8_t>& solid_sides)
      : arrangement_(*arrangement), solid_sides_(solid_sides) {}

  // False: cancelled.
  bool Run(int num_threads, Progress& progress) {
    if (!SortAroundVertices(num_threads, progress)) return false;
    const auto num_halves = static_cast<int64_t>(2 * arrangement_.edges.size());
    std::vector<bool> seen(num_halves, false);
    std::vector<int64_t> walk;
    progress.Begin("faces", num_halves, "sides of edges");
    // [Simsarian96 §2.2 step IV] "while there is an unused edge": its counter-clockwise cycle is a region
    for (int64_t first = 0; first < num_halves; ++first) {
      if (first % kItemsPerBlock == kItemsPerBlock - 1) {
        progress.Advance(kItemsPerBlock);
        if (progress.Cancelled()) break;
      }
      if (seen[first]) continue;
      walk.clear();
      bool inside = true;
      for (int64_t half = first; !seen[half]; half = Next(half)) {
        seen[half] = true;
        walk.push_back(half);
        inside = inside && (solid_sides_[half / 2] & (half % 2 == 0 ? 1 : 2)) == 0;
      }
      if (inside && TwiceArea(walk) > 0) AddFace(walk);
    }
    progress.End();
    return !progress.Cancelled();
  }

 private:
  int32_t Origin(int64_t half) const {
    const Arrangement::Edge& edge = arrangement_.edges[half / 2];
    return half % 2 == 0 ? edge.start : edge.end;
  }
  int32_t Target(int64_t half) const { return Origin(half ^ 1); }

  bool SortAroundVertices(int num_threads, Progress& progress) {
    const size_t num_vertices = arrangement_.vertices.size();
    const auto num_halves = static_cast<int64_t>(2 * arrangement_.edges.size());
    offsets_.assign(num_vertices + 1, 0);
    const auto stopped = [&](int64_t item) { return item % kItemsPerBlock == 0 && progress.Cancelled(); };
    for (int64_t half = 0; half < num_halves; ++half) {
      if (stopped(half)) return false;
      ++offsets_[Origin(half) + 1];
    }
    std::partial_sum(offsets_.begin(), offsets_.end(), offsets_.begin());
    around_.resize(num_halves);
    std::vector<int64_t> next(offsets_.begin(), offsets_.end() - 1);
    for (int64_t half = 0; half < num_halves; ++half) {
      if (stopped(half)) return false;
      around_[next[Origin(half)]++] = half;
    }
    place_.resize(num_halves);
    const int64_t num_blocks = (static_cast<int64_t>(num_vertices) + kItemsPerBlock - 1) / kItemsPerBlock;
    ParallelFor(num_blocks, num_threads, [&](int64_t block) {
      if (progress.Cancelled()) return;
      const size_t end = std::min<size_t>(num_vertices, (block + 1) * kItemsPerBlock);
      for (size_t vertex = block * kItemsPerBlock; vertex < end; ++vertex) SortAround(vertex);
    });
    return !progress.Cancelled();
  }

  void SortAround(size_t vertex) {
    const GridPoint& centre = arrangement_.vertices[vertex];
    const auto is_lower = [&](const GridPoint& point) {
      return point.y < centre.y || (point.y == centre.y && point.x < centre.x);
    };
    std::sort(around_.begin() + offsets_[vertex], around_.begin() + offsets_[vertex + 1],
              [&](int64_t a, int64_t b) {
                const GridPoint &to_a = arrangement_.vertices[Target(a)],
                                &to_b = arrangement_.vertices[Target(b)];
                if (is_lower(to_a) != is_lower(to_b)) return is_lower(to_b);
                return Orientation(centre, to_a, to_b) > 0;
              });
    for (int64_t i = offsets_[vertex]; i < offsets_[vertex + 1]; ++i) place_[around_[i]] = i;
  }

  // [Simsarian96 §2.2 step IV] "turning as sharply as possible to the left": the half-edge that follows with
  // the same face to its left is, at the target, the next one clockwise.
  int64_t Next(int64_t half) const {
    const int32_t vertex = Target(half);
    const int64_t at = place_[half ^ 1];
    return around_[at == offsets_[vertex] ? offsets_[vertex + 1] - 1 : at - 1];
  }

  double TwiceArea(const std::vector<int64_t>& walk) const {
    const GridPoint& origin = arrangement_.vertices[Origin(walk[0])];
    __int128 twice = 0;
    for (const int64_t half : walk)
      twice += Orientation(origin, arrangement_.vertices[Origin(half)], arrangement_.vertices[Target(half)]);
    return static_cast<double>(twice);
  }

  void AddFace(const std::vector<int64_t>& walk) {
    const int32_t face = arrangement_.num_faces();
    for (const int64_t half : walk) {
      Arrangement::Edge& edge = arrangement_.edges[half / 2];
      (half % 2 == 0 ? edge.left : edge.right) = face;
      arrangement_.face_vertices.push_back(Origin(half));
    }
    arrangement_.face_offsets.push_back(static_cast<int64_t>(arrangement_.face_vertices.size()));
  }

  Arrangement& arrangement_;
  const std::vector<int8_t>& solid_sides_;  // per edge: 1: nothing of the domain on its left, 2: on its right
  std::vector<int64_t> offsets_, around_, place_;
};

}  // namespace

std::vector<TaggedSegment> ArrangedSegments(const FloorPlan& plan,
                                            const std::vector<ViewBoundary>& boundaries) {
  std::vector<TaggedSegment> segments;
  for (size_t i = 0; i < boundaries.size(); ++i)
    segments.push_back({boundaries[i].start, boundaries[i].end, static_cast<int32_t>(i)});
  for (size_t i = 0; i < plan.pieces.size(); ++i) {
    segments.push_back({Real(plan.vertices[plan.pieces[i].start]), Real(plan.vertices[plan.pieces[i].end]),
                        -1 - static_cast<int32_t>(i)});
  }
  if (plan.closed) return segments;
  const Vec2 low = Real(plan.low), high = Real(plan.high);
  const auto box = -1 - static_cast<int32_t>(plan.pieces.size());
  segments.push_back({low, {high.x(), low.y()}, box});
  segments.push_back({{high.x(), low.y()}, high, box});
  segments.push_back({high, {low.x(), high.y()}, box});
  segments.push_back({{low.x(), high.y()}, low, box});
  return segments;
}

Result<Arrangement> Arrange(const FloorPlan& plan, const SegmentNoder& noder, int num_threads,
                            Progress& progress) {
  Arrangement arrangement;
  // [Simsarian96 §2.2 step II] view boundaries intersect: interior vertices
  CAIRN_ASSIGN_OR_RETURN(NodedSegments result, noder.Node(num_threads, progress));
  arrangement.vertices = std::move(result.vertices);
  std::vector<NodedEdge> noded = std::move(result.edges);
  const auto lower_first = [](const NodedEdge& edge) { return std::minmax(edge.start, edge.end); };
  std::vector<int8_t> solid_sides;
  for (size_t i = 0; i < noded.size(); ++i) {
    if (i % kItemsPerBlock == 0 && progress.Cancelled()) break;
    const auto [start, end] = lower_first(noded[i]);
    if (i == 0 || lower_first(noded[i - 1]) != lower_first(noded[i])) {
      arrangement.edges.push_back({.start = start, .end = end});
      arrangement.edges.back().first_crossing = static_cast<int64_t>(arrangement.crossings.size());
      solid_sides.push_back(0);
    }
    const bool reversed = noded[i].start != start;
    if (noded[i].tag >= 0) {
      arrangement.crossings.push_back({noded[i].tag, reversed});
    } else {
      arrangement.edges.back().is_wall = true;
      const bool is_box = noded[i].tag < -static_cast<int32_t>(plan.pieces.size());
      // Right of a closed plan's walls is nothing; nor is it right of the box's sides.
      if (plan.closed || is_box) solid_sides.back() |= reversed ? 1 : 2;
    }
  }
  std::vector<NodedEdge>().swap(noded);
  if (progress.Cancelled() || !FaceWalker(&arrangement, solid_sides).Run(num_threads, progress))
    return MakeError(ErrorCode::kCancelled, "cancelled");
  return arrangement;
}

}  // namespace cairn
