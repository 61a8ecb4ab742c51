#include "ros/map_localizer.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "ros/gravity.h"
#include "ros/grey_pixels.h"
#include "ros/odometry.h"
#include "ros/plan_follower.h"
#include "ros/robot_pose.h"
#include "ros/start_finder.h"
#include "ros/steerer.h"
#include "ros/whereabouts.h"
#include "runtime/drive/sure_tracker.h"
#include "runtime/localize/measurement.h"
#include "runtime/robot_log/shared_log.h"

namespace cairn_ros {
namespace {

using namespace cairn;  // NOLINT: this file is the bridge

// Of a parameter.
Result<Pose> MountingOf(const char* name, const std::vector<double>& numbers) {
  if (numbers.empty()) return Pose();
  if (numbers.size() != 7)
    return MakeError(ErrorCode::kInvalidArgument,
                     "~{} has {} numbers, expected 7: x y z (metres), qx qy qz qw", name, numbers.size());
  const Eigen::Quaterniond q(numbers[6], numbers[3], numbers[4], numbers[5]);
  if (!(std::abs(q.norm() - 1) < 1e-3))
    return MakeError(ErrorCode::kInvalidArgument, "~{}: the quaternion's length is {}, expected 1", name,
                     q.norm());
  return Pose{q.normalized(), {numbers[0], numbers[1], numbers[2]}};
}

Result<std::shared_ptr<const Map>> OpenMap(const Parameters& parameters) {
  if (parameters.map.empty())
    return MakeError(ErrorCode::kInvalidArgument,
                     "~map is not set; give the path of a map: _map:=kitchen.cairn");
  if (parameters.memory_budget_mib <= 0)
    return MakeError(ErrorCode::kInvalidArgument, "~memory_budget_mib is {}; must be positive",
                     parameters.memory_budget_mib);
  MapOptions options = {.memory_budget_bytes = int64_t{parameters.memory_budget_mib} << 20};
  if (!parameters.public_key.empty()) {
    CAIRN_ASSIGN_OR_RETURN(options.public_key, ReadTrustedKeys(parameters.public_key));
  }
  return Map::Open(parameters.map, options);
}

Result<cv::Mat> GreyPixelsOf(const Image& image) {
  return GreyPixels({image.encoding, image.width, image.height, image.step, image.bytes, image.num_bytes});
}

}  // namespace

struct MapLocalizer::State {
  State(Parameters given, std::shared_ptr<const Map> opened, const Pose& mounting)
      : parameters(std::move(given)),
        map(std::move(opened)),
        robot_from_camera(mounting),
        localizer(map, WithBudget(parameters)),
        tracker(map, WithBudget(parameters)),
        odometry(mounting),
        starts(map, mounting, parameters.steer) {}

  Parameters parameters;
  std::shared_ptr<const Map> map;
  Pose robot_from_camera;
  Localizer localizer;
  RegionTracker tracker;
  Odometry odometry;  // of the images that the tracker sees
  StartFinder starts;
  std::shared_ptr<SharedLog> log;          // null: none
  std::optional<Steerer> steerer;          // with Parameters::steer
  std::optional<Whereabouts> whereabouts;  // with Parameters::where
  std::optional<Gravity> gravity;          // with Parameters::gravity
  std::optional<PlanFollower> plan;        // with Parameters::plan, where the map has one
  double place_probability = 0;            // of the last fix's place

  static LocalizerOptions WithBudget(const Parameters& parameters) {
    LocalizerOptions options;
    options.budget_ms = parameters.budget_ms;
    options.core_speed = parameters.core_speed;
    return options;
  }

  // What a map and parameters allow.  Errors: as Steerer::Make, Whereabouts::Make, PlanFollower::Make,
  // SharedLog::Open.
  Status Begin() {
    if (parameters.steer) {
      CAIRN_ASSIGN_OR_RETURN(steerer, Steerer::Make(map, parameters, robot_from_camera));
    }
    if (!(parameters.min_place_probability >= 0 && parameters.min_place_probability < 1))
      return MakeError(ErrorCode::kInvalidArgument,
                       "~min_place_probability is {}; expected 0 or more, below 1",
                       parameters.min_place_probability);
    if (parameters.min_place_probability > 0 && !parameters.where)
      return MakeError(
          ErrorCode::kInvalidArgument,
          "~min_place_probability is of the places that ~where finds; set that, or leave it out");
    CAIRN_RETURN_IF_ERROR(CheckBudget());
    if (parameters.gravity) {
      CAIRN_RETURN_IF_ERROR(BeginGravity());
    }
    if (parameters.where) {
      CAIRN_ASSIGN_OR_RETURN(whereabouts,
                             Whereabouts::Make(map, robot_from_camera, parameters.where_period_s));
    }
    if (parameters.plan) {
      CAIRN_RETURN_IF_ERROR(BeginPlan());
    }
    if (parameters.log.empty()) return Ok();
    CAIRN_ASSIGN_OR_RETURN(log, SharedLog::Open(parameters.log, *map, parameters.log_max_mb_per_day));
    return Ok();
  }

