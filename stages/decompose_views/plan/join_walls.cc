#include "stages/decompose_views/plan/join_walls.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>

namespace cairn::decompose_views {
namespace {

using Vec2 = Eigen::Vector2d;

// Pieces in a row: vertices[i] to vertices[i + 1] is pieces[i], reversed where it is marked.
struct Chain {
  std::deque<int32_t> vertices;
  std::deque<int32_t> pieces;
  int32_t wall = 0;
};

class Joiner {
 public:
  Joiner(const std::vector<GridPoint>& vertices, const std::vector<PlanPiece>& pieces, double tolerance,
         bool directed)
      : vertices_(vertices), pieces_(pieces), tolerance_(tolerance), directed_(directed) {
    at_vertex_.resize(vertices.size());
    for (size_t i = 0; i < pieces.size(); ++i) {
      at_vertex_[pieces[i].start].push_back(static_cast<int32_t>(i));
      at_vertex_[pieces[i].end].push_back(static_cast<int32_t>(i));
    }
  }

  JoinedWalls Run() {
    JoinedWalls result;
    std::vector<int32_t> order(pieces_.size());
    for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int32_t>(i);
    // Walls of one origin are joined first, then with others.
    std::stable_sort(order.begin(), order.end(),
                     [&](int32_t a, int32_t b) { return pieces_[a].wall < pieces_[b].wall; });
    used_.assign(pieces_.size(), false);
    for (const int32_t piece : order) {
      if (used_[piece]) continue;
      used_[piece] = true;
      Chain chain{{pieces_[piece].start, pieces_[piece].end}, {piece}, pieces_[piece].wall};
      while (Extend(&chain, /*at_end=*/true)) {
      }
      while (Extend(&chain, /*at_end=*/false)) {
      }
      Emit(chain, &result);
    }
    return result;
  }

 private:
  Vec2 Real(int32_t vertex) const {
    return {static_cast<double>(vertices_[vertex].x), static_cast<double>(vertices_[vertex].y)};
  }

  // Adds the piece that continues the chain best, if one does.
  bool Extend(Chain* chain, bool at_end) {
    const int32_t tip = at_end ? chain->vertices.back() : chain->vertices.front();
    const int32_t last = at_end ? chain->pieces.back() : chain->pieces.front();
    const int32_t before = pieces_[last].start == tip ? pieces_[last].end : pieces_[last].start;
    const Vec2 along = (Real(tip) - Real(before)).normalized();
    int32_t best = -1;
    double best_cosine = kMinCosine;
    for (const int32_t piece : at_vertex_[tip]) {
      if (used_[piece]) continue;
      const bool from_tip = pieces_[piece].start == tip;
      if (directed_ && from_tip != at_end) continue;
      const int32_t next = from_tip ? pieces_[piece].end : pieces_[piece].start;
      const double cosine = along.dot((Real(next) - Real(tip)).normalized());
      if (cosine <= best_cosine || !StaysStraight(*chain, next, at_end)) continue;
      best = piece;
      best_cosine = cosine;
    }
    if (best < 0) return false;
    used_[best] = true;
    const int32_t next = pieces_[best].start == tip ? pieces_[best].end : pieces_[best].start;
    if (at_end) {
      chain->vertices.push_back(next);
      chain->pieces.push_back(best);
    } else {
      chain->vertices.push_front(next);
      chain->pieces.push_front(best);
    }
    chain->wall = std::min(chain->wall, pieces_[best].wall);
    return true;
  }

  bool StaysStraight(const Chain& chain, int32_t next, bool at_end) const {
    const Vec2 start = Real(next), end = Real(at_end ? chain.vertices.front() : chain.vertices.back());
    const Vec2 along = end - start;
    const double length = along.norm();
    if (length < 1) return false;
    for (const int32_t vertex : chain.vertices) {
      const Vec2 offset = Real(vertex) - start;
      if (std::abs(along.x() * offset.y() - along.y() * offset.x()) > (tolerance_ + 0.75) * length)
        return false;
    }
    return true;
  }

  // The number of a chain's wall: that of the chains of the same origin that lie on one line with it, or the
  // next.
  int32_t WallOf(const Chain& chain, JoinedWalls* result) {
    const std::vector<int32_t> vertices(chain.vertices.begin(), chain.vertices.end());
    for (auto wall = static_cast<int32_t>(result->origins.size()) - 1;
         wall >= 0 && result->origins[wall] == chain.wall; --wall) {
      std::vector<int32_t> both = of_walls_[wall];
      both.insert(both.end(), vertices.begin(), vertices.end());
      if (!LieOnALine(both)) continue;
      of_walls_[wall] = std::move(both);
      return wall;
    }
    result->origins.push_back(chain.wall);
    of_walls_.push_back(vertices);
    return static_cast<int32_t>(result->origins.size()) - 1;
  }

  // Whether vertices lie within the tolerance of the line between the two that are farthest apart along it.
  bool LieOnALine(const std::vector<int32_t>& vertices) const {
    const Vec2 first = Real(vertices.front());
    Vec2 along = Vec2::Zero();
    for (const int32_t vertex : vertices) {
      const Vec2 offset = Real(vertex) - first;
      if (offset.squaredNorm() > along.squaredNorm()) along = offset;
    }
    const auto place = [&](int32_t a, int32_t b) { return Real(a).dot(along) < Real(b).dot(along); };
    const auto [low, high] = std::minmax_element(vertices.begin(), vertices.end(), place);
    const Vec2 start = Real(*low), line = Real(*high) - start;
    return std::all_of(vertices.begin(), vertices.end(), [&](int32_t vertex) {
      const Vec2 offset = Real(vertex) - start;
      return std::abs(line.x() * offset.y() - line.y() * offset.x()) <= (tolerance_ + 0.75) * line.norm();
    });
  }

  void Emit(const Chain& chain, JoinedWalls* result) {
    const int32_t wall = WallOf(chain, result);
    int32_t from = chain.vertices.front();
    for (size_t i = 1; i < chain.vertices.size(); ++i) {
      const int32_t vertex = chain.vertices[i];
      if (i + 1 < chain.vertices.size() && at_vertex_[vertex].size() == 2) {
        result->removed_vertices.push_back({vertex, wall});
        continue;
      }
      result->pieces.push_back({from, vertex, wall});
      from = vertex;
    }
  }

  // Pieces that turn by more than 10 degrees do not continue each other, however short they are.
  static constexpr double kMinCosine = 0.985;

  const std::vector<GridPoint>& vertices_;
  const std::vector<PlanPiece>& pieces_;
  const double tolerance_;
  const bool directed_;
  std::vector<std::vector<int32_t>> at_vertex_;
  std::vector<bool> used_;
  std::vector<std::vector<int32_t>> of_walls_;  // vertices, by the result's walls
};

}  // namespace

JoinedWalls JoinWalls(const std::vector<GridPoint>& vertices, const std::vector<PlanPiece>& pieces,
                      double tolerance, bool directed) {
  return Joiner(vertices, pieces, tolerance, directed).Run();
}

}  // namespace cairn::decompose_views
