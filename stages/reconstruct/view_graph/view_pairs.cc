#include "stages/reconstruct/view_graph/view_pairs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <Eigen/SVD>

#include "core/base/parallel.h"
#include "core/geometry/estimate_two_view.h"
#include "core/geometry/relative_pose.h"
#include "core/structure/camera_sensitivity.h"

namespace cairn::reconstruct {
namespace {

// Ladder of focal lengths, as parts of the image's longer side.
constexpr double kMinFocalRatio = 0.3, kMaxFocalRatio = 4;
constexpr int kNumFocalSteps = 80, kNumSweeps = 10, kNumRefineSteps = 12;
// Difference of the two singular values over their mean that counts as that of a good pair.
constexpr double kGoodDifference = 0.02;
// What is likely of a focal length before anything is seen: as a part of the longer side, the logarithm's
// standard deviation, and how much that counts beside the pairs' mean cost.  Cameras that turn on the spot or
// walk about have a cost that is lower by 1 to 4 at the right one; one that drives straight ahead has nearly
// the same everywhere.
constexpr double kLikelyFocalRatio = 0.8, kLogSigma = 0.35, kWeightOfLikely = 0.2;
constexpr int kNumRefinements = 8;
// Relative poses with costs within this ratio of the least explain the matches as well; they are different
// from this angle on.
constexpr double kAsGoodRatio = 1.2, kSameRotationDeg = 3;

std::map<ImageId, int> IndexOf(const MapperInput& input) {
  std::map<ImageId, int> index;
  for (size_t i = 0; i < input.images.size(); ++i)
    index.emplace(input.images[i].image_id, static_cast<int>(i));
  return index;
}

Eigen::Matrix3d CalibrationMatrix(double focal, const Eigen::Vector2d& centre) {
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  K(0, 0) = K(1, 1) = focal;
  K(0, 2) = centre.x();
  K(1, 2) = centre.y();
  return K;
}

// A pair with a fundamental matrix, of two cameras.
struct FocalPair {
  const Eigen::Matrix3d* F;
  CameraId camera1, camera2;
  double weight;
};

class FocalSearch {
 public:
  explicit FocalSearch(const MapperInput& input) : cameras_(input.cameras) {
    for (const auto& [camera_id, camera] : cameras_) focals_[camera_id] = camera.MeanFocal();
    const std::map<ImageId, int> index = IndexOf(input);
    for (const TwoViewGeometry& geometry : input.geometries) {
      if (geometry.F.isZero() || geometry.config == TwoViewConfig::kPlanarOrPanoramic) continue;
      const CameraId camera1 = input.images[index.at(geometry.image_id1)].camera_id,
                     camera2 = input.images[index.at(geometry.image_id2)].camera_id;
      if (cameras_.at(camera1).has_focal_prior && cameras_.at(camera2).has_focal_prior) continue;
      pairs_.push_back(
          {&geometry.F, camera1, camera2, std::sqrt(static_cast<double>(geometry.inliers.size()))});
    }
  }

  std::map<CameraId, Camera> Search() {
    for (int sweep = 0; sweep < kNumSweeps; ++sweep) {
      bool changed = false;
      for (auto& [camera_id, camera] : cameras_) {
        if (!camera.has_focal_prior && SearchCamera(camera_id, camera)) changed = true;
      }
      if (!changed || cameras_.size() == 1) break;
    }
    for (auto& [camera_id, camera] : cameras_) {
      if (camera.has_focal_prior) continue;
      const double ratio = focals_[camera_id] / camera.MeanFocal();
      for (int p = 0; p < NumFocals(camera.model); ++p) camera.params[p] *= ratio;
    }
    return cameras_;
  }

 private:
  double Cost(CameraId camera_id, double focal) const {
    double cost = 0, weight = 0;
    for (const FocalPair& pair : pairs_) {
      if (pair.camera1 != camera_id && pair.camera2 != camera_id) continue;
      const auto focal_of = [&](CameraId id) { return id == camera_id ? focal : focals_.at(id); };
      const Eigen::Matrix3d E =
          CalibrationMatrix(focal_of(pair.camera2), cameras_.at(pair.camera2).PrincipalPoint()).transpose() *
          *pair.F * CalibrationMatrix(focal_of(pair.camera1), cameras_.at(pair.camera1).PrincipalPoint());
      const Eigen::Vector3d values = E.jacobiSvd().singularValues();
      const double difference = 2 * (values[0] - values[1]) / std::max(values[0] + values[1], 1e-300);
      cost += pair.weight * std::log1p(difference * difference / (kGoodDifference * kGoodDifference));
      weight += pair.weight;
    }
    const Camera& camera = cameras_.at(camera_id);
    const double from_likely =
        std::log(focal / (kLikelyFocalRatio * std::max(camera.width, camera.height))) / kLogSigma;
    return (weight > 0 ? cost / weight : 0) + kWeightOfLikely * from_likely * from_likely;
  }

