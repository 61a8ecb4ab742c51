#include "runtime/localize/estimate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "core/base/pooled.h"
#include "core/base/random.h"
#include "core/geometry/minimal_pose.h"
#include "core/work/work_budget.h"
#include "runtime/localize/refine.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

constexpr int kMaxSampleSize = 3;
constexpr int kMinNumInliers = 4;

// The cameras of a rig at one of its poses.
class CamerasAt {
 public:
  explicit CamerasAt(const Pose& rig_from_world) : rig_from_world_(rig_from_world) {}

  // Squared reprojection error in px, at most `limit`.  Fast where measurements of one image follow each
  // other.
  double TruncatedError(const PoseMeasurement& measurement, double limit) {
    if (measurement.image != image_ || measurement.row) {
      image_ = measurement.image;
      Turn(measurement.cam_from_rig ? *measurement.cam_from_rig * rig_from_world_ : rig_from_world_);
    }
    const Eigen::Vector3d x = rotation_ * measurement.point + translation_;
    if (!(x.z() > 0)) return limit;
    const double error =
        (measurement.ray.pixel_from_ray * (x.hnormalized() - measurement.ray.ray)).squaredNorm();
    return error < limit ? error : limit;  // NaN: limit
  }

 private:
  void Turn(const Pose& cam_from_world) {
    rotation_ = cam_from_world.rotation.toRotationMatrix();
    translation_ = cam_from_world.translation;
  }

  Pose rig_from_world_;
  int image_ = -1;  // whose camera's these are:
  Eigen::Matrix3d rotation_ = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation_ = Eigen::Vector3d::Zero();
};

// Sum of truncated errors; stops early once it exceeds `best`.
double Score(std::span<const PoseMeasurement> measurements, const Pose& pose, double limit, double best,
             WorkBudget* work) {
  CamerasAt cameras(pose);
  double sum = 0;
  size_t num = 0;
  while (num < measurements.size() && sum <= best) sum += cameras.TruncatedError(measurements[num++], limit);
  Spend(work, Work::kScore, num);
  return sum;
}

PooledVector<int> Inliers(std::span<const PoseMeasurement> measurements, const Pose& pose, double limit) {
  CamerasAt cameras(pose);
  PooledVector<int> inliers;
  inliers.reserve(measurements.size());
  for (size_t i = 0; i < measurements.size(); ++i) {
    if (cameras.TruncatedError(measurements[i], limit) < limit) inliers.push_back(static_cast<int>(i));
  }
  return inliers;
}

using Sample = std::array<int, kMaxSampleSize>;  // indices of measurements

RigRay RayOf(const PoseMeasurement& measurement) {
  const Eigen::Vector3d in_camera = measurement.ray.ray.homogeneous().normalized();
  if (!measurement.cam_from_rig) return {Eigen::Vector3d::Zero(), in_camera};
  return {measurement.cam_from_rig->Center(), measurement.cam_from_rig->rotation.conjugate() * in_camera};
}

// The first N of a sample.
template <size_t N>
std::pair<std::array<RigRay, N>, std::array<Eigen::Vector3d, N>> RaysAndPointsOf(
    std::span<const PoseMeasurement> measurements, const Sample& sample) {
  std::array<RigRay, N> rays;
  std::array<Eigen::Vector3d, N> points;
  for (size_t i = 0; i < N; ++i) {
    rays[i] = RayOf(measurements[sample[i]]);
    points[i] = measurements[sample[i]].point;
  }
  return {rays, points};
}

// The poses that a sample leads to.
MinimalPoses Solve(std::span<const PoseMeasurement> measurements, const Sample& sample, int sample_size,
                   const std::optional<UpMeasurement>& up) {
  if (sample_size == 2) {
    const auto [rays, points] = RaysAndPointsOf<2>(measurements, sample);
    return PosesFromTwoRays(rays, points, up->in_rig, up->in_world);
  }
  const auto [rays, points] = RaysAndPointsOf<3>(measurements, sample);
  const MinimalPoses all = PosesFromThreeRays(rays, points);
  if (!up) return all;
  MinimalPoses upright;
  for (const Pose& pose : all) {
    if (UpErrorInSigmas(*up, pose) <= up->max_sigmas) upright.push_back(pose);
  }
  return upright;
}

