#include "stages/reconstruct/registration/place_piece.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/quantiles.h"
#include "core/geometry/rotations.h"
#include "core/geometry/vector_geometry.h"

namespace cairn::reconstruct {
namespace {

// Fixes that hypotheses are made of, and point matches of an image that hypotheses are tried on.
constexpr size_t kMaxNumFixes = 25, kMaxNumTried = 100;
// Images of a hypothesis are at least this far apart, beside the two farthest.
constexpr double kMinPairSpreadRatio = 0.2;
// What more matches of one image add says little.
constexpr int kMaxCounted = 50;
constexpr int kNumNewtonSteps = 10;
constexpr int kNumPlaceRefinements = 3;

// World points in the frame of the piece, as many units of the world as they are: scale * y = R X + t for the
// point y of the piece.
struct PiecePlacement {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  double scale = 1;

  // In the camera's frame, in units of the world.
  Eigen::Vector3d InCamera(const Pose& cam_from_piece, const Eigen::Vector3d& point) const {
    return cam_from_piece.rotation * (rotation * point + translation) + scale * cam_from_piece.translation;
  }
  Pose CamFromWorld(const Pose& cam_from_piece) const {
    return {(cam_from_piece.rotation * Eigen::Quaterniond(rotation)).normalized(),
            cam_from_piece.rotation * translation + scale * cam_from_piece.translation};
  }
  Similarity WorldFromPiece() const {
    return {scale, Eigen::Quaterniond(rotation.transpose()).normalized(),
            -(rotation.transpose() * translation)};
  }
};

bool Agrees(const PiecePlacement& placement, const Pose& cam_from_piece, const PointMatch& match,
            double max_error_px) {
  const Eigen::Vector3d x = placement.InCamera(cam_from_piece, match.position);
  return match.ray.normal.dot(x) > 0 && match.ray.Residual(x).squaredNorm() <= max_error_px * max_error_px;
}

// Evenly spread, at most so many.
std::vector<PointMatch> SomeOf(const std::vector<PointMatch>& matches, size_t max_num) {
  if (matches.size() <= max_num) return matches;
  std::vector<PointMatch> some;
  for (size_t k = 0; k < max_num; ++k) some.push_back(matches[k * matches.size() / max_num]);
  return some;
}

std::vector<int> CountInliers(const Piece& piece, const std::vector<std::vector<PointMatch>>& matches,
                              const PiecePlacement& placement, double max_error_px) {
  std::vector<int> counts;
  for (size_t i = 0; i < matches.size(); ++i) {
    counts.push_back(
        static_cast<int>(std::count_if(matches[i].begin(), matches[i].end(), [&](const PointMatch& match) {
          return Agrees(placement, piece.cam_from_piece[i], match, max_error_px);
        })));
  }
  return counts;
}

int PlaceScore(const std::vector<int>& counts) {
  return std::accumulate(counts.begin(), counts.end(), 0,
                         [](int sum, int count) { return sum + std::min(count, kMaxCounted); });
}

int NumSupported(const std::vector<int>& counts, int min_num_inliers) {
  return static_cast<int>(
      std::count_if(counts.begin(), counts.end(), [&](int count) { return count >= min_num_inliers; }));
}

// One of the poses that an image may have.
struct PossiblePose {
  size_t image = 0;  // of the piece
  Pose cam_from_world;
};

// The placement that puts two images where they may be, turned as the first; the scale of one alone is 1.
PiecePlacement FromTwo(const Piece& piece, const PossiblePose& first, const PossiblePose& second) {
  PiecePlacement placement;
  const Pose& from_piece = piece.cam_from_piece[first.image];
  placement.rotation = (from_piece.rotation.conjugate() * first.cam_from_world.rotation).toRotationMatrix();
  const Eigen::Vector3d center = first.cam_from_world.Center();
  if (first.image != second.image) {
    placement.scale = (second.cam_from_world.Center() - center).norm() /
                      (piece.cam_from_piece[second.image].Center() - from_piece.Center()).norm();
  }
  placement.translation = placement.scale * from_piece.Center() - placement.rotation * center;
  return placement;
}

// Of the images whose fixes are surest.
std::vector<PossiblePose> PossiblePoses(const std::vector<ImageFix>& fixes, int min_num_inliers) {
  std::vector<size_t> sure(fixes.size());
  std::iota(sure.begin(), sure.end(), 0);
  std::erase_if(sure, [&](size_t i) { return fixes[i].num_inliers() < min_num_inliers; });
  std::stable_sort(sure.begin(), sure.end(),
                   [&](size_t a, size_t b) { return fixes[a].num_inliers() > fixes[b].num_inliers(); });
  sure.resize(std::min(sure.size(), kMaxNumFixes));
  std::vector<PossiblePose> poses;
  for (const size_t i : sure) {
    for (const FixedPose& pose : fixes[i].poses) {
      if (pose.num_inliers >= min_num_inliers) poses.push_back({i, pose.cam_from_world});
    }
  }
  return poses;
}

std::vector<PiecePlacement> Hypotheses(const Piece& piece, const std::vector<ImageFix>& fixes,
                                       int min_num_inliers) {
  const std::vector<PossiblePose> poses = PossiblePoses(fixes, min_num_inliers);
  std::vector<PiecePlacement> placements;
  if (piece.images.size() == 1) {
    for (const PossiblePose& pose : poses) placements.push_back(FromTwo(piece, pose, pose));
    return placements;
  }
  const auto distance = [&](const PossiblePose& a, const PossiblePose& b) {
    return (piece.cam_from_piece[a.image].Center() - piece.cam_from_piece[b.image].Center()).norm();
  };
  double farthest = 0;
  for (const PossiblePose& a : poses) {
    for (const PossiblePose& b : poses) farthest = std::max(farthest, distance(a, b));
  }
  if (farthest == 0) return placements;
  for (const PossiblePose& a : poses) {
    for (const PossiblePose& b : poses) {
      if (a.image == b.image || distance(a, b) < kMinPairSpreadRatio * farthest) continue;
      const PiecePlacement placement = FromTwo(piece, a, b);
      if (placement.scale > 0) placements.push_back(placement);
    }
  }
  return placements;
}

// Over the matches that agree, with the images rigid to each other.
PiecePlacement RefinePlace(const Piece& piece, const std::vector<std::vector<PointMatch>>& matches,
                           PiecePlacement placement, double max_error_px) {
  using Vector7 = Eigen::Matrix<double, 7, 1>;
  using Matrix7 = Eigen::Matrix<double, 7, 7>;
  for (int step = 0; step < kNumNewtonSteps; ++step) {
    Matrix7 normal = Matrix7::Zero();
    Vector7 gradient = Vector7::Zero();
    for (size_t i = 0; i < matches.size(); ++i) {
      const Pose& pose = piece.cam_from_piece[i];
      const Eigen::Matrix3d turn = pose.rotation.toRotationMatrix();
      for (const PointMatch& match : matches[i]) {
        if (!Agrees(placement, pose, match, max_error_px)) continue;
        const Eigen::Vector3d x = placement.InCamera(pose, match.position);
        Eigen::Matrix<double, 3, 7> x_by;  // of a turn of R from the left, of t, of the scale
        x_by << -turn * CrossMatrix(placement.rotation * match.position), turn, pose.translation;
        const Eigen::Matrix<double, 2, 7> by = match.ray.ResidualByPoint(x) * x_by;
        const Eigen::Vector2d residual = match.ray.Residual(x);
        const double weight = 1 / (1 + residual.squaredNorm() / (0.25 * max_error_px * max_error_px));
        normal += weight * by.transpose() * by;
        gradient += weight * by.transpose() * residual;
      }
    }
    // A single image says nothing of the scale.
    if (piece.images.size() == 1) normal(6, 6) += 1;
    const Eigen::LDLT<Matrix7> solver(normal);
    if (solver.info() != Eigen::Success || !solver.isPositive()) return placement;
    const Vector7 change = -solver.solve(gradient);
    if (!change.allFinite()) return placement;
    placement.rotation =
        (QuaternionFromVector<double>(change.head<3>()) * Eigen::Quaterniond(placement.rotation))
            .normalized()
            .toRotationMatrix();
    placement.translation += change.segment<3>(3);
    placement.scale += change[6];
  }
  return placement;
}

// How far the cameras see.
double MedianDistance(const std::vector<std::vector<PointMatch>>& matches, const Piece& piece,
                      const PiecePlacement& placement, double max_error_px) {
  std::vector<double> distances;
  for (size_t i = 0; i < matches.size(); ++i) {
    for (const PointMatch& match : matches[i]) {
      if (Agrees(placement, piece.cam_from_piece[i], match, max_error_px))
        distances.push_back(placement.InCamera(piece.cam_from_piece[i], match.position).norm());
    }
  }
  return distances.empty() ? 0 : Median(distances);
}

// Matches that agree with another placement, of images that support one and are elsewhere by the other.
int NumMatchesElsewhere(const Piece& piece, const std::vector<int>& counts_here,
                        const std::vector<int>& counts_there, const PiecePlacement& here,
                        const PiecePlacement& there, double distance, const PlacePieceOptions& options) {
  int num_matches = 0;
  for (size_t i = 0; i < piece.images.size(); ++i) {
    if (counts_here[i] < options.min_num_inliers) continue;
    const Pose a = here.CamFromWorld(piece.cam_from_piece[i]),
               b = there.CamFromWorld(piece.cam_from_piece[i]);
    if (CenterErrorM(a, b) > options.min_shift_ratio * distance ||
        RotationErrorDeg(a, b) > options.min_turn_deg)
      num_matches += std::min(counts_there[i], kMaxCounted);
  }
  return num_matches;
}

}  // namespace

std::optional<PiecePlace> PlacePiece(const Piece& piece, const std::vector<ImageFix>& fixes,
                                     const PlacePieceOptions& options) {
  std::vector<std::vector<PointMatch>> matches, tried;
  for (const ImageFix& fix : fixes) {
    matches.push_back(fix.matches);
    tried.push_back(SomeOf(fix.matches, kMaxNumTried));
  }
  const std::vector<PiecePlacement> hypotheses = Hypotheses(piece, fixes, options.min_num_inliers);
  if (hypotheses.empty()) return std::nullopt;
  std::vector<std::vector<int>> counts;
  size_t best = 0;
  for (size_t h = 0; h < hypotheses.size(); ++h) {
    counts.push_back(CountInliers(piece, tried, hypotheses[h], options.max_error_px));
    if (PlaceScore(counts[h]) > PlaceScore(counts[best])) best = h;
  }
  PiecePlacement placement = hypotheses[best];
  for (int round = 0; round < kNumPlaceRefinements; ++round)
    placement = RefinePlace(piece, matches, placement, options.max_error_px);
  PiecePlace place{.world_from_piece = placement.WorldFromPiece(),
                   .num_inliers = CountInliers(piece, matches, placement, options.max_error_px)};
  place.num_supported = NumSupported(place.num_inliers, options.min_num_inliers);
  const std::vector<int> here = CountInliers(piece, tried, placement, options.max_error_px);
  for (const int count : here)
    if (count >= options.min_num_inliers) place.num_matches += std::min(count, kMaxCounted);
  const double distance = MedianDistance(matches, piece, placement, options.max_error_px);
  for (size_t h = 0; h < hypotheses.size(); ++h) {
    place.num_matches_elsewhere =
        std::max(place.num_matches_elsewhere,
                 NumMatchesElsewhere(piece, here, counts[h], placement, hypotheses[h], distance, options));
  }
  return place;
}

}  // namespace cairn::reconstruct
