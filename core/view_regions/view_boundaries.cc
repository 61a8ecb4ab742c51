#include "core/view_regions/view_boundaries.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>

#include "core/base/parallel.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

// A direction on the grid, and tests against it.
struct Direction {
  int64_t x, y;
  Direction Reversed() const { return {-x, -y}; }
};

int64_t Left(const Direction& direction, const GridPoint& from, const GridPoint& to) {
  return direction.x * (to.y - from.y) - direction.y * (to.x - from.x);
}

// The label that a ray meets at a vertex when it passes closely on one side of it, -1: none.
struct VertexView {
  LabelIdx left = -1, right = -1;
  bool Blocks() const { return left >= 0 && right >= 0; }
};

// Vertices on one line that see each other, up to where the line is blocked at both ends.
struct Chord {
  std::vector<int32_t> vertices;
  WallRays::Hit before, after;                   // what blocks it; .none() where a vertex does, or nothing
  bool open_before = false, open_after = false;  // it goes on beyond the first, the last vertex
};

class BoundaryFinder {
 public:
  BoundaryFinder(const FloorPlan& plan, const WallRays& rays) : plan_(plan), rays_(rays) {}

  // Boundaries on chords whose first pair of neighbours, in the order of ids, contains `vertex` as the lower.
  void FindFrom(int32_t vertex, std::vector<ViewBoundary>* boundaries) const {
    // [Simsarian96 §2.2 step I] a vertex's scan: by rays to the other vertices, not by one walk around
    for (int32_t other = vertex + 1; other < static_cast<int32_t>(plan_.vertices.size()); ++other) {
      if (!Extends(vertex, other) && !Extends(other, vertex)) continue;
      if (plan_.closed && !InsideFrom(vertex, other)) continue;
      if (!rays_.Free(vertex, other)) continue;
      const Chord chord = MakeChord(vertex, other);
      if (IsFirstPair(chord, vertex, other)) AddBoundaries(chord, boundaries);
    }
  }

 private:
  const GridPoint& At(int32_t vertex) const { return plan_.vertices[vertex]; }

  Direction Between(int32_t from, int32_t to) const { return {At(to).x - At(from).x, At(to).y - At(from).y}; }

  // The walls at a vertex that a ray in `direction` meets, passing it on either side.
  VertexView ViewAt(int32_t vertex, const Direction& direction) const {
    VertexView view;
    GridPoint nearest_left, nearest_right;
    for (const int32_t index : rays_.PiecesAt(vertex)) {
      const PlanPiece& piece = plan_.pieces[index];
      const bool outward = piece.start == vertex;
      const GridPoint& other = At(outward ? piece.end : piece.start);
      const int64_t side = Left(direction, At(vertex), other);
      // The ray first meets the wall that turns least from the ray's origin.
      if (side > 0 && (view.left < 0 || Orientation(At(vertex), nearest_left, other) > 0)) {
        nearest_left = other;
        view.left = LabelOf(piece.wall, !outward);
      }
      if (side < 0 && (view.right < 0 || Orientation(At(vertex), nearest_right, other) < 0)) {
        nearest_right = other;
        view.right = LabelOf(piece.wall, outward);
      }
    }
    return view;
  }

  // Whether the line from -> to goes on beyond `to`.
  bool Extends(int32_t from, int32_t to) const { return !ViewAt(to, Between(from, to)).Blocks(); }

  // Closed plans: whether the segment leaves `from` into the domain, or along a wall.
  bool InsideFrom(int32_t from, int32_t to) const {
    // The wall next to the right of the segment: the domain lies left of it.
    const PlanPiece* next = nullptr;
    bool next_is_right = false;
    GridPoint next_end;
    for (const int32_t index : rays_.PiecesAt(from)) {
      const PlanPiece& piece = plan_.pieces[index];
      const GridPoint& other = At(piece.start == from ? piece.end : piece.start);
      const int64_t side = Orientation(At(from), At(to), other);
      const Direction direction = Between(from, to);
      const int64_t ahead = direction.x * (other.x - At(from).x) + direction.y * (other.y - At(from).y);
      if (side == 0 && ahead > 0) return true;
      // Angles to the right: first those in (0, 180), then 180, then the rest.
      const bool is_right = side < 0;
      const bool opposite = side == 0;
      bool nearer;
      if (next == nullptr) {
        nearer = true;
      } else if (is_right != next_is_right) {
        nearer = is_right;
      } else if (is_right) {
        nearer = Orientation(At(from), next_end, other) > 0;
      } else {
        nearer = opposite || Orientation(At(from), next_end, other) > 0;
      }
      if (!nearer) continue;
      next = &piece;
      next_is_right = is_right;
      next_end = other;
    }
    return next == nullptr || next->start == from;
  }