  Status BeginPlan() {
    if (!(parameters.min_plan_probability >= 0 && parameters.min_plan_probability < 1))
      return MakeError(ErrorCode::kInvalidArgument,
                       "~min_plan_probability is {}; expected 0 or more, below 1",
                       parameters.min_plan_probability);
    if (!(parameters.where_period_s >= 0) || !std::isfinite(parameters.where_period_s))
      return MakeError(ErrorCode::kInvalidArgument, "~where_period_s is {}; expected 0 or more",
                       parameters.where_period_s);
    CAIRN_ASSIGN_OR_RETURN(const Pose robot_from_laser,
                           MountingOf("laser_in_robot", parameters.laser_in_robot));
    if (!map->has_floor_plan()) return Ok();
    CAIRN_ASSIGN_OR_RETURN(plan, PlanFollower::Make(map, robot_from_camera, robot_from_laser,
                                                    parameters.laser_max_range_m, parameters.where_period_s));
    return Ok();
  }

  Status CheckBudget() const {
    LocalizerOptions options = WithBudget(parameters);
    CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&options)));
    if (parameters.budget_ms == 0 && parameters.core_speed != 1)
      return MakeError(ErrorCode::kInvalidArgument,
                       "~core_speed is of ~budget_ms; set that, or leave it out");
    if (parameters.budget_ms == 0 || !parameters.where) return Ok();
    return MakeError(
        ErrorCode::kInvalidArgument,
        "~budget_ms bounds the work of a fix, and what ~where finds takes more; leave one of them "
        "out");
  }

  Status BeginGravity() {
    if (parameters.camera_in_robot.empty())
      return MakeError(
          ErrorCode::kInvalidArgument,
          "~gravity is of the robot's IMU: set ~camera_in_robot, which says how the camera is mounted");
    if (!(parameters.gravity_sigma_deg > 0) || !std::isfinite(parameters.gravity_sigma_deg))
      return MakeError(ErrorCode::kInvalidArgument, "~gravity_sigma_deg is {}; expected more than 0",
                       parameters.gravity_sigma_deg);
    CAIRN_ASSIGN_OR_RETURN(const Pose robot_from_imu, MountingOf("imu_in_robot", parameters.imu_in_robot));
    gravity.emplace(robot_from_camera.rotation.conjugate() * robot_from_imu.rotation,
                    parameters.gravity_sigma_deg);
    return Ok();
  }

  Result<Camera> CameraFor(const cv::Mat& grey) const {
    if (parameters.camera_model.empty()) return map->CameraForSize(grey.cols, grey.rows);
    Camera camera;
    CAIRN_ASSIGN_OR_RETURN(camera.model, CameraModelFromName(parameters.camera_model));
    camera.width = grey.cols;
    camera.height = grey.rows;
    camera.params.assign(parameters.camera_params.begin(), parameters.camera_params.end());
    return camera;
  }

  // With what a log and a belief need of the image.
  Result<Localization> LocateByFeatures(const cv::Mat& grey, const Camera& camera, double stamp_s,
                                        std::optional<Places>* places,
                                        std::optional<PlanPlaces>* plan_places) {
    QueryFrame frame(localizer, grey, camera);
    if (const std::optional<SensedUp> up = UpAt(stamp_s)) frame.set_up(*up);
    const auto by_itself = [&]() -> Result<Localization> {
      CAIRN_ASSIGN_OR_RETURN(const Query* query, frame.WithAllFeatures());
      return localizer.LocalizeQuery(*query, std::nullopt);
    };
    CAIRN_ASSIGN_OR_RETURN(Localization found, parameters.follow ? tracker.TrackFrame(&frame) : by_itself());
    if (IsForPlan(stamp_s)) {
      // What a tracker expected would count twice; to look again may take more than is allowed.
      const bool is_followed = found.scope == Scope::kTrack;
      if (!is_followed) *plan_places = plan->SeeImage(found, stamp_s);
      if (is_followed && parameters.budget_ms == 0) {
        CAIRN_ASSIGN_OR_RETURN(const Localization alone, by_itself());
        *plan_places = plan->SeeImage(alone, stamp_s);
      }
    }
    if (whereabouts) {
      CAIRN_RETURN_IF_ERROR(Believe(&frame, stamp_s, &found, places));
    }
    if (log) log->Offer(&frame, found);
    return found;
  }

  bool IsForPlan(double stamp_s) const {
    return plan && IsMetric(map->head().frame) && plan->IsImageDue(stamp_s);
  }

  std::optional<SensedUp> UpAt(double stamp_s) const { return gravity ? gravity->At(stamp_s) : std::nullopt; }

  // What the frame says of places, and whether its fix, if it has one, is sure.
  Status Believe(QueryFrame* frame, double stamp_s, Localization* found, std::optional<Places>* places) {
    const double needed = parameters.min_place_probability;
    const bool is_followed = found->scope == Scope::kTrack;
    const bool is_awaited = needed > 0 && (place_probability < needed || !is_followed);
    if (is_awaited || whereabouts->IsDue(stamp_s)) {
      // What a tracker expected has been in the belief already: the image by itself counts.
      CAIRN_ASSIGN_OR_RETURN(const Query* query, frame->WithAllFeatures());
      Localization alone = *found;
      if (is_followed) {
        CAIRN_ASSIGN_OR_RETURN(alone, localizer.LocalizeQuery(*query, std::nullopt));
      }
      *places = whereabouts->See(*query, alone, stamp_s, frame->up());
      const auto probability_of = [&](const Localization& fix) {
        const bool is_known = fix.has_fix() && (*places)->error.empty();
        return is_known ? whereabouts->ProbabilityAround(fix.cam_from_world) : 0;
      };
      place_probability = probability_of(*found);
      if (needed > 0 && is_followed && place_probability < needed && probability_of(alone) >= needed) {
        tracker = RegionTracker(map, WithBudget(parameters));  // it followed a look-alike
        CAIRN_ASSIGN_OR_RETURN(*found, tracker.TrackFrame(frame));
        place_probability = probability_of(*found);
      }
    }
    if (!found->has_fix()) place_probability = 0;
    if (needed > 0) *found = PublishIfSure(std::move(*found), place_probability, needed);
    return Ok();
  }

  Result<Localization> Locate(const Image& image, double* library_ms, std::optional<Places>* places,
                              std::optional<PlanPlaces>* plan_places) {
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, GreyPixelsOf(image));
    CAIRN_ASSIGN_OR_RETURN(const Camera camera, CameraFor(grey));
    const std::optional<FloorMotion> moved = odometry.MoveTo(image.stamp_s);
    if (parameters.follow && moved && IsMetric(map->head().frame))
      CAIRN_RETURN_IF_ERROR(tracker.Move(moved->way_m, moved->turn_left_rad));
    const auto begin = std::chrono::steady_clock::now();
    const auto locate = [&]() -> Result<Localization> {
      if (log || whereabouts || IsForPlan(image.stamp_s))
        return LocateByFeatures(grey, camera, image.stamp_s, places, plan_places);
      const std::optional<SensedUp> up = UpAt(image.stamp_s);
      if (!parameters.follow) return localizer.Localize(grey, camera, std::nullopt, up);
      if (up) CAIRN_RETURN_IF_ERROR(tracker.SenseUp(*up));
      return tracker.Track(grey, camera);
    };
    Result<Localization> found = locate();
    *library_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    return found;
  }

  // Passes all images at which the robot has arrived; the command is that for the one after them.
  Status Steer(const Image& image, Steered* steered) {
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, GreyPixelsOf(image));
    CAIRN_ASSIGN_OR_RETURN(const Camera camera, CameraFor(grey));
    CAIRN_ASSIGN_OR_RETURN(const Features seen, steerer->See(grey));
    for (int32_t next = starts.Next(); next >= 0; next = starts.Next()) {
      CAIRN_ASSIGN_OR_RETURN(const ServoCommand command,
                             steerer->Step(next, starts.IsGoalNext(), seen, camera));
      steered->speed_m_s = command.speed_m_s;
      steered->turn_rad_s = command.turn_rad_s;
      steered->state = ServoStateName(command.state);
      steered->why = command.why;
      steered->num_matches = command.num_matches;
      if (command.state != ServoState::kArrived) return Ok();
      CAIRN_RETURN_IF_ERROR(starts.Report("arrived"));
      CAIRN_RETURN_IF_ERROR(starts.Look(grey, camera));
      steerer->Forget();
      CAIRN_ASSIGN_OR_RETURN(Starts known, starts.Found());
      steered->arrivals.push_back(std::move(known));
    }
    return Ok();
  }
};

