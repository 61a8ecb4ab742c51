#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/camera/camera.h"
#include "core/features/features.h"
#include "core/geometry/pose.h"
#include "core/options/options.h"

namespace cairn {

// An equirectangular panorama is compiled as pinhole views from its centre, evenly turned around its vertical
// axis: what follows feature extraction (and COLMAP) sees pinhole images only.
struct PanoramaOptions {
  // Views of a panorama.  REQUIRES: in [3, 36]
  int num_panorama_views = 6;
  // Width and height of each, degrees; wider than 360 / num_panorama_views, so that features at the seams are
  // seen whole.  REQUIRES: in [20, 120]
  double panorama_view_deg = 90;
};
OptionTable DescribeOptions(PanoramaOptions* options);

// Errors: InvalidArgument when the views leave gaps.
Status CheckPanoramaOptions(const PanoramaOptions& options);

// Name of a view in databases and maps, NAME#2of6 for view 2 of 0 .. 5: the view's pose follows from the
// panorama's and the name.
std::string PanoramaViewName(const std::string& panorama_name, int view, int num_views);

// The inverse.
struct PanoramaView {
  std::string panorama_name;
  int view = 0;
  int num_views = 0;
};
std::optional<PanoramaView> ParsePanoramaViewName(const std::string& name);

// Turn of a view: view 0 looks along the panorama's +z, the next ones to its right.
Pose ViewFromPanorama(int view, int num_views);

// Pose of an image by its name: as it is listed, or that of a panorama's view.
std::optional<Pose> FindPose(const std::map<std::string, Pose>& cam_from_world_by_name,
                             const std::string& name);

// The pinhole camera of all views of a panorama, as sharp in its middle as the panorama on its horizon.
// REQUIRES: panorama.model == kEquirectangular
Camera PanoramaViewCamera(const Camera& panorama, const PanoramaOptions& options);

// The image of one view, bilinear; exact to the last bit of a float in position.  8-bit grey.
cv::Mat CutPanoramaView(const cv::Mat& panorama, const Camera& view_camera, int view, int num_views);

// Removes the features that another view shows nearer to its axis, so that none is found twice.
void KeepSectorOfView(const Camera& view_camera, int num_views, Features* features);

}  // namespace cairn
