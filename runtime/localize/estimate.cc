#include "runtime/localize/estimate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <opencv2/calib3d.hpp>

#include "core/base/random.h"
#include "runtime/localize/refine.h"

namespace cairn {
namespace {

constexpr int kSampleSize = 3;
constexpr int kMinNumInliers = 4;

// Squared reprojection error in px, at most `limit`.
double TruncatedError(const PoseMeasurement& measurement, const Eigen::Matrix3d& rotation,
                      const Eigen::Vector3d& translation, double limit) {
  const Eigen::Vector3d x = rotation * measurement.point + translation;
  if (!(x.z() > 0)) return limit;
  const double error =
      (measurement.ray.pixel_from_ray * (x.hnormalized() - measurement.ray.ray)).squaredNorm();
  return error < limit ? error : limit;  // NaN: limit
}

// Sum of truncated errors; stops early once it exceeds `best`.
double Score(const std::vector<PoseMeasurement>& measurements, const Pose& pose, double limit, double best) {
  const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
  double sum = 0;
  for (const PoseMeasurement& measurement : measurements) {
    sum += TruncatedError(measurement, rotation, pose.translation, limit);
    if (sum > best) break;
  }
  return sum;
}

std::vector<int> Inliers(const std::vector<PoseMeasurement>& measurements, const Pose& pose, double limit) {
  const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
  std::vector<int> inliers;
  for (size_t i = 0; i < measurements.size(); ++i) {
    if (TruncatedError(measurements[i], rotation, pose.translation, limit) < limit)
      inliers.push_back(static_cast<int>(i));
  }
  return inliers;
}

std::vector<Pose> SolveThreePoints(const std::vector<PoseMeasurement>& measurements,
                                   const std::array<int, kSampleSize>& sample) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> rays;
  // Relative to the first point: P3P loses digits far from the origin.
  const Eigen::Vector3d origin = measurements[sample[0]].point;
  for (const int i : sample) {
    const Eigen::Vector3d point = measurements[i].point - origin;
    points.emplace_back(point.x(), point.y(), point.z());
    rays.emplace_back(measurements[i].ray.ray.x(), measurements[i].ray.ray.y());
  }
  std::vector<cv::Mat> rotations, translations;
  cv::solveP3P(points, rays, cv::Matx33d::eye(), cv::noArray(), rotations, translations, cv::SOLVEPNP_AP3P);
  std::vector<Pose> poses;
  for (size_t k = 0; k < rotations.size(); ++k) {
    const Eigen::Vector3d rotation(rotations[k].ptr<double>());
    const Eigen::Vector3d translation(translations[k].ptr<double>());
    if (!rotation.allFinite() || !translation.allFinite()) continue;
    Vector6d xi;
    xi << rotation, translation;
    Pose pose = Perturb(Pose(), xi);
    pose.translation -= pose.rotation * origin;
    poses.push_back(pose);
  }
  return poses;
}

std::array<int, kSampleSize> DrawSample(int num_measurements, Random& random) {
  std::array<int, kSampleSize> sample;
  for (int k = 0; k < kSampleSize; ++k) {
    do {
      sample[k] = static_cast<int>(random.UniformInt(0, num_measurements - 1));
    } while (std::find(sample.begin(), sample.begin() + k, sample[k]) != sample.begin() + k);
  }
  return sample;
}

// Number of samples needed so that, with the wanted confidence, one has inliers only.
int NumIterations(size_t num_inliers, size_t num_measurements, const EstimateOptions& options) {
  const double ratio = static_cast<double>(num_inliers) / static_cast<double>(num_measurements);
  const double good = std::pow(ratio, kSampleSize);
  if (good >= 1) return options.min_num_ransac_iterations;
  const double needed = std::log(1 - options.confidence) / std::log1p(-good);
  return static_cast<int>(std::clamp(needed, static_cast<double>(options.min_num_ransac_iterations),
                                     static_cast<double>(options.max_num_ransac_iterations)));
}

std::vector<PoseMeasurement> Select(const std::vector<PoseMeasurement>& measurements,
                                    const std::vector<int>& indices) {
  std::vector<PoseMeasurement> selected;
  selected.reserve(indices.size());
  for (const int i : indices) selected.push_back(measurements[i]);
  return selected;
}

}  // namespace

OptionTable DescribeOptions(EstimateOptions* o) {
  return {
      {.name = "max_error_px",
       .value = &o->max_error_px,
       .help = "largest reprojection error of an inlier, px",
       .min = 1e-3},
      {.name = "confidence",
       .value = &o->confidence,
       .help = "probability of drawing one sample of inliers only",
       .min = 0.01,
       .max = 0.999999},
      {.name = "min_num_ransac_iterations",
       .value = &o->min_num_ransac_iterations,
       .help = "least number of samples",
       .min = 1},
      {.name = "max_num_ransac_iterations",
       .value = &o->max_num_ransac_iterations,
       .help = "most samples",
       .min = 1},
  };
}

std::optional<PoseEstimate> EstimatePose(const std::vector<PoseMeasurement>& measurements,
                                         const EstimateOptions& options, const RefineOptions& refine_options,
                                         uint64_t seed) {
  const int num_measurements = static_cast<int>(measurements.size());
  if (num_measurements < kMinNumInliers) return std::nullopt;
  const double limit = options.max_error_px * options.max_error_px;
  double best_score = limit * num_measurements;
  PoseEstimate best;
  Random random(seed);
  RefineOptions local_options = refine_options;
  local_options.max_num_refine_iterations = 5;
  int num_iterations = std::max(options.min_num_ransac_iterations, options.max_num_ransac_iterations);
  for (best.num_iterations = 0; best.num_iterations < num_iterations; ++best.num_iterations) {
    const auto sample = DrawSample(num_measurements, random);
    for (const Pose& pose : SolveThreePoints(measurements, sample)) {
      double score = Score(measurements, pose, limit, best_score);
      if (score >= best_score) continue;
      Pose local = pose;
      std::vector<int> inliers = Inliers(measurements, pose, limit);
      for (int round = 0; round < 3 && inliers.size() >= kMinNumInliers; ++round) {
        const auto refined = RefinePose(Select(measurements, inliers), local, local_options);
        const double refined_score = refined ? Score(measurements, *refined, limit, score) : score;
        if (!(refined_score < score)) break;
        local = *refined;
        score = refined_score;
        inliers = Inliers(measurements, local, limit);
      }
      best_score = score;
      best.cam_from_world = local;
      best.inliers = std::move(inliers);
      num_iterations = NumIterations(best.inliers.size(), measurements.size(), options);
    }
  }
  if (best.inliers.size() < kMinNumInliers) return std::nullopt;
  return best;
}

}  // namespace cairn