MapLocalizer::MapLocalizer(std::unique_ptr<State> state) : state_(std::move(state)) {}
MapLocalizer::~MapLocalizer() = default;

std::unique_ptr<MapLocalizer> MapLocalizer::Open(const Parameters& parameters, int* code,
                                                 std::string* message) {
  const auto fail = [&](const Error& error) {
    *code = static_cast<int>(error.code);
    *message = error.message;
    return nullptr;
  };
  const Result<Pose> mounting = MountingOf("camera_in_robot", parameters.camera_in_robot);
  if (!mounting.ok()) return fail(mounting.error());
  const auto map = OpenMap(parameters);
  if (!map.ok()) return fail(map.error());
  auto state = std::make_unique<State>(parameters, *map, *mounting);
  if (const Status begun = state->Begin(); !begun.ok()) return fail(begun.error());
  return std::unique_ptr<MapLocalizer>(new MapLocalizer(std::move(state)));
}

Answer MapLocalizer::Locate(const Image& image) {
  Answer answer;
  const Result<Localization> found =
      state_->Locate(image, &answer.library_ms, &answer.places, &answer.plan_places);
  if (!found.ok()) {
    answer.is_error = true;
    answer.reason = ErrorCodeName(found.error().code);
    answer.message = found.error().message;
    return answer;
  }
  answer.has_fix = found->has_fix();
  answer.reason = NoFixName(found->reason);
  answer.message = found->message;
  answer.num_features = found->num_features;
  answer.num_inliers = found->num_inliers;
  answer.region = found->region;
  answer.scope = ScopeName(found->scope);
  answer.probability = found->probability;
  answer.work_ms = found->work_ms;
  if (!answer.has_fix) return answer;
  const RobotPose pose = RobotPoseOf(*found, state_->robot_from_camera);
  std::copy_n(pose.position.data(), 3, answer.position);
  std::copy_n(pose.orientation.coeffs().data(), 4, answer.orientation_xyzw);  // Eigen's order too
  for (int i = 0; i < 36; ++i) answer.covariance[i] = pose.covariance(i / 6, i % 6);
  return answer;
}

