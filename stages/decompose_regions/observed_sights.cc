#include "stages/decompose_regions/pose_information.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "core/camera/camera.h"
#include "core/geometry/vector_geometry.h"

namespace cairn::decompose_regions {
namespace {

using Matrix23d = Eigen::Matrix<double, 2, 3>;
using Matrix26d = Eigen::Matrix<double, 2, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// Nearer than this a landmark has no bearing, metres.
constexpr double kMinDistanceM = 1e-6;

// S^(-1/2) J, up to a rotation of its rows.
std::optional<Matrix26d> WhitenedJacobian(const FeatureClass& feature_class, const Pose& cam_from_world,
                                          double keypoint_sigma_rad) {
  const Eigen::Vector3d point = cam_from_world * feature_class.position;
  const double distance = point.norm();
  if (distance < kMinDistanceM) return std::nullopt;
  const Matrix23d basis = TangentBasis(point / distance).transpose() / distance;
  Matrix26d jacobian;
  jacobian << -basis * CrossMatrix(point), basis;
  const Matrix23d basis_in_world = basis * cam_from_world.rotation.toRotationMatrix();
  const Eigen::Matrix2d noise = keypoint_sigma_rad * keypoint_sigma_rad * Eigen::Matrix2d::Identity() +
                                basis_in_world * feature_class.covariance * basis_in_world.transpose();
  return noise.llt().matrixL().solve(jacobian);
}

}  // namespace

Result<std::vector<SightInformation>> SightsOf(const FeatureClass& feature_class, double distinctiveness,
                                               const Classes& classes, const ChooseFeaturesOptions& options) {
  std::vector<SightInformation> sights;
  for (const Observation& observation : feature_class.observations) {
    const auto image = std::lower_bound(
        classes.images.begin(), classes.images.end(), observation.image_id,
        [](const SurveyImage& survey_image, ImageId id) { return survey_image.image_id < id; });
    if (image == classes.images.end() || image->image_id != observation.image_id) {
      return MakeError(ErrorCode::kInvalidArgument, "class {} is observed in image {}, which has no pose",
                       feature_class.class_id, observation.image_id);
    }
    const auto camera =
        std::lower_bound(classes.cameras.begin(), classes.cameras.end(), image->camera_id,
                         [](const Camera& candidate, CameraId id) { return candidate.camera_id < id; });
    if (camera == classes.cameras.end() || camera->camera_id != image->camera_id) {
      return MakeError(ErrorCode::kInvalidArgument, "image {} is of camera {}, which does not exist",
                       image->image_id, image->camera_id);
    }
    const double sigma_px =
        std::hypot(options.keypoint_sigma_px, options.keypoint_sigma_per_scale * observation.keypoint.scale,
                   feature_class.reprojection_error_px);
    const auto jacobian =
        WhitenedJacobian(feature_class, image->cam_from_world, sigma_px / camera->MeanFocal());
    if (!jacobian) continue;
    sights.push_back(
        {static_cast<size_t>(image - classes.images.begin()), std::sqrt(distinctiveness) * *jacobian});
  }
  return sights;
}

PoseInformation::PoseInformation(size_t num_images, const ChooseFeaturesOptions& options) {
  Vector6d rough_sigma;
  rough_sigma << Eigen::Vector3d::Constant(RadFromDeg(options.rough_sigma_deg)),
      Eigen::Vector3d::Constant(options.rough_sigma_m);
  const Vector6d variance = rough_sigma.cwiseAbs2();
  views_.assign(num_images, {variance.cwiseInverse().asDiagonal(), variance.asDiagonal()});
}

double PoseInformation::Gain(const std::vector<SightInformation>& sights) const {
  double gain = 0;
  for (const SightInformation& sight : sights) {
    // det(A + R' R) = det(A) det(1 + R A^-1 R')
    const Eigen::Matrix2d factor =
        Eigen::Matrix2d::Identity() + sight.root * views_[sight.image].covariance * sight.root.transpose();
    gain += std::log(std::max(1.0, factor.determinant()));
  }
  return gain;
}

void PoseInformation::Add(const std::vector<SightInformation>& sights) {
  for (const SightInformation& sight : sights) {
    View& view = views_[sight.image];
    view.information += sight.root.transpose() * sight.root;
    view.covariance = view.information.inverse();
  }
}

}  // namespace cairn::decompose_regions
