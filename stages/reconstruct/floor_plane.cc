#include "stages/reconstruct/floor_plane.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>

#include "core/base/quantiles.h"
#include "core/base/random.h"
#include "core/geometry/pose.h"
#include "stages/reconstruct/align.h"

namespace cairn::reconstruct {
namespace {

constexpr int kNumSamples = 500;
constexpr uint64_t kFloorSeed = 1;
constexpr double kMaxSlopeDeg = 15;
// A point is on a plane within this part of the cameras' height over it; another plane is at least so many of
// these away.
constexpr double kThicknessRatio = 0.05, kMinStepThicknesses = 3;
constexpr size_t kMinNumPoints = 50;
constexpr size_t kMinNumCameras = 5;
constexpr int kMinNumPointsOfCamera = 5;
// Of the points below the cameras: so many at least are the floor's, and so many at most below it.  A second
// plane below it with so many of its points is one that could be the floor, too.
constexpr double kMinOnFloorRatio = 0.05, kMaxBelowRatio = 0.2, kRivalRatio = 0.2;
// A floor has so many times as many points as the space of its thickness above it, where walls have as many.
constexpr double kMinStandsOut = 1.5;
// The cameras' heights: largest spread, and how many in a row see the same floor.
constexpr double kMaxSpreadRatio = 0.1, kMinSigmaRatio = 0.005, kNumOfOneFloor = 10;
// Cameras whose places leave less than this of their way beside a plane moved over one.
constexpr double kFlatRatio = 0.1, kLineRatio = 0.05;

struct Plane {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  double offset = 0;  // up . x on it
  double height = 0;  // the cameras' median over it
  std::vector<int> points;
};

class FloorFinder {
 public:
  FloorFinder(const std::vector<SeenPoint>& points, const std::vector<Eigen::Vector3d>& centers,
              const Eigen::Vector3d& up)
      : points_(points), centers_(centers), up_(LevelOf(centers, up)) {
    for (size_t i = 0; i < points.size(); ++i) {
      const bool is_below = std::all_of(points[i].cameras.begin(), points[i].cameras.end(), [&](int camera) {
        return up_.dot(centers[camera] - points[i].position) > 0;
      });
      if (is_below && !points[i].cameras.empty()) below_.push_back(static_cast<int>(i));
    }
  }

  Result<FloorPlane> Find() const {
    if (below_.size() < kMinNumPoints) {
      return MakeError(ErrorCode::kNoData,
                       "{} of {} points lie below the cameras that see them, of which a floor needs {}: they "
                       "look too far up, or it has no texture",
                       below_.size(), points_.size(), kMinNumPoints);
    }
    const std::optional<Plane> floor = BestPlane(below_);
    const size_t num_needed =
        std::max(kMinNumPoints, static_cast<size_t>(kMinOnFloorRatio * static_cast<double>(below_.size())));
    if (!floor || floor->points.size() < num_needed) {
      return MakeError(
          ErrorCode::kNoData,
          "of {} points below the cameras at most {} lie on one level plane, and a floor needs {}",
          below_.size(), floor ? floor->points.size() : 0, num_needed);
    }
    const auto num_above = static_cast<size_t>(std::count_if(below_.begin(), below_.end(), [&](int i) {
      const double over = floor->up.dot(points_[i].position) - floor->offset;
      const double thickness = kThicknessRatio * floor->height;
      return over > thickness && over <= 3 * thickness;
    }));
    if (static_cast<double>(floor->points.size()) < kMinStandsOut * static_cast<double>(num_above)) {
      return MakeError(
          ErrorCode::kNoData,
          "of {} points below the cameras {} lie on the level plane with most of them, and as many as "
          "{} as near above it: it does not stand out",
          below_.size(), floor->points.size(), num_above);
    }
    if (const Status status = CheckBelow(*floor); !status.ok()) return status.error();
    return Measure(*floor);
  }

 private:
  // Up of the plane that the cameras moved over, if they did and it is nearly level; else `up`.
  static Eigen::Vector3d LevelOf(const std::vector<Eigen::Vector3d>& centers, const Eigen::Vector3d& up) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& center : centers) mean += center / static_cast<double>(centers.size());
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector3d& center : centers) scatter += (center - mean) * (center - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
    const Eigen::Vector3d extent = solver.eigenvalues().cwiseMax(0).cwiseSqrt();
    Eigen::Vector3d normal = solver.eigenvectors().col(0);
    if (normal.dot(up) < 0) normal = -normal;
    const bool is_plane = extent[0] < kFlatRatio * extent[1] && extent[1] > kLineRatio * extent[2];
    return is_plane && normal.dot(up) > std::cos(RadFromDeg(kMaxSlopeDeg)) ? normal : up;
  }

  double MedianHeight(const Eigen::Vector3d& up, double offset) const {
    std::vector<double> heights;
    for (const Eigen::Vector3d& center : centers_) heights.push_back(up.dot(center) - offset);
    return Median(heights);
  }

