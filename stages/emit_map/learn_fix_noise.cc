#include "stages/emit_map/learn_fix_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "core/base/parallel.h"
#include "core/base/pooled.h"
#include "core/base/quantiles.h"
#include "core/camera/pixel_ray.h"
#include "runtime/localize/refine.h"

namespace cairn::emit_map {
namespace {

constexpr int kRunLength = 12;
constexpr size_t kMaxNumRuns = 40, kMinNumRuns = 3, kMinNumFixesTried = 20;
constexpr int kMinNumRays = 3;           // of other images, that place a landmark
constexpr size_t kMinNumKeypoints = 40;  // that an image is placed by
// Every one of an image's keypoints, every fourth, and every sixteenth.
constexpr std::array<size_t, 3> kSteps = {1, 4, 16};
constexpr double kMaxScale = 1e5;
constexpr double kNineOfTenOfSix = 10.645;  // of chi-square with 6 degrees of freedom
// Landmarks that other images place worse than this are no landmarks of theirs, m (standard deviation).
constexpr double kMaxSigmaM = 0.2;

// An observation of a landmark, linear in its position.
struct RunSight {
  int image = 0;  // index into Classes::images
  Keypoint keypoint;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
};

// What an image of a left-out run sees, by the number of its keypoints that are used.
struct Tried {
  int run = 0;
  struct Placed {
    double squared_error = 0;  // in units of the covariance of independent keypoints
    double num_inliers = 0;
  };
  std::array<std::vector<Placed>, kSteps.size()> placed;
};

class FixNoiseLearner {
 public:
  FixNoiseLearner(const Classes& classes, const MapRows& rows)
      : images_(classes.images), measured_(images_.size()) {
    for (const Camera& camera : rows.cameras) cameras_[camera.camera_id] = &camera;
    std::map<ImageId, int> image_of_id;
    for (size_t i = 0; i < images_.size(); ++i) image_of_id[images_[i].image_id] = static_cast<int>(i);
    const size_t num_runs = (images_.size() + kRunLength - 1) / kRunLength;
    const size_t step = (num_runs + kMaxNumRuns - 1) / kMaxNumRuns;
    for (size_t run = step / 2; run < num_runs; run += step) is_tried_.insert(static_cast<int>(run));
    std::map<ClassId, const FeatureClass*> class_of_id;
    for (const FeatureClass& feature : classes.classes) class_of_id[feature.class_id] = &feature;
    for (const MapLandmark& landmark : rows.landmarks) {
      const auto feature = class_of_id.find(landmark.class_id);
      if (feature != class_of_id.end()) Measure(*feature->second, image_of_id);
    }
  }

  std::optional<FixNoise> Run(int num_threads) const {
    std::vector<int> images;
    for (size_t i = 0; i < measured_.size(); ++i) {
      if (measured_[i].size() >= kMinNumKeypoints) images.push_back(static_cast<int>(i));
    }
    std::vector<Tried> tried(images.size());
    ParallelFor(static_cast<int64_t>(images.size()), num_threads,
                [&](int64_t i) { tried[i] = Try(images[i]); });
    std::set<int> runs;
    for (const Tried& image : tried) {
      if (!image.placed[0].empty()) runs.insert(image.run);
    }
    if (runs.size() < kMinNumRuns) return std::nullopt;
    return Fit(tried);
  }

 private:
  static int RunOf(int image) { return image / kRunLength; }

  // The measurements that images of tried runs make of a class, placed by the other images.
  void Measure(const FeatureClass& feature, const std::map<ImageId, int>& image_of_id) {
    std::vector<RunSight> sights;
    bool is_wanted = false;
    for (const Observation& observation : feature.observations) {
      const auto image = image_of_id.find(observation.image_id);
      if (image == image_of_id.end()) continue;
      const SurveyImage& row = images_[image->second];
      const auto ray =
          MakePixelRay(*cameras_.at(row.camera_id), {observation.keypoint.x, observation.keypoint.y});
      const Eigen::Vector3d x = row.cam_from_world * feature.position;
      if (!ray || !(ray->normal.dot(x) > 0)) continue;
      const Eigen::Matrix<double, 2, 3> jacobian =
          ray->ResidualByPoint(x) * row.cam_from_world.rotation.toRotationMatrix();
      sights.push_back({image->second, observation.keypoint, jacobian.transpose() * jacobian,
                        jacobian.transpose() * ray->Residual(x)});
      is_wanted = is_wanted || is_tried_.contains(RunOf(image->second));
    }
    if (!is_wanted) return;
    for (const RunSight& sight : sights) {
      if (!is_tried_.contains(RunOf(sight.image))) continue;
      Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
      Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
      int num_rays = 0;
      for (const RunSight& other : sights) {
        if (RunOf(other.image) == RunOf(sight.image)) continue;
        normal += other.normal;
        gradient += other.gradient;
        ++num_rays;
      }
      if (num_rays < kMinNumRays) continue;
      const Eigen::LDLT<Eigen::Matrix3d> factors(normal);
      if (factors.info() != Eigen::Success || !(factors.vectorD().minCoeff() > 0)) continue;
      const Eigen::Matrix3d covariance = factors.solve(Eigen::Matrix3d::Identity());
      if (!(covariance.trace() < kMaxSigmaM * kMaxSigmaM)) continue;
      PoseMeasurement measurement{};
      measurement.point = feature.position - covariance * gradient;
      measurement.point_covariance = covariance;
      measured_[sight.image].emplace_back(measurement, sight.keypoint);
    }
  }

