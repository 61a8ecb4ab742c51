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
#include "stages/reconstruct/mapper.h"
#include "stages/reconstruct/verdict/verdict.h"

namespace cairn::reconstruct {

// Finds the poses of a capture that has none, from its matches: of all images at once
// (globally/map_globally.h), up to a similarity, which odometry, GPS, known positions or known distances then
// determine (align.h).  Where too few images are registered, and by default where they are no drive, COLMAP's
// mapper runs (mapper.h): with the cameras' distortion refined, without, and then from a start of any motion.
// Before: match_features.  After: group_classes and all stages that read poses.
struct ReconstructOptions {
  MapperOptions mapper;
  // Smallest part of the capture's images that the largest model must have; with fewer there is no
  // result.  REQUIRES: in [0, 1]
  double min_registered_ratio = 0.5;
  // Where scale and axes come from: "odometry" (the capture's odometry.txt), "gps" (EXIF), "control_points",
  // "distances", or "none"; "auto": the control points if their file is given, else the distances if theirs
  // is, else odometry if it is there, else GPS where at least three images have it and are far enough apart,
  // else none.
  std::string scale_from = "auto";
  // Files, absolute or relative to the capture (known_places.h describes them).
  std::string control_points;
  std::string distances;
  // Standard deviations: of a GPS position, level and in altitude; of a control point; of a known distance,
  // over its length; of the cameras' mean up against the vertical, degrees.  REQUIRES: > 0
  double gps_sigma_m = 5;
  double gps_altitude_sigma_m = 10;
  double control_point_sigma_m = 0.05;
  double distance_sigma_ratio = 0.02;
  double up_sigma_deg = 5;
  // Where nothing gives a scale: median distance of an image to the nearest other, in the map's unit, so that
  // lengths in options of later stages are meaningful.  REQUIRES: > 0
  double unscaled_step = 0.5;
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

struct ReconstructResult {
  std::map<CameraId, Camera> cameras;  // as the mapper refined them
  std::vector<CaptureImage> images;    // ascending by name; poses in `frame`
  std::vector<CaptureImage> queries;   // held out, likewise
  CaptureFrame frame;
  std::vector<AlignmentResidual> residuals;
  double scale_sigma_ratio = 0;  // standard deviation of the scale, as a part of it; 0: not known
  std::vector<Reject> rejects;   // images that are in neither list, and why
  std::vector<std::string> warnings;
  std::vector<int> model_sizes;  // images of each model, the kept one first
  int num_points = 0;            // of the model kept
  double mean_error_px = 0;      // its mean reprojection error
  Verdict verdict;               // is it whole, and where is it weak?  Held-out images are in it
};

// Maps the images and puts the largest model into a frame.  `work_folder` is an empty folder, for COLMAP.
// Same result on every run and any number of threads where options.mapper.deterministic.  Errors:
// InvalidArgument (options); NoData (too few images registered, the requested scale is not available, no
// image of the database in the capture); those of RunMapper and of the files.
Result<ReconstructResult> Reconstruct(const MapperInput& input, const Capture& capture,
                                      const ReconstructOptions& options, const std::string& work_folder,
                                      int num_threads, Progress& progress);

}  // namespace cairn::reconstruct