Sample DrawSample(int num_measurements, int sample_size, Random& random) {
  Sample sample{};
  for (int k = 0; k < sample_size; ++k) {
    do {
      sample[k] = static_cast<int>(random.UniformInt(0, num_measurements - 1));
    } while (std::find(sample.begin(), sample.begin() + k, sample[k]) != sample.begin() + k);
  }
  return sample;
}

// Number of samples needed so that, with the wanted confidence, one has inliers only.
int NumIterations(size_t num_inliers, size_t num_measurements, int sample_size,
                  const EstimateOptions& options) {
  const double ratio = static_cast<double>(num_inliers) / static_cast<double>(num_measurements);
  const double good = std::pow(ratio, sample_size);
  if (good >= 1) return options.min_num_ransac_iterations;
  const double needed = std::log(1 - options.confidence) / std::log1p(-good);
  return static_cast<int>(std::clamp(needed, static_cast<double>(options.min_num_ransac_iterations),
                                     static_cast<double>(options.max_num_ransac_iterations)));
}

struct ScoredPose {
  PoseEstimate estimate;
  double score = 0;  // sum of truncated errors
};

// The score below which a pose is looked at: better than the last of a full list, and than the best but for
// a quarter of its inliers.
double ScoreNeeded(std::span<const ScoredPose> best, int max_num_poses, double limit, int num_measurements) {
  if (best.empty()) return limit * num_measurements;
  if (static_cast<int>(best.size()) == max_num_poses) return best.back().score;
  constexpr double kMaxFewer = 0.25;
  const double fewer = kMaxFewer * static_cast<double>(best.front().estimate.inliers.size());
  return std::min(limit * num_measurements, best.front().score + limit * std::max(1.0, fewer));
}

// Whether they are of the same matches, most of them.
bool IsSame(std::span<const int> a, std::span<const int> b) {
  return 10 * static_cast<size_t>(NumShared(a, b)) > 9 * std::min(a.size(), b.size());
}

// Puts a pose into a list by score, unless a better one has the same inliers; worse ones with the same leave.
void Insert(ScoredPose pose, int max_num_poses, PooledVector<ScoredPose>* best) {
  const auto is_same = [&](const ScoredPose& other) {
    return IsSame(pose.estimate.inliers, other.estimate.inliers);
  };
  const auto at = std::find_if(best->begin(), best->end(),
                               [&](const ScoredPose& other) { return pose.score < other.score; });
  if (std::any_of(best->begin(), at, is_same)) return;
  best->erase(std::remove_if(at, best->end(), is_same), best->end());
  best->insert(at, std::move(pose));
  if (static_cast<int>(best->size()) > max_num_poses) best->pop_back();
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
      {.name = "max_num_first_poses",
       .value = &o->max_num_first_poses,
       .help = "where few matches agree on a pose: most poses that guided matching follows up",
       .min = 1,
       .max = 100},
  };
}

namespace {

// How far one standard deviation of up moves points in the image.
double UpErrorPx(std::span<const PoseMeasurement> measurements, const UpMeasurement& up) {
  return up.sigma_rad * std::sqrt(std::abs(measurements.front().ray.pixel_from_ray.determinant()));
}

}  // namespace

bool UsesTwoPoints(std::span<const PoseMeasurement> measurements, const std::optional<UpMeasurement>& up,
                   const EstimateOptions& options) {
  return up && !measurements.empty() && UpErrorPx(measurements, *up) <= options.max_error_px;
}

