#include "runtime/localize/measurement.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/pooled.h"
#include "core/blocks/map_rows.h"
#include "runtime/localize/localization.h"
#include "runtime/localize/refine.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

// d pixel / d ray by central differences; nothing where the ray's neighbours are not seen.
std::optional<Eigen::Matrix2d> PixelFromRay(const Camera& camera, const Eigen::Vector2d& ray) {
  constexpr double kStep = 1e-5;
  Eigen::Matrix2d jacobian;
  for (int axis = 0; axis < 2; ++axis) {
    Eigen::Vector2d step = Eigen::Vector2d::Zero();
    step[axis] = kStep;
    const auto ahead = ImageFromCamera(camera, (ray + step).homogeneous());
    const auto behind = ImageFromCamera(camera, (ray - step).homogeneous());
    if (!ahead || !behind) return std::nullopt;
    jacobian.col(axis) = (*ahead - *behind) / (2 * kStep);
  }
  return jacobian;
}

PooledVector<std::optional<QueryRay>> RaysOf(std::span<const Keypoint> keypoints, const Camera& camera,
                                             const MeasurementOptions& options) {
  PooledVector<std::optional<QueryRay>> rays(keypoints.size());
  for (size_t i = 0; i < keypoints.size(); ++i) {
    const Keypoint& keypoint = keypoints[i];
    const auto direction = CameraFromImage(camera, {keypoint.x, keypoint.y});
    if (!direction) continue;
    const auto pixel_from_ray = PixelFromRay(camera, *direction);
    if (!pixel_from_ray) continue;
    rays[i] =
        QueryRay{*direction, *pixel_from_ray,
                 std::hypot(options.keypoint_sigma_px, options.keypoint_sigma_per_scale * keypoint.scale)};
  }
  return rays;
}

bool IsIdentity(const Pose& pose) { return pose.translation.isZero(0) && pose.rotation.vec().isZero(0); }

// Of the motion while the image is read, from the middle row to this one.
double ReadoutPart(const Query& query, double row) { return row / query.camera.height - 0.5; }

}  // namespace

std::optional<Eigen::Vector2d> PixelOf(const Query& query, const Eigen::Vector3d& in_camera) {
  std::optional<Eigen::Vector2d> pixel = ImageFromCamera(query.camera, in_camera);
  if (query.readout.motion.isZero(0)) return pixel;
  // The row says when, and when says the row: two rounds leave nothing where a row is read in far less time
  // than the point takes to move by one.
  for (int round = 0; round < 2 && pixel; ++round) {
    const Pose moved = Perturb(Pose(), ReadoutPart(query, pixel->y()) * query.readout.motion);
    pixel = ImageFromCamera(query.camera, moved * in_camera);
  }
  return pixel;
}

OptionTable DescribeOptions(MeasurementOptions* o) {
  return {{.name = "keypoint_sigma_px",
           .value = &o->keypoint_sigma_px,
           .help = "standard deviation of a small keypoint's position, px",
           .min = 1e-3},
          {.name = "keypoint_sigma_per_scale",
           .value = &o->keypoint_sigma_per_scale,
           .help = "its growth with the keypoint's scale",
           .min = 0}};
}

bool IsInImage(const Eigen::Vector2d& pixel, const Camera& camera) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= camera.width && pixel.y() <= camera.height;
}

Status CheckQueryCamera(const Camera& camera) {
  CAIRN_RETURN_IF_ERROR(CheckCamera(camera));
  if (camera.model != CameraModel::kEquirectangular) return Ok();
  return MakeError(ErrorCode::kUnsupported,
                   "localize: a panorama is not localized as a whole; cut it into pinhole views first");
}

Camera AsFound(const MapHead& head, const Camera& camera) {
  const auto is_stated = [&](const Camera& stated) {
    return stated.model == camera.model && stated.width == camera.width && stated.height == camera.height &&
           stated.params == camera.params;
  };
  const Camera* match = nullptr;
  for (const Camera& stated : head.stated_cameras) {
    if (is_stated(stated) && (match == nullptr || stated.camera_id == camera.camera_id)) match = &stated;
  }
  if (match == nullptr) return camera;
  for (const Camera& found : head.cameras) {
    if (found.camera_id == match->camera_id) return found;
  }
  return camera;
}

