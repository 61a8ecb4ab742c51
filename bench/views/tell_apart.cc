// views_tell_apart [--seed N] [--num N] PLAN|hotelN...: robots that a turn about leaves in two places or
// more drive until one is sure: by the next look that n poses ask for (runtime/looks/next_look.h), by the
// planner for the two most probable poses (runtime/paths/disambiguate.h), and at random.  Each robot scans
// every half metre; its laser sees half the view around, as far as 5 m.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "bench/views/scan_places.h"
#include "bench/views/simulated_laser.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/view_regions/derive_views.h"
#include "runtime/beams/plan_rays.h"
#include "runtime/belief/plan_tracker.h"
#include "runtime/looks/next_look.h"
#include "runtime/paths/disambiguate.h"
#include "stages/decompose_views/plan/clean_plan.h"
#include "stages/decompose_views/plan/read_plan.h"

namespace {

using namespace cairn;
using Vec2 = Eigen::Vector2d;

constexpr double kWheelsErr = 0.03;
constexpr double kSure = 0.99, kScanEveryM = 0.5, kRadiusM = 0.2, kMostM = 60, kReplanM = 2;
constexpr std::array<const char*, 3> kPlanners = {"next look of n", "two poses", "at random"};

constexpr SimulatedLaser kLaser{.range_m = 5, .sigma_m = 0.02, .hidden_ratio = 0.05};

bool IsSure(const PoseBelief& belief) {
  return !belief.places().empty() && belief.places()[0].probability >= kSure &&
         IsDetermined(belief.places()[0].covariance);
}

// A robot on its way through a plan.
class Robot {
 public:
  Robot(const PlanSpace& space, const PlanRays& rays, PlanTracker tracker, const PlanarPose& pose,
        uint64_t seed)
      : space_(space), rays_(rays), tracker_(std::move(tracker)), pose_(pose), random_(seed) {
    radius_ = std::min(kRadiusM, 0.9 * space.Clearance(pose.position));
    See();
    // It turns about once, as robots that are lost do.
    for (int i = 0; i < 3; ++i) MoveTo({pose_.position, WrapAngle(pose_.heading_rad + std::numbers::pi / 2)});
  }

  // A way in its frame now, until it is sure, is stopped by a wall or has driven `most_m`; then turns.
  void Follow(const std::vector<Vec2>& path, std::optional<double> heading_rad, double most_m) {
    const PlanarPose start = pose_;
    const double begin = way_;
    for (size_t i = 1; i < path.size(); ++i) {
      const Vec2 target = start.FloorFromRobot(path[i]);
      while ((target - pose_.position).norm() > 1e-6) {
        if (IsDone() || way_ - begin >= most_m) return;
        const Vec2 ahead = target - pose_.position;
        const double step = std::min(kScanEveryM, ahead.norm());
        const Vec2 next = pose_.position + step * ahead.normalized();
        if (!space_.IsFree(pose_.position, next, 0.95 * radius_)) return;
        MoveTo({next, std::atan2(ahead.y(), ahead.x())});
      }
    }
    if (heading_rad && !IsDone()) MoveTo({pose_.position, WrapAngle(start.heading_rad + *heading_rad)});
  }
  // As far as it goes, up to three metres, in any direction.
  void Wander() {
    const double angle = random_.Uniform(-std::numbers::pi, std::numbers::pi);
    const double way = random_.Uniform(0.5, 3);
    Follow({Vec2::Zero(), way * Vec2(std::cos(angle), std::sin(angle))}, std::nullopt, way);
  }

  bool IsDone() const { return IsSure(tracker_.belief()) || way_ >= kMostM; }
  bool IsRightAndSure() const {
    return IsSure(tracker_.belief()) && IsRight(tracker_.belief().places()[0].pose, pose_, 0.5, 10);
  }
  double way() const { return way_; }
  const PoseBelief& belief() const { return tracker_.belief(); }

 private:
  void MoveTo(const PlanarPose& next) {
    const PlanarPose moved = MotionBetween(pose_, next);
    const double way = 1 + random_.Normal(0, kWheelsErr), turn = 1 + random_.Normal(0, kWheelsErr);
    (void)tracker_.Move({way * moved.position, turn * moved.heading_rad});
    way_ += moved.position.norm();
    pose_ = next;
    See();
  }
  void See() { (void)tracker_.SeeScan(SimulatedScan(kLaser, rays_, pose_, &random_)); }

