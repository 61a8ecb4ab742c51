#include "stages/reconstruct/view_graph/image_motion.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "core/base/quantiles.h"
#include "stages/reconstruct/view_graph/average_rotations.h"

namespace cairn::reconstruct {
namespace {

// Pairs of so many matches tell whether a motion is right.
constexpr size_t kMinNumTestMatches = 50;
// A turn that differs by more, and by more than this part of it, is another one.
constexpr double kMaxErrorDeg = 5, kMaxErrorOfTurn = 0.5;
// Directions of pairs are not as sure as their turns.
constexpr double kMaxDirectionErrorDeg = 45;
constexpr int kMinNumTestedMotions = 5;
// A way longer than this many typical ones is a jump.
constexpr double kMaxWays = 10;
constexpr double kWeight = 0.3;

Pose Inverted(const Pose& pose, bool inverted) { return inverted ? pose.Inverse() : pose; }

double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return DegFromRad(std::atan2(a.cross(b).norm(), a.dot(b)));
}

// A motion beside the pair of the same images.
struct Tested {
  double turn_error_deg = 0, most_turn_error_deg = 0, direction_error_deg = 0;
  bool moves = false;
};

Tested Test(const ImageMotion& motion, const ViewPair& pair, double median_way_m) {
  const Pose cam2_from_cam1 = Inverted(motion.cam2_from_cam1, pair.image1 != motion.image1);
  Tested tested;
  tested.turn_error_deg = RotationErrorDeg(cam2_from_cam1, pair.cam2_from_cam1);
  tested.direction_error_deg = AngleDeg(cam2_from_cam1.translation, pair.cam2_from_cam1.translation);
  for (const Pose& other : pair.alternatives) {
    tested.turn_error_deg = std::min(tested.turn_error_deg, RotationErrorDeg(cam2_from_cam1, other));
    tested.direction_error_deg =
        std::min(tested.direction_error_deg, AngleDeg(cam2_from_cam1.translation, other.translation));
  }
  tested.most_turn_error_deg =
      std::max(kMaxErrorDeg, kMaxErrorOfTurn * RotationErrorDeg(pair.cam2_from_cam1, Pose()));
  tested.moves = motion.Way().norm() >= median_way_m;
  return tested;
}

}  // namespace

double MedianWayM(const std::vector<ImageMotion>& motions) {
  std::vector<double> ways;
  for (const ImageMotion& motion : motions) ways.push_back(motion.Way().norm());
  return ways.empty() ? 0 : Median(ways);
}

std::string LeaveOutContradicted(const std::vector<ViewPair>& pairs, std::vector<ImageMotion>* motions) {
  std::map<std::pair<int, int>, const ViewPair*> sure_pairs;
  for (const ViewPair& pair : pairs) {
    if (pair.matches.size() >= kMinNumTestMatches) sure_pairs[std::minmax(pair.image1, pair.image2)] = &pair;
  }
  const double median_way_m = MedianWayM(*motions);
  int num_tested = 0, num_wrong_turns = 0;
  std::vector<double> directions;
  std::vector<bool> is_wrong;
  for (const ImageMotion& motion : *motions) {
    is_wrong.push_back(median_way_m > 0 && motion.Way().norm() > kMaxWays * median_way_m);
    if (is_wrong.back()) continue;
    const auto pair = sure_pairs.find(std::minmax(motion.image1, motion.image2));
    if (pair == sure_pairs.end()) continue;
    const Tested tested = Test(motion, *pair->second, median_way_m);
    ++num_tested;
    is_wrong.back() = tested.turn_error_deg > tested.most_turn_error_deg;
    num_wrong_turns += is_wrong.back() ? 1 : 0;
    if (tested.moves) directions.push_back(tested.direction_error_deg);
  }
  if (num_tested >= kMinNumTestedMotions && 2 * num_wrong_turns > num_tested) {
    motions->clear();
    return fmt::format("on {} of {} steps the camera turned otherwise than the odometry says",
                       num_wrong_turns, num_tested);
  }
  if (std::ssize(directions) >= kMinNumTestedMotions && Median(directions) > kMaxDirectionErrorDeg) {
    const double median_deg = Median(directions);
    motions->clear();
    return fmt::format(
        "the camera moved in another direction than the odometry says, by {:.0f} degrees in the median",
        median_deg);
  }
  size_t m = 0;
  std::erase_if(*motions, [&](const ImageMotion&) { return is_wrong[m++]; });
  return "";
}

std::vector<ViewPair> PairsOf(const std::vector<ImageMotion>& motions) {
  std::vector<ViewPair> pairs;
  for (const ImageMotion& motion : motions) {
    pairs.push_back({.image1 = motion.image1,
                     .image2 = motion.image2,
                     .cam2_from_cam1 = motion.cam2_from_cam1,
                     .alternatives = {},
                     .matches = {},
                     .strength = 0,
                     .weight = kWeight});
  }
  return pairs;
}

}  // namespace cairn::reconstruct
