#include "runtime/beams/pose_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <queue>
#include <tuple>
#include <unordered_map>
#include <utility>

#include <Eigen/Eigenvalues>

#include "runtime/beams/pose_step.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr double kApartM = 0.35, kApartRad = 8 * std::numbers::pi / 180;

// Windows of places with one heading, and what its points can reach there at most.
struct Window {
  int32_t bound = 0;
  int16_t level = 0;
  int16_t heading = 0;
  int32_t column = 0, row = 0;

  // The best last; of equal ones the smallest first, then by place, so that ties never depend on the heap.
  auto Order() const { return std::tuple(bound, -level, -heading, -row, -column); }
  bool operator<(const Window& other) const { return Order() < other.Order(); }
};

// Where an end lies from the place of a pose.
struct EndCell {
  int layer = 0, column = 0, row = 0;
};

// Neighbours this near to an end tell the direction there, if this much narrower than long.
constexpr double kNeighbourM = 0.3, kNarrow = 0.15;
// Of neighbours nearer to each other one will do, metres.
constexpr double kNeighboursApartM = 0.025;

// The direction of what stands where beam `i` ended.
std::optional<double> DirectionAt(const std::vector<Beam>& beams, int i) {
  const Vec2 end = beams[i].End();
  Vec2 sum = Vec2::Zero();  // of offsets from it
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  int num = 1;
  for (const int step : {-1, 1}) {
    Vec2 last = Vec2::Zero();
    for (int k = i + step; k >= 0 && k < std::ssize(beams) && beams[k].met; k += step) {
      const Vec2 offset = beams[k].End() - end;
      if (offset.norm() > kNeighbourM) break;
      if ((offset - last).norm() < kNeighboursApartM) continue;
      last = offset;
      sum += offset;
      squares += offset * offset.transpose();
      ++num;
    }
  }
  if (num < 3) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver((squares - sum * sum.transpose() / num).eval());
  if (solver.eigenvalues()[0] >= kNarrow * kNarrow * solver.eigenvalues()[1]) return std::nullopt;
  return std::atan2(solver.eigenvectors()(1, 1), solver.eigenvectors()(0, 1));
}

// Steps of RefineByEnds, and how far one turns; it ends where one is shorter: metres and radians.
constexpr int kEndSteps = 12;
constexpr double kLargestEndTurn = 0.1, kLeastEndStep = 1e-4;

// Poses found so far, by place.
class ApartPoses {
 public:
  bool IsNear(const PlanarPose& pose) const {
    const auto [x, y] = KeyOf(pose.position);
    for (int64_t dy = -1; dy <= 1; ++dy) {
      for (int64_t dx = -1; dx <= 1; ++dx) {
        const auto found = poses_.find((y + dy) * kRow + x + dx);
        if (found == poses_.end()) continue;
        for (const PlanarPose& other : found->second) {
          if ((other.position - pose.position).norm() < kApartM &&
              std::abs(WrapAngle(other.heading_rad - pose.heading_rad)) < kApartRad)
            return true;
        }
      }
    }
    return false;
  }
  void Add(const PlanarPose& pose) {
    const auto [x, y] = KeyOf(pose.position);
    poses_[y * kRow + x].push_back(pose);
  }

 private:
  static constexpr int64_t kRow = int64_t{1} << 32;
  static std::pair<int64_t, int64_t> KeyOf(const Vec2& place) {
    return {static_cast<int64_t>(std::floor(place.x() / kApartM)),
            static_cast<int64_t>(std::floor(place.y() / kApartM))};
  }
  std::unordered_map<int64_t, std::vector<PlanarPose>> poses_;
};

}  // namespace

std::vector<BeamEnd> EndsApart(const std::vector<Beam>& beams, double apart_m) {
  std::vector<BeamEnd> kept;
  for (int i = 0; i < std::ssize(beams); ++i) {
    if (!beams[i].met) continue;
    const Vec2 place = beams[i].End();
    // The newest first: beams follow each other.
    const bool near = std::any_of(kept.rbegin(), kept.rend(), [&](const BeamEnd& other) {
      return (other.place - place).squaredNorm() < apart_m * apart_m;
    });
    if (!near) kept.push_back({place, DirectionAt(beams, i)});
  }
  return kept;
}