  const PlanSpace& space_;
  const PlanRays& rays_;
  PlanTracker tracker_;
  PlanarPose pose_;
  Random random_;
  double radius_ = 0, way_ = 0;
};

struct Drive {
  double way = 0;
  bool is_sure = false, is_right = false;
  int num_plans = 0, num_without = 0;  // plans made, and those that found no look
  double seconds = 0;                  // of planning
};

Drive DriveUntilSure(const PlanSpace& space, Robot robot, int planner) {
  Drive drive;
  int stuck = 0;
  while (!robot.IsDone()) {
    const double before = robot.way();
    const double begin = Seconds();
    std::vector<Vec2> path;
    std::optional<double> heading;
    const std::vector<PossiblePlace>& places = robot.belief().places();
    if (planner == 0) {
      const auto next =
          PlanNextLook(space, places, nullptr, {.radius_m = kRadiusM, .view_range_m = kLaser.range_m}, 1);
      if (next.ok() && next->outcome == NextLookOutcome::kFound) {
        path = next->path;
        heading = next->heading_rad;
      }
    } else if (planner == 1 && places.size() > 1) {
      const auto plan = PlanDisambiguation(space, places[0].pose, places[1].pose,
                                           {.max_range_m = kLaser.range_m, .radius_m = kRadiusM});
      if (plan.ok() && plan->outcome == DisambiguationOutcome::kFound) {
        for (const Vec2& point : plan->path_a) path.push_back(places[0].pose.RobotFromFloor(point));
        const Vec2 towards =
            places[0].pose.RobotFromFloor(0.5 * (plan->feature_start_a + plan->feature_end_a)) - path.back();
        heading = std::atan2(towards.y(), towards.x());
      }
    }
    if (planner != 2) {
      drive.seconds += Seconds() - begin;
      ++drive.num_plans;
      drive.num_without += path.empty() ? 1 : 0;
    }
    if (path.empty() || stuck > 2) {
      robot.Wander();
      stuck = 0;
    } else {
      robot.Follow(path, heading, kReplanM);
      stuck = robot.way() > before ? 0 : stuck + 1;
    }
  }
  drive.way = robot.way();
  drive.is_sure = IsSure(robot.belief());
  drive.is_right = robot.IsRightAndSure();
  return drive;
}

// Of the mean of the ratios' numerators by that of their denominators: 2.5 and 97.5 % of bootstrap samples.
std::array<double, 2> RatioInterval(const std::vector<double>& above, const std::vector<double>& below) {
  Random random(1);
  std::vector<double> ratios;
  for (int sample = 0; sample < 2000; ++sample) {
    double sum_above = 0, sum_below = 0;
    for (size_t i = 0; i < above.size(); ++i) {
      const auto k = static_cast<size_t>(random.UniformInt(0, std::ssize(above) - 1));
      sum_above += above[k];
      sum_below += below[k];
    }
    ratios.push_back(sum_above / std::max(1e-9, sum_below));
  }
  std::sort(ratios.begin(), ratios.end());
  return {ratios[50], ratios[1949]};
}

using Drives = std::array<std::vector<Drive>, kPlanners.size()>;  // by planner, of the same robots

void PrintDrives(const Drives& drives) {
  std::array<std::vector<double>, kPlanners.size()> ways;
  for (size_t planner = 0; planner < kPlanners.size(); ++planner) {
    for (const Drive& drive : drives[planner]) ways[planner].push_back(drive.way);
  }
  for (size_t planner = 0; planner < kPlanners.size(); ++planner) {
    int right = 0, wrong = 0, unsure = 0, plans = 0, without = 0;
    double sum = 0, seconds = 0;
    for (const Drive& drive : drives[planner]) {
      right += drive.is_right ? 1 : 0;
      wrong += drive.is_sure && !drive.is_right ? 1 : 0;
      unsure += drive.is_sure ? 0 : 1;
      plans += drive.num_plans;
      without += drive.num_without;
      sum += drive.way;
      seconds += drive.seconds;
    }
    std::vector<double> sorted = ways[planner];
    std::sort(sorted.begin(), sorted.end());
    const auto [low_ratio, high_ratio] = RatioInterval(ways[planner], ways[1]);
    std::printf("| | %s | %d, %d, %d | %.1f, %.1f | %.2f to %.2f | %d, %d | %.0f |\n", kPlanners[planner],
                right, wrong, unsure, sorted.empty() ? 0 : sum / static_cast<double>(sorted.size()),
                sorted.empty() ? 0 : sorted[sorted.size() / 2], low_ratio, high_ratio, plans, without,
                plans == 0 ? 0 : 1e3 * seconds / plans);
  }
}

// A corridor with rooms of one kind on both sides; in one of four stands a pillar.
std::string Hotel(uint64_t seed) {
  Random random(seed);
  constexpr int kNumRooms = 10;
  constexpr double kWidth = 4, kDepth = 5, kDoor = 1;
  std::string text = fmt::format("0,-1,0,1\n{0},-1,{0},1\n", kNumRooms * kWidth);
  for (const int side : {-1, 1}) {
    for (int room = 0; room < kNumRooms; ++room) {
      const double x = room * kWidth, near = side * 1.0, far = side * (1.0 + kDepth);
      text += fmt::format("{0},{1},{2},{1}\n", x, near, x + 1) +
              fmt::format("{0},{1},{2},{1}\n", x + 1 + kDoor, near, x + kWidth) +
              fmt::format("{0},{1},{2},{1}\n", x, far, x + kWidth) +
              fmt::format("{0},{1},{0},{2}\n", x, near, far);
      if (room + 1 == kNumRooms) text += fmt::format("{0},{1},{0},{2}\n", x + kWidth, near, far);
      if (random.Uniform() >= 0.25) continue;
      const double px = x + random.Uniform(1, 3), py = side * random.Uniform(2, 5);
      text += fmt::format("{0},{1},{2},{1}\n{2},{1},{2},{3}\n{2},{3},{0},{3}\n{0},{3},{0},{1}\n", px, py,
                          px + 0.4, py + 0.4);
    }
  }
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  uint64_t seed = 1;
  int num = 40;
  std::vector<std::string> paths;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--seed" && i + 1 < argc) {
      seed = std::strtoull(argv[++i], nullptr, 10);
    } else if (argument == "--num" && i + 1 < argc) {
      num = std::atoi(argv[++i]);
    } else {
      paths.push_back(argument);
    }
  }
  std::printf(
      "| plan | planner | sure and right, sure and wrong, not sure after %.0f m | metres: mean, median | of "
      "those "
      "by two poses (95 %%) | plans, without a look | ms a plan |\n|---|---|---|---|---|---|---|\n",
      kMostM);
  Drives all;
  for (const std::string& path : paths) {
    NoProgress progress;
    const auto input = path.starts_with("hotel")
                           ? decompose_views::ParsePlan(Hotel(std::strtoull(&path[5], nullptr, 10)), path)
                           : decompose_views::ReadPlan(path);
    const auto cleaned = input.ok() ? decompose_views::CleanPlan(*input, {}, progress) : input.error();
    if (!cleaned.ok()) {
      std::fprintf(stderr, "%s\n", cleaned.error().message.c_str());
      return 1;
    }
    const auto derived = DeriveViews(cleaned->plan, 0, 4096, progress);
    if (!derived.ok()) {
      std::fprintf(stderr, "%s: %s\n", path.c_str(), derived.error().message.c_str());
      return 1;
    }
    const Views& views = derived->views;
    const PlanSpace space(views);
    const PlanRays rays(views.plan.walls);
    const auto tracker = PlanTracker::Make(views);
    if (!tracker.ok()) {
      std::fprintf(stderr, "%s: %s\n", path.c_str(), tracker.error().message.c_str());
      return 1;
    }
    // Places where one scan leaves several.
    Random random(seed);
    std::vector<Robot> robots;
    int num_tried = 0;
    const Vec2 low = views.plan.Metres(views.plan.low), high = views.plan.Metres(views.plan.high);
    while (std::ssize(robots) < num && num_tried < 20000) {
      const double x = random.Uniform(low.x(), high.x()), y = random.Uniform(low.y(), high.y());
      const PlanarPose pose{{x, y}, random.Uniform(-std::numbers::pi, std::numbers::pi)};
      if (!space.IsFree(pose.position, pose.position, 1.2 * kRadiusM)) continue;
      Random of_scan(seed);
      const ScanView scan = SimulatedScan(kLaser, rays, pose, &of_scan);
      const auto num_met =
          std::count_if(scan.beams.begin(), scan.beams.end(), [](const Beam& beam) { return beam.met; });
      if (num_met < 2 * SimulatedLaser::kNumBeams / 3) continue;
      ++num_tried;
      Robot robot(space, rays, *tracker, pose, seed + static_cast<uint64_t>(num_tried));
      const auto& places = robot.belief().places();
      if (places.empty() || IsSure(robot.belief()) ||
          (places.size() > 1 && places[1].probability < 0.05 && IsDetermined(places[0].covariance)))
        continue;
      robots.push_back(std::move(robot));
    }
    std::printf("| %s | %zu of %d scans left several places | | | | | |\n", path.c_str(), robots.size(),
                num_tried);
    Drives drives;
    for (auto& of_planner : drives) of_planner.resize(robots.size());
    ParallelFor(std::ssize(robots) * std::ssize(kPlanners), 0, [&](int64_t i) {
      const auto planner = static_cast<int>(i % std::ssize(kPlanners));
      const size_t robot = i / kPlanners.size();
      drives[planner][robot] = DriveUntilSure(space, robots[robot], planner);
    });
    PrintDrives(drives);
    for (size_t planner = 0; planner < kPlanners.size(); ++planner)
      all[planner].insert(all[planner].end(), drives[planner].begin(), drives[planner].end());
    std::fflush(stdout);
  }
  std::printf("| all | %zu | | | | | |\n", all[0].size());
  PrintDrives(all);
  return 0;
}
