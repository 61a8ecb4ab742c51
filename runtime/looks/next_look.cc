#include "runtime/looks/next_look.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <queue>
#include <tuple>

#include <Eigen/Eigenvalues>

#include "core/base/parallel.h"
#include "core/geometry/pose.h"
#include "runtime/beams/plan_rays.h"
#include "runtime/beams/scan_locator.h"
#include "runtime/looks/surveyed_looks.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

// Of a laser, all around; and that a robot may look along.
constexpr int kNumBeams = 192, kNumHeadings = 8;
// What all beams of a sector of 12 degrees speak against a pose that would measure something else there, the
// logarithm of odds: they count as one (ScanLocator).
constexpr double kBySector = 4, kByBeam = kBySector * 30 / kNumBeams;
// An image of another place speaks so much against a pose; and a look rules a pose out that speaks as much.
constexpr double kByImage = 4, kRulesOut = 2;
// A robot that stands nearer to a wall than it is wide keeps this share of its distance.
constexpr double kOfClearance = 0.9;
// First looks of which the way to the end is reckoned: the nearest, and those that leave least.
constexpr int kMaxNumFirstLooks = 40;

// Where a hypothesis is looked at whose place along some direction is not known: its middle first.
constexpr std::array<double, 5> kSpreadSigmas = {0, -0.75, 0.75, -1.5, 1.5};

using Set = uint64_t;  // of hypotheses
constexpr int kMaxInSet = 64;

Set Of(int hypothesis) { return Set{1} << hypothesis; }
bool Has(Set set, int hypothesis) { return (set >> hypothesis & 1) != 0; }

// A place that the robot may get to, in its frame before it moves.
struct Place {
  Vec2 at = Vec2::Zero();
  double length = 0;
  int before = -1;
};

// What is known after a look: for each hypothesis, if it is the right one, those that are left.
struct Look {
  int place = 0;
  double heading_rad = 0;
  std::array<Set, kMaxInSet> left{};
};

// A hypothesis; or, where it is not determined, places along the direction in which it is least known.
std::vector<PossiblePlace> Spread(const PossiblePlace& hypothesis) {
  if (IsDetermined(hypothesis.covariance)) return {hypothesis};
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(
      hypothesis.covariance.topLeftCorner<2, 2>().eval());
  const Vec2 along = std::sqrt(std::max(0.0, solver.eigenvalues()[1])) * solver.eigenvectors().col(1);
  // The heading that goes with it.
  const double variance = std::max(1e-12, solver.eigenvalues()[1]);
  const Vec2 with_heading = hypothesis.covariance.topRightCorner<2, 1>();
  std::vector<PossiblePlace> places;
  double sum = 0;
  for (const double sigmas : kSpreadSigmas) {
    PossiblePlace place = hypothesis;
    place.pose.position += sigmas * along;
    place.pose.heading_rad = WrapAngle(place.pose.heading_rad + sigmas * along.dot(with_heading) / variance);
    place.covariance.setZero();
    place.probability *= std::exp(-0.5 * sigmas * sigmas);
    sum += std::exp(-0.5 * sigmas * sigmas);
    places.push_back(place);
  }
  for (PossiblePlace& place : places) place.probability /= sum;
  return places;
}

class LookPlanner {
 public:
  LookPlanner(const PlanSpace& space, const std::vector<PossiblePlace>& hypotheses,
              const SurveyedLooks* images, const NextLookOptions& options, int num_threads)
      : space_(space),
        rays_(space.views().plan.walls),
        hypotheses_(hypotheses),
        images_(images),
        options_(options),
        num_threads_(num_threads) {}

  NextLook Run() {
    for (const PossiblePlace& hypothesis : hypotheses_) {
      const double clearance = space_.Clearance(hypothesis.pose.position);
      radii_.push_back(std::min(options_.radius_m, kOfClearance * clearance));
    }
    FindPlaces();
    Compare();
    return Choose();
  }

 private:
  int num() const { return static_cast<int>(hypotheses_.size()); }
  PlanarPose RobotAt(int hypothesis, const Vec2& moved) const {
    const PlanarPose& pose = hypotheses_[hypothesis].pose;
    return {pose.FloorFromRobot(moved), pose.heading_rad};
  }