Query MakeQuery(Features features, const Camera& camera, const MeasurementOptions& options) {
  Query query;
  query.camera = camera;
  query.rays = RaysOf(features.keypoints, camera, options);
  query.packed = PackedDescriptors(features.descriptors, features.kind.space());
  query.features = std::move(features);
  return query;
}

void AddFeatures(const Features& features, const MeasurementOptions& options, Query* query) {
  const auto rays = RaysOf(features.keypoints, query->camera, options);
  query->rays.insert(query->rays.end(), rays.begin(), rays.end());
  Features& all = query->features;
  all.keypoints.insert(all.keypoints.end(), features.keypoints.begin(), features.keypoints.end());
  const Eigen::Index num_before = all.descriptors.rows();
  all.descriptors.conservativeResize(num_before + features.descriptors.rows(), Eigen::NoChange);
  all.descriptors.bottomRows(features.descriptors.rows()) = features.descriptors;
}

bool WasLookedFor(const MapLandmark& landmark, double depth_m, const Query& query) {
  return query.min_scale_px == 0 ||
         landmark.scale_m * query.camera.MeanFocal() >= query.min_scale_px * depth_m;
}

Status CheckSensedUp(const SensedUp& up) {
  const double length = up.direction.norm();
  if (!std::isfinite(length) || !(length > 0))
    return MakeError(ErrorCode::kInvalidArgument, "gravity: ({}, {}, {}) is no direction", up.direction.x(),
                     up.direction.y(), up.direction.z());
  if (!(up.sigma_deg > 0) || !std::isfinite(up.sigma_deg))
    return MakeError(ErrorCode::kInvalidArgument, "gravity: sigma of {} degrees; expected more than 0",
                     up.sigma_deg);
  return Ok();
}

int Sighting::num_features() const {
  size_t num = 0;
  for (const Query& query : images) num += query.features.keypoints.size();
  return static_cast<int>(num);
}

PooledVector<LandmarkIdx> LandmarksOf(std::span<const Correspondence> correspondences) {
  PooledVector<LandmarkIdx> landmarks;
  landmarks.reserve(correspondences.size());
  for (const Correspondence& correspondence : correspondences) landmarks.push_back(correspondence.landmark);
  SortUnique(&landmarks);
  return landmarks;
}

PooledVector<PoseMeasurement> MakeMeasurements(const Sighting& sighting, const LandmarkSet& landmarks,
                                               std::span<const Correspondence> correspondences) {
  PooledVector<PoseMeasurement> measurements;
  measurements.reserve(correspondences.size());
  for (const Correspondence& correspondence : correspondences) {
    const MapLandmark& landmark = landmarks.Find(correspondence.landmark);
    const Query& query = sighting.images[correspondence.image];
    PoseMeasurement measurement{.point = landmark.position,
                                .point_covariance = landmark.covariance,
                                .ray = *query.rays[correspondence.keypoint],
                                .image = correspondence.image};
    if (!IsIdentity(query.cam_from_rig)) measurement.cam_from_rig = query.cam_from_rig;
    if (!query.readout.is_none()) {
      const double part = ReadoutPart(query, query.features.keypoints[correspondence.keypoint].y);
      measurement.cam_from_rig = Perturb(query.cam_from_rig, part * query.readout.motion);
      measurement.row = {part, query.readout.sigmas};
    }
    measurements.push_back(std::move(measurement));
  }
  return measurements;
}

PooledVector<PoseMeasurement> SelectMeasurements(std::span<const PoseMeasurement> measurements,
                                                 std::span<const int> indices) {
  PooledVector<PoseMeasurement> selected;
  selected.reserve(indices.size());
  for (const int i : indices) selected.push_back(measurements[i]);
  return selected;
}

}  // namespace cairn
