#include "runtime/laser/found_interpretations.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/geometry/pose.h"
#include "runtime/laser/rank_interpretations.h"

namespace cairn {

using Vec2 = Eigen::Vector2d;

double FoundInterpretations::Misfit(const Interpretation& found, int segment, LabelIdx label) const {
  const ScanSegment& seen = segments_[segment];
  const Vec2 start = LabelStart(plan_, label), end = LabelEnd(plan_, label);
  const double length = (end - start).norm();
  const Vec2 along = (end - start) / length, normal(-along.y(), along.x());
  const double angle = WrapAngle(std::atan2(along.y(), along.x()) - seen.Angle() - found.pose.heading_rad);
  const double angle_sigma = std::hypot(seen.sigma_angle_rad, std::sqrt(found.covariance(2, 2)));
  const double angle_misfit =
      std::abs(angle) / (options_.num_sigmas * angle_sigma + RadFromDeg(options_.angle_tolerance_deg));
  if (angle_misfit > 1) return angle_misfit;
  const Vec2 middle = found.pose.FloorFromRobot(seen.Middle()), arm = middle - found.pose.position;
  const auto allowed = [&](const Vec2& direction) {
    const Eigen::Vector3d row(direction.x(), direction.y(), direction.dot(Vec2(-arm.y(), arm.x())));
    const double variance = row.dot(found.covariance * row) + std::pow(seen.sigma_offset_m, 2);
    return options_.num_sigmas * std::sqrt(variance) + options_.position_tolerance_m;
  };
  const double offset = std::abs(normal.dot(middle - start)) / allowed(normal);
  const double half = 0.5 * seen.Length(), place = along.dot(middle - start);
  const double beyond =
      std::max({0.0, half - place, place + half - length}) / (allowed(along) + options_.length_tolerance_m);
  return std::max({angle_misfit, offset, beyond});
}

bool FoundInterpretations::IsSeen(const Interpretation& found, int segment) const {
  const ScanSegment& seen = segments_[segment];
  for (double share = 0.1; share < 1; share += 0.2) {
    const Vec2 point = found.pose.FloorFromRobot(seen.start + share * (seen.end - seen.start));
    if (SeesPoint(plan_, found.pose, point, 2 * options_.position_tolerance_m)) return true;
  }
  return false;
}

int FoundInterpretations::WorstPairing(const Interpretation& found) const {
  int worst = -1;
  double most = 1;
  for (int segment = 0; segment < static_cast<int>(segments_.size()); ++segment) {
    if (found.labels[segment] < 0) continue;
    const double misfit = IsSeen(found, segment) ? Misfit(found, segment, found.labels[segment])
                                                 : std::numeric_limits<double>::infinity();
    if (misfit > most) {
      most = misfit;
      worst = segment;
    }
  }
  return worst;
}

bool FoundInterpretations::IsInPlan(const Vec2& place) const {
  const Eigen::Array2d low = plan_.Metres(plan_.low).array() - options_.position_tolerance_m,
                       high = plan_.Metres(plan_.high).array() + options_.position_tolerance_m;
  return (place.array() >= low).all() && (place.array() <= high).all();
}

bool FoundInterpretations::Add(const std::vector<LabelIdx>& labels) {
  Interpretation found;
  found.labels = labels;
  const int least = std::max(2, static_cast<int>(segments_.size()) - MaxNumNulls(segments_.size(), options_));
  while (true) {
    FitPose(plan_, segments_, &found);
    if (found.num_matched < least) return false;
    const int worst = found.determined ? WorstPairing(found) : -1;
    if (worst < 0) break;
    found.labels[worst] = -1;
  }
  if (!IsInPlan(found.pose.position)) return false;
  for (Interpretation& other : solutions_) {
    if (other.determined != found.determined ||
        (other.pose.position - found.pose.position).norm() > 2 * options_.position_tolerance_m ||
        std::abs(WrapAngle(other.pose.heading_rad - found.pose.heading_rad)) >
            RadFromDeg(2 * options_.angle_tolerance_deg)) {
      continue;
    }
    if (found.matched_length_m > other.matched_length_m + 1e-6 ||
        (found.matched_length_m > other.matched_length_m - 1e-6 && found.rms_m < other.rms_m)) {
      other = std::move(found);
    }
    return false;
  }
  solutions_.push_back(std::move(found));
  return solutions_.back().rms_m <= options_.position_tolerance_m;
}

bool FoundInterpretations::HasBoth(int a, LabelIdx label_a, int b, LabelIdx label_b) const {
  return std::any_of(solutions_.begin(), solutions_.end(), [&](const Interpretation& found) {
    return found.labels[a] == label_a && found.labels[b] == label_b;
  });
}

std::vector<Interpretation> FoundInterpretations::TakeRanked() {
  RankInterpretations(plan_, segments_, options_, &solutions_);
  std::erase_if(solutions_,
                [&](const Interpretation& found) { return found.rms_m > options_.position_tolerance_m; });
  return std::move(solutions_);
}

}  // namespace cairn
