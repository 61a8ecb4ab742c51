#pragma once

#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/options/options.h"
#include "stages/group_classes/adjust/bundle.h"
#include "stages/group_classes/adjust/camera_models.h"
#include "stages/group_classes/adjust/keypoint_noise.h"
#include "stages/group_classes/tracks/posed_images.h"

namespace cairn::group_classes {

struct AdjustSurveyOptions {
  // Find out which parameters of the cameras differ from what is stated.
  bool refine_cameras = true;
  CameraPriorOptions camera_prior;
  // Find one rigid offset between all stated poses and their cameras (the poses may be a depth camera's or a
  // body's), and its standard deviations about zero, metres and degrees.  REQUIRES: > 0
  bool refine_camera_offset = true;
  double offset_sigma_m = 0.05;
  double offset_sigma_deg = 3.0;
  // Keypoints of an image that decide on poses and cameras.  REQUIRES: >= 10
  int num_keypoints_adjusted = 100;
  // Images from which the noise and the cameras are learnt.  REQUIRES: >= 10
  int num_images_learnt = 80;
  // Most rounds in which the poses' noise is learnt.  REQUIRES: >= 1
  int num_rounds = 4;
  // Most iterations of a round's solver.  REQUIRES: >= 1
  int max_num_iterations = 30;
  // Poses of a survey of more images are straightened in parts (parts.h) before all are adjusted together.
  // REQUIRES: >= 10
  int num_images_at_once = 600;
  // Poses of a survey of more images are adjusted block by block (blocks.h), each of at most so many: memory
  // is that of a block.  REQUIRES: >= 10
  int num_images_together = 5000;
};
OptionTable DescribeOptions(AdjustSurveyOptions* options);

// What was found out of a camera.
struct CameraFinding {
  std::string variant;        // CameraVariant::name; empty: it is as stated
  std::vector<int> free;      // indices of the parameters that were changed
  std::vector<double> sigma;  // their standard deviations
  double gain = 0;  // by which part the variance of left-out keypoints' errors is smaller than as stated
  Camera camera;    // as found
};

struct SurveyFindings {
  PoseNoise noise;
  KeypointNoise keypoints;
  bool has_offset = false;
  Pose camera_from_given;
  std::vector<CameraFinding> cameras;  // per camera
  // By which part the variance of left-out keypoints' errors is smaller when the poses are adjusted; 0: not
  // significantly, and they are what was stated.
  double pose_gain = 0;
};

// How the survey's keypoints err, where poses and cameras stay as stated.
KeypointNoise MeasureSurvey(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                            const TriangulateOptions& triangulate, const AdjustSurveyOptions& options,
                            int num_threads, const PosedImages& posed);

// Finds out from the images how wrong the stated poses and cameras are, and makes them as right as the images
// allow; exact ones stay what they are.  In turns:
//   - poses, points, cameras and offset are adjusted together (bundle.h), over long tracks, 100 keypoints an
//     image or more, at most 16 of a track;
//   - what keypoints' errors are is measured by scale, and how much of them an image's keypoints share
//     (keypoint_noise.h): real images say far less than as many independent keypoints would;
//   - the four components of the poses' noise are learnt [MacKay 1992]: a standard deviation squared is the
//     sum of its squared errors over the number of them that keypoints determine;
//   - the camera's model is chosen by the errors of keypoints that were left out (camera_models.h): a larger
//     model must make their variance smaller by more than half the part that an image's keypoints share,
//     and than chance; what they share is no camera's;
//   - an offset that is not significant is none;
//   - a large survey is straightened in parts first (parts.h), so that its size adds no steps to the
//     adjustment of the whole; and a very large one is then adjusted block by block (blocks.h).
// The world frame stays that of the stated poses, in the mean.  Changes poses, cameras and
// camera_from_given of `posed`.  `solved`: where what was solved is kept (solved_file.h); may be null.
// `first`: how tracks are triangulated by poses and cameras as stated.  Stops early, with no meaning, when
// progress is cancelled.  Pure; same result for any number of threads.  O(images
// * keypoints adjusted) but for the sparse factorisation of the poses.
SurveyFindings AdjustSurvey(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                            const TriangulateOptions& first, const TriangulateOptions& triangulate,
                            const AdjustSurveyOptions& options, int num_threads, Progress& progress,
                            SolvedFile* solved, PosedImages* posed);

}  // namespace cairn::group_classes
