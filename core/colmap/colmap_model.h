#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/camera/camera.h"
#include "core/geometry/pose.h"

namespace cairn {

// A COLMAP model: cameras, images and points3D in one folder, each a .txt or a .bin file
// (src/base/reconstruction.cc of COLMAP 3.8; later versions add rigs and frames, and still state every
// image's own pose here).

inline constexpr uint64_t kNoPoint = ~uint64_t{0};  // COLMAP's -1: a keypoint without a point

struct ModelKeypoint {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  // px, COLMAP's
  uint64_t point_id = kNoPoint;
};

struct ModelImage {
  ImageId image_id = 0;
  std::string name;
  CameraId camera_id = 0;
  Pose cam_from_world;
  std::vector<ModelKeypoint> keypoints;
};

struct ModelPoint {
  uint64_t point_id = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // world frame
  std::array<uint8_t, 3> color = {0, 0, 0};            // red, green, blue
  double error_px = -1;                                // mean reprojection error; -1: not known
  std::vector<std::pair<ImageId, KeypointIdx>> track;  // the keypoints that show it
};

struct ColmapModel {
  std::map<CameraId, Camera> cameras;
  std::vector<ModelImage> images;  // ascending image_id
  std::vector<ModelPoint> points;  // ascending point_id
};

enum class ModelFormat { kText, kBinary };

// Whether a folder has cameras and images as .bin or as .txt files.
bool IsColmapModel(const std::string& folder);

// Reads a model; the binary files where there are both, as COLMAP does.  Without points3D it has no points.
// Errors, naming file and line, byte or element: NotFound; Corrupt (truncated, an invalid number or pose, a
// reference to a camera, image, keypoint or point that is not there, an id listed twice); Unsupported
// (camera model).
Result<ColmapModel> ReadColmapModel(const std::string& folder);

// Writes cameras, images and points3D into an existing folder.  Numbers read back to the same bits.
Status WriteColmapModel(const ColmapModel& model, ModelFormat format, const std::string& folder);

// The first line of an image in images.txt: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME.  The quaternion is
// as written, of any norm.  Errors: Corrupt, without the file's name.
Result<ModelImage> ParseImageLine(std::string_view line);

// Normalises the quaternion.  Errors: Corrupt when the pose is not finite, or the quaternion's norm differs
// from 1 by more than 0.01; without the file's name.
Status NormalizePose(Pose* pose);

// One format each; ReadColmapModel checks what refers to what.
Result<ColmapModel> ReadColmapModelText(const std::string& folder);
Result<ColmapModel> ReadColmapModelBinary(const std::string& folder);
Status WriteColmapModelText(const ColmapModel& model, const std::string& folder);
Status WriteColmapModelBinary(const ColmapModel& model, const std::string& folder);

}  // namespace cairn