  // Free of walls wherever the robot is.
  bool IsFree(const Vec2& from, const Vec2& to) const {
    for (int i = 0; i < num(); ++i) {
      const PlanarPose& pose = hypotheses_[i].pose;
      if (!space_.IsFree(pose.FloorFromRobot(from), pose.FloorFromRobot(to), radii_[i])) return false;
    }
    return true;
  }

  // Dijkstra over a lattice around the robot, its first place a node of it.
  void FindPlaces() {
    struct Entry {
      double length;
      int column, row, before;
      bool operator>(const Entry& other) const {
        return std::tie(length, row, column, before) >
               std::tie(other.length, other.row, other.column, other.before);
      }
    };
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    std::map<std::pair<int, int>, int> known;  // places, by row and column
    queue.push({0, 0, 0, -1});
    while (!queue.empty()) {
      const Entry entry = queue.top();
      queue.pop();
      if (!known.emplace(std::pair(entry.row, entry.column), static_cast<int>(places_.size())).second)
        continue;
      const Vec2 at = options_.step_m * Vec2(entry.column, entry.row);
      const int index = static_cast<int>(places_.size());
      places_.push_back({at, entry.length, entry.before});
      for (int row = entry.row - 1; row <= entry.row + 1; ++row) {
        for (int column = entry.column - 1; column <= entry.column + 1; ++column) {
          if (known.contains({row, column})) continue;
          const Vec2 next = options_.step_m * Vec2(column, row);
          if (!IsFree(at, next)) continue;
          const double length = entry.length + (next - at).norm();
          if (length > options_.reach_m) {
            has_more_ = true;
          } else {
            queue.push({length, column, row, index});
          }
        }
      }
    }
  }

  // Ranges at each hypothesis, moved.
  std::vector<std::array<double, kNumBeams>> Ranges(const Vec2& moved) const {
    std::vector<std::array<double, kNumBeams>> ranges(hypotheses_.size());
    for (int i = 0; i < num(); ++i) {
      const PlanarPose robot = RobotAt(i, moved);
      for (int k = 0; k < kNumBeams; ++k) {
        const double angle = robot.heading_rad + 2 * std::numbers::pi * k / kNumBeams;
        const PlanRays::Hits hits =
            rays_.Cast(robot.position, {std::cos(angle), std::sin(angle)}, options_.view_range_m);
        ranges[i][k] = hits.size > 0 ? hits.at[0].distance_m : options_.view_range_m;
      }
    }
    return ranges;
  }

  // Whether a beam does not fit what neighbouring ones of another pose would measure: a robot that stands a
  // little off sees an edge a little earlier or later.
  bool Differs(double range, const std::array<double, kNumBeams>& others, int beam) const {
    const double before = others[(beam + kNumBeams - 1) % kNumBeams], at = others[beam],
                 after = others[(beam + 1) % kNumBeams];
    return range < std::min({before, at, after}) - options_.same_range_m ||
           range > std::max({before, at, after}) + options_.same_range_m;
  }

  // Beams, of both by each other, that do not fit: what tells one from another tells this from that.  Sums of
  // those before each beam, twice around.
  using Sums = std::array<int, 2 * kNumBeams + 1>;
  std::vector<Sums> SumsOf(const std::vector<std::array<double, kNumBeams>>& ranges) const {
    std::vector<Sums> sums(static_cast<size_t>(num()) * num());
    for (int i = 0; i < num(); ++i) {
      for (int k = i + 1; k < num(); ++k) {
        Sums& of_pair = sums[i * num() + k];
        of_pair[0] = 0;
        for (int beam = 0; beam < 2 * kNumBeams; ++beam) {
          const int at = beam % kNumBeams;
          of_pair[beam + 1] = of_pair[beam] + (Differs(ranges[i][at], ranges[k], at) ? 1 : 0) +
                              (Differs(ranges[k][at], ranges[i], at) ? 1 : 0);
        }
        sums[k * num() + i] = of_pair;
      }
    }
    return sums;
  }

