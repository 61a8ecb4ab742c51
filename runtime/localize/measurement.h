#pragma once

#include <memory>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/base/pooled.h"
#include "core/blocks/map_head.h"
#include "core/camera/camera.h"
#include "core/features/features.h"
#include "core/features/packed_descriptors.h"
#include "core/geometry/pose.h"
#include "runtime/localize/localization.h"
#include "runtime/localize/localizer_options.h"

namespace cairn {

class WorkBudget;    // core/work/work_budget.h
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

// Up, as a robot's accelerometer says and as the map does, and how well the two agree where a pose is right:
// standard deviation per axis, rad.
struct UpMeasurement {
  Eigen::Vector3d in_rig = -Eigen::Vector3d::UnitY();  // of length 1, as the other
  Eigen::Vector3d in_world = Eigen::Vector3d::UnitZ();
  double sigma_rad = 0;
  double max_sigmas = 4;  // poses that have up farther off than so many of these are none
};

// What localization needs of a query image.
struct Query {
  Features features;
  Camera camera;
  PooledVector<std::optional<QueryRay>> rays;  // per keypoint; none where the camera model has no forward ray
  PackedDescriptors packed;                    // descriptors of the features that are matched
  // Features of smaller scales (sigma, px) were not looked for in all of the image, and what the image should
  // show of them is not missing.
  double min_scale_px = 0;
  // These in frames of the map's cameras (MapHead::camera_from_given).
  std::optional<UpMeasurement> up;
  Pose cam_from_rig;                 // of a camera of a rig, whose frame `up` is in then
  ReadoutMotion readout;             // poses are those of the middle row
  std::shared_ptr<WorkBudget> work;  // what its answer may cost; null: not counted
  bool had_no_room = false;          // for any features of its image
};

// Where a point of the camera's frame in the middle row's moment is seen, in the image or not; as
// ImageFromCamera.
std::optional<Eigen::Vector2d> PixelOf(const Query& query, const Eigen::Vector3d& in_camera);
Query MakeQuery(Features features, const Camera& camera, const MeasurementOptions& options);
// More features of the same image, behind those that the query has.  They are found by guided matching
// alone: they are not packed.
void AddFeatures(const Features& features, const MeasurementOptions& options, Query* query);

// Whether the query would have a feature that shows a landmark which is so far away (DepthOfScale, metres).
// Of a landmark whose size is not known only where all scales were looked for.
bool WasLookedFor(const MapLandmark& landmark, double depth_m, const Query& query);

// What one fix is made of: an image, or those that the cameras of a rig take at once.  Poses are the rig's;
// with one image, its camera's.  The images outlive it.
struct Sighting {
  std::span<const Query> images;
  std::optional<UpMeasurement> up;
  WorkBudget* work;  // null: not counted

  Sighting(const Query& query)
      : images(&query, 1), up(query.up), work(query.work.get()) {}  // NOLINT: an image is a sighting
  // REQUIRES: at least one; what the first knows of up, and its budget, count
  explicit Sighting(std::span<const Query> of_rig)
      : images(of_rig), up(of_rig.front().up), work(of_rig.front().work.get()) {}
  int num_images() const { return static_cast<int>(images.size()); }
  int num_features() const;
};

// A keypoint that shows a landmark.
struct Correspondence {
  KeypointIdx keypoint = 0;
  LandmarkIdx landmark = 0;
  int image = 0;  // of the sighting
};

// Their landmarks, ascending, each once.
PooledVector<LandmarkIdx> LandmarksOf(std::span<const Correspondence> correspondences);

// A correspondence with everything that pose estimation needs.
struct PoseMeasurement {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();             // landmark, world frame, metres
  Eigen::Matrix3d point_covariance = Eigen::Matrix3d::Zero();  // m^2
  QueryRay ray;
  int image = 0;
  std::optional<Pose> cam_from_rig;  // none: the rig's frame is the camera's
  // Of an image that is read row by row: cam_from_rig is that of the keypoint's row.  Which part of the
  // motion lies between the middle row and it, and what is not known of all of the motion.
  struct Row {
    double part = 0;
    Vector6d motion_sigmas = Vector6d::Zero();
  };
  std::optional<Row> row;

  Eigen::Vector3d InCamera(const Eigen::Vector3d& in_rig) const {
    return cam_from_rig ? *cam_from_rig * in_rig : in_rig;
  }
};
// REQUIRES: the keypoints have rays, the landmarks are in the set
PooledVector<PoseMeasurement> MakeMeasurements(const Sighting& sighting, const LandmarkSet& landmarks,
                                               std::span<const Correspondence> correspondences);
// Those at these indices, in the indices' order.
PooledVector<PoseMeasurement> SelectMeasurements(std::span<const PoseMeasurement> measurements,
                                                 std::span<const int> indices);

}  // namespace cairn
