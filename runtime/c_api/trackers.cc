// The C API's trackers (runtime/c_api/cairn.h): frame after frame, in space and on the floor.
#include <memory>
#include <optional>
#include <utility>

#include "runtime/c_api/cairn.h"
#include "runtime/c_api/calls.h"
#include "runtime/c_api/logs.h"
#include "runtime/c_api/named_options.h"
#include "runtime/c_api/structs.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"

namespace cairn {
namespace {

struct OpenTracker : OfOneThread {
  static constexpr const char* kName = "tracker";
  static constexpr const char* kOnePer = "camera";
  std::shared_ptr<const Map> map;
  SpaceTrackerOptions options;
  std::optional<SureTracker> tracker;
  std::shared_ptr<SharedLog> log;  // where it has one

  // After an error it is as before.
  Status Begin(const SpaceTrackerOptions& given) {
    CAIRN_ASSIGN_OR_RETURN(tracker, SureTracker::Make(map, given.localizer, given.tracker, given.sure));
    options = given;
    return Ok();
  }
};

struct OpenVisualTracker : OfOneThread {
  static constexpr const char* kName = "visual tracker";
  static constexpr const char* kOnePer = "camera";
  std::shared_ptr<const Map> map;
  FloorTrackerOptions options;
  std::optional<Localizer> localizer;  // for the features of images
  std::optional<VisualTracker> tracker;

  // After an error it is as before.
  Status Begin(const FloorTrackerOptions& given) {
    CAIRN_ASSIGN_OR_RETURN(tracker,
                           VisualTracker::Make(map, given.map, given.tracker, given.filter, given.estimate));
    options = given;
    localizer.emplace(map, options.features);
    return Ok();
  }
};

Handles<cairn_tracker, OpenTracker, HandleKind::kTracker>& OpenTrackers() {
  static auto* trackers = new Handles<cairn_tracker, OpenTracker, HandleKind::kTracker>;
  return *trackers;
}

Handles<cairn_visual_tracker, OpenVisualTracker, HandleKind::kVisualTracker>& OpenVisualTrackers() {
  static auto* trackers = new Handles<cairn_visual_tracker, OpenVisualTracker, HandleKind::kVisualTracker>;
  return *trackers;
}

template <typename Handle, typename Object, HandleKind kKind>
Status CreateTracker(const cairn_map* map, Handles<Handle, Object, kKind>& handles, Handle** tracker) {
  if (tracker == nullptr) return Misuse("tracker is NULL: there is no place for the handle");
  auto created = std::make_shared<Object>();
  CAIRN_ASSIGN_OR_RETURN(created->map, FindMap(map));
  CAIRN_RETURN_IF_ERROR(created->Begin({}));
  *tracker = handles.Add(std::move(created));
  return Ok();
}

template <typename Handle, typename Object, HandleKind kKind>
Status SetTrackerOption(const Handles<Handle, Object, kKind>& handles, const Handle* tracker,
                        const char* name, const char* value) {
  CAIRN_ASSIGN_OR_RETURN(const auto used, Use<Object>::Begin(handles, tracker));
  auto options = used->options;
  CAIRN_RETURN_IF_ERROR(SetOptionByName(DescribeOptions(&options), name, value));
  return used->Begin(options);
}

}  // namespace
}  // namespace cairn

using namespace cairn;  // NOLINT: what follows is C, in the global namespace

int32_t cairn_tracker_create(const cairn_map* map, cairn_tracker** tracker) {
  if (tracker != nullptr) *tracker = nullptr;
  return Call("cairn_tracker_create", [&] { return CreateTracker(map, OpenTrackers(), tracker); });
}

int32_t cairn_tracker_set_option(cairn_tracker* tracker, const char* name, const char* value) {
  return Call("cairn_tracker_set_option",
              [&] { return SetTrackerOption(OpenTrackers(), tracker, name, value); });
}

int32_t cairn_tracker_track(cairn_tracker* tracker, const cairn_image* image, const cairn_camera* camera,
                            cairn_fix* fix) {
  return Call("cairn_tracker_track", [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(CheckFix(fix));
    Return(FixFrom({}), fix);  // after an error the caller must not find the previous fix
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenTracker>::Begin(OpenTrackers(), tracker));
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, PixelsOf(image));
    CAIRN_ASSIGN_OR_RETURN(const Camera chosen, CameraOf(camera, *used->map, grey));
    QueryFrame frame(Localizer(used->map, used->options.localizer), grey, chosen);
    CAIRN_ASSIGN_OR_RETURN(const Localization found, used->tracker->TrackFrame(&frame));
    Return(FixFrom(found), fix);
    if (used->log) used->log->Offer(&frame, found);
    return Ok();
  });
}

int32_t cairn_tracker_move(cairn_tracker* tracker, double ahead_m, double left_m, double turn_left_rad) {
  return Call("cairn_tracker_move", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenTracker>::Begin(OpenTrackers(), tracker));
    return used->tracker->Move({ahead_m, left_m}, turn_left_rad);
  });
}

