#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/camera/camera.h"
#include "core/capture/capture_frame.h"
#include "core/features/features.h"
#include "core/geometry/pose.h"

namespace cairn {

// MapHead::algorithm of regions that keep promises (core/promise) instead of k common landmarks.
inline constexpr const char* kPromiseAlgorithm = "promise";

// What a map says of itself as a whole.
struct MapHead {
  std::string name;
  std::string writer;  // program and version, "cairn 0.1.0"
  // Of the processor that extracted the features, in maps of programs whose SIFT differed between them in the
  // last bits.
  std::string instruction_set;
  uint64_t seed = 0;    // of the compilation
  bool sealed = false;  // checked, with its self-test figures
  // Counts the releases of a map of this name: a robot takes only a map with a later epoch than its own
  // (docs/updates.md).  0: not counted.
  uint64_t epoch = 0;
  // Hash of the tables of findings, hexadecimal; written by WriteMapRows.  Empty: a map of format 2.4
  // or earlier.
  std::string findings_hash;
  // Which classes are landmarks: those that regions keep ("regions"), the fewest with which images are
  // localized as with all ("fewest"), or "all".
  std::string landmark_choice = "regions";
  // What the landmarks' descriptors are: queries of another kind are refused.
  DescriptorKind descriptor_kind;
  // Which images retrieval finds: "all", or those of the appearance graph's kept nodes ("kept").
  std::string documents = "all";
  // How the regions were made; kPromiseAlgorithm: of the nodes whose promises the same landmarks keep, and k,
  // tau, rho are 0.
  std::string algorithm;
  int k = 0;
  int tau = 0;
  int rho = 0;
  // Certified least number of regions of any decomposition that leaves at most `uncovered_limit` coverable
  // stations uncovered; nothing where none is known.
  std::optional<int> lower_bound;
  int uncovered_limit = 0;
  std::map<std::string, std::string> stage_options;  // stage -> TOML
  std::map<std::string, std::string> input_hashes;   // file -> XXH3
  std::map<std::string, double> self_test;           // figure -> value; empty in an unsealed map

  // What the world frame's coordinates mean: their unit, and where on the Earth they are.
  CaptureFrame frame;
  // The surveys that the map is made from, if there are several: the image SESSION/NAME belongs to
  // one of them.
  std::vector<std::string> sessions;
  Pose floor_from_world;
  // The poses that the capture states are cam_from_world = camera_from_given^-1 * (the poses here), up
  // to noise.
  Pose camera_from_given;
  // That noise, root mean square per axis of a camera's place (m) and rotation (degrees), which the poses
  // here are free from; 0: poses as stated.
  double stated_pose_sigma_m = 0;
  double stated_pose_sigma_deg = 0;
  // How much wider than its normal matrix says the covariance of a fix of n inliers is, as left-out survey
  // images show: covariance_scale * (1 + n / 2 * keypoint_correlation).  0: not measured.
  double covariance_scale = 0;
  // Which part of its variance a keypoint shares with the others of its image.  0: not measured.
  double keypoint_correlation = 0;

  std::vector<Camera> cameras;  // ascending camera_id
  // Cameras as the capture states them, where the survey's images showed that they are others; ascending
  // camera_id, each of which `cameras` has.
  std::vector<Camera> stated_cameras;
};

// The figure of a self-test by runs of the survey's own images, in maps without them: how many runs.
inline constexpr const char* kLeftOutRunsFigure = "num_left_out_runs";
// What the images of the self-test are called: "left-out" in that case, else "held-out".
std::string TriedWord(const MapHead& head);

// As CheckMapRows (core/blocks/map_rows.h), of the head alone.
Status CheckMapHead(const MapHead& head);

}  // namespace cairn