  bool SearchCamera(CameraId camera_id, const Camera& camera) {
    const double side = std::max(camera.width, camera.height);
    const double step = std::log(kMaxFocalRatio / kMinFocalRatio) / kNumFocalSteps;
    const auto focal_at = [&](double i) { return side * kMinFocalRatio * std::exp(step * i); };
    double best = -1, least = 0;
    for (int i = 0; i <= kNumFocalSteps; ++i) {
      const double cost = Cost(camera_id, focal_at(i));
      if (best >= 0 && !(cost < least)) continue;
      best = i, least = cost;
    }
    double width = 0.5;
    for (int refine = 0; refine < kNumRefineSteps; ++refine, width *= 0.5) {
      for (const double at : {best - width, best + width}) {
        const double cost = Cost(camera_id, focal_at(at));
        if (cost < least) best = at, least = cost;
      }
    }
    const bool changed = focals_[camera_id] != focal_at(best);
    focals_[camera_id] = focal_at(best);
    return changed;
  }

  std::map<CameraId, Camera> cameras_;
  std::map<CameraId, double> focals_;
  std::vector<FocalPair> pairs_;
};

double CauchyCost(const Eigen::Matrix3d& E, const Correspondences& c, double scale_rad) {
  double cost = 0;
  for (int i = 0; i < c.size(); ++i)
    cost += std::log1p(SquaredSampsonError(E, c.bearings1[i], c.bearings2[i]) / (scale_rad * scale_rad));
  return cost;
}

Eigen::Matrix3d CalibrationOf(const Camera& camera) {
  return CalibrationMatrix(camera.MeanFocal(), camera.PrincipalPoint());
}

double TurnOf(const Pose& pose) { return pose.rotation.angularDistance(Eigen::Quaterniond::Identity()); }

// The relative poses that explain the matches about as well as any, that of the smallest turn first: those to
// which the pair's matrices and five points lead.  A fundamental matrix of points on a plane leads anywhere,
// and a homography to two poses that no match tells apart.
std::vector<Pose> RelativePosesOf(const TwoViewGeometry& geometry, const Camera& camera1,
                                  const Camera& camera2, const Correspondences& c, double max_error_rad) {
  std::vector<Eigen::Matrix3d> starts;
  if (!geometry.E.isZero()) {
    starts.push_back(geometry.E);
  } else {
    // Pixels know nothing of the guess that was made of the focal length.
    if (!geometry.F.isZero() && geometry.config != TwoViewConfig::kPlanarOrPanoramic)
      starts.push_back(CalibrationOf(camera2).transpose() * geometry.F * CalibrationOf(camera1));
    if (const auto E = EstimateEssentialMatrix(c, {.max_error_rad = max_error_rad})) starts.push_back(*E);
  }
  if (!geometry.H.isZero()) {
    const Eigen::Matrix3d H = CalibrationOf(camera2).inverse() * geometry.H * CalibrationOf(camera1);
    for (const Pose& pose : PosesFromHomography(H)) starts.push_back(EssentialMatrix(pose));
  }
  std::vector<std::pair<double, Pose>> found;
  double least = std::numeric_limits<double>::infinity();
  for (const Eigen::Matrix3d& start : starts) {
    const Pose pose =
        RefineRelativePose(PoseFromEssentialMatrix(start, c), c, 0.5 * max_error_rad, kNumRefinements);
    const double cost = CauchyCost(EssentialMatrix(pose), c, 0.25 * max_error_rad);
    found.emplace_back(cost, pose);
    least = std::min(least, cost);
  }
  std::vector<Pose> poses;
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [cost, pose] : found) {
    const auto is_same = [&](const Pose& other) { return RotationErrorDeg(pose, other) < kSameRotationDeg; };
    if (cost <= kAsGoodRatio * least && std::none_of(poses.begin(), poses.end(), is_same))
      poses.push_back(pose);
  }
  std::stable_sort(poses.begin(), poses.end(),
                   [](const Pose& a, const Pose& b) { return TurnOf(a) < TurnOf(b); });
  return poses;
}

std::optional<ViewPair> EstimateViewPair(const TwoViewGeometry& geometry, const Camera& camera1,
                                         const Camera& camera2, const std::vector<Eigen::Vector3d>& bearings1,
                                         const std::vector<Eigen::Vector3d>& bearings2,
                                         const ViewPairOptions& options) {
  Correspondences all;
  for (size_t m = 0; m < geometry.inliers.size(); ++m) {
    const Eigen::Vector3d &a = bearings1[geometry.inliers[m].idx1], &b = bearings2[geometry.inliers[m].idx2];
    if (a.allFinite() && b.allFinite()) all.Add(a, b, static_cast<int>(m));
  }
  if (all.size() < options.min_num_matches) return std::nullopt;
  const double max_error_rad =
      options.max_epipolar_error_px / (0.5 * (camera1.MeanFocal() + camera2.MeanFocal()));
  std::vector<Pose> poses = RelativePosesOf(geometry, camera1, camera2, all, max_error_rad);
  if (poses.empty()) return std::nullopt;
  ViewPair pair;
  pair.cam2_from_cam1 = poses.front();
  pair.alternatives.assign(poses.begin() + 1, poses.end());
  const Eigen::Matrix3d E = EssentialMatrix(pair.cam2_from_cam1);
  for (int i = 0; i < all.size(); ++i) {
    if (SquaredSampsonError(E, all.bearings1[i], all.bearings2[i]) <= max_error_rad * max_error_rad)
      pair.matches.push_back(geometry.inliers[all.match_idx[i]]);
  }
  if (static_cast<int>(pair.matches.size()) < options.min_num_matches) return std::nullopt;
  return pair;
}

void SetStrengths(const MapperInput& input, std::vector<ViewPair>* pairs) {
  std::vector<std::vector<bool>> is_matched(input.images.size());
  for (size_t i = 0; i < is_matched.size(); ++i) is_matched[i].assign(input.keypoints[i].size(), false);
  for (const ViewPair& pair : *pairs) {
    for (const Match& match : pair.matches)
      is_matched[pair.image1][match.idx1] = is_matched[pair.image2][match.idx2] = true;
  }
  std::vector<double> count;
  for (const std::vector<bool>& of_image : is_matched)
    count.push_back(static_cast<double>(std::count(of_image.begin(), of_image.end(), true)));
  for (ViewPair& pair : *pairs)
    pair.strength =
        static_cast<double>(pair.matches.size()) / std::max(count[pair.image1], count[pair.image2]);
}

}  // namespace

