#include "stages/match_features/verify_pair.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Dense>
#include <opencv2/calib3d.hpp>

namespace cairn {
namespace {

constexpr double kPureRotationBaselineM = 1e-3;

Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d skew;
  skew << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return skew;
}

Eigen::Matrix3d EssentialMatrix(const Pose& cam2_from_cam1) {
  return Skew(cam2_from_cam1.translation.normalized()) * cam2_from_cam1.rotation.toRotationMatrix();
}

// Two unit vectors that span the plane orthogonal to v.
Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& v) {
  const Eigen::Vector3d axis = std::abs(v.x()) < 0.6 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = v.cross(axis).normalized();
  basis.col(1) = v.cross(basis.col(0)).normalized();
  return basis;
}

// Signed Sampson distance.
double SampsonResidual(const Eigen::Matrix3d& E, const Eigen::Vector2d& x1, const Eigen::Vector2d& x2) {
  const Eigen::Vector3d Ex1 = E * x1.homogeneous();
  const Eigen::Vector3d Etx2 = E.transpose() * x2.homogeneous();
  const double norm2 = Ex1.head<2>().squaredNorm() + Etx2.head<2>().squaredNorm();
  return x2.homogeneous().dot(Ex1) / std::sqrt(std::max(norm2, 1e-18));
}

// The correspondences of a pair in normalised coordinates, with the index of the match behind each.
struct Correspondences {
  std::vector<Eigen::Vector2d> x1, x2;
  std::vector<int> match_idx;
};

Correspondences CollectCorrespondences(const ViewForVerification& view1, const ViewForVerification& view2,
                                       const std::vector<Match>& matches) {
  Correspondences c;
  for (size_t i = 0; i < matches.size(); ++i) {
    const Eigen::Vector2d& x1 = (*view1.rays)[matches[i].idx1];
    const Eigen::Vector2d& x2 = (*view2.rays)[matches[i].idx2];
    if (!x1.allFinite() || !x2.allFinite()) continue;
    c.x1.push_back(x1);
    c.x2.push_back(x2);
    c.match_idx.push_back(static_cast<int>(i));
  }
  return c;
}

// One Gauss-Newton step on sum_i w_i r_i^2 over rotation (left perturbation) and direction of the
// translation, with Cauchy weights of the given scale.  Derivatives are central differences: five columns,
// cheap and exact enough.
Pose RefineStep(const Pose& pose, const Correspondences& c, double scale) {
  const Eigen::Matrix<double, 3, 2> tangent = TangentBasis(pose.translation);
  const auto perturbed = [&](int parameter, double step) {
    Pose p = pose;
    if (parameter < 3) {
      p.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(step, Eigen::Vector3d::Unit(parameter))) * p.rotation;
    } else {
      p.translation = (p.translation + step * tangent.col(parameter - 3)).normalized();
    }
    return EssentialMatrix(p);
  };
  constexpr double kStep = 1e-6;
  const Eigen::Matrix3d E = EssentialMatrix(pose);
  std::array<Eigen::Matrix3d, 5> dE;
  for (int p = 0; p < 5; ++p) dE[p] = (perturbed(p, kStep) - perturbed(p, -kStep)) / (2 * kStep);
  Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Identity() * 1e-12;
  Eigen::Matrix<double, 5, 1> gradient = Eigen::Matrix<double, 5, 1>::Zero();
  for (size_t i = 0; i < c.x1.size(); ++i) {
    const Eigen::Vector3d h1 = c.x1[i].homogeneous(), h2 = c.x2[i].homogeneous();
    const Eigen::Vector3d Ex1 = E * h1, Etx2 = E.transpose() * h2;
    const double inverse_norm =
        1 / std::sqrt(std::max(Ex1.head<2>().squaredNorm() + Etx2.head<2>().squaredNorm(), 1e-18));
    const double residual = h2.dot(Ex1) * inverse_norm;
    const double weight = 1 / (1 + residual * residual / (scale * scale));
    Eigen::Matrix<double, 5, 1> row;  // the change of the norm is of second order near the solution
    for (int p = 0; p < 5; ++p) row[p] = h2.dot(dE[p] * h1) * inverse_norm;
    normal.noalias() += weight * row * row.transpose();
    gradient += weight * residual * row;
  }
  const Eigen::Matrix<double, 5, 1> step = normal.ldlt().solve(-gradient);
  if (!step.allFinite()) return pose;
  Pose refined = pose;
  const double angle = step.head<3>().norm();
  if (angle > 0) {
    refined.rotation =
        (Eigen::Quaterniond(Eigen::AngleAxisd(angle, step.head<3>() / angle)) * pose.rotation).normalized();
  }
  refined.translation = (pose.translation + tangent * step.tail<2>()).normalized();
  return refined;
}