  // Follows the line beyond its last vertex.
  void Follow(std::vector<int32_t>* vertices, WallRays::Hit* end, bool* open) const {
    for (;;) {
      const int32_t last = vertices->back(), before = vertices->end()[-2];
      *open = Extends(before, last);
      if (!*open) return;
      const WallRays::Hit hit = rays_.Beyond(before, last);
      if (hit.vertex < 0) {
        *end = hit;
        return;
      }
      vertices->push_back(hit.vertex);
    }
  }

  Chord MakeChord(int32_t a, int32_t b) const {
    Chord chord;
    std::vector<int32_t> backward{b, a};
    Follow(&backward, &chord.before, &chord.open_before);
    chord.vertices.assign(backward.rbegin(), backward.rend());
    Follow(&chord.vertices, &chord.after, &chord.open_after);
    return chord;
  }

  // A chord is found from each pair of neighbours on it; only one pair handles it.
  bool IsFirstPair(const Chord& chord, int32_t a, int32_t b) const {
    std::pair<int32_t, int32_t> first{std::numeric_limits<int32_t>::max(), 0};
    for (size_t i = 0; i + 1 < chord.vertices.size(); ++i) {
      const std::pair<int32_t, int32_t> pair = std::minmax(chord.vertices[i], chord.vertices[i + 1]);
      if (pair < first && (!plan_.closed || InsideFrom(pair.first, pair.second))) first = pair;
    }
    return first == std::pair<int32_t, int32_t>(a, b);
  }

  LabelIdx LabelBeyond(const WallRays::Hit& hit, int32_t seen_from) const {
    if (hit.piece < 0) return -1;
    const PlanPiece& piece = plan_.pieces[hit.piece];
    return LabelOf(piece.wall, Orientation(At(piece.start), At(piece.end), At(seen_from)) < 0);
  }

  // The side of a piece along the line between neighbours that lies left of from -> to, -1: no such piece.
  LabelIdx Along(int32_t from, int32_t to, bool left) const {
    for (const int32_t index : rays_.PiecesAt(from)) {
      const PlanPiece& piece = plan_.pieces[index];
      if (piece.start == from && piece.end == to) return LabelOf(piece.wall, !left);
      if (piece.end == from && piece.start == to) return LabelOf(piece.wall, left);
    }
    return -1;
  }

  // Looking along vertices in a row, from just beside their line: the label seen by the ray that passes the
  // first `split` of them on one side and the others on the other.
  LabelIdx Window(const std::vector<int32_t>& row, const std::vector<VertexView>& views, LabelIdx beyond,
                  size_t split, bool first_on_left) const {
    for (size_t i = 0; i < row.size(); ++i) {
      const bool on_left = (i < split) == first_on_left;
      const LabelIdx met = on_left ? views[i].left : views[i].right;
      if (met >= 0) return met;
      if (i + 1 == split && split < row.size()) {
        const LabelIdx along = Along(row[i], row[i + 1], on_left);
        if (along >= 0) return along;
      }
    }
    return beyond;
  }

  // Adds windows seen from the left of the line minus those seen from its right, looking along the row.
  // Returns the label to the left of all of them.
  LabelIdx AddChanges(const std::vector<int32_t>& row, const Direction& direction, LabelIdx beyond, int sign,
                      std::map<LabelIdx, int>* changes) const {
    std::vector<VertexView> views;
    for (const int32_t vertex : row) views.push_back(ViewAt(vertex, direction));
    const LabelIdx leftmost = Window(row, views, beyond, row.size(), true);
    if (row.size() < 2) return leftmost;
    // [Simsarian96 Fig. 4] Which labels a boundary exposes or occludes: read off the windows on its two
    // sides, in place of the source's cases (a) to (c).  From the left: the nearer a vertex, the farther
    // right it is.
    LabelIdx before = -2;
    for (size_t split = row.size() + 1; split-- > 0;) {
      const LabelIdx label = Window(row, views, beyond, split, /*first_on_left=*/true);
      if (label != before && label >= 0) (*changes)[label] += sign;
      before = label;
    }
    before = -2;
    for (size_t split = 0; split <= row.size(); ++split) {
      const LabelIdx label = Window(row, views, beyond, split, /*first_on_left=*/false);
      if (label != before && label >= 0) (*changes)[label] -= sign;
      before = label;
    }
    return leftmost;
  }

