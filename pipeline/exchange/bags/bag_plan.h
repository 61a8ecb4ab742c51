#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/types.hpp>

#include "core/base/error.h"
#include "core/camera/camera.h"
#include "pipeline/exchange/bags/bag_options.h"
#include "pipeline/exchange/bags/choose_topics.h"
#include "pipeline/exchange/bags/frame_tree.h"

namespace cairn::pipeline {

// What of a bag is imported, once it was looked through.
struct BagPlan {
  std::string path;
  TopicContents images;
  std::optional<TopicContents> odometry;  // only with `chain`
  std::optional<FrameChain> chain;        // between the odometry's child frame and the images' frame
  std::optional<TopicContents> imu;
  std::optional<FrameChain> imu_chain;             // between the images' frame and the IMU's
  std::map<std::string, TopicClock> frame_clocks;  // of transforms, by child frame
  std::optional<Camera> camera;
  bool camera_is_asked_for = false;
};

// Chooses topics, the camera, and the ways between frames.  What is assumed, missing or left out is said in
// `warnings`.  Errors: those of ChooseImages, ChooseOdometry, ChooseImu; InvalidArgument (the camera that is
// asked for).
Result<BagPlan> PlanImport(const BagContents& contents, const std::string& path, const BagOptions& options,
                           std::vector<std::string>* warnings);

// Leaves the camera out where the images are of another size.  Errors: InvalidArgument where it was asked
// for.
Status CheckCameraSize(const cv::Size& size, BagPlan* plan, std::vector<std::string>* warnings);

}  // namespace cairn::pipeline
