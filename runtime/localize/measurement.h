#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/blocks/map_head.h"
#include "core/camera/camera.h"
#include "core/features/features.h"
#include "core/features/packed_descriptors.h"
#include "runtime/localize/localizer_options.h"

namespace cairn {

struct LandmarkSet;  // runtime/map/landmark_set.h
struct MapLandmark;  // core/packing/map_landmark.h

// Whether images of such a camera can be localized.  Errors: those of CheckCamera, Unsupported (a panorama).
Status CheckQueryCamera(const Camera& camera);

// The camera that the survey's images showed a stated one to be; others stay what they are.  Of several that
// were stated alike, the one with the same number.
Camera AsFound(const MapHead& head, const Camera& camera);

// Whether a pixel lies in the image, its edges among it.
bool IsInImage(const Eigen::Vector2d& pixel, const Camera& camera);

// A keypoint of the query as a ray: the rest of localization needs no camera model, to first order.
struct QueryRay {
  Eigen::Vector2d ray = Eigen::Vector2d::Zero();  // x/z, y/z
  Eigen::Matrix2d pixel_from_ray =
      Eigen::Matrix2d::Identity();  // d pixel / d ray: turns ray differences into px
  double sigma_px = 1;
};

// What localization needs of a query image.
struct Query {
  Features features;
  Camera camera;
  std::vector<std::optional<QueryRay>> rays;  // per keypoint; none where the camera model has no forward ray
  PackedDescriptors packed;                   // descriptors of the features that are matched
  // Features of smaller scales (sigma, px) were not looked for in all of the image, and what the image should
  // show of them is not missing.
  double min_scale_px = 0;
};
Query MakeQuery(Features features, const Camera& camera, const MeasurementOptions& options);
// More features of the same image, behind those that the query has.  They are found by guided matching
// alone: they are not packed.
void AddFeatures(const Features& features, const MeasurementOptions& options, Query* query);

// Whether the query would have a feature that shows a landmark which is so far away (DepthOfScale, metres).
// Of a landmark whose size is not known only where all scales were looked for.
bool WasLookedFor(const MapLandmark& landmark, double depth_m, const Query& query);

// A keypoint that shows a landmark.
struct Correspondence {
  KeypointIdx keypoint = 0;
  LandmarkIdx landmark = 0;
};

// A correspondence with everything that pose estimation needs.
struct PoseMeasurement {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();             // landmark, world frame, metres
  Eigen::Matrix3d point_covariance = Eigen::Matrix3d::Zero();  // m^2
  QueryRay ray;
};
// REQUIRES: the keypoints have rays, the landmarks are in the set
std::vector<PoseMeasurement> MakeMeasurements(const Query& query, const LandmarkSet& landmarks,
                                              const std::vector<Correspondence>& correspondences);

}  // namespace cairn