// Relative pose from the stated one; nothing when too few matches agree with it.
std::optional<Eigen::Matrix3d> RefineStatedPose(const Pose& stated, const Correspondences& all,
                                                double focal_px, const VerifyPairOptions& options) {
  Pose pose = stated;
  pose.translation.normalize();
  Correspondences near;
  const Eigen::Matrix3d stated_E = EssentialMatrix(pose);
  const double max_prior_error = options.max_prior_error_px / focal_px;
  for (size_t i = 0; i < all.x1.size(); ++i) {
    if (SquaredSampsonError(stated_E, all.x1[i], all.x2[i]) > max_prior_error * max_prior_error) continue;
    near.x1.push_back(all.x1[i]);
    near.x2.push_back(all.x2[i]);
  }
  if (static_cast<int>(near.x1.size()) < options.min_num_inliers) return std::nullopt;
  // The scale shrinks from a quarter of the prior's error to half of an inlier's.
  for (const double scale_px : {options.max_prior_error_px / 4, options.max_epipolar_error_px,
                                options.max_epipolar_error_px / 2, options.max_epipolar_error_px / 2}) {
    for (int iteration = 0; iteration < 3; ++iteration) pose = RefineStep(pose, near, scale_px / focal_px);
  }
  return EssentialMatrix(pose);
}

std::optional<Eigen::Matrix3d> EstimateEssentialMatrix(const Correspondences& c, double focal_px,
                                                       const VerifyPairOptions& options) {
  if (static_cast<int>(c.x1.size()) < options.min_num_inliers) return std::nullopt;
  std::vector<cv::Point2d> points1, points2;
  for (size_t i = 0; i < c.x1.size(); ++i) {
    points1.emplace_back(c.x1[i].x(), c.x1[i].y());
    points2.emplace_back(c.x2[i].x(), c.x2[i].y());
  }
  cv::UsacParams params;
  params.confidence = 0.999;
  params.maxIterations = 5000;
  params.threshold = options.max_epipolar_error_px / focal_px;
  params.score = cv::SCORE_METHOD_MAGSAC;
  params.sampler = cv::SAMPLING_UNIFORM;
  params.loMethod = cv::LOCAL_OPTIM_SIGMA;
  params.loIterations = 10;
  params.loSampleSize = 50;
  params.randomGeneratorState = 0;
  params.isParallel = false;
  try {
    cv::Mat mask;
    const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
    const cv::Mat E = cv::findEssentialMat(points1, points2, identity, identity, cv::noArray(), cv::noArray(),
                                           mask, params);
    if (E.rows != 3 || E.cols != 3) return std::nullopt;
    Eigen::Matrix3d matrix;
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 3; ++k) matrix(r, k) = E.at<double>(r, k);
    }
    return matrix;
  } catch (const cv::Exception&) {
    return std::nullopt;  // OpenCV's estimator throws on some degenerate sets
  }
}

Eigen::Matrix3d InverseCalibration(const Camera& camera) {
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  K(0, 0) = camera.FocalX();
  K(1, 1) = camera.FocalY();
  K.topRightCorner<2, 1>() = camera.PrincipalPoint();
  return K.inverse();
}

