#include "runtime/paths/disambiguate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <tuple>
#include <unordered_set>

#include "core/geometry/pose.h"
#include "core/view_regions/derive_views.h"
#include "core/view_regions/nearby_plan.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

// Regions are first derived within so many ranges of the laser.
constexpr double kFirstReach = 1.5;

// A stretch of wall in the robot's frame that only one of two views has.
struct Feature {
  Vec2 start, end;
  double distance;
  bool is_at_a;
};

class Planner {
 public:
  Planner(const PlanSpace& space, const PlanarPose& a, const PlanarPose& b,
          const DisambiguateOptions& options)
      : space_(space), a_(a), b_(b), options_(options) {}

  Result<DisambiguationPlan> Run() {
    DisambiguationPlan plan;
    plan.num_regions = 1;
    // [Simsarian96 §4.2] case 1: the views differ; move closer to the telling feature
    if (const auto feature = Telling(Vec2::Zero())) {
      Fill(1, {Vec2::Zero(), Towards(*feature)}, *feature, &plan);
      return plan;
    }
    // Both are the same pose.
    if (a_.position == b_.position && WrapAngle(a_.heading_rad - b_.heading_rad) == 0) return plan;
    for (const PlanarPose* pose : {&a_, &b_}) {
      if (space_.IsFree(pose->position, pose->position, options_.radius_m)) continue;
      return MakeError(
          ErrorCode::kNoData,
          "the views from both places are the same, and a robot of radius {:g} m does not fit at "
          "({:g}, {:g}): a wall is {:.3f} m away",
          options_.radius_m, pose->position.x(), pose->position.y(), space_.Clearance(pose->position));
    }
    Search(&plan);
    return plan;
  }

 private:
  struct Step {
    double length;
    bool is_around_b;  // whether the region belongs to the search around b, or to that around a
    FaceIdx face;
    Vec2 place;  // in the robot's first frame
    int before;  // step
    int depth;
  };

  // Views in the frame of the robot before it moved, from where it has moved to.
  std::vector<std::pair<Vec2, Vec2>> Seen(const PlanarPose& pose, const Vec2& moved) const {
    std::vector<std::pair<Vec2, Vec2>> seen;
    for (const VisibleStretch& stretch : space_.ViewFrom(pose.FloorFromRobot(moved)))
      seen.push_back({pose.RobotFromFloor(stretch.start), pose.RobotFromFloor(stretch.end)});
    return seen;
  }

  // Nearer, or equally near and first by place: independent of which pose is called a.
  static bool IsBefore(double distance, const Vec2& start, const Feature& other) {
    return std::make_tuple(distance, start.x(), start.y()) <
           std::make_tuple(other.distance, other.start.x(), other.start.y());
  }

  // The longest part of a stretch that the other view lacks, if it is long enough and near enough.
  void Compare(const std::vector<std::pair<Vec2, Vec2>>& view,
               const std::vector<std::pair<Vec2, Vec2>>& other, const Vec2& moved, bool is_at_a,
               std::optional<Feature>* best) const {
    for (const auto& [start, end] : view) {
      const double length = (end - start).norm();
      if (length < options_.min_feature_m) continue;
      const Vec2 along = (end - start) / length, normal(-along.y(), along.x());
      std::vector<std::pair<double, double>> covered;
      for (const auto& [from, to] : other) {
        const Vec2 direction = (to - from).normalized();
        if (along.dot(direction) < std::cos(RadFromDeg(options_.same_wall_deg))) continue;
        const double low = along.dot(from - start), high = along.dot(to - start);
        if (high < 0 || low > length ||
            std::abs(normal.dot(0.5 * (from + to) - start)) > options_.same_wall_m)
          continue;
        covered.push_back({low - options_.same_wall_m, high + options_.same_wall_m});
      }
      std::sort(covered.begin(), covered.end());
      covered.push_back({length, length});
      double at = 0;
      for (const auto& [low, high] : covered) {
        const double gap_end = std::min(low, length);
        if (gap_end - at >= options_.min_feature_m) {
          const Vec2 from = start + at * along, to = start + gap_end * along;
          const double distance = (0.5 * (from + to) - moved).norm();
          if (distance <= options_.max_range_m && (!*best || IsBefore(distance, from, **best)))
            *best = Feature{from, to, distance, is_at_a};
        }
        at = std::max(at, high);
      }
    }
  }

  std::optional<Feature> Telling(const Vec2& moved) const {
    const auto view_a = Seen(a_, moved), view_b = Seen(b_, moved);
    std::optional<Feature> best;
    Compare(view_a, view_b, moved, true, &best);
    Compare(view_b, view_a, moved, false, &best);
    return best;
  }