  // Where the line leaves the domain's box.
  Vec2 BoxExit(int32_t from, const Direction& direction) const {
    const Vec2 origin = Real(At(from));
    const Vec2 along(static_cast<double>(direction.x), static_cast<double>(direction.y));
    double t = std::numeric_limits<double>::infinity();
    if (along.x() != 0)
      t = std::min(
          t, (static_cast<double>(along.x() > 0 ? plan_.high.x : plan_.low.x) - origin.x()) / along.x());
    if (along.y() != 0)
      t = std::min(
          t, (static_cast<double>(along.y() > 0 ? plan_.high.y : plan_.low.y) - origin.y()) / along.y());
    return origin + t * along;
  }

  void AddBoundaries(const Chord& chord, std::vector<ViewBoundary>* boundaries) const {
    const std::vector<int32_t>& row = chord.vertices;
    const Direction direction = Between(row.front(), row.back());
    const LabelIdx beyond = LabelBeyond(chord.after, row.back());
    const LabelIdx before = LabelBeyond(chord.before, row.front());
    const size_t first = chord.open_before ? 0 : 1, last = row.size() - (chord.open_after ? 0 : 1);
    for (size_t i = first; i <= last; ++i) {
      if (i > 0 && i < row.size() && Along(row[i - 1], row[i], true) >= 0) continue;
      const std::vector<int32_t> ahead(row.begin() + static_cast<std::ptrdiff_t>(i), row.end());
      const std::vector<int32_t> behind(row.rend() - static_cast<std::ptrdiff_t>(i), row.rend());
      if (ahead.size() < 2 && behind.size() < 2) continue;
      std::map<LabelIdx, int> changes;
      // A place on the line lies in a closed plan's domain if it sees walls' inner sides.
      const LabelIdx seen_ahead = AddChanges(ahead, direction, beyond, +1, &changes);
      const LabelIdx seen_behind = AddChanges(behind, direction.Reversed(), before, -1, &changes);
      if (plan_.closed && (IsRightSide(seen_ahead) || IsRightSide(seen_behind))) continue;
      // [Simsarian96 §2.2 step I] a view boundary and its labels, one or several
      ViewBoundary boundary;
      for (const auto& [label, windows] : changes) {
        if (windows != 0) boundary.changes.push_back({label, windows});
      }
      if (boundary.changes.empty()) continue;
      boundary.start = i > 0                     ? Real(At(row[i - 1]))
                       : chord.before.piece >= 0 ? chord.before.place
                                                 : BoxExit(row.front(), direction.Reversed());
      boundary.end = i < row.size()           ? Real(At(row[i]))
                     : chord.after.piece >= 0 ? chord.after.place
                                              : BoxExit(row.back(), direction);
      boundaries->push_back(std::move(boundary));
    }
  }

  const FloorPlan& plan_;
  const WallRays& rays_;
};

}  // namespace

Result<std::vector<ViewBoundary>> FindViewBoundaries(const FloorPlan& plan, const WallRays& rays, int stride,
                                                     int64_t max_num, int num_threads, Progress& progress) {
  const int64_t num_items = (static_cast<int64_t>(plan.vertices.size()) + stride - 1) / stride;
  std::vector<std::vector<ViewBoundary>> found(num_items);
  const BoundaryFinder finder(plan, rays);
  std::atomic<int64_t> total{0};
  progress.Begin(stride > 1 ? "view boundaries, a sample" : "view boundaries", num_items, "vertices");
  ParallelFor(num_items, num_threads, [&](int64_t i) {
    if (progress.Cancelled() || total > max_num) return;
    finder.FindFrom(static_cast<int32_t>(i * stride), &found[i]);
    total += static_cast<int64_t>(found[i].size());
    progress.Advance();
  });
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "cancelled");
  if (total > max_num) return MakeError(ErrorCode::kFailed, "more than {} view boundaries", max_num);
  std::vector<ViewBoundary> boundaries;
  boundaries.reserve(total);
  for (std::vector<ViewBoundary>& part : found) {
    std::move(part.begin(), part.end(), std::back_inserter(boundaries));
    std::vector<ViewBoundary>().swap(part);
  }
  return boundaries;
}

}  // namespace cairn
