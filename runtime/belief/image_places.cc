#include "runtime/belief/image_places.h"

#include <cmath>

#include "core/blocks/map_head.h"
#include "core/geometry/floor_pose.h"
#include "core/geometry/pose.h"
#include "runtime/localize/refine.h"

namespace cairn {
namespace {

// Of possible poses, of which localization states none.
constexpr double kPossibleSigmaM = 0.3, kPossibleSigmaDeg = 5;

UncertainPlanarPose CameraOnPlan(const Pose& cam_from_world, const Matrix6d& covariance,
                                 const Pose& floor_from_world) {
  const FloorPose on_floor = FloorPoseOf(cam_from_world, floor_from_world);
  UncertainPlanarPose camera;
  camera.pose = {on_floor.position, WrapAngle(RadFromDeg(on_floor.heading_deg))};
  // A perturbation (rotation, translation) on the left of cam_from_world moves the camera by -R^T translation
  // and turns it by -R^T rotation, in the world's frame.
  const Eigen::Matrix3d floor_from_cam =
      (floor_from_world.rotation * cam_from_world.rotation.conjugate()).toRotationMatrix();
  Eigen::Matrix<double, 3, 6> jacobian = Eigen::Matrix<double, 3, 6>::Zero();
  jacobian.block<2, 3>(0, 3) = -floor_from_cam.topRows<2>();
  jacobian.block<1, 3>(2, 0) = -floor_from_cam.row(2);
  camera.covariance = jacobian * covariance * jacobian.transpose();
  return camera;
}

}  // namespace

std::vector<PossiblePlace> PlacesOf(const Localization& found, const MapHead& head,
                                    const PlanarPose& robot_in_camera) {
  std::vector<PossiblePlace> places;
  const auto add = [&](const Pose& given_from_world, const Matrix6d& covariance, double probability) {
    const UncertainPlanarPose camera =
        CameraOnPlan(head.camera_from_given * given_from_world,
                     TransformCovariance(head.camera_from_given, covariance), head.floor_from_world);
    places.push_back({camera * robot_in_camera, probability});
  };
  if (found.has_fix()) {
    add(found.cam_from_world, found.covariance, found.probability);
    return places;
  }
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal().head<3>().setConstant(std::pow(RadFromDeg(kPossibleSigmaDeg), 2));
  covariance.diagonal().tail<3>().setConstant(kPossibleSigmaM * kPossibleSigmaM);
  for (size_t i = 0; i < found.possible_poses.size() && i < found.possible_probabilities.size(); ++i)
    add(found.possible_poses[i], covariance, found.possible_probabilities[i]);
  return places;
}

}  // namespace cairn
