#include "pipeline/exchange/bags/bag_plan.h"

#include "core/colmap/cameras_text.h"
#include "pipeline/exchange/bags/camera_of_info.h"

namespace cairn::pipeline {
namespace {

// Finds the camera, if one is stated; what is assumed or missing is said in `warnings`.
Status ChooseCamera(const BagContents& contents, const BagOptions& options, BagPlan* plan,
                    std::vector<std::string>* warnings) {
  if (!options.camera.empty()) {
    CAIRN_ASSIGN_OR_RETURN(plan->camera, ParseCamera(options.camera));
    plan->camera->camera_id = 1;
    plan->camera_is_asked_for = true;
    return Ok();
  }
  constexpr char kRemedy[] = "the focal length is found when the map is made; --camera states it";
  const std::optional<TopicContents> topic = CameraInfoOf(contents, plan->images);
  if (!topic || !topic->camera_info) {
    warnings->push_back(fmt::format("{}: no camera_info that belongs to {}{}; {}", plan->path,
                                    plan->images.topic.name, topic ? " can be read: " + topic->problem : "",
                                    kRemedy));
    return Ok();
  }
  const std::string& name = topic->topic.name;
  const Result<Camera> camera = CameraOfInfo(*topic->camera_info, AreRectified(plan->images));
  if (!camera.ok()) {
    warnings->push_back(
        fmt::format("{}: {} is not used: {}; {}", plan->path, name, camera.error().message, kRemedy));
    return Ok();
  }
  if (topic->camera_info_changes)
    warnings->push_back(fmt::format("{}: {} changes; its first message is used", plan->path, name));
  plan->camera = *camera;
  return Ok();
}

// Odometry without the camera's place on the robot says nothing about images.
void ChooseChain(const BagContents& contents, const BagOptions& options, BagPlan* plan,
                 std::vector<std::string>* warnings) {
  if (!plan->odometry) return;
  const Result<FrameChain> chain =
      !plan->odometry->header
          ? Error{ErrorCode::kNoData, "no message of " + plan->odometry->topic.name +
                                          " can be read; the first: " + plan->odometry->problem}
      : options.base_from_camera
          ? FrameChain()
          : contents.frames.Chain(plan->odometry->child_frame_id, plan->images.header->frame_id);
  if (chain.ok()) {
    plan->chain = *chain;
    return;
  }
  warnings->push_back(fmt::format("{}: odometry is left out: {}{}", plan->path, chain.error().message,
                                  plan->odometry->header ? "; --camera-on-robot states it" : ""));
  plan->odometry.reset();
}

// An IMU without a stated place is of use, too.
void ChooseImuChain(const BagContents& contents, const BagOptions& options, BagPlan* plan) {
  if (!plan->imu || options.camera_from_imu) return;
  const Result<FrameChain> chain =
      contents.frames.Chain(plan->images.header->frame_id, plan->imu->header->frame_id);
  if (chain.ok()) plan->imu_chain = *chain;
}

}  // namespace

Result<BagPlan> PlanImport(const BagContents& contents, const std::string& path, const BagOptions& options,
                           std::vector<std::string>* warnings) {
  BagPlan plan = {.path = path, .frame_clocks = contents.frame_clocks};
  CAIRN_ASSIGN_OR_RETURN(plan.images, ChooseImages(contents, path, options.topic, warnings));
  CAIRN_ASSIGN_OR_RETURN(plan.odometry, ChooseOdometry(contents, path, options.odometry));
  CAIRN_RETURN_IF_ERROR(ChooseCamera(contents, options, &plan, warnings));
  ChooseChain(contents, options, &plan, warnings);
  CAIRN_ASSIGN_OR_RETURN(plan.imu, ChooseImu(contents, path, options.imu, warnings));
  ChooseImuChain(contents, options, &plan);
  return plan;
}

// The camera is only of use where it is that of the images.
Status CheckCameraSize(const cv::Size& size, BagPlan* plan, std::vector<std::string>* warnings) {
  if (!plan->camera || (plan->camera->width == size.width && plan->camera->height == size.height))
    return Ok();
  const std::string sizes = fmt::format("{} x {} px, but the images have {} x {}", plan->camera->width,
                                        plan->camera->height, size.width, size.height);
  if (plan->camera_is_asked_for)
    return MakeError(ErrorCode::kInvalidArgument, "--camera has {}; give that of the images", sizes);
  warnings->push_back(fmt::format("{}: camera_info is not used: it is of {}; --camera states the right one",
                                  plan->path, sizes));
  plan->camera.reset();
  return Ok();
}

}  // namespace cairn::pipeline
