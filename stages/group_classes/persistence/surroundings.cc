#include "stages/group_classes/persistence/surroundings.h"

#include <algorithm>
#include <map>
#include <unordered_map>

namespace cairn::group_classes {
namespace {

// REQUIRES: not empty
double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

Surroundings SurroundingsOf(const Classes& classes, const ImageSessions& images) {
  std::unordered_map<ImageId, Eigen::Vector3d> centers;
  for (const SurveyImage& image : classes.images) centers[image.image_id] = image.cam_from_world.Center();
  Surroundings surroundings;
  std::unordered_map<ImageId, double> num_seen;
  std::vector<double> distances;
  for (const FeatureClass& feature : classes.classes) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Observation& observation : feature.observations) {
      const Eigen::Vector3d to_image = centers.at(observation.image_id) - feature.position;
      if (&observation == &feature.observations.front()) distances.push_back(to_image.norm());
      sum += to_image.normalized();
      ++num_seen[observation.image_id];
    }
    surroundings.sides.push_back(sum.normalized());
  }
  if (!distances.empty()) surroundings.typical_distance = std::max(Median(distances), 1e-9);
  std::map<int, std::vector<double>> of_session;
  for (size_t i = 0; i < classes.images.size(); ++i)
    of_session[images.session[i]].push_back(num_seen[classes.images[i].image_id]);
  for (size_t i = 0; i < classes.images.size(); ++i) {
    const double median = Median(of_session[images.session[i]]);
    surroundings.sight_ratio.push_back(
        std::min(num_seen[classes.images[i].image_id] / std::max(median, 1.0), 1.0));
  }
  return surroundings;
}

}  // namespace cairn::group_classes
