#include "core/geometry/relative_pose.h"

#include <cmath>

#include <Eigen/Dense>

#include "core/geometry/rotations.h"
#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

// Derivatives of vec(E), column by column, by rotation (left perturbation) and direction of the translation.
Eigen::Matrix<double, 9, 5> EssentialMatrixDerivatives(const Pose& pose,
                                                       const Eigen::Matrix<double, 3, 2>& tangent) {
  const Eigen::Matrix3d R = pose.rotation.toRotationMatrix();
  const Eigen::Matrix3d T = CrossMatrix(pose.translation);
  Eigen::Matrix<double, 9, 5> derivatives;
  for (int p = 0; p < 5; ++p) {
    const Eigen::Matrix3d dE = p < 3 ? Eigen::Matrix3d(T * CrossMatrix(Eigen::Vector3d::Unit(p)) * R)
                                     : CrossMatrix(tangent.col(p - 3)) * R;
    derivatives.col(p) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(dE.data());
  }
  return derivatives;
}

Pose RefineStep(const Pose& pose, const Correspondences& c, double scale_rad) {
  const Eigen::Matrix<double, 3, 2> tangent = TangentBasis(pose.translation);
  const Eigen::Matrix<double, 9, 5> dE = EssentialMatrixDerivatives(pose, tangent);
  const Eigen::Matrix3d E = EssentialMatrix(pose);
  Eigen::Matrix<double, 9, 9> moments = Eigen::Matrix<double, 9, 9>::Zero();
  Eigen::Matrix<double, 9, 1> weighted = Eigen::Matrix<double, 9, 1>::Zero();
  for (int i = 0; i < c.size(); ++i) {
    const Eigen::Vector3d &b1 = c.bearings1[i], &b2 = c.bearings2[i];
    const Eigen::Vector3d normal2 = E * b1, normal1 = E.transpose() * b2;
    const double s = b2.dot(normal2);
    const double gradient2 = std::max(normal1.squaredNorm() + normal2.squaredNorm() - 2 * s * s, 1e-18);
    const double weight = 1 / (1 + s * s / (gradient2 * scale_rad * scale_rad)) / gradient2;
    // The change of the gradient is of second order near the solution: the residual's derivative is that of
    // b2' E b1 = vec(b2 b1')' vec(E) over the gradient.
    Eigen::Matrix<double, 9, 1> outer;
    outer << b2 * b1.x(), b2 * b1.y(), b2 * b1.z();
    moments.selfadjointView<Eigen::Lower>().rankUpdate(outer, weight);
    weighted += weight * s * outer;
  }
  const Eigen::Matrix<double, 5, 5> normal = dE.transpose() * moments.selfadjointView<Eigen::Lower>() * dE +
                                             Eigen::Matrix<double, 5, 5>::Identity() * 1e-12;
  const Eigen::Matrix<double, 5, 1> step = normal.ldlt().solve(-(dE.transpose() * weighted));
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

// How many correspondences lie in front of both cameras, for points lambda1 R b1 + t = lambda2 b2.
int CountInFront(const Eigen::Matrix3d& R, const Eigen::Vector3d& t, const Correspondences& c) {
  int num = 0;
  for (int i = 0; i < c.size(); ++i) {
    const Eigen::Vector3d d1 = R * c.bearings1[i];
    const Eigen::Vector3d& d2 = c.bearings2[i];
    const double cosine = d1.dot(d2);
    const double t1 = d1.dot(t), t2 = d2.dot(t);
    num += cosine * t2 - t1 > 0 && t2 - cosine * t1 > 0 ? 1 : 0;
  }
  return num;
}

}  // namespace

Eigen::Matrix3d EssentialMatrix(const Pose& cam2_from_cam1) {
  return CrossMatrix(cam2_from_cam1.translation.normalized()) * cam2_from_cam1.rotation.toRotationMatrix();
}

Pose RefineRelativePose(const Pose& cam2_from_cam1, const Correspondences& correspondences, double scale_rad,
                        int num_iterations) {
  Pose pose = cam2_from_cam1;
  pose.translation.normalize();
  for (int i = 0; i < num_iterations; ++i) pose = RefineStep(pose, correspondences, scale_rad);
  return pose;
}

Eigen::Quaterniond RefineRotation(const Eigen::Quaterniond& cam2_from_cam1, const Correspondences& c,
                                  double scale_rad, int num_iterations) {
  Eigen::Matrix3d R = cam2_from_cam1.toRotationMatrix();
  for (int iteration = 0; iteration < num_iterations; ++iteration) {
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (int i = 0; i < c.size(); ++i) {
      const double error = SquaredTransferError(R, c.bearings1[i], c.bearings2[i]);
      covariance += c.bearings2[i] * c.bearings1[i].transpose() / (1 + error / (scale_rad * scale_rad));
    }
    R = NearestRotation(covariance);
  }
  return Eigen::Quaterniond(R).normalized();
}

Pose PoseFromEssentialMatrix(const Eigen::Matrix3d& E, const Correspondences& correspondences) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(E, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU(), V = svd.matrixV();
  if (U.determinant() < 0) U = -U;
  if (V.determinant() < 0) V = -V;
  Eigen::Matrix3d W;
  W << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  Pose best;
  int num_best = -1;
  for (const Eigen::Matrix3d& turn : {W, Eigen::Matrix3d(W.transpose())}) {
    const Eigen::Matrix3d R = U * turn * V.transpose();
    for (const double sign : {1.0, -1.0}) {
      const Eigen::Vector3d t = sign * U.col(2);
      const int num = CountInFront(R, t, correspondences);
      if (num <= num_best) continue;
      num_best = num;
      best = {Eigen::Quaterniond(R).normalized(), t};
    }
  }
  return best;
}

}  // namespace cairn
