#include "stages/reconstruct/registration/posed_input.h"

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"
#include "core/geometry/two_view_error.h"
#include "core/geometry/vector_geometry.h"

namespace cairn::reconstruct {
namespace {

constexpr int kMinPosedTrackLength = 2;
constexpr double kMinPosedAngleDeg = 1;
// A way this short, beside the scene's unit, leaves no epipolar line.
constexpr double kMinPosedBaseline = 1e-9;

using Bearings = std::vector<std::optional<Eigen::Vector3d>>;

std::vector<Bearings> BearingsOfPosed(const PosedInput& posed, int num_threads) {
  std::vector<Bearings> bearings(posed.input.images.size());
  ParallelFor(static_cast<int64_t>(bearings.size()), num_threads, [&](int64_t i) {
    if (!posed.cam_from_world[i]) return;
    for (const Keypoint& keypoint : posed.input.keypoints[i])
      bearings[i].push_back(BearingFromImage(posed.CameraOf(static_cast<int>(i)), {keypoint.x, keypoint.y}));
  });
  return bearings;
}

// Whether two posed images may see one thing by these keypoints.
class PairOfPosed {
 public:
  PairOfPosed(const PosedInput& posed, int image1, int image2, double max_error_px)
      : cam2_from_cam1_(*posed.cam_from_world[image2] * posed.cam_from_world[image1]->Inverse()),
        tolerance_rad_(max_error_px /
                       std::min(posed.CameraOf(image1).MeanFocal(), posed.CameraOf(image2).MeanFocal())),
        essential_(CrossMatrix(cam2_from_cam1_.translation.normalized()) *
                   cam2_from_cam1_.rotation.toRotationMatrix()) {}

  bool Allows(const Eigen::Vector3d& bearing1, const Eigen::Vector3d& bearing2) const {
    if (cam2_from_cam1_.translation.norm() < kMinPosedBaseline)
      return (cam2_from_cam1_.rotation * bearing1 - bearing2).norm() <= tolerance_rad_;
    return SquaredSampsonError(essential_, bearing1, bearing2) <= tolerance_rad_ * tolerance_rad_ &&
           RaysConverge(cam2_from_cam1_.rotation * bearing1, bearing2, -cam2_from_cam1_.translation,
                        tolerance_rad_);
  }

 private:
  Pose cam2_from_cam1_;
  double tolerance_rad_;
  Eigen::Matrix3d essential_;
};

std::vector<Track> TracksOfPosed(const PosedInput& posed, double max_error_px, int num_threads) {
  const std::vector<Bearings> bearings = BearingsOfPosed(posed, num_threads);
  const std::map<ImageId, int> index = IndexOf(posed.input);
  std::vector<int> num_keypoints;
  for (const auto& keypoints : posed.input.keypoints)
    num_keypoints.push_back(static_cast<int>(keypoints.size()));
  ScoredMatches matches(num_keypoints);
  for (const TwoViewGeometry& geometry : posed.input.geometries) {
    const int image1 = index.at(geometry.image_id1), image2 = index.at(geometry.image_id2);
    if (!posed.cam_from_world[image1] || !posed.cam_from_world[image2]) continue;
    const PairOfPosed pair(posed, image1, image2, max_error_px);
    for (const Match& match : geometry.inliers) {
      const auto& bearing1 = bearings[image1][match.idx1];
      const auto& bearing2 = bearings[image2][match.idx2];
      // Of strong pairs first.
      if (bearing1 && bearing2 && pair.Allows(*bearing1, *bearing2))
        matches.Add({image1, match.idx1}, {image2, match.idx2},
                    static_cast<int32_t>(geometry.inliers.size()));
    }
  }
  int64_t num_conflicts = 0;
  return UnionMatches(std::move(matches), &num_conflicts).value();
}

}  // namespace

SeenPoints TriangulateSeen(const PosedInput& posed, double max_error_px, int num_threads) {
  SeenPoints seen;
  seen.tracks = TracksOfPosed(posed, max_error_px, num_threads);
  seen.triangulations.resize(seen.tracks.size());
  const TriangulateOptions options{.max_reprojection_error_px = max_error_px,
                                   .min_triangulation_angle_deg = kMinPosedAngleDeg,
                                   .min_num_observations = kMinPosedTrackLength};
  ParallelFor(static_cast<int64_t>(seen.tracks.size()), num_threads, [&](int64_t t) {
    std::vector<PosedRay> rays;
    for (const TrackElement& element : seen.tracks[t]) {
      const auto ray = MakePixelRay(posed.CameraOf(element.image_idx), posed.PixelOf(element));
      PixelRay none;
      none.normal.setZero();  // no point is in front of it
      rays.push_back({*posed.cam_from_world[element.image_idx], ray.value_or(none)});
    }
    Triangulation point = Triangulate(rays, options);
    if (point.outcome == TriangulateOutcome::kOk) {
      seen.triangulations[t] = std::move(point);
    } else {
      seen.triangulations[t].inliers.clear();
    }
  });
  for (const auto& keypoints : posed.input.keypoints) seen.track_of.emplace_back(keypoints.size(), -1);
  for (size_t t = 0; t < seen.tracks.size(); ++t) {
    for (const int e : seen.triangulations[t].inliers) {
      const TrackElement& element = seen.tracks[t][e];
      seen.track_of[element.image_idx][element.keypoint_idx] = static_cast<int>(t);
    }
  }
  return seen;
}

}  // namespace cairn::reconstruct
