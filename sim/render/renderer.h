#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/camera/camera.h"
#include "core/geometry/pose.h"
#include "sim/render/building.h"

namespace cairn::sim {

// Renders what a camera sees in a building.  Made once per camera (the ray of every pixel is computed then),
// used for any number of poses, from any number of threads at once:
//
//   CAIRN_ASSIGN_OR_RETURN(const Building building, MakeBuilding(options, seed));
//   const Renderer renderer(building, camera);
//   cv::Mat image = renderer.Render(cam_from_world);
//
// One ray per pixel through a grid of boxes; textures are averaged over the pixel's footprint, and pixels in
// which two surfaces meet over kEdgeSamples^2 rays: no aliasing.  All camera models of core/camera/camera.h,
// lens distortion included.  Deterministic.  About 50 ms for 640 x 480 on one core.
class Renderer {
 public:
  // `building` must outlive the renderer.  REQUIRES: CheckCamera(camera).ok()
  Renderer(const Building& building, const Camera& camera);

  // The image, 8-bit grey.  Black where a pixel has no ray, and for cameras outside of the free space.
  cv::Mat Render(const Pose& cam_from_world) const;
  // The same before rounding, CV_32FC1 in [0, 255]: for adding exposure, noise and blur.
  cv::Mat RenderFloat(const Pose& cam_from_world) const;
  // The same with each row seen from a pose of its own, as a rolling shutter does.
  cv::Mat RenderFloat(const std::function<Pose(int row)>& cam_from_world) const;

  const Camera& camera() const { return camera_; }

 private:
  const Building& building_;
  const Camera camera_;
  // Per pixel (row by row): the direction of its centre in the camera frame, with z = 1 where the camera has
  // forward rays only; NaN where there is none.
  std::vector<Eigen::Vector3f> rays_;
};

}  // namespace cairn::sim
