#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/capture/capture.h"
#include "core/capture/capture_frame.h"
#include "core/options/options.h"
#include "stages/reconstruct/by_colmap/mapper.h"
#include "stages/reconstruct/inertial/preintegration.h"
#include "stages/reconstruct/registration/register_sessions.h"
#include "stages/reconstruct/verdict/verdict.h"

namespace cairn::reconstruct {

// Finds the poses of a capture that has none, from its matches: of all images at once
// (globally/map_globally.h), up to a similarity, which odometry, GPS, known positions or known distances then
// determine (align.h).  Where too few images are registered, and by default where they are no drive, COLMAP's
// mapper runs (by_colmap/mapper.h): with the cameras' distortion refined, without, and then from a start of
// any motion. Before: match_features.  After: group_classes and all stages that read poses.
struct ReconstructOptions {
  MapperOptions mapper;
  // Smallest part of the capture's images that the largest model must have; with fewer there is no
  // result.  REQUIRES: in [0, 1]
  double min_registered_ratio = 0.5;
  // Where scale and axes come from: "control_points", "odometry" (the capture's odometry.txt), "imu" (its
  // imu.csv), "gps" (EXIF), "rig", "camera_height", "distances", or "none"; "auto": the first of these that
  // is there and says something (find_frame.h).
  std::string scale_from = "auto";
  // Files, absolute or relative to the capture (known_places.h describes them).
  std::string control_points;
  std::string distances;
  std::string rig_baselines;
  // Standard deviations: of a GPS position, level and in altitude; of a control point; of a known distance,
  // over its length; of all that odometry says, over its length (a wheel's radius, which no image shows); of
  // the cameras' mean up against the vertical, degrees.  REQUIRES: > 0
  double gps_sigma_m = 5;
  double gps_altitude_sigma_m = 10;
  double control_point_sigma_m = 0.05;
  double distance_sigma_ratio = 0.02;
  double odometry_sigma_ratio = 0.01;
  // The same of all that an IMU says, over its length: its accelerometer's own scale.  REQUIRES: > 0
  double imu_sigma_ratio = 0.005;
  // Densities of an IMU's white noise, as data sheets have them: of the accelerometer, m/s^2/sqrt(Hz), and of
  // the gyro, rad/s/sqrt(Hz).  More is noticed; less is not believed.  REQUIRES: > 0
  double imu_accel_noise = ImuNoise().accel_m_s2_rthz;
  double imu_gyro_noise = ImuNoise().gyro_rad_s_rthz;
  // The same of a stated baseline of a rig, which all its pairs of images share.  REQUIRES: > 0
  double rig_sigma_ratio = 0.01;
  // How high the camera is over a flat floor that it sees, all the way (floor_plane.h), and the standard
  // deviation of that; 0: not known.  REQUIRES: >= 0; > 0
  double camera_height_m = 0;
  double camera_height_sigma_m = 0.02;
  double up_sigma_deg = 5;
  // Where nothing gives a scale: median distance of the points from the images that see them, in the map's
  // unit.  What is looked at indoors is two or three metres away however densely pictures are taken, so that
  // lengths in options of later stages, and of localization, are meant nearly as they stand.  REQUIRES: > 0
  double unscaled_depth = 2.5;
  // One in this many registered images, in the order of names, is kept out of the map and becomes a query
  // with its reconstructed pose; 0: none.  REQUIRES: >= 0, not 1
  int hold_out_every = 0;
};
OptionTable DescribeOptions(ReconstructOptions* options);

// Distance of an image from its known position; for distances, the error of the distance.
struct AlignmentResidual {
  std::string name;  // an image, or "IMAGE1 IMAGE2"
  double residual_m = 0;
  bool is_off = false;  // by more than three standard deviations: it had little weight
};

// What one source says of the scale.
struct ScaleFound {
  std::string source;      // as scale_from has it
  std::string told_by;     // in words: a file, the GPS of so many images
  double span_m = 0;       // how far the cameras' places reach, by it: the diagonal of their box
  double sigma_ratio = 0;  // its standard deviation, as a part of it
};

struct ReconstructResult {
  std::map<CameraId, Camera> cameras;  // as the mapper refined them
  std::vector<CaptureImage> images;    // ascending by name; poses in `frame`
  std::vector<CaptureImage> queries;   // held out, likewise
  CaptureFrame frame;
  std::vector<AlignmentResidual> residuals;
  std::vector<ScaleFound> scales;  // all that know one, most trusted first; frame.source names the one taken
  std::vector<Reject> rejects;     // images that are in neither list, and why
  std::vector<std::string> warnings;
  std::vector<int> model_sizes;             // images of each model, the kept one first
  int num_points = 0;                       // of the model kept
  double mean_error_px = 0;                 // its mean reprojection error
  std::vector<RegisteredSession> sessions;  // of a capture some of whose sessions have poses in its frame
  Verdict verdict;                          // is it whole, and where is it weak?  Held-out images are in it
};

// Maps the images and puts the largest model into a frame.  Of a capture some of whose sessions have poses in
// its frame the others are registered to these (registration/register_sessions.h): stated poses stay as they
// are.  `work_folder` is an empty folder, for COLMAP. Same result on every run and any number of threads
// where options.mapper.deterministic.  Errors: InvalidArgument (options); NoData (too few images registered,
// the requested scale is not available, no image of the database in the capture); those of RunMapper and of
// the files.
Result<ReconstructResult> Reconstruct(const MapperInput& input, const Capture& capture,
                                      const ReconstructOptions& options, const std::string& work_folder,
                                      int num_threads, Progress& progress);

}  // namespace cairn::reconstruct