  // What the looks from a place leave, along each heading; into an empty list.
  void LookFrom(int place, std::vector<Look>* looks) const {
    const std::vector<Sums> sums = SumsOf(Ranges(places_[place].at));
    const int num_seen =
        std::clamp(static_cast<int>(std::lround(options_.view_deg / 360 * kNumBeams)), 1, kNumBeams);
    std::vector<int64_t> totals;  // of beams that tell any two apart, those ahead twice, of each look
    for (int heading = 0; heading < kNumHeadings; ++heading) {
      Look look{.place = place, .heading_rad = HeadingOf(heading)};
      const int begin = (heading * kNumBeams / kNumHeadings - num_seen / 2 + kNumBeams) % kNumBeams;
      std::vector<NodeIdx> images(hypotheses_.size(), -1);
      for (int i = 0; i < num() && images_ != nullptr; ++i) {
        PlanarPose robot = RobotAt(i, places_[place].at);
        robot.heading_rad = WrapAngle(robot.heading_rad + look.heading_rad);
        images[i] = images_->PlaceAt(robot);
      }
      bool rules_out = false;
      int64_t total = 0;
      for (int i = 0; i < num(); ++i) {
        look.left[i] = Of(i);
        for (int k = 0; k < num(); ++k) {
          if (i == k) continue;
          const Sums& of_pair = sums[i * num() + k];
          const int num_other = of_pair[begin + num_seen] - of_pair[begin];
          total += num_other + of_pair[begin + num_seen - num_seen / 4] - of_pair[begin + num_seen / 4];
          double against = 0.5 * kByBeam * num_other;
          if (images[i] >= 0 && (images[k] < 0 || !images_->AreAlike(images[i], images[k])))
            against += kByImage;
          if (against < kRulesOut) look.left[i] |= Of(k);
        }
        rules_out = rules_out || look.left[i] != All();
      }
      if (!rules_out) continue;
      // Of those that leave the same, the one that shows most of what differs.
      const auto same = std::find_if(looks->begin(), looks->end(),
                                     [&](const Look& other) { return other.left == look.left; });
      if (same == looks->end()) {
        looks->push_back(look);
        totals.push_back(total);
      } else if (total > totals[same - looks->begin()]) {
        totals[same - looks->begin()] = total;
        same->heading_rad = look.heading_rad;
      }
    }
  }

  static double HeadingOf(int eighth) { return WrapAngle(2 * std::numbers::pi * eighth / kNumHeadings); }
  Set All() const { return num() == kMaxInSet ? ~Set{0} : Of(num()) - 1; }

  void Compare() {
    std::vector<std::vector<Look>> looks(places_.size());
    ParallelFor(std::ssize(places_), num_threads_,
                [&](int64_t place) { LookFrom(static_cast<int>(place), &looks[place]); });
    separable_.assign(hypotheses_.size(), 0);
    for (const std::vector<Look>& of_place : looks) {
      for (const Look& look : of_place) {
        for (int i = 0; i < num(); ++i) separable_[i] |= All() & ~look.left[i];
        looks_.push_back(look);
      }
    }
  }

  double Weight(Set set) const {
    double sum = 0;
    for (int i = 0; i < num(); ++i) sum += Has(set, i) ? hypotheses_[i].probability : 0;
    return sum;
  }
  // A way from one place to another, at least: as the crow flies, or by the lengths of the ways to them.
  double Apart(int place, int other) const {
    const Place &a = places_[place], &b = places_[other];
    return std::max((a.at - b.at).norm(), std::abs(a.length - b.length));
  }

  // Of a set, how likely two of it that are drawn from it are not told apart by a look, though others do.
  double Confused(Set set, const Look* look) const {
    double confused = 0;
    for (int i = 0; i < num(); ++i) {
      if (Has(set, i))
        confused += hypotheses_[i].probability *
                    Weight((look == nullptr ? set : look->left[i] & set) & separable_[i]);
    }
    return confused;
  }

