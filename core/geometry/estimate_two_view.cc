#include "core/geometry/estimate_two_view.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/SVD>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "core/base/random.h"

namespace cairn {
namespace {

constexpr double kMinCosine = 0.5;  // 60 degrees off the axis
// USAC's estimators are written for pixels (one degeneracy test has its threshold in them): perspective
// coordinates are multiplied by a focal length to get pixels.
constexpr double kPixels = 1000;

struct PointPairs {
  std::vector<cv::Point2d> points1, points2;
};

PointPairs PerspectivePoints(const Correspondences& c, double scale) {
  PointPairs pairs;
  for (int i = 0; i < c.size(); ++i) {
    const Eigen::Vector3d &b1 = c.bearings1[i], &b2 = c.bearings2[i];
    if (b1.z() < kMinCosine || b2.z() < kMinCosine) continue;
    pairs.points1.emplace_back(scale * b1.x() / b1.z(), scale * b1.y() / b1.z());
    pairs.points2.emplace_back(scale * b2.x() / b2.z(), scale * b2.y() / b2.z());
  }
  return pairs;
}

cv::UsacParams Params(double threshold, int max_num_iterations) {
  cv::UsacParams params;
  params.confidence = 0.999;
  params.maxIterations = max_num_iterations;
  params.threshold = threshold;
  params.score = cv::SCORE_METHOD_MAGSAC;
  params.sampler = cv::SAMPLING_UNIFORM;
  params.loMethod = cv::LOCAL_OPTIM_SIGMA;
  params.loIterations = 10;
  params.loSampleSize = 50;
  params.randomGeneratorState = 0;
  params.isParallel = false;
  return params;
}

// Runs `estimate`, a call of OpenCV, on at least `min_num_points` pairs of points.
template <typename Estimate>
std::optional<Eigen::Matrix3d> Run(const PointPairs& pairs, size_t min_num_points, Estimate estimate) {
  if (pairs.points1.size() < min_num_points) return std::nullopt;
  try {
    const cv::Mat model = estimate();
    if (model.rows != 3 || model.cols != 3) return std::nullopt;
    Eigen::Matrix3d matrix;
    cv::cv2eigen(model, matrix);
    if (!matrix.allFinite() || matrix.norm() < 1e-12) return std::nullopt;
    return matrix / matrix.norm();
  } catch (const cv::Exception& exception) {
    if (exception.code == cv::Error::StsNoMem) throw std::bad_alloc();
    return std::nullopt;  // OpenCV's estimators throw on some degenerate sets
  }
}

// Chance that one of the samples drawn was free of outliers.
constexpr double kConfidence = 0.999;
constexpr int kSampleSize = 8;

std::optional<Eigen::Matrix3d> FitEightPoints(const PointPairs& pairs, bool is_essential) {
  const auto F = Run(pairs, kSampleSize,
                     [&] { return cv::findFundamentalMat(pairs.points1, pairs.points2, cv::FM_8POINT); });
  if (!F || !is_essential) return F;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(*F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * Eigen::Vector3d(1, 1, 0).asDiagonal() * svd.matrixV().transpose() / std::sqrt(2.0);
}

std::vector<int> SampsonInliers(const Eigen::Matrix3d& M, const Correspondences& c, double max_error_rad) {
  std::vector<int> inliers;
  for (int i = 0; i < c.size(); ++i) {
    if (SquaredSampsonError(M, c.bearings1[i], c.bearings2[i]) <= max_error_rad * max_error_rad)
      inliers.push_back(i);
  }
  return inliers;
}

PointPairs Select(const PointPairs& pairs, const std::vector<int>& indices) {
  PointPairs selected;
  for (const int i : indices) {
    selected.points1.push_back(pairs.points1[i]);
    selected.points2.push_back(pairs.points2[i]);
  }
  return selected;
}

}  // namespace

std::optional<Eigen::Matrix3d> EstimateByEightPoints(const Correspondences& correspondences,
                                                     bool is_essential, const EstimateModelOptions& options) {
  Correspondences ahead;
  for (int i = 0; i < correspondences.size(); ++i) {
    const Eigen::Vector3d &b1 = correspondences.bearings1[i], &b2 = correspondences.bearings2[i];
    if (b1.z() >= kMinCosine && b2.z() >= kMinCosine) ahead.Add(b1, b2, i);
  }
  const PointPairs pairs = PerspectivePoints(ahead, 1);
  if (ahead.size() < kSampleSize) return std::nullopt;
  Random random(0);
  std::optional<Eigen::Matrix3d> best;
  std::vector<int> best_inliers;
  double num_wanted = options.max_num_iterations;
  std::vector<int> sample(ahead.size());
  std::iota(sample.begin(), sample.end(), 0);
  for (int iteration = 0; iteration < num_wanted; ++iteration) {
    for (int i = 0; i < kSampleSize; ++i)
      std::swap(sample[i], sample[random.UniformInt(i, ahead.size() - 1)]);
    // [Booij06 §III] "the standard 3D reconstruction 8-point algorithm", here in RANSAC
    const auto model =
        FitEightPoints(Select(pairs, {sample.begin(), sample.begin() + kSampleSize}), is_essential);
    if (!model) continue;
    std::vector<int> inliers = SampsonInliers(*model, ahead, options.max_error_rad);
    if (inliers.size() <= best_inliers.size()) continue;
    best = model;
    best_inliers = std::move(inliers);
    const double good = std::pow(static_cast<double>(best_inliers.size()) / ahead.size(), kSampleSize);
    if (good > 1e-12)
      num_wanted = std::min(num_wanted, good < 1 ? std::log(1 - kConfidence) / std::log1p(-good) : 0);
  }
  // Estimate again as long as that finds more inliers.
  while (best_inliers.size() > kSampleSize) {
    const auto again = FitEightPoints(Select(pairs, best_inliers), is_essential);
    if (!again) break;
    std::vector<int> inliers = SampsonInliers(*again, ahead, options.max_error_rad);
    if (inliers.size() <= best_inliers.size()) break;
    best = again;
    best_inliers = std::move(inliers);
  }
  return best;
}

std::optional<Eigen::Matrix3d> EstimateEssentialMatrix(const Correspondences& correspondences,
                                                       const EstimateModelOptions& options) {
  const PointPairs pairs = PerspectivePoints(correspondences, 1);
  return Run(pairs, 8, [&] {
    const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
    cv::Mat mask;
    return cv::findEssentialMat(pairs.points1, pairs.points2, identity, identity, cv::noArray(),
                                cv::noArray(), mask,
                                Params(options.max_error_rad, options.max_num_iterations));
  });
}

std::optional<Eigen::Matrix3d> EstimateFundamentalMatrix(const Correspondences& correspondences,
                                                         const EstimateModelOptions& options) {
  const PointPairs pairs = PerspectivePoints(correspondences, kPixels);
  auto F = Run(pairs, 8, [&] {
    cv::Mat mask;
    return cv::findFundamentalMat(pairs.points1, pairs.points2, mask,
                                  Params(options.max_error_rad * kPixels, options.max_num_iterations));
  });
  if (!F) return F;
  const Eigen::Vector3d scale(kPixels, kPixels, 1);
  const Eigen::Matrix3d on_bearings = scale.asDiagonal() * *F * scale.asDiagonal();
  return on_bearings / on_bearings.norm();
}

std::optional<Eigen::Matrix3d> EstimateHomography(const Correspondences& correspondences,
                                                  const EstimateModelOptions& options) {
  const PointPairs pairs = PerspectivePoints(correspondences, kPixels);
  const auto H = Run(pairs, 8, [&] {
    cv::Mat mask;
    return cv::findHomography(pairs.points1, pairs.points2, mask,
                              Params(options.max_error_rad * kPixels, options.max_num_iterations));
  });
  if (!H) return H;
  const Eigen::Vector3d scale(kPixels, kPixels, 1);
  Eigen::Matrix3d on_bearings = scale.cwiseInverse().asDiagonal() * *H * scale.asDiagonal();
  int sign = 0;
  for (int i = 0; i < correspondences.size(); ++i) {
    sign += correspondences.bearings2[i].dot(on_bearings * correspondences.bearings1[i]) > 0 ? 1 : -1;
  }
  return on_bearings / (sign < 0 ? -on_bearings.norm() : on_bearings.norm());
}

std::vector<Pose> PosesFromHomography(const Eigen::Matrix3d& H) {
  std::vector<Pose> poses;
  if (!H.allFinite() || std::abs(H.determinant()) < 1e-12) return poses;
  cv::Mat matrix;
  cv::eigen2cv(Eigen::Matrix3d(H), matrix);
  std::vector<cv::Mat> rotations, translations, normals;
  try {
    cv::decomposeHomographyMat(matrix, cv::Mat::eye(3, 3, CV_64F), rotations, translations, normals);
  } catch (const cv::Exception& exception) {
    if (exception.code == cv::Error::StsNoMem) throw std::bad_alloc();
    return poses;  // as of the other estimators
  }
  for (size_t i = 0; i < rotations.size(); ++i) {
    Eigen::Matrix3d rotation;
    Eigen::Vector3d translation;
    cv::cv2eigen(rotations[i], rotation);
    cv::cv2eigen(translations[i], translation);
    if (!rotation.allFinite() || !(translation.norm() > 1e-9)) continue;
    poses.push_back({Eigen::Quaterniond(rotation).normalized(), translation.normalized()});
  }
  return poses;
}

}  // namespace cairn
