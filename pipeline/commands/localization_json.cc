#include "pipeline/commands/localization_json.h"

#include <cmath>
#include <vector>

namespace cairn::pipeline {

nlohmann::ordered_json ErrorJson(const std::string& image, const Error& error) {
  return {
      {"image", image}, {"fix", false}, {"reason", ErrorCodeName(error.code)}, {"message", error.message}};
}

nlohmann::ordered_json PoseJson(const Pose& cam_from_world, const Matrix6d& covariance) {
  const Eigen::Quaterniond& q = cam_from_world.rotation;
  const Eigen::Vector3d& t = cam_from_world.translation;
  const Eigen::Vector3d center = cam_from_world.Center();
  return {{"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
          {"translation_m", {t.x(), t.y(), t.z()}},
          {"center_m", {center.x(), center.y(), center.z()}},
          {"covariance", std::vector<double>(covariance.data(), covariance.data() + 36)}};
}

nlohmann::ordered_json LocalizationJson(const Localization& found) {
  nlohmann::ordered_json json = {{"fix", found.has_fix()}};
  if (found.has_fix()) {
    json.update(PoseJson(found.cam_from_world, found.covariance));
    json["probability"] = found.probability;
    json["region"] = found.region;
  } else {
    json["reason"] = NoFixName(found.reason);
    json["message"] = found.message;
    if (found.probability > 0) json["probability"] = found.probability;
    for (const Pose& pose : found.possible_poses) {
      const Eigen::Vector3d center = pose.Center();
      json["possible_centers_m"].push_back({center.x(), center.y(), center.z()});
    }
    if (!found.possible_poses.empty()) json["possible_probabilities"] = found.possible_probabilities;
  }
  json["scope"] = ScopeName(found.scope);
  json["work_ms"] = std::round(100 * found.work_ms) / 100;
  json["num_features"] = found.num_features;
  json["num_matches"] = found.num_matches;
  json["num_inliers"] = found.num_inliers;
  json["candidates"] = found.candidates;
  if (!found.voted_regions.empty()) json["voted_regions"] = found.voted_regions;
  return json;
}

}  // namespace cairn::pipeline
