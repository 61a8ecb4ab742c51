#include "stages/match_features/estimate_models.h"

#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

namespace cairn {
namespace {

constexpr double kMinCosine = 0.5;  // 60 degrees off the axis
// USAC's estimators are written for pixels (one degeneracy test has its threshold in them): perspective
// coordinates are multiplied by a focal length that makes them such.
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

}  // namespace

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

}  // namespace cairn
