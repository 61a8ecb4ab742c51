#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/world/landmark_model.h"

namespace cairn {

// Most sights of one model: the cost of a query grows with their cube.
inline constexpr int kMaxNumSights = 512;

// What a map stores of its visual map [Sala06 §VI-C]: the sights from which LandmarkModel makes the
// generative model of every landmark, and how well it predicts.  schemas/FORMAT.md, block 12.

// A landmark in a survey image, by the image's index.
struct LandmarkSight {
  int32_t image = 0;
  Eigen::Vector3f seen = Eigen::Vector3f::Zero();  // x px, y px, log2 of the scale in px
  friend bool operator==(const LandmarkSight&, const LandmarkSight&) = default;
};

// A landmark as cameras of about one heading see it.
struct HeadingModel {
  int32_t heading = 0;  // index in VisualMapData::headings_deg
  KernelShape shape;
  // Standard deviations of errors of left-out sights: x px, y px, octaves of scale.
  Eigen::Vector3d sigma = Eigen::Vector3d::Zero();
  bool predicts_badly = false;        // counts less
  std::vector<LandmarkSight> sights;  // ascending image, kMinNumSights to kMaxNumSights
};

// What the survey's own images say about the quality of its visual map: they are localized with models that
// used no sight from within one spacing of the survey around them.
struct VisualErrors {
  // Standard deviation of the part that landmarks' errors share (heights of cameras, ways between places):
  // per axis, and of the heading.  It does not average out over landmarks.
  float shared_m = 0, shared_rad = 0;
  // A model's standard deviation at a distance d from the nearest of its sights: sigma sqrt(1 +
  // (growth d)^2).
  float growth_per_m = 0;
  // Pitch and roll of the survey's cameras, root mean square.  Sights are stored as a level camera's.
  float tilt_rad = 0;
  friend bool operator==(const VisualErrors&, const VisualErrors&) = default;
};

struct VisualMapData {
  // The camera of all sights; queries must come from it too.
  CameraId camera_id = 0;
  // How a turn of the camera changes an image, as the survey itself shows it: as for a pinhole camera with
  // this focal length, px; 0: not known from the survey.
  float focal_px = 0;
  VisualErrors errors;
  // The headings of models, floor frame, degrees, ascending in [0, 360).  Sights from headings between are
  // turned to the nearest.
  std::vector<double> headings_deg;
  // Per landmark of the map, ascending heading; empty: the map has no visual map.
  std::vector<std::vector<HeadingModel>> landmarks;
};

// Rounds to the values that the file stores: storing and reading again changes nothing.  Errors: Unsupported
// for a position outside of [-2048, 6143] px.
Status RoundAsStored(VisualMapData* visual_map);

// Errors: InvalidArgument, naming the landmark: lists that are not ascending, an image that does not exist,
// too few sights, an invalid number.
Status CheckVisualMap(const VisualMapData& visual_map, int64_t num_landmarks, int64_t num_images);

}  // namespace cairn