PooledVector<PoseEstimate> EstimatePoses(std::span<const PoseMeasurement> measurements, int max_num_poses,
                                         const EstimateOptions& options, const RefineOptions& refine_options,
                                         uint64_t seed, const std::optional<UpMeasurement>& up,
                                         WorkBudget* work) {
  const int num_measurements = static_cast<int>(measurements.size());
  if (num_measurements < kMinNumInliers) return {};
  // An error of up moves points in the image.  Of those that are inliers all the same, local refinement finds
  // the others; but where it is larger than an inlier's, two points may lead to a wrong pose: every other
  // sample is of three, and where it is much larger, all are.
  constexpr double kMaxErrors = 3;
  const bool is_exact = UsesTwoPoints(measurements, up, options);
  const bool alternates =
      up && !is_exact && UpErrorPx(measurements, *up) <= kMaxErrors * options.max_error_px;
  const int sample_size = is_exact || alternates ? 2 : 3;
  const double limit = options.max_error_px * options.max_error_px;
  PooledVector<ScoredPose> best;  // by score
  Random random(seed);
  RefineOptions local_options = refine_options;
  local_options.max_num_refine_iterations = 5;
  int num_iterations = std::max(options.min_num_ransac_iterations, options.max_num_ransac_iterations);
  int iteration = 0;
  for (; iteration < num_iterations && Spend(work, Work::kSample, 1); ++iteration) {
    const int size = alternates && iteration % 2 == 1 ? 3 : sample_size;
    const Sample sample = DrawSample(num_measurements, size, random);
    for (const Pose& pose : Solve(measurements, sample, size, up)) {
      const double needed = ScoreNeeded(best, max_num_poses, limit, num_measurements);
      double score = Score(measurements, pose, limit, needed, work);
      if (score >= needed) continue;
      Pose local = pose;
      PooledVector<int> inliers = Inliers(measurements, pose, limit);
      for (int round = 0; round < 3 && inliers.size() >= kMinNumInliers; ++round) {
        const auto refined =
            RefinePose(SelectMeasurements(measurements, inliers), local, local_options, up, work);
        const double refined_score = refined ? Score(measurements, *refined, limit, score, work) : score;
        if (!(refined_score < score)) break;
        local = *refined;
        score = refined_score;
        inliers = Inliers(measurements, local, limit);
      }
      Insert({{local, std::move(inliers)}, score}, max_num_poses, &best);
      num_iterations =
          NumIterations(best.front().estimate.inliers.size(), measurements.size(), sample_size, options);
      if (alternates) num_iterations = std::min(2 * num_iterations, options.max_num_ransac_iterations);
    }
  }
  PooledVector<PoseEstimate> poses;
  for (ScoredPose& pose : best) {
    pose.estimate.num_iterations = iteration;
    if (pose.estimate.inliers.size() >= kMinNumInliers) poses.push_back(std::move(pose.estimate));
  }
  return poses;
}

std::optional<PoseEstimate> EstimatePose(std::span<const PoseMeasurement> measurements,
                                         const EstimateOptions& options, const RefineOptions& refine_options,
                                         uint64_t seed, const std::optional<UpMeasurement>& up,
                                         WorkBudget* work) {
  PooledVector<PoseEstimate> poses = EstimatePoses(measurements, 1, options, refine_options, seed, up, work);
  if (poses.empty()) return std::nullopt;
  return std::move(poses.front());
}

std::optional<PoseEstimate> EstimateOtherPose(std::span<const PoseMeasurement> measurements,
                                              const PoseEstimate& first, const EstimateOptions& options,
                                              const RefineOptions& refine_options, uint64_t seed,
                                              const std::optional<UpMeasurement>& up, WorkBudget* work) {
  PooledVector<int> indices;
  for (size_t i = 0, next = 0; i < measurements.size(); ++i) {
    if (next < first.inliers.size() && first.inliers[next] == static_cast<int>(i)) {
      ++next;
    } else {
      indices.push_back(static_cast<int>(i));
    }
  }
  auto other =
      EstimatePose(SelectMeasurements(measurements, indices), options, refine_options, seed, up, work);
  if (!other) return std::nullopt;
  for (int& i : other->inliers) i = indices[i];
  return other;
}

}  // namespace cairn