void ChooseRotation(const Eigen::Quaterniond& cam2_from_cam1, ViewPair* pair) {
  for (Pose& other : pair->alternatives) {
    if (other.rotation.angularDistance(cam2_from_cam1) <
        pair->cam2_from_cam1.rotation.angularDistance(cam2_from_cam1))
      std::swap(other, pair->cam2_from_cam1);
  }
}

std::map<CameraId, Camera> CalibrateFromPairs(const MapperInput& input) {
  return FocalSearch(input).Search();
}

std::vector<ViewPair> EstimateViewPairs(const MapperInput& input, const std::map<CameraId, Camera>& cameras,
                                        const ViewPairOptions& options, int num_threads, Progress& progress) {
  progress.Begin("relative poses", static_cast<int64_t>(input.geometries.size()), "pairs");
  const std::map<ImageId, int> index = IndexOf(input);
  std::vector<std::vector<Eigen::Vector3d>> bearings(input.images.size());
  ParallelFor(static_cast<int64_t>(input.images.size()), num_threads, [&](int64_t i) {
    const Camera& camera = cameras.at(input.images[i].camera_id);
    for (const Keypoint& keypoint : input.keypoints[i]) {
      const auto bearing = BearingFromImage(camera, {keypoint.x, keypoint.y});
      bearings[i].push_back(bearing ? *bearing : Eigen::Vector3d::Constant(std::nan("")));
    }
  });
  std::vector<std::optional<ViewPair>> estimated(input.geometries.size());
  ParallelFor(static_cast<int64_t>(input.geometries.size()), num_threads, [&](int64_t g) {
    if (progress.Cancelled()) return;
    progress.Advance();
    const TwoViewGeometry& geometry = input.geometries[g];
    const int image1 = index.at(geometry.image_id1), image2 = index.at(geometry.image_id2);
    estimated[g] = EstimateViewPair(geometry, cameras.at(input.images[image1].camera_id),
                                    cameras.at(input.images[image2].camera_id), bearings[image1],
                                    bearings[image2], options);
    if (!estimated[g]) return;
    estimated[g]->image1 = image1;
    estimated[g]->image2 = image2;
  });
  std::vector<ViewPair> pairs;
  for (std::optional<ViewPair>& pair : estimated) {
    if (pair) pairs.push_back(std::move(*pair));
  }
  SetStrengths(input, &pairs);
  progress.End();
  return pairs;
}

}  // namespace cairn::reconstruct
