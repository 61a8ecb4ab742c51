#include "core/promise/view_distance.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "core/base/quantiles.h"

namespace cairn {
namespace {

// A leaf has so many views at most.
constexpr int32_t kMaxInLeaf = 8;

double SquaredInRadii(const Eigen::Quaterniond& rotation_a, const Eigen::Vector3d& center_a,
                      const Eigen::Quaterniond& rotation_b, const Eigen::Vector3d& center_b, double radius_m,
                      double radius_deg) {
  const double cosine = std::abs(rotation_a.dot(rotation_b));
  const double turn = DegFromRad(2 * std::acos(std::min(1.0, cosine))) / radius_deg;
  return (center_a - center_b).squaredNorm() / (radius_m * radius_m) + turn * turn;
}

std::vector<Pose> PosesOf(const Classes& classes) {
  std::vector<Pose> poses;
  for (const SurveyImage& image : classes.images) poses.push_back(image.cam_from_world);
  return poses;
}

// 1 where no image sees anything.
double MedianDepth(const Classes& classes) {
  std::unordered_map<ImageId, Eigen::Vector3d> centers;
  for (const SurveyImage& image : classes.images) centers[image.image_id] = image.cam_from_world.Center();
  std::vector<double> depths;
  for (const FeatureClass& feature_class : classes.classes) {
    for (const Observation& observation : feature_class.observations) {
      const auto center = centers.find(observation.image_id);
      if (center != centers.end()) depths.push_back((center->second - feature_class.position).norm());
    }
  }
  return depths.empty() ? 1 : UpperMedian(std::move(depths));
}

}  // namespace

bool IsInView(const Camera& camera, const Pose& cam_from_world, const Eigen::Vector3d& point) {
  const auto pixel = ImageFromCamera(camera, cam_from_world * point);
  return pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() < camera.width &&
         pixel->y() < camera.height;
}

double ViewDistanceSquared(const Pose& a, const Pose& b, double radius_m, double radius_deg) {
  return SquaredInRadii(a.rotation, a.Center(), b.rotation, b.Center(), radius_m, radius_deg);
}

ViewTree::ViewTree(const std::vector<Pose>& cam_from_world, double radius_m, double radius_deg)
    : radius_m_(radius_m), radius_deg_(radius_deg), order_(cam_from_world.size()) {
  for (const Pose& pose : cam_from_world) {
    rotations_.push_back(pose.rotation);
    centers_.push_back(pose.Center());
  }
  std::iota(order_.begin(), order_.end(), 0);
  if (!order_.empty()) Build(0, static_cast<int32_t>(order_.size()));
}

int32_t ViewTree::Build(int32_t first, int32_t last) {
  const auto at = static_cast<int32_t>(nodes_.size());
  Node node{.low = centers_[order_[first]], .high = centers_[order_[first]], .first = first, .last = last};
  for (int32_t i = first; i < last; ++i) {
    node.low = node.low.cwiseMin(centers_[order_[i]]);
    node.high = node.high.cwiseMax(centers_[order_[i]]);
  }
  nodes_.push_back(node);
  if (last - first <= kMaxInLeaf) return at;
  int axis = 0;
  (node.high - node.low).maxCoeff(&axis);
  const int32_t middle = first + (last - first) / 2;
  std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + last,
                   [&](int32_t a, int32_t b) {
                     return std::pair(centers_[a][axis], a) < std::pair(centers_[b][axis], b);
                   });
  Build(first, middle);
  const int32_t second_child = Build(middle, last);
  nodes_[at].second_child = second_child;
  return at;
}

double ViewTree::SquaredFrom(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& center,
                             size_t view) const {
  return SquaredInRadii(rotation, center, rotations_[view], centers_[view], radius_m_, radius_deg_);
}

std::vector<int32_t> ViewTree::Nearest(const Pose& cam_from_world, size_t num, int32_t except) const {
  std::vector<std::pair<double, int32_t>> nearest;  // ascending
  const Eigen::Vector3d center = cam_from_world.Center();
  const auto limit_m2 = [&] {
    return nearest.size() < num ? std::numeric_limits<double>::infinity()
                                : nearest.back().first * radius_m_ * radius_m_;
  };
  if (num > 0) {
    Walk(center, limit_m2, [&](int32_t view) {
      if (view == except) return;
      const std::pair candidate(SquaredFrom(cam_from_world.rotation, center, view), view);
      if (nearest.size() == num && !(candidate < nearest.back())) return;
      if (nearest.size() == num) nearest.pop_back();
      nearest.insert(std::upper_bound(nearest.begin(), nearest.end(), candidate), candidate);
    });
  }
  std::vector<int32_t> views;
  for (const auto& [squared, view] : nearest) views.push_back(view);
  return views;
}

ViewDistance::ViewDistance(const Classes& classes, const ViewOptions& options)
    : options_(options), depth_(MedianDepth(classes)), tree_(PosesOf(classes), radius(), radius_deg()) {}

double ViewDistance::operator()(size_t a, size_t b) const { return std::sqrt(Squared(a, b)); }

}  // namespace cairn
