#include "core/promise/view_distance.h"

#include <cmath>
#include <unordered_map>
#include <utility>

#include "core/base/quantiles.h"
#include "core/geometry/pose.h"

namespace cairn {
namespace {

double SquaredInRadii(const Eigen::Quaterniond& rotation_a, const Eigen::Vector3d& center_a,
                      const Eigen::Quaterniond& rotation_b, const Eigen::Vector3d& center_b, double radius_m,
                      double radius_deg) {
  const double cosine = std::abs(rotation_a.dot(rotation_b));
  const double turn = DegFromRad(2 * std::acos(std::min(1.0, cosine))) / radius_deg;
  return (center_a - center_b).squaredNorm() / (radius_m * radius_m) + turn * turn;
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

ViewDistance::ViewDistance(const Classes& classes, const ViewOptions& options) : options_(options) {
  std::unordered_map<ImageId, size_t> index;
  for (const SurveyImage& image : classes.images) {
    index[image.image_id] = poses_.size();
    poses_.push_back(image.cam_from_world);
    centers_.push_back(image.cam_from_world.Center());
  }
  std::vector<double> depths;
  for (const FeatureClass& feature_class : classes.classes) {
    for (const Observation& observation : feature_class.observations) {
      const auto image = index.find(observation.image_id);
      if (image != index.end()) depths.push_back((centers_[image->second] - feature_class.position).norm());
    }
  }
  if (!depths.empty()) depth_ = UpperMedian(std::move(depths));
}

double ViewDistance::operator()(size_t a, size_t b) const { return std::sqrt(Squared(a, b)); }

double ViewDistance::Squared(size_t a, size_t b) const { return Squared(poses_[a].rotation, centers_[a], b); }

double ViewDistance::Squared(const Pose& cam_from_world, size_t b) const {
  return Squared(cam_from_world.rotation, cam_from_world.Center(), b);
}

double ViewDistance::Squared(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& center,
                             size_t b) const {
  return SquaredInRadii(rotation, center, poses_[b].rotation, centers_[b], radius(), radius_deg());
}

}  // namespace cairn