  bool IsFree(const Vec2& from, const Vec2& to) const {
    return IsFreeAt(a_, from, to) && IsFreeAt(b_, from, to);
  }
  bool IsFreeAt(const PlanarPose& pose, const Vec2& from, const Vec2& to) const {
    const Vec2 end = pose.FloorFromRobot(to);
    return space_.IsFree(pose.FloorFromRobot(from), end, options_.radius_m) && space_.FaceAt(end) >= 0;
  }

  // Straight to one metre before the feature, or as far as the way is free at both poses.
  Vec2 Towards(const Feature& feature) const {
    const Vec2 target = 0.5 * (feature.start + feature.end);
    double share = std::max(0.0, 1 - 1 / std::max(1e-9, target.norm()));
    while (share > 0.02 && !IsFree(Vec2::Zero(), share * target)) share *= 0.8;
    return share > 0.02 ? Vec2(share * target) : Vec2(Vec2::Zero());
  }

  void Search(DisambiguationPlan* plan) {
    const auto key = [&](int i) {
      return std::make_tuple(steps_[i].length, steps_[i].place.x(), steps_[i].place.y(), i);
    };
    const auto later = [&](int i, int k) { return key(i) > key(k); };
    std::priority_queue<int, std::vector<int>, decltype(later)> queue(later);
    std::unordered_set<FaceIdx> done[2];
    for (const bool is_around_b : {false, true}) {
      const PlanarPose& pose = is_around_b ? b_ : a_;
      steps_.push_back({0, is_around_b, space_.FaceAt(pose.position), Vec2::Zero(), -1, 0});
      queue.push(static_cast<int>(steps_.size()) - 1);
    }
    double best_cost = std::numeric_limits<double>::infinity();
    // [Simsarian96 §4.2] best-first in parallel from both poses, to the cheapest pair, not the first
    while (!queue.empty()) {
      const int at = queue.top();
      queue.pop();
      const Step step = steps_[at];
      if (step.length >= best_cost) return;
      if (!done[step.is_around_b].insert(step.face).second) continue;
      if (step.depth > 0) {
        if (plan->num_regions >= options_.max_num_regions) {
          plan->is_best = false;
          if (plan->kind == 0) plan->outcome = DisambiguationOutcome::kGaveUp;
          return;
        }
        ++plan->num_regions;
        const auto feature = Telling(step.place);
        // [Simsarian96 §4.2] the length of the path, plus a measure of the cost of telling the two apart
        const double cost = feature ? step.length + options_.cost_of_distance * feature->distance : best_cost;
        if (cost < best_cost) {
          best_cost = cost;
          // [Simsarian96 §4.2] case 2: a border of the region is crossed; case 3: it is left
          Fill(step.depth == 1 ? 2 : 3, PathTo(at), *feature, plan);
        }
      }
      AddNeighbours(at, done[step.is_around_b], [&](int next) { queue.push(next); });
    }
  }

  // Over the middle of each border to the middle of the region behind it.
  template <typename Push>
  void AddNeighbours(int at, const std::unordered_set<FaceIdx>& done, const Push& push) {
    const Step step = steps_[at];
    const PlanarPose& pose = step.is_around_b ? b_ : a_;
    for (auto* next = space_.NeighboursBegin(step.face); next != space_.NeighboursEnd(step.face); ++next) {
      if (done.contains(next->face)) continue;
      const Vec2 middle = pose.RobotFromFloor(next->middle);
      const Vec2 place = pose.RobotFromFloor(space_.views().Centroid(next->face));
      if (!IsFree(step.place, middle) || !IsFree(middle, place)) continue;
      const double length = step.length + (middle - step.place).norm() + (place - middle).norm();
      steps_.push_back({length, step.is_around_b, next->face, place, at, step.depth + 1});
      push(static_cast<int>(steps_.size()) - 1);
    }
  }

  // Without detours over the middles of regions where the straight way is free.
  std::vector<Vec2> PathTo(int at) const {
    std::vector<Vec2> places;
    for (int i = at; i >= 0; i = steps_[i].before) places.push_back(steps_[i].place);
    std::reverse(places.begin(), places.end());
    return Tightened(places, [&](const Vec2& from, const Vec2& to) { return IsFree(from, to); });
  }

