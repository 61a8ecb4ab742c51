#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/pose.h"
#include "core/geometry/similarity.h"
#include "stages/reconstruct/known_places.h"
#include "stages/reconstruct/view_graph/image_motion.h"
#include "stages/reconstruct/view_graph/mapper_input.h"

namespace cairn::reconstruct {

// A piece of the way, from one image to a later one.
struct OdometryWindow {
  std::string first;
  std::string last;
  double odometry_m = 0;  // straight from the one to the other
  double model = 0;       // the same as reconstructed
  bool is_off = false;    // the two disagree far more than elsewhere: a jump, a slip, a bend
};

struct OdometryAlignment {
  Similarity world_from_model;
  Eigen::Vector3d first =
      Eigen::Vector3d::Zero();   // where the first image is: it stays there, whatever the scale
  double scale_sigma_ratio = 0;  // standard deviation of the scale, as a part of it
  double spread_ratio = 0;       // of single windows about it
  std::vector<OdometryWindow> windows;
};

// Scale, vertical and origin of a reconstruction from odometry.  The way is cut into about forty pieces (each
// at least five images); each gives the scale as the ratio of the straight lines between its ends, whatever
// the odometry drifts elsewhere.  The scale is that of all pieces together that lie within three standard
// deviations (by the median absolute deviation) of the median; pieces on which the camera comes back to where
// it was do not count.  Up is the odometry's, in the mean over images; origin and heading are where it has
// the first image.  What all pieces share (a wheel's radius) is not in scale_sigma_ratio.  `model`:
// cam_from_model by image name.  Pure.  Errors: NoData (fewer than three pieces).
Result<OdometryAlignment> AlignToOdometry(const std::vector<OdometryPose>& odometry,
                                          const std::map<std::string, Pose>& model);

// How the camera moved from each image to the next one of its folder, by odometry; images of the input that
// it lacks are skipped.
std::vector<ImageMotion> MotionsOf(const std::vector<OdometryPose>& odometry, const MapperInput& input);

// What the capture's odometry says, if it has any.  Errors: those of ReadOdometry but NoData.
Result<std::vector<ImageMotion>> OdometryMotions(const MapperInput& input, const Capture& capture);

}  // namespace cairn::reconstruct
