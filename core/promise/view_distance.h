#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/camera/camera.h"
#include "core/geometry/pose.h"
#include "core/world/feature_class.h"

namespace cairn {

// How far a robot's image is from the survey's images, where the survey was as dense as it needs to be: two
// images are one view when
//   (distance / (same_view_ratio depth))^2 + (rotation / same_view_deg)^2 < 1,
// depth = median distance of what survey images see.
struct ViewOptions {
  double same_view_ratio = 0.1;  // REQUIRES: > 0
  double same_view_deg = 15;     // REQUIRES: > 0
};

// Whether a point (world frame) lies in front of a camera and projects into its image.
bool IsInView(const Camera& camera, const Pose& cam_from_world, const Eigen::Vector3d& point);

// How far apart two views are, in radii of a view, squared: (distance / radius)^2 + (rotation /
// radius_deg)^2.
double ViewDistanceSquared(const Pose& a, const Pose& b, double radius_m, double radius_deg);

// Views of cameras, to find those near a pose among many: a k-d tree of their places, as what turns do to a
// distance only adds to it.  Const and safe from any thread.
class ViewTree {
 public:
  // Views are positions in `cam_from_world`.  Metres, or the map's units; degrees.  O(n log n).
  ViewTree(const std::vector<Pose>& cam_from_world, double radius_m, double radius_deg);

  size_t size() const { return centers_.size(); }

  // Calls visit(view, squared) for the views at a ViewDistanceSquared below `limit` from view `a`, in no
  // order.
  template <typename Visit>
  void ForNear(size_t a, double limit, const Visit& visit) const {
    const double limit_m2 = limit * radius_m_ * radius_m_;
    Walk(
        centers_[a], [&] { return limit_m2; },
        [&](int32_t view) {
          const double squared = Squared(a, view);
          if (squared < limit) visit(view, squared);
        });
  }

  // Calls visit(view) for the views of cameras less than `distance_m` from a place, in no order.
  template <typename Visit>
  void ForPlacesNear(const Eigen::Vector3d& place, double distance_m, const Visit& visit) const {
    Walk(
        place, [&] { return distance_m * distance_m; },
        [&](int32_t view) {
          if ((place - centers_[view]).norm() < distance_m) visit(view);
        });
  }

  // ViewDistanceSquared of two views, of a pose and a view, and of a pose whose camera stands at `center`.
  double Squared(size_t a, size_t b) const { return SquaredFrom(rotations_[a], centers_[a], b); }
  double Squared(const Pose& cam_from_world, size_t b) const {
    return SquaredFrom(cam_from_world.rotation, cam_from_world.Center(), b);
  }
  double SquaredFrom(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& center, size_t view) const;
  // Of two views; infinity where places alone make it more than `most`.
  double SquaredUpTo(double most, size_t a, size_t b) const {
    if ((centers_[a] - centers_[b]).squaredNorm() > most * radius_m_ * radius_m_)
      return std::numeric_limits<double>::infinity();
    return Squared(a, b);
  }

  // The views nearest to a pose's by ViewDistanceSquared, the nearest first, of equals the smaller one; all
  // of them where there are not so many.  `except` is none of them.
  std::vector<int32_t> Nearest(const Pose& cam_from_world, size_t num, int32_t except = -1) const;

 private:
  // The views order_[first, last).
  struct Node {
    Eigen::Vector3d low, high;  // of their places
    int32_t first = 0, last = 0;
    int32_t second_child = 0;  // position; the first child follows its parent; 0: a leaf
  };

  int32_t Build(int32_t first, int32_t last);
  // Square of the distance of a node's box, metres.
  double BoxSquared(const Node& node, const Eigen::Vector3d& place) const {
    return (node.low - place).cwiseMax(place - node.high).cwiseMax(0).squaredNorm();
  }

  // Calls visit(view) for all views in boxes that are not farther than the square root of `limit_m2()`, which
  // may fall meanwhile; near boxes first.
  template <typename Limit, typename Visit>
  void Walk(const Eigen::Vector3d& place, const Limit& limit_m2, const Visit& visit) const {
    if (!nodes_.empty()) WalkFrom(0, place, limit_m2, visit);
  }
  template <typename Limit, typename Visit>
  void WalkFrom(int32_t at, const Eigen::Vector3d& place, const Limit& limit_m2, const Visit& visit) const {
    const Node& node = nodes_[at];
    if (BoxSquared(node, place) > limit_m2() * (1 + kRounding)) return;
    if (node.second_child == 0) {
      for (int32_t i = node.first; i < node.last; ++i) visit(order_[i]);
      return;
    }
    int32_t near = at + 1, far = node.second_child;
    if (BoxSquared(nodes_[far], place) < BoxSquared(nodes_[near], place)) std::swap(near, far);
    WalkFrom(near, place, limit_m2, visit);
    WalkFrom(far, place, limit_m2, visit);
  }

  static constexpr double kRounding = 1e-9;

  double radius_m_, radius_deg_;
  std::vector<Eigen::Quaterniond> rotations_;  // per view
  std::vector<Eigen::Vector3d> centers_;       // per view
  std::vector<int32_t> order_;                 // of views
  std::vector<Node> nodes_;                    // the root is the first
};

// The distance of two survey images in radii of a view.
class ViewDistance {
 public:
  ViewDistance(const Classes& classes, const ViewOptions& options);

  // `a`, `b`: positions in Classes::images.
  double operator()(size_t a, size_t b) const;
  double Squared(size_t a, size_t b) const { return tree_.Squared(a, b); }
  // The survey's images.
  const ViewTree& tree() const { return tree_; }
  // Metres, or the map's units.
  double depth() const { return depth_; }
  // Of a view: metres, or the map's units.
  double radius() const { return options_.same_view_ratio * depth_; }
  double radius_deg() const { return options_.same_view_deg; }

 private:
  ViewOptions options_;
  double depth_;
  ViewTree tree_;
};

}  // namespace cairn
