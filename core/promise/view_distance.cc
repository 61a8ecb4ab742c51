#include "core/promise/view_distance.h"

#include <cmath>
#include <unordered_map>
#include <utility>

#include "core/base/quantiles.h"
#include "core/geometry/pose.h"

namespace cairn {

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

double ViewDistance::Squared(size_t a, size_t b) const {
  const double radius = options_.same_view_ratio * depth_;
  const double cosine = std::abs(poses_[a].rotation.dot(poses_[b].rotation));
  const double turn = DegFromRad(2 * std::acos(std::min(1.0, cosine))) / options_.same_view_deg;
  return (centers_[a] - centers_[b]).squaredNorm() / (radius * radius) + turn * turn;
}

}  // namespace cairn
