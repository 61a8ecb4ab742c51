#include "stages/group_classes/persistence/surroundings.h"

#include <algorithm>
#include <map>
#include <unordered_map>
#include <utility>

#include "core/base/quantiles.h"

namespace cairn::group_classes {
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
  if (!distances.empty()) surroundings.typical_distance = std::max(UpperMedian(std::move(distances)), 1e-9);
  std::map<int, std::vector<double>> of_session;
  for (size_t i = 0; i < classes.images.size(); ++i)
    of_session[images.session[i]].push_back(num_seen[classes.images[i].image_id]);
  std::map<int, double> median_of_session;
  for (auto& [session, counts] : of_session)
    median_of_session[session] = std::max(UpperMedian(std::move(counts)), 1.0);
  for (size_t i = 0; i < classes.images.size(); ++i) {
    surroundings.sight_ratio.push_back(
        std::min(num_seen[classes.images[i].image_id] / median_of_session.at(images.session[i]), 1.0));
  }
  return surroundings;
}

}  // namespace cairn::group_classes