namespace {

// What is known after something was done.
Starts AnswerOf(const StartFinder& finder, const Status& done) {
  Result<Starts> found = finder.Found();
  Starts starts = found.ok() ? std::move(found).value() : Starts();
  if (!done.ok()) starts.error = done.error().message;
  if (!found.ok()) starts.error = found.error().message;
  return starts;
}

}  // namespace

Starts MapLocalizer::SetGoal(const std::string& image) {
  if (state_->steerer) state_->steerer->Forget();
  return AnswerOf(state_->starts, state_->starts.SetGoal(image));
}

Starts MapLocalizer::Report(const std::string& word) {
  if (state_->steerer) state_->steerer->Forget();
  return AnswerOf(state_->starts, state_->starts.Report(word));
}

bool MapLocalizer::IsLooking() const { return state_->starts.IsWaiting(); }

Starts MapLocalizer::Look(const Image& image) {
  const Result<cv::Mat> grey = GreyPixelsOf(image);
  if (!grey.ok()) return AnswerOf(state_->starts, grey.error());
  const Result<Camera> camera = state_->CameraFor(*grey);
  return AnswerOf(state_->starts,
                  state_->starts.Look(*grey, camera.ok() ? std::optional(*camera) : std::nullopt));
}

bool MapLocalizer::IsSteering() const {
  return state_->steerer && !state_->starts.IsWaiting() && state_->starts.Next() >= 0;
}

Steered MapLocalizer::Steer(const Image& image) {
  Steered steered;
  const Status done = state_->Steer(image, &steered);
  if (done.ok()) return steered;
  steered.error = done.error().message;
  steered.speed_m_s = steered.turn_rad_s = 0;
  steered.state = ServoStateName(ServoState::kLost);
  return steered;
}

bool MapLocalizer::AddOdometry(double stamp_s, double x_m, double y_m, double heading_rad) {
  const PlanarPose pose{{x_m, y_m}, heading_rad};
  return state_->odometry.Add(stamp_s, pose).ok() &&
         (!state_->whereabouts || state_->whereabouts->AddOdometry(stamp_s, pose).ok()) &&
         (!state_->plan || state_->plan->AddOdometry(stamp_s, pose).ok());
}

bool MapLocalizer::IsOnPlan() const { return state_->plan.has_value(); }

std::optional<PlanPlaces> MapLocalizer::Scan(const LaserScan& scan) {
  if (!state_->plan) return std::nullopt;
  return state_->plan->See(scan);
}

bool MapLocalizer::AddUp(double stamp_s, double x, double y, double z, bool is_acceleration) {
  constexpr double kAccelerationSigmaDeg = 6;
  return !state_->gravity ||
         state_->gravity->Add(stamp_s, {x, y, z}, is_acceleration ? kAccelerationSigmaDeg : 0).ok();
}

std::string MapLocalizer::map_name() const { return state_->map->head().name; }
int64_t MapLocalizer::num_landmarks() const { return state_->map->num_landmarks(); }
int64_t MapLocalizer::num_kept_bytes() const { return state_->map->num_kept_bytes(); }
int64_t MapLocalizer::num_logged() const { return state_->log ? state_->log->num_kept() : 0; }
std::string MapLocalizer::log_error() const {
  if (!state_->log) return "";
  const Status error = state_->log->error();
  return error.ok() ? "" : error.error().message;
}

}  // namespace cairn_ros
