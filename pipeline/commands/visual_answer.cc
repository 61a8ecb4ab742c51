#include "pipeline/commands/visual_answer.h"

namespace cairn::pipeline {

nlohmann::ordered_json VisualJson(const VisualPose& pose) {
  nlohmann::ordered_json json = {{"fix", pose.flag == VisualFlag::kNone}};
  if (pose.flag != VisualFlag::kNone) {
    json["reason"] = VisualFlagName(pose.flag);
    json["message"] = pose.message;
  }
  json["floor_m"] = {pose.position.x(), pose.position.y()};
  json["heading_deg"] = pose.heading_deg;
  json["higher_m"] = pose.higher_m;
  json["covariance"] = std::vector<double>(pose.covariance.data(), pose.covariance.data() + 9);
  json["mean_m"] = {pose.mean.x(), pose.mean.y()};
  json["entropy"] = pose.entropy;
  json["elsewhere"] = pose.elsewhere;
  json["num_matches"] = pose.num_matches;
  json["num_agreeing"] = pose.num_agreeing;
  return json;
}

nlohmann::ordered_json TrackedJson(const TrackedVisualPose& found) {
  nlohmann::ordered_json json = VisualJson(found.pose);
  json["scope"] = ScopeName(found.scope);
  json["regions"] = found.regions;
  return json;
}

nlohmann::ordered_json DisagreementJson(const Disagreement& disagreement) {
  return {{"distance_m", disagreement.distance_m},
          {"angle_deg", disagreement.angle_deg},
          {"mahalanobis", disagreement.mahalanobis}};
}

}  // namespace cairn::pipeline
