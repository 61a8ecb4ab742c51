#include "ros/whereabouts.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "core/blocks/map_head.h"
#include "ros/survey_pose.h"

namespace cairn_ros {

using namespace cairn;  // NOLINT: this file is the bridge

namespace {

double TimeOr(double image_time_s) {
  if (image_time_s != 0) return image_time_s;
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

Result<Whereabouts> Whereabouts::Make(std::shared_ptr<const Map> map, const Pose& robot_from_camera,
                                      double period_s) {
  if (!(period_s >= 0) || !std::isfinite(period_s))
    return MakeError(ErrorCode::kInvalidArgument, "~where_period_s is {}; expected 0 or more", period_s);
  CAIRN_ASSIGN_OR_RETURN(PlaceBelief belief, PlaceBelief::Make(map));
  return Whereabouts(std::move(map), robot_from_camera, period_s, std::move(belief));
}

Status Whereabouts::AddOdometry(double time_s, const PlanarPose& odom_from_robot) {
  return odometry_.Add(time_s, odom_from_robot);
}

bool Whereabouts::IsDue(double image_time_s) const {
  // A recording that is played again begins earlier.
  return !last_image_s_ || std::abs(TimeOr(image_time_s) - *last_image_s_) >= period_s_;
}

Places Whereabouts::See(const Query& query, const Localization& found, double image_time_s,
                        const std::optional<SensedUp>& up) {
  const double time_s = TimeOr(image_time_s);
  const double seconds = time_s - std::exchange(last_image_s_, time_s).value_or(time_s);
  if (seconds < 0) {  // a recording begins again: nothing is known
    Result<PlaceBelief> anew = PlaceBelief::Make(map_);
    if (!anew.ok()) return {.error = anew.error().message};
    belief_ = std::move(anew).value();
  }
  Result<Places> places = Update(query, found, image_time_s, std::max(0.0, seconds), up);
  if (places.ok()) return std::move(places).value();
  return {.error = places.error().message};
}

Result<Places> Whereabouts::Update(const Query& query, const Localization& found, double image_time_s,
                                   double seconds, const std::optional<SensedUp>& up) {
  const std::optional<FloorMotion> move = odometry_.MoveTo(image_time_s);
  if (move && IsMetric(map_->head().frame))
    CAIRN_RETURN_IF_ERROR(belief_.Move(move->way_m, move->turn_left_rad));
  CAIRN_RETURN_IF_ERROR(belief_.Elapse(seconds));
  if (up) CAIRN_RETURN_IF_ERROR(belief_.SenseUp(up->direction, up->sigma_deg));
  CAIRN_RETURN_IF_ERROR(belief_.See(query, found));
  Places places{.elsewhere = belief_.elsewhere()};
  CAIRN_ASSIGN_OR_RETURN(const auto hypotheses, belief_.Hypotheses(static_cast<int>(map_->num_images())));
  for (const PlaceHypothesis& hypothesis : hypotheses) {
    CAIRN_ASSIGN_OR_RETURN(const SurveyPose pose, SurveyPoseOf(*map_, hypothesis.image, robot_from_camera_));
    places.places.push_back({pose, hypothesis.probability});
  }
  return places;
}

}  // namespace cairn_ros
