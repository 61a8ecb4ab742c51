#include "stages/reconstruct/view_graph/view_pairs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "core/base/parallel.h"
#include "core/geometry/estimate_two_view.h"
#include "core/geometry/relative_pose.h"
#include "stages/reconstruct/view_graph/calibrate_from_pairs.h"

namespace cairn::reconstruct {
namespace {

constexpr int kNumRefinements = 8;
// Relative poses with costs within this ratio of the least explain the matches as well; they are different
// from this angle on.
constexpr double kAsGoodRatio = 1.2, kSameRotationDeg = 3;

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
    const auto is_same = [&pose = pose](const Pose& other) {
      return RotationErrorDeg(pose, other) < kSameRotationDeg;
    };
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
