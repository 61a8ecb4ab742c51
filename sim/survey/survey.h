#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/camera/camera.h"
#include "core/geometry/pose.h"
#include "sim/render/building.h"
#include "sim/render/renderer.h"

namespace cairn::sim {

// An image to be taken: where the camera is, its stated pose, and what the camera does to the image.
struct PlannedImage {
  std::string name;            // file name; sorts in order of capture
  Pose cam_from_world;         // true pose, in the middle of the exposure
  Pose stated_cam_from_world;  // the pose in images.txt: with pose noise for survey images
  double noise = 0;            // standard deviation of grey noise, of 255
  double gain = 1, bias = 0;   // exposure: gain * grey + bias
  // How the scene turns about the camera during the exposure, camera frame: axis times angle, rad.
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  // The camera's way during the exposure, camera frame in the middle of it, metres.
  Eigen::Vector3d way = Eigen::Vector3d::Zero();
  // A rolling shutter: from the top row to the bottom row the pose goes on by this much, from the left, axis
  // times angle (rad) and metres; cam_from_world is that of the middle row.
  Eigen::Vector3d readout_turn = Eigen::Vector3d::Zero();
  Eigen::Vector3d readout_way = Eigen::Vector3d::Zero();
};

struct Survey {
  Camera camera;                          // of the survey images
  Camera query_camera;                    // the same, except for panoramas
  std::vector<PlannedImage> images;       // the survey
  std::vector<PlannedImage> queries;      // held out
  std::vector<Eigen::Vector2d> stations;  // where survey images are taken, metres
  // Where the cameras are on the rig that takes the queries, and the images of a driven survey, whose names
  // begin with RigFolder(camera); the first at its origin.  One where there is no rig.
  std::vector<Pose> cams_from_rig;
};

std::string RigFolder(int camera);  // "cam0/"

// cam_from_world of a camera at a place, looking along `heading_rad` (counter-clockwise from +x), pitched up
// and rolled clockwise.
Pose MakePose(const Eigen::Vector3d& centre, double heading_rad, double pitch_rad = 0, double roll_rad = 0);

// The camera of survey images, and that of queries: the same (camera 1), except that queries of a panorama
// survey are taken with a pinhole camera (camera 2).
Camera MakeCamera(const SimulateOptions& options);
Camera MakeQueryCamera(const SimulateOptions& options);

// Decides where images are taken.  Lattice stations are the places ((i + 1/2) spacing_m, (j + 1/2) spacing_m)
// with enough clearance, row by row; each has num_headings images.  Queries lie off the lattice, inside the
// surveyed area, and look anywhere; those of a driven survey look roughly along the drive.  Errors:
// InvalidArgument for bad options, NoData where no station or query fits; both with a remedy.
Result<Survey> PlanSurvey(const Building& building, const SimulateOptions& options, uint64_t seed);

// Renders a planned image, 8-bit grey: the mean over the camera's motion, then exposure, then noise.
cv::Mat TakeImage(const Renderer& renderer, const PlannedImage& image, uint64_t seed);

}  // namespace cairn::sim
