#include "runtime/paths/reached_part.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>

#include "runtime/paths/plan_roadmap.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

// Nodes of a roadmap that are joined to node 0.
std::vector<Vec2> JoinedToFirst(const PlanRoadmap& roadmap) {
  std::vector<int> order{0}, rest(roadmap.num_nodes() - 1);
  std::iota(rest.begin(), rest.end(), 1);
  for (size_t i = 0; i < order.size(); ++i) {
    const auto first = std::stable_partition(rest.begin(), rest.end(),
                                             [&](int node) { return !roadmap.AreJoined(order[i], node); });
    order.insert(order.end(), first, rest.end());
    rest.erase(first, rest.end());
  }
  std::vector<Vec2> places;
  for (const int node : order) places.push_back(roadmap.place(node));
  return places;
}

// Points of a lattice that lie in parts of the free space, joined where the robot may go straight to a
// neighbour.
class FreeLattice {
 public:
  FreeLattice(const PlanSpace& space, double radius_m) : space_(space) {
    const FloorPlan& plan = space.views().plan;
    low_ = plan.Metres(plan.low);
    const Vec2 size = plan.Metres(plan.high) - low_;
    constexpr double kNumPoints = 40000;
    step_m_ = std::max(std::sqrt(size.x() * size.y() / kNumPoints), size.maxCoeff() / kNumPoints);
    num_columns_ = static_cast<int>(size.x() / step_m_) + 1;
    num_rows_ = static_cast<int>(size.y() / step_m_) + 1;
    part_.assign(static_cast<size_t>(num_columns_) * num_rows_, -1);
    for (int i = 0; i < static_cast<int>(part_.size()); ++i) {
      if (space.FaceAt(Place(i)) < 0 || !space.IsFree(Place(i), Place(i), radius_m)) continue;
      part_[i] = i;
      if (i % num_columns_ > 0) Join(i, i - 1, radius_m);
      if (i >= num_columns_) Join(i, i - num_columns_, radius_m);
    }
  }

  // Calls visit(a point, number of points) for each part.
  template <typename Visit>
  void ForEachPart(Visit&& visit) {
    std::map<int, int64_t> sizes;
    for (int i = 0; i < static_cast<int>(part_.size()); ++i) {
      if (part_[i] >= 0) ++sizes[Root(i)];
    }
    for (const auto& [root, size] : sizes) visit(Place(root), size);
  }
  double PointArea() const { return step_m_ * step_m_; }

 private:
  Vec2 Place(int i) const { return low_ + step_m_ * Vec2(i % num_columns_ + 0.5, i / num_columns_ + 0.5); }
  int Root(int i) {
    while (part_[i] != i) i = part_[i] = part_[part_[i]];
    return i;
  }
  void Join(int i, int k, double radius_m) {
    if (part_[k] < 0 || !space_.IsFree(Place(i), Place(k), radius_m)) return;
    const int a = Root(i), b = Root(k);
    part_[std::max(a, b)] = std::min(a, b);
  }

  const PlanSpace& space_;
  Vec2 low_;
  double step_m_ = 1;
  int num_columns_ = 1, num_rows_ = 1;
  std::vector<int> part_;  // -1: not free
};

}  // namespace

std::vector<int> ConnectedFloor(const PlanSpace& space) {
  std::vector<int> parts(space.views().num_faces(), -1);
  int num_parts = 0;
  std::vector<FaceIdx> stack;
  for (FaceIdx first = 0; first < space.views().num_faces(); ++first) {
    if (parts[first] >= 0) continue;
    parts[first] = num_parts;
    for (stack.push_back(first); !stack.empty();) {
      const FaceIdx face = stack.back();
      stack.pop_back();
      for (auto next = space.NeighboursBegin(face); next != space.NeighboursEnd(face); ++next) {
        if (parts[next->face] >= 0) continue;
        parts[next->face] = num_parts;
        stack.push_back(next->face);
      }
    }
    ++num_parts;
  }
  return parts;
}

ReachedPart::ReachedPart(const PlanSpace& space, double radius_m, const Vec2& from)
    : space_(space), radius_m_(radius_m) {
  if (radius_m > 0) {
    places_ = JoinedToFirst(PlanRoadmap(space, radius_m, {from}));
    return;
  }
  const std::vector<int> parts = ConnectedFloor(space);
  const FaceIdx face = space.FaceAt(from);
  for (const int part : parts) is_reached_face_.push_back(face >= 0 && part == parts[face]);
}

bool ReachedPart::Contains(const Vec2& place) const {
  const FaceIdx face = space_.FaceAt(place);
  if (face < 0 || !space_.IsFree(place, place, radius_m_)) return false;
  if (radius_m_ <= 0) return is_reached_face_[face];
  std::vector<std::pair<double, size_t>> nearest;
  for (size_t i = 0; i < places_.size(); ++i) nearest.emplace_back((places_[i] - place).squaredNorm(), i);
  std::sort(nearest.begin(), nearest.end());
  return std::any_of(nearest.begin(), nearest.end(), [&](const auto& entry) {
    return space_.IsFree(place, places_[entry.second], radius_m_);
  });
}

double ReachedPart::Area() const {
  double area = 0;
  if (radius_m_ <= 0) {
    for (FaceIdx face = 0; face < space_.views().num_faces(); ++face)
      area += is_reached_face_[face] ? space_.views().Area(face) : 0;
    return area;
  }
  FreeLattice lattice(space_, radius_m_);
  lattice.ForEachPart([&](const Vec2& place, int64_t num_points) {
    if (Contains(place)) area += static_cast<double>(num_points) * lattice.PointArea();
  });
  return area;
}

}  // namespace cairn