PoseSearchResult SearchPoses(const WallField& field, const std::vector<BeamEnd>& ends,
                             const PoseSearchOptions& options) {
  PoseSearchResult result;
  if (ends.empty()) return result;
  const CellGrid& grid = field.grid();
  const int num_headings = static_cast<int>(std::lround(360 / options.step_deg));
  const double step_rad = 2 * std::numbers::pi / num_headings;
  std::vector<EndCell> cells(static_cast<size_t>(num_headings) * ends.size());
  for (int heading = 0; heading < num_headings; ++heading) {
    const Eigen::Rotation2Dd rotation(heading * step_rad);
    for (size_t i = 0; i < ends.size(); ++i) {
      const Vec2 at = rotation * ends[i].place / grid.cell_m;
      cells[heading * ends.size() + i] = {
          ends[i].along_rad ? WallField::LayerOf(*ends[i].along_rad + heading * step_rad)
                            : WallField::kAllWalls,
          static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y()))};
    }
  }
  std::priority_queue<Window> windows;
  const auto add = [&](int level, int heading, int column, int row, int32_t least) {
    ++result.num_windows;
    int32_t sum = 0;
    const EndCell* cell = &cells[heading * ends.size()];
    for (size_t i = 0; i < ends.size(); ++i)
      sum += field.Best(cell[i].layer, level, column + cell[i].column, row + cell[i].row);
    if (sum >= least && sum > 0)
      windows.push({sum, static_cast<int16_t>(level), static_cast<int16_t>(heading), column, row});
  };
  constexpr int kTop = WallField::kTopLevel;
  for (int heading = 0; heading < num_headings; ++heading) {
    for (int row = 0; row < grid.num_rows; row += 1 << kTop) {
      for (int column = 0; column < grid.num_columns; column += 1 << kTop) add(kTop, heading, column, row, 0);
    }
  }
  ApartPoses apart;
  int32_t least = 0;
  while (!windows.empty()) {
    const Window window = windows.top();
    windows.pop();
    if (window.bound < least) break;
    if (std::ssize(result.poses) == options.max_num_poses) {
      result.complete = false;
      break;
    }
    if (window.level == 0) {
      if (result.poses.empty()) least = static_cast<int32_t>(std::ceil(options.least_share * window.bound));
      const PlanarPose pose{grid.Middle(window.column, window.row), WrapAngle(window.heading * step_rad)};
      if (apart.IsNear(pose)) continue;
      apart.Add(pose);
      result.poses.push_back({pose, window.bound / (255.0 * static_cast<double>(ends.size()))});
      continue;
    }
    if (result.num_windows * std::ssize(ends) > options.max_num_lookups) {
      result.complete = false;
      break;
    }
    const int half = 1 << (window.level - 1);
    for (const int row : {window.row, window.row + half}) {
      for (const int column : {window.column, window.column + half}) {
        if (column < grid.num_columns && row < grid.num_rows)
          add(window.level - 1, window.heading, column, row, least);
      }
    }
  }
  return result;
}

PlanarPose RefineByEnds(const WallField& field, const std::vector<PlanWall>& walls,
                        const std::vector<BeamEnd>& ends, const PlanarPose& pose) {
  PlanarPose refined = pose;
  double band = field.reach_m();
  for (int step = 0; step < kEndSteps; ++step, band = std::max(0.25 * field.reach_m(), 0.8 * band)) {
    PoseStep change(1e-6);
    const Eigen::Rotation2Dd rotation(refined.heading_rad);
    for (const BeamEnd& end : ends) {
      const Vec2 arm = rotation * end.place, at = refined.position + arm;
      const int32_t nearest = field.NearestWall(at);
      if (nearest < 0) continue;
      const PlanWall& wall = walls[nearest];
      const Vec2 along = (wall.end - wall.start).normalized(), normal(-along.y(), along.x());
      const double off = normal.dot(at - wall.start);
      if (std::abs(off) < band) change.Add(TukeyWeight(off, band), off, OffsetRow(normal, arm));
    }
    if (change.Move(band, kLargestEndTurn, &refined) < kLeastEndStep) break;
  }
  return refined;
}

}  // namespace cairn