  // The plane through a place, with those of the candidates that lie on it; none where it is not level, or
  // not below the cameras.
  std::optional<Plane> PlaneAt(const Eigen::Vector3d& normal, const Eigen::Vector3d& place,
                               const std::vector<int>& candidates) const {
    Plane plane;
    plane.up = normal.dot(up_) < 0 ? Eigen::Vector3d(-normal) : normal;
    if (plane.up.dot(up_) < std::cos(RadFromDeg(kMaxSlopeDeg))) return std::nullopt;
    plane.offset = plane.up.dot(place);
    plane.height = MedianHeight(plane.up, plane.offset);
    if (!(plane.height > 0)) return std::nullopt;
    for (const int i : candidates) {
      if (std::abs(plane.up.dot(points_[i].position) - plane.offset) <= kThicknessRatio * plane.height)
        plane.points.push_back(i);
    }
    return plane;
  }

  std::optional<Plane> Refit(const Plane& plane, const std::vector<int>& candidates) const {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const int i : plane.points) mean += points_[i].position / static_cast<double>(plane.points.size());
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const int i : plane.points)
      scatter += (points_[i].position - mean) * (points_[i].position - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
    return PlaneAt(solver.eigenvectors().col(0), mean, candidates);
  }

  // That with most points; the first of equals.
  std::optional<Plane> BestPlane(const std::vector<int>& candidates) const {
    if (candidates.size() < 3) return std::nullopt;
    Random random(kFloorSeed);
    std::optional<Plane> best;
    for (int sample = 0; sample < kNumSamples; ++sample) {
      std::array<Eigen::Vector3d, 3> corners;
      for (Eigen::Vector3d& corner : corners)
        corner = points_[candidates[random.UniformInt(0, std::ssize(candidates) - 1)]].position;
      const Eigen::Vector3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
      if (!(normal.norm() > 0)) continue;
      std::optional<Plane> plane = PlaneAt(normal.normalized(), corners[0], candidates);
      if (plane && (!best || plane->points.size() > best->points.size())) best = std::move(plane);
    }
    for (int round = 0; round < 3 && best && best->points.size() >= 3; ++round) {
      std::optional<Plane> refit = Refit(*best, candidates);
      if (!refit || refit->points.size() < best->points.size()) break;
      best = std::move(refit);
    }
    return best;
  }

  // Whether nothing that could be the floor lies below it.
  Status CheckBelow(const Plane& floor) const {
    std::vector<int> lower;
    for (const int i : below_) {
      const double over = floor.up.dot(points_[i].position) - floor.offset;
      if (over < -kMinStepThicknesses * kThicknessRatio * floor.height) lower.push_back(i);
    }
    const std::optional<Plane> rival = BestPlane(lower);
    const auto num_on_floor = static_cast<double>(floor.points.size());
    if (rival && rival->points.size() >= kMinNumPoints &&
        static_cast<double>(rival->points.size()) >= kRivalRatio * num_on_floor) {
      return MakeError(
          ErrorCode::kNoData,
          "two level planes lie below the cameras, one with {} points, and one {:.2f} times as far "
          "down with {}: which is the floor is not clear",
          floor.points.size(), rival->height / floor.height, rival->points.size());
    }
    if (static_cast<double>(lower.size()) > kMaxBelowRatio * static_cast<double>(below_.size())) {
      return MakeError(
          ErrorCode::kNoData,
          "the plane with most points below the cameras ({}) has {} points below itself: it is not "
          "the floor",
          floor.points.size(), lower.size());
    }
    return Ok();
  }

  Result<FloorPlane> Measure(const Plane& floor) const {
    std::vector<std::vector<double>> seen_by(centers_.size());
    for (const int i : floor.points) {
      for (const int camera : points_[i].cameras)
        seen_by[camera].push_back(floor.up.dot(centers_[camera] - points_[i].position));
    }
    FloorPlane found{.up = floor.up, .num_points = static_cast<int>(floor.points.size())};
    for (size_t camera = 0; camera < seen_by.size(); ++camera) {
      if (std::ssize(seen_by[camera]) < kMinNumPointsOfCamera) continue;
      found.cameras.push_back(static_cast<int>(camera));
      found.heights.push_back(Median(seen_by[camera]));
    }
    if (found.cameras.size() < kMinNumCameras) {
      return MakeError(ErrorCode::kNoData,
                       "{} cameras see {} points of the floor each, {} cameras at least are needed",
                       found.cameras.size(), kMinNumPointsOfCamera, kMinNumCameras);
    }
    found.height = Median(found.heights);
    std::vector<double> deviations;
    for (const double height : found.heights) deviations.push_back(std::abs(height / found.height - 1));
    const double spread_ratio = kSigmaOfMad * Median(deviations);
    if (spread_ratio > kMaxSpreadRatio) {
      return MakeError(
          ErrorCode::kNoData,
          "the cameras' heights over the floor differ by {:.0f} %, at most {:.0f} % are a camera at "
          "one height",
          100 * spread_ratio, 100 * kMaxSpreadRatio);
    }
    const double num_apart = std::max(1.0, static_cast<double>(found.cameras.size()) / kNumOfOneFloor);
    found.sigma_ratio = std::max(kMinSigmaRatio, kSigmaOfMedian * spread_ratio / std::sqrt(num_apart));
    return found;
  }

  const std::vector<SeenPoint>& points_;
  const std::vector<Eigen::Vector3d>& centers_;
  Eigen::Vector3d up_;
  std::vector<int> below_;  // points below all cameras that see them
};

}  // namespace

Result<FloorPlane> FindFloor(const std::vector<SeenPoint>& points,
                             const std::vector<Eigen::Vector3d>& camera_centers, const Eigen::Vector3d& up) {
  return FloorFinder(points, camera_centers, up).Find();
}

}  // namespace cairn::reconstruct
