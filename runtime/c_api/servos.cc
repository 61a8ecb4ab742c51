// The C API's servo: it steers a robot to where a survey image was taken (runtime/c_api/cairn.h).
#include <memory>
#include <optional>
#include <utility>

#include "runtime/c_api/cairn.h"
#include "runtime/c_api/calls.h"
#include "runtime/c_api/named_options.h"
#include "runtime/c_api/structs.h"
#include "runtime/drive/image_servo.h"

namespace cairn {
namespace {

static_assert(CAIRN_SERVO_LOST == static_cast<int>(ServoState::kLost));

struct OpenServo : OfOneThread {
  static constexpr const char* kName = "servo";
  static constexpr const char* kOnePer = "robot";
  std::shared_ptr<const Map> map;
  int32_t image = 0;
  ImageServoOptions options;
  std::optional<ImageServo> servo;

  // After an error it is as before.
  Status Begin(const ImageServoOptions& given) {
    CAIRN_ASSIGN_OR_RETURN(servo, ImageServo::ToImage(map, image, given));
    options = given;
    return Ok();
  }
};

Handles<cairn_servo, OpenServo, HandleKind::kServo>& OpenServos() {
  static auto* servos = new Handles<cairn_servo, OpenServo, HandleKind::kServo>;
  return *servos;
}

cairn_servo_command CommandFrom(const ServoCommand& given, double step_s) {
  cairn_servo_command command = CAIRN_SERVO_COMMAND_INIT;
  command.speed_m_s = given.speed_m_s;
  command.turn_rad_s = given.turn_rad_s;
  command.step_s = step_s;
  command.state = static_cast<int32_t>(given.state);
  command.num_matches = given.num_matches;
  command.num_inliers = given.epipoles ? given.epipoles->num_inliers : 0;
  CopyText(given.why, command.why);
  return command;
}

}  // namespace
}  // namespace cairn

using namespace cairn;  // NOLINT: what follows is C, in the global namespace

const char* cairn_servo_state_name(int32_t state) {
  return state < CAIRN_SERVO_TURNING || state > CAIRN_SERVO_LOST
             ? "unknown"
             : ServoStateName(static_cast<ServoState>(state));
}

int32_t cairn_servo_create(const cairn_map* map, int32_t image, cairn_servo** servo) {
  if (servo != nullptr) *servo = nullptr;
  return Call("cairn_servo_create", [&]() -> Status {
    if (servo == nullptr) return Misuse("servo is NULL: there is no place for the handle");
    auto created = std::make_shared<OpenServo>();
    CAIRN_ASSIGN_OR_RETURN(created->map, FindMap(map));
    created->image = image;
    CAIRN_RETURN_IF_ERROR(created->Begin({}));
    *servo = OpenServos().Add(std::move(created));
    return Ok();
  });
}

int32_t cairn_servo_set_option(cairn_servo* servo, const char* name, const char* value) {
  return Call("cairn_servo_set_option", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenServo>::Begin(OpenServos(), servo));
    ImageServoOptions options = used->options;
    CAIRN_RETURN_IF_ERROR(SetOptionByName(DescribeOptions(&options), name, value, kServoOptionsHelp));
    return used->Begin(options);
  });
}

int32_t cairn_servo_step(cairn_servo* servo, const cairn_image* image, const cairn_camera* camera,
                         cairn_servo_command* command) {
  return Call("cairn_servo_step", [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(CheckStruct(command, "command"));
    Return(cairn_servo_command CAIRN_SERVO_COMMAND_INIT, command);  // after an error the robot stands
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenServo>::Begin(OpenServos(), servo));
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, PixelsOf(image));
    CAIRN_ASSIGN_OR_RETURN(const Camera chosen, CameraOf(camera, *used->map, grey));
    CAIRN_ASSIGN_OR_RETURN(const ServoCommand given, used->servo->Step(grey, chosen));
    Return(CommandFrom(given, used->options.servo.step_s), command);
    return Ok();
  });
}

int32_t cairn_servo_blocked(cairn_servo* servo) {
  return Call("cairn_servo_blocked", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenServo>::Begin(OpenServos(), servo));
    used->servo->Blocked();
    return Ok();
  });
}

int32_t cairn_servo_destroy(cairn_servo* servo) {
  return Call("cairn_servo_destroy", [&] { return DestroyObject(OpenServos(), servo); });
}