  // The expected way from a place on until a set is told apart as far as it can be, if the robot goes each
  // time to the look that tells most apart for its way.
  double ToTheEnd(Set set, int from) {
    const auto [known, is_new] = to_the_end_.try_emplace({set, from}, 2 * options_.reach_m);
    if (!is_new) return known->second;  // what is asked for while it is reckoned leads nowhere: much
    const double confused = Confused(set, nullptr);
    if (confused <= 0) return known->second = 0;
    const Look* best = nullptr;
    double most = 0;
    for (const Look& look : looks_) {
      const double least_way = options_.step_m + Apart(look.place, from);
      if (confused <= most * least_way) continue;
      const double told = (confused - Confused(set, &look)) / least_way;
      if (!(told > most * (1 + 1e-9))) continue;
      most = told;
      best = &look;
    }
    if (best == nullptr) return known->second;
    double way = Apart(best->place, from);
    const double weight = Weight(set);
    for (int i = 0; i < num(); ++i) {
      if (Has(set, i))
        way += hypotheses_[i].probability / weight * ToTheEnd(best->left[i] & set, best->place);
    }
    return known->second = way;
  }

  double Cost(const Look& look) {
    double cost = places_[look.place].length;
    for (int i = 0; i < num(); ++i) cost += hypotheses_[i].probability * ToTheEnd(look.left[i], look.place);
    return cost;
  }

  NextLook Choose() {
    NextLook next;
    next.num_looks = static_cast<int>(places_.size());
    for (int i = 0; i < num(); ++i) {
      for (int k = i + 1; k < num(); ++k) {
        if (!Has(separable_[i], k) && !Has(separable_[k], i)) next.alike.emplace_back(i, k);
      }
    }
    if (looks_.empty()) {
      next.outcome = has_more_ ? NextLookOutcome::kOutOfReach : NextLookOutcome::kAlike;
      next.path = {Vec2::Zero()};
      next.left.assign(hypotheses_.size(), std::vector<int>(hypotheses_.size()));
      for (std::vector<int>& left : next.left) std::iota(left.begin(), left.end(), 0);
      return next;
    }
    // Looks in the order of the ways to them: those that leave less than all nearer ones.
    std::vector<const Look*> first;
    double least_left = std::numeric_limits<double>::infinity();
    for (const Look& look : looks_) {
      const double left = Confused(All(), &look);
      if (!(left < least_left - 1e-9)) continue;
      least_left = left;
      first.push_back(&look);
    }
    // Many: the last ones leave least.
    if (std::ssize(first) > kMaxNumFirstLooks)
      first.erase(first.begin() + 1, first.end() - (kMaxNumFirstLooks - 1));
    double least = std::numeric_limits<double>::infinity();
    const Look* best = nullptr;
    for (const Look* look : first) {
      if (places_[look->place].length >= least) break;
      const double cost = Cost(*look);
      if (!(cost < least - 1e-9)) continue;
      least = cost;
      best = look;
    }
    Fill(*best, least, &next);
    return next;
  }

  void Fill(const Look& look, double expected, NextLook* next) const {
    next->outcome = NextLookOutcome::kFound;
    next->heading_rad = look.heading_rad;
    next->expected_length_m = expected;
    std::vector<Vec2> way;
    for (int at = look.place; at >= 0; at = places_[at].before) way.push_back(places_[at].at);
    std::reverse(way.begin(), way.end());
    next->path = Tightened(way, [&](const Vec2& from, const Vec2& to) { return IsFree(from, to); });
    for (size_t i = 0; i + 1 < next->path.size(); ++i)
      next->length_m += (next->path[i + 1] - next->path[i]).norm();
    for (int i = 0; i < num(); ++i) {
      next->left.emplace_back();
      for (int k = 0; k < num(); ++k) {
        if (Has(look.left[i], k)) next->left.back().push_back(k);
      }
    }
  }