  void Fill(int kind, const std::vector<Vec2>& path, const Feature& feature, DisambiguationPlan* plan) const {
    plan->outcome = DisambiguationOutcome::kFound;
    plan->kind = kind;
    plan->path_a.clear();
    plan->path_b.clear();
    plan->path_length_m = 0;
    for (size_t i = 0; i < path.size(); ++i) {
      plan->path_a.push_back(a_.FloorFromRobot(path[i]));
      plan->path_b.push_back(b_.FloorFromRobot(path[i]));
      if (i > 0) plan->path_length_m += (path[i] - path[i - 1]).norm();
    }
    plan->feature_is_at_a = feature.is_at_a;
    plan->feature_start_a = a_.FloorFromRobot(feature.start);
    plan->feature_end_a = a_.FloorFromRobot(feature.end);
    plan->feature_start_b = b_.FloorFromRobot(feature.start);
    plan->feature_end_b = b_.FloorFromRobot(feature.end);
    plan->distance_m = (0.5 * (feature.start + feature.end) - path.back()).norm();
  }

  const PlanSpace& space_;
  const PlanarPose &a_, &b_;
  const DisambiguateOptions& options_;
  std::vector<Step> steps_;
};

}  // namespace

OptionTable DescribeOptions(DisambiguateOptions* o) {
  return {
      {.name = "min_feature_m",
       .value = &o->min_feature_m,
       .help = "length of wall, seen from one of the places only, that tells them apart, metres",
       .min = 0.01,
       .max = 100},
      {.name = "same_wall_m",
       .value = &o->same_wall_m,
       .help = "walls closer than this look the same, metres",
       .min = 1e-6,
       .max = 10},
      {.name = "same_wall_deg",
       .value = &o->same_wall_deg,
       .help = "walls whose directions differ by less than this look the same, degrees",
       .min = 1e-6,
       .max = 45},
      {.name = "view_range_m",
       .value = &o->max_range_m,
       .help = "range of the laser, metres",
       .min = 0.1,
       .max = 1e4},
      {.name = "radius_m", .value = &o->radius_m, .help = "radius of the robot, metres", .min = 0, .max = 10},
      {.name = "cost_of_distance",
       .value = &o->cost_of_distance,
       .help = "metres of path that count as much as one metre of distance to what tells the places apart",
       .min = 0,
       .max = 1e3},
      {.name = "max_num_regions",
       .value = &o->max_num_regions,
       .help = "most regions to look from, around both poses together, before giving up",
       .min = 1,
       .max = 1e9},
  };
}

Result<DisambiguationPlan> PlanDisambiguation(const PlanSpace& space, const PlanarPose& a,
                                              const PlanarPose& b, const DisambiguateOptions& options) {
  DisambiguateOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  for (const PlanarPose* pose : {&a, &b}) {
    CAIRN_RETURN_IF_ERROR(space.CheckInside(pose->position));
    if (!std::isfinite(pose->heading_rad)) {
      return MakeError(ErrorCode::kInvalidArgument, "the pose at ({:g}, {:g}) has no heading: {:g}",
                       pose->position.x(), pose->position.y(), pose->heading_rad);
    }
  }
  return Planner(space, a, b, options).Run();
}

Result<DisambiguationPlan> PlanDisambiguation(const FloorPlan& plan, const PlanarPose& a, const PlanarPose& b,
                                              const DisambiguateOptions& options, int num_threads,
                                              int64_t memory_mib, Progress& progress) {
  DisambiguateOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  const std::array<Vec2, 2> places = {a.position, b.position};
  for (const Vec2& place : places) {
    if (place.allFinite() && plan.Contains(place)) continue;
    return MakeError(ErrorCode::kInvalidArgument, "the place ({:g}, {:g}) lies in no region of the plan",
                     place.x(), place.y());
  }
  for (double reach_m = kFirstReach * options.max_range_m;; reach_m *= 2) {
    const NearbyPlan near = PlanNear(plan, places, reach_m);
    if (near.walls.size() == plan.walls.size()) break;
    if (near.walls.empty()) continue;
    CAIRN_ASSIGN_OR_RETURN(const DerivedViews derived,
                           DeriveViews(near.plan, num_threads, memory_mib, progress));
    const auto found = PlanDisambiguation(PlanSpace(derived.views), a, b, options);
    if (!found.ok()) return found;
    // The search went no farther than this.
    if (found->outcome == DisambiguationOutcome::kFound && found->is_best &&
        found->path_length_m + options.cost_of_distance * found->distance_m + options.max_range_m <= reach_m)
      return found;
  }
  CAIRN_ASSIGN_OR_RETURN(const DerivedViews derived, DeriveViews(plan, num_threads, memory_mib, progress));
  return PlanDisambiguation(PlanSpace(derived.views), a, b, options);
}

}  // namespace cairn