  Tried Try(int image) const {
    const SurveyImage& row = images_[image];
    Features features;
    for (const auto& [measurement, keypoint] : measured_[image]) features.keypoints.push_back(keypoint);
    const Query query = MakeQuery(std::move(features), *cameras_.at(row.camera_id), {});
    PooledVector<PoseMeasurement> all;
    for (size_t i = 0; i < measured_[image].size(); ++i) {
      if (!query.rays[i]) continue;
      all.push_back(measured_[image][i].first);
      all.back().ray = *query.rays[i];
    }
    Tried tried{.run = RunOf(image), .placed = {}};
    for (size_t s = 0; s < kSteps.size(); ++s) {
      for (size_t first = 0; first < std::min<size_t>(2, kSteps[s]); ++first) {
        PooledVector<PoseMeasurement> some;
        for (size_t i = first; i < all.size(); i += kSteps[s]) some.push_back(all[i]);
        if (some.size() < kMinNumKeypoints) continue;
        const auto refined = RefinePoseWithCovariance(some, row.cam_from_world, {});
        if (!refined) continue;
        const Vector6d error = PerturbationBetween(refined->cam_from_world, row.cam_from_world);
        const double squared = error.dot(refined->covariance.ldlt().solve(error));
        if (std::isfinite(squared))
          tried.placed[s].push_back({squared, static_cast<double>(refined->inliers.size())});
      }
    }
    return tried;
  }

  static std::optional<FixNoise> Fit(const std::vector<Tried>& tried) {
    std::vector<FixFactor> factors;
    for (size_t s = 0; s < kSteps.size(); ++s) {
      std::vector<double> squares;
      double num_inliers = 0;
      for (const Tried& image : tried) {
        for (const Tried::Placed& placed : image.placed[s]) {
          squares.push_back(placed.squared_error);
          num_inliers += placed.num_inliers;
        }
      }
      if (squares.size() < kMinNumFixesTried) continue;
      factors.push_back(
          {num_inliers / static_cast<double>(squares.size()), Quantile(squares, 0.9) / kNineOfTenOfSix});
    }
    if (factors.empty()) return std::nullopt;
    return FitFixNoise(factors);
  }

  const std::vector<SurveyImage>& images_;
  std::map<CameraId, const Camera*> cameras_;
  std::set<int> is_tried_;                                                   // runs
  std::vector<std::vector<std::pair<PoseMeasurement, Keypoint>>> measured_;  // per image
};

}  // namespace

FixNoise FitFixNoise(const std::vector<FixFactor>& factors) {
  double sum = 0, sum_x = 0, sum_y = 0, sum_xx = 0, sum_xy = 0;
  for (const FixFactor& at : factors) {
    const double weight = at.num_inliers;
    sum += weight;
    sum_x += weight * at.num_inliers;
    sum_y += weight * at.factor;
    sum_xx += weight * at.num_inliers * at.num_inliers;
    sum_xy += weight * at.num_inliers * at.factor;
  }
  const double spread = sum * sum_xx - sum_x * sum_x;
  double slope = spread > 1e-9 * sum * sum_xx ? std::max(0.0, (sum * sum_xy - sum_x * sum_y) / spread) : 0;
  double scale = (sum_y - slope * sum_x) / sum;
  if (scale < 1) {
    scale = 1;
    slope = std::max(0.0, (sum_xy - sum_x) / sum_xx);
  }
  return {std::round(1e3 * std::min(scale, kMaxScale)) / 1e3,
          std::round(1e5 * std::min(1.0, 2 * slope / scale)) / 1e5};
}

std::optional<FixNoise> LearnFixNoise(const Classes& classes, const MapRows& rows, int num_threads) {
  return FixNoiseLearner(classes, rows).Run(num_threads);
}

}  // namespace cairn::emit_map