  const PlanSpace& space_;
  const PlanRays rays_;
  const std::vector<PossiblePlace>& hypotheses_;  // their probabilities sum to 1
  const SurveyedLooks* images_;
  const NextLookOptions& options_;
  const int num_threads_;
  std::vector<double> radii_;   // at each hypothesis
  std::vector<Place> places_;   // by the length of the way to them
  bool has_more_ = false;       // places beyond the reach
  std::vector<Look> looks_;     // that rule anything out, by the length of the way to them
  std::vector<Set> separable_;  // for each hypothesis, those that some look tells from it
  std::map<std::pair<Set, int>, double> to_the_end_;  // by the set and the place
};

}  // namespace

OptionTable DescribeOptions(NextLookOptions* o) {
  return {
      {.name = "radius_m", .value = &o->radius_m, .help = "radius of the robot, metres", .min = 0, .max = 10},
      {.name = "view_range_m",
       .value = &o->view_range_m,
       .help = "range of the laser, metres",
       .min = 0.1,
       .max = 1e4},
      {.name = "view_deg",
       .value = &o->view_deg,
       .help = "angle that the laser sees, half of it to either side, degrees",
       .min = 1,
       .max = 360},
      {.name = "same_range_m",
       .value = &o->same_range_m,
       .help = "ranges that differ by less are the same, metres",
       .min = 1e-3,
       .max = 10},
      {.name = "step_m",
       .value = &o->step_m,
       .help = "looks are planned at places so far from each other, metres",
       .min = 0.05,
       .max = 10},
      {.name = "reach_m",
       .value = &o->reach_m,
       .help = "no look is farther away, by the way to it, metres",
       .min = 0.1,
       .max = 1e3},
      {.name = "least_probability",
       .value = &o->least_probability,
       .help = "places less probable than this are not told apart",
       .min = 0,
       .max = 0.5},
      {.name = "max_num_hypotheses",
       .value = &o->max_num_hypotheses,
       .help = "the most probable places that are told apart",
       .min = 2,
       .max = kMaxInSet},
  };
}

Result<NextLook> PlanNextLook(const PlanSpace& space, std::span<const PossiblePlace> hypotheses,
                              const SurveyedLooks* images, const NextLookOptions& options, int num_threads) {
  NextLookOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  std::vector<int> order;
  double sum = 0;
  for (int i = 0; i < std::ssize(hypotheses); ++i) {
    const PossiblePlace& place = hypotheses[i];
    if (!place.pose.position.allFinite() || !std::isfinite(place.pose.heading_rad) ||
        !(place.probability >= 0 && std::isfinite(place.probability))) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "place {} of {}: its pose or its probability is not a number", i + 1,
                       hypotheses.size());
    }
    if (place.probability >= options.least_probability && place.probability > 0) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return hypotheses[a].probability > hypotheses[b].probability; });
  if (std::ssize(order) > options.max_num_hypotheses) order.resize(options.max_num_hypotheses);
  if (order.empty()) {
    return MakeError(ErrorCode::kNoData, "none of {} places has a probability of {:g} or more",
                     hypotheses.size(), options.least_probability);
  }
  std::vector<PossiblePlace> kept;
  std::vector<int> of;
  for (const int i : order) {
    for (const PossiblePlace& place : Spread(hypotheses[i])) {
      if (std::ssize(kept) == kMaxInSet || !space.IsFree(place.pose.position, place.pose.position, 0))
        continue;
      kept.push_back(place);
      of.push_back(i);
      sum += place.probability;
    }
  }
  if (kept.empty()) {
    const PossiblePlace& first = hypotheses[order[0]];
    return MakeError(ErrorCode::kNoData,
                     "no robot stands at ({:g}, {:g}): it lies on a wall, or outside of the plan",
                     first.pose.position.x(), first.pose.position.y());
  }
  if (kept.size() == 1)
    return NextLook{.outcome = NextLookOutcome::kOnePlace,
                    .places = kept,
                    .hypotheses = of,
                    .path = {Vec2::Zero()},
                    .left = {{0}}};
  const std::vector<PossiblePlace> places = kept;
  for (PossiblePlace& place : kept) place.probability /= sum;
  LookPlanner planner(space, kept, images, options, num_threads);
  NextLook next = planner.Run();
  next.places = places;
  next.hypotheses = std::move(of);
  return next;
}

}  // namespace cairn