int32_t cairn_tracker_move_camera(cairn_tracker* tracker, const cairn_uncertain_pose* next_from_last) {
  return Call("cairn_tracker_move_camera", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenTracker>::Begin(OpenTrackers(), tracker));
    CAIRN_ASSIGN_OR_RETURN(const UncertainPose motion, UncertainPoseOf(next_from_last));
    return used->tracker->Move(motion);
  });
}

int32_t cairn_tracker_elapse(cairn_tracker* tracker, double seconds) {
  return Call("cairn_tracker_elapse", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenTracker>::Begin(OpenTrackers(), tracker));
    return used->tracker->Elapse(seconds);
  });
}

int32_t cairn_tracker_sense_up(cairn_tracker* tracker, double right, double down, double ahead,
                               double sigma_deg) {
  return Call("cairn_tracker_sense_up", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenTracker>::Begin(OpenTrackers(), tracker));
    return used->tracker->SenseUp({right, down, ahead}, sigma_deg);
  });
}

int32_t cairn_tracker_predict(cairn_tracker* tracker, int32_t* is_expected, cairn_prior* prior) {
  if (is_expected != nullptr) *is_expected = 0;
  return Call("cairn_tracker_predict", [&]() -> Status {
    if (is_expected == nullptr) return Misuse("is_expected is NULL");
    CAIRN_RETURN_IF_ERROR(CheckStruct(prior, "prior"));
    Return(cairn_prior CAIRN_PRIOR_INIT, prior);
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenTracker>::Begin(OpenTrackers(), tracker));
    const std::optional<PosePrior> expected = used->tracker->Prediction();
    if (!expected) return Ok();
    Return(PriorFrom(*expected), prior);
    *is_expected = 1;
    return Ok();
  });
}

int32_t cairn_tracker_believe(cairn_tracker* tracker, int32_t* is_known, cairn_uncertain_pose* pose) {
  if (is_known != nullptr) *is_known = 0;
  return Call("cairn_tracker_believe", [&]() -> Status {
    if (is_known == nullptr) return Misuse("is_known is NULL");
    CAIRN_RETURN_IF_ERROR(CheckStruct(pose, "pose"));
    Return(cairn_uncertain_pose CAIRN_UNCERTAIN_POSE_INIT, pose);
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenTracker>::Begin(OpenTrackers(), tracker));
    const std::optional<UncertainPose> believed = used->tracker->Believed();
    if (!believed) return Ok();
    Return(UncertainPoseFrom(*believed), pose);
    *is_known = 1;
    return Ok();
  });
}

int32_t cairn_tracker_set_log(cairn_tracker* tracker, const cairn_log* log) {
  return Call("cairn_tracker_set_log", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenTracker>::Begin(OpenTrackers(), tracker));
    CAIRN_ASSIGN_OR_RETURN(used->log, LogFor(log, *used->map));
    return Ok();
  });
}

int32_t cairn_tracker_destroy(cairn_tracker* tracker) {
  return Call("cairn_tracker_destroy", [&] { return DestroyObject(OpenTrackers(), tracker); });
}

int32_t cairn_visual_tracker_create(const cairn_map* map, cairn_visual_tracker** tracker) {
  if (tracker != nullptr) *tracker = nullptr;
  return Call("cairn_visual_tracker_create",
              [&] { return CreateTracker(map, OpenVisualTrackers(), tracker); });
}

int32_t cairn_visual_tracker_set_option(cairn_visual_tracker* tracker, const char* name, const char* value) {
  return Call("cairn_visual_tracker_set_option",
              [&] { return SetTrackerOption(OpenVisualTrackers(), tracker, name, value); });
}

int32_t cairn_visual_tracker_move(cairn_visual_tracker* tracker, double ahead_m, double left_m,
                                  double turn_left_rad) {
  return Call("cairn_visual_tracker_move", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenVisualTracker>::Begin(OpenVisualTrackers(), tracker));
    return used->tracker->Move({ahead_m, left_m}, turn_left_rad);
  });
}

int32_t cairn_visual_tracker_track(cairn_visual_tracker* tracker, const cairn_image* image,
                                   const cairn_camera* camera, cairn_floor_fix* fix) {
  return Call("cairn_visual_tracker_track", [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(CheckFix(fix));
    Return(cairn_floor_fix CAIRN_FLOOR_FIX_INIT, fix);
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenVisualTracker>::Begin(OpenVisualTrackers(), tracker));
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, PixelsOf(image));
    CAIRN_ASSIGN_OR_RETURN(const Camera chosen, CameraOf(camera, *used->map, grey));
    CAIRN_ASSIGN_OR_RETURN(const Query query, used->localizer->QueryFromImage(grey, chosen));
    CAIRN_ASSIGN_OR_RETURN(const TrackedVisualPose found, used->tracker->See(query));
    Return(FloorFixFrom(found.pose, found.scope), fix);
    return Ok();
  });
}

int32_t cairn_visual_tracker_destroy(cairn_visual_tracker* tracker) {
  return Call("cairn_visual_tracker_destroy", [&] { return DestroyObject(OpenVisualTrackers(), tracker); });
}