// Homography of the inliers (least squares with a robust start) and how many of them it explains.
int CountHomographyInliers(const Correspondences& c, const std::vector<int>& inliers, double max_error,
                           Eigen::Matrix3d* H) {
  std::vector<cv::Point2d> points1, points2;
  for (const int i : inliers) {
    points1.emplace_back(c.x1[i].x(), c.x1[i].y());
    points2.emplace_back(c.x2[i].x(), c.x2[i].y());
  }
  try {
    cv::Mat mask;
    const cv::Mat h = cv::findHomography(points1, points2, cv::RANSAC, max_error, mask, 500, 0.99);
    if (h.rows != 3) return 0;
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 3; ++k) (*H)(r, k) = h.at<double>(r, k);
    }
    return cv::countNonZero(mask);
  } catch (const cv::Exception&) {
    return 0;
  }
}

}  // namespace

double SquaredSampsonError(const Eigen::Matrix3d& E, const Eigen::Vector2d& x1, const Eigen::Vector2d& x2) {
  const double residual = SampsonResidual(E, x1, x2);
  return residual * residual;
}

TwoViewGeometry VerifyPair(const ViewForVerification& view1, const ViewForVerification& view2,
                           const std::vector<Match>& matches, const VerifyPairOptions& options) {
  TwoViewGeometry geometry;
  geometry.config = TwoViewConfig::kDegenerate;
  const Correspondences c = CollectCorrespondences(view1, view2, matches);
  const double focal_px = 0.5 * (view1.camera->MeanFocal() + view2.camera->MeanFocal());
  const double max_error = options.max_epipolar_error_px / focal_px;

  std::vector<int> inliers;
  if (view1.cam_from_world && view2.cam_from_world) {
    const Pose cam2_from_cam1 = *view2.cam_from_world * view1.cam_from_world->Inverse();
    if (cam2_from_cam1.translation.norm() < kPureRotationBaselineM) {
      // No baseline, no epipolar line: a match must lie where the rotation takes it.
      geometry.config = TwoViewConfig::kPanoramic;
      geometry.H = cam2_from_cam1.rotation.toRotationMatrix();
      for (size_t i = 0; i < c.x1.size(); ++i) {
        const Eigen::Vector3d turned = cam2_from_cam1.rotation * c.x1[i].homogeneous();
        const double error = options.max_prior_error_px / focal_px;
        if (turned.z() > 0 && (turned.hnormalized() - c.x2[i]).norm() <= error)
          inliers.push_back(static_cast<int>(i));
      }
    } else if (const auto E = RefineStatedPose(cam2_from_cam1, c, focal_px, options)) {
      geometry.E = *E;
      geometry.config = TwoViewConfig::kCalibrated;
    }
  } else if (const auto E = EstimateEssentialMatrix(c, focal_px, options)) {
    geometry.E = *E;
    geometry.config = TwoViewConfig::kCalibrated;
  }
  if (geometry.config == TwoViewConfig::kCalibrated) {
    for (size_t i = 0; i < c.x1.size(); ++i) {
      if (SquaredSampsonError(geometry.E, c.x1[i], c.x2[i]) <= max_error * max_error)
        inliers.push_back(static_cast<int>(i));
    }
  }
  if (static_cast<int>(inliers.size()) < options.min_num_inliers) {
    return TwoViewGeometry{.image_id1 = 0, .image_id2 = 0, .config = TwoViewConfig::kDegenerate};
  }
  if (geometry.config == TwoViewConfig::kCalibrated) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    const int num_on_homography = CountHomographyInliers(c, inliers, 2 * max_error, &H);
    if (num_on_homography >= options.min_homography_ratio * static_cast<double>(inliers.size())) {
      geometry.config = TwoViewConfig::kPlanarOrPanoramic;
      geometry.H = H;
    }
  }
  const Eigen::Matrix3d K1_inverse = InverseCalibration(*view1.camera),
                        K2_inverse = InverseCalibration(*view2.camera);
  geometry.F = K2_inverse.transpose() * geometry.E * K1_inverse;
  geometry.H = K2_inverse.inverse() * geometry.H * K1_inverse;
  for (const int i : inliers) geometry.inliers.push_back(matches[c.match_idx[i]]);
  std::sort(geometry.inliers.begin(), geometry.inliers.end());
  return geometry;
}

}  // namespace cairn
