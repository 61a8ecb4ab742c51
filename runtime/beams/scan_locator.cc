#include "runtime/beams/scan_locator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <set>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "core/geometry/pose.h"
#include "core/geometry/vector_geometry.h"
#include "runtime/beams/pose_search.h"
#include "runtime/laser/found_interpretations.h"
#include "runtime/laser/rank_interpretations.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

// Ends of beams are thinned to this distance for the search and the first refinement, metres.
constexpr double kThinM = 0.15;
constexpr int kFieldSteps = 12;
// Poses are first weighed with so many beams; the best with all.
constexpr int kNumFewBeams = 90, kNumRefined = 40;
constexpr int kMaxNumBeamsRefined = 180;
// From the coarse to the fine, metres.
constexpr std::array<double, 2> kRefineSigmas = {0.16, 0.06};
// Poses this near to a better one are that one.
constexpr double kSameM = 0.15, kSameRad = 3 * std::numbers::pi / 180;
// All beams count as much as there are sectors with one: what stands in one's way stands in that of its
// neighbours.
constexpr double kSectorRad = 12 * std::numbers::pi / 180;
// The place is known where its standard deviation is nowhere larger, metres.
constexpr double kKnownM = 0.25;
constexpr double kKnownRad = 10 * std::numbers::pi / 180;  // and the heading
// Poses along a corridor are one group: this near to a line, and to each other along it, metres; and as
// likely.
constexpr double kRowM = 0.3, kRowGapM = 1.5, kRowEvidence = 3;
// A row counts as many times as it has of these lengths, metres.
constexpr double kRowUnitM = 1;
// Ends of beams that are searched with, at most, and beams of which they are chosen.
constexpr int kMaxNumEnds = 400, kMaxNumBeamsSearched = 2000;
// A search in larger plans would be coarse, square metres.
constexpr double kMaxAreaM2 = 5e5;
constexpr int kMaxNumHypotheses = 50;
// The best of many poses explains so much better than a plan without walls, in a place that the plan does not
// show: the logarithm of odds.
constexpr double kByChance = 3;

std::vector<Beam> SomeOf(const std::vector<Beam>& beams, size_t most) {
  const size_t step = std::max<size_t>(1, (beams.size() + most - 1) / most);
  std::vector<Beam> some;
  for (size_t i = step / 2; i < beams.size(); i += step) some.push_back(beams[i]);
  return some;
}

// What a beam counts among its neighbours.
double WeightOfABeam(const std::vector<Beam>& beams) {
  std::set<int> sectors;
  for (const Beam& beam : beams)
    sectors.insert(
        static_cast<int>(std::floor(std::atan2(beam.direction.y(), beam.direction.x()) / kSectorRad)));
  return std::min(1.0, static_cast<double>(sectors.size()) / static_cast<double>(beams.size()));
}

// A pose, and what beams say about it.
struct WeighedPose {
  PlanarPose pose;
  BeamEvidence evidence;
};

void BestFirst(std::vector<WeighedPose>* poses) {
  std::stable_sort(poses->begin(), poses->end(), [](const WeighedPose& a, const WeighedPose& b) {
    return a.evidence.log_likelihood > b.evidence.log_likelihood;
  });
}

// Without those that are the same as a better one.
void RemoveTheSame(std::vector<WeighedPose>* poses) {
  std::vector<WeighedPose> kept;
  for (const WeighedPose& pose : *poses) {
    const bool same = std::any_of(kept.begin(), kept.end(), [&](const WeighedPose& other) {
      return (other.pose.position - pose.pose.position).norm() < kSameM &&
             std::abs(WrapAngle(other.pose.heading_rad - pose.pose.heading_rad)) < kSameRad;
    });
    if (!same) kept.push_back(pose);
  }
  *poses = std::move(kept);
}

// The direction in which a place is least known, and its standard deviation, metres.
std::pair<Vec2, double> LeastKnown(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(covariance.topLeftCorner<2, 2>().eval());
  return {solver.eigenvectors().col(1), std::sqrt(std::max(0.0, solver.eigenvalues()[1]))};
}

// Poses of which the beams say the same, in a row along a direction in which the place is not known, as in a
// corridor; or one pose.
struct PoseGroup {
  WeighedPose best;
  Vec2 along = Vec2::Zero();
  double low_m = 0, high_m = 0;  // of the row, from the best along it
};

// Groups of poses, which are the best first.  `covariance_of(pose)`, `weight`: of a beam.
template <typename CovarianceOf>
std::vector<PoseGroup> GroupPoses(const std::vector<WeighedPose>& poses, double weight, size_t most,
                                  CovarianceOf&& covariance_of) {
  std::vector<PoseGroup> groups;
  std::vector<char> taken(poses.size(), 0);
  for (size_t i = 0; i < poses.size() && groups.size() < most; ++i) {
    if (taken[i] != 0) continue;
    PoseGroup group{poses[i]};
    const auto [along, sigma] = LeastKnown(covariance_of(poses[i]));
    if (sigma > kKnownM) {
      group.along = along;
      std::vector<std::pair<double, size_t>> row;  // places along it
      for (size_t k = i; k < poses.size(); ++k) {
        const Vec2 apart = poses[k].pose.position - poses[i].pose.position;
        if (taken[k] == 0 && std::abs(Cross(along, apart)) < kRowM &&
            std::abs(WrapAngle(poses[k].pose.heading_rad - poses[i].pose.heading_rad)) < 2 * kSameRad &&
            weight * (poses[i].evidence.log_likelihood - poses[k].evidence.log_likelihood) < kRowEvidence)
          row.emplace_back(along.dot(apart), k);
      }
      std::sort(row.begin(), row.end());
      // Those that follow each other, from the best both ways.
      const auto at =
          std::find_if(row.begin(), row.end(), [&](const auto& member) { return member.second == i; });
      auto first = at, last = at;
      while (first != row.begin() && first->first - std::prev(first)->first < kRowGapM) --first;
      while (std::next(last) != row.end() && std::next(last)->first - last->first < kRowGapM) ++last;
      group.low_m = first->first;
      group.high_m = last->first;
      for (auto member = first; member <= last; ++member) taken[member->second] = 1;
    }
    taken[i] = 1;
    groups.push_back(group);
  }
  return groups;
}

// A group's hypothesis: of a row its middle, as uncertain along it as it is long.
void SpreadAlong(const PoseGroup& group, ScanHypothesis* found) {
  const auto [along, sigma] = LeastKnown(found->covariance);
  const double length = group.high_m - group.low_m;
  found->determined = sigma <= kKnownM && std::sqrt(found->covariance(2, 2)) <= kKnownRad;
  if (group.along == Vec2::Zero() || sigma <= kKnownM) return;
  found->pose.position += 0.5 * (group.low_m + group.high_m) * group.along;
  const double variance = length * length / 12 + kSameM * kSameM;  // of a uniform distribution
  found->covariance.topLeftCorner<2, 2>() += (variance - sigma * sigma) * along * along.transpose();
  found->probability *= std::max(1.0, length / kRowUnitM);
}

}  // namespace

OptionTable DescribeOptions(ScanLocatorOptions* o) {
  OptionTable table = {
      {.name = "search",
       .value = &o->search,
       .help =
           "where poses come from: places at which the ends of beams lie at walls, or pairings of segments "
           "with walls",
       .choices = {"beams", "vir", "standard"}},
      {.name = "least_odds",
       .value = &o->least_odds,
       .help = "poses less probable than this share of the first are left out",
       .min = 1e-9,
       .max = 1},
  };
  OptionTable tree = DescribeOptions(&o->tree);
  std::erase_if(tree,
                [](const Option& option) { return option.name == "search" || option.name == "first_only"; });
  AddCondition({"search", {"vir", "standard"}},
               {"max_null_ratio", "max_missing_ratio", "one_segment_per_wall", "rank_growth",
                "fix_pose_early", "max_num_nodes"},
               &tree);
  std::move(tree.begin(), tree.end(), std::back_inserter(table));
  return table;
}

ScanLocator::ScanLocator(const Views& views, const ScanLocatorOptions& options)
    : plan_(&views.plan),
      options_(options),
      rays_(std::make_shared<PlanRays>(views.plan.walls)),
      field_(std::make_shared<WallField>(views.plan.walls)),
      model_(views.plan.walls, *rays_,
             {.sigma_wall_m = options.tree.sigma_wall_m, .sigma_wall_deg = options.tree.sigma_wall_deg}) {
  options_.tree.search = options.search == "standard" ? "standard" : "vir";
  options_.tree.first_only = false;
  if (options.search != "beams") index_ = std::make_shared<ViewSearchIndex>(views);
}

Result<ScanLocator> ScanLocator::Make(const Views& views, const ScanLocatorOptions& options) {
  ScanLocatorOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (views.plan.walls.empty()) return MakeError(ErrorCode::kNoData, "a plan without walls");
  const Vec2 size = ExtentOf(views.plan.walls);
  if (!(size.prod() <= kMaxAreaM2)) {
    return MakeError(
        ErrorCode::kUnsupported,
        "the plan's walls lie within {:g} x {:g} m; scans are located in up to {:g} square metres: are "
        "its coordinates metres? else divide it",
        size.x(), size.y(), kMaxAreaM2);
  }
  return ScanLocator(views, options);
}

PlanarPose ScanLocator::RefineInField(const std::vector<BeamEnd>& ends, const PlanarPose& pose) const {
  PlanarPose refined = pose;
  double band = field_->reach_m();
  for (int step = 0; step < kFieldSteps; ++step, band = std::max(0.25 * field_->reach_m(), 0.8 * band)) {
    Eigen::Matrix3d information = 1e-6 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    const Eigen::Rotation2Dd rotation(refined.heading_rad);
    for (const BeamEnd& end : ends) {
      const Vec2 arm = rotation * end.place, at = refined.position + arm;
      const int32_t nearest = field_->NearestWall(at);
      if (nearest < 0) continue;
      const PlanWall& wall = plan_->walls[nearest];
      const Vec2 along = (wall.end - wall.start).normalized(), normal(-along.y(), along.x());
      const double off = normal.dot(at - wall.start);
      if (std::abs(off) >= band) continue;
      const double tukey = 1 - off * off / (band * band), weight = tukey * tukey;
      const Eigen::Vector3d row(normal.x(), normal.y(), normal.dot(Vec2(-arm.y(), arm.x())));
      information += weight * row * row.transpose();
      gradient -= weight * off * row;
    }
    Eigen::Vector3d change = information.ldlt().solve(gradient);
    change.head<2>() *= std::min(1.0, band / std::max(band, change.head<2>().norm()));
    change[2] = std::clamp(change[2], -0.1, 0.1);
    refined.position += change.head<2>();
    refined.heading_rad = WrapAngle(refined.heading_rad + change[2]);
    if (change.norm() < 1e-4) break;
  }
  return refined;
}

std::vector<PlanarPose> ScanLocator::PosesByBeams(const std::vector<Beam>& beams,
                                                  LocatedScan* located) const {
  std::vector<BeamEnd> ends = EndsApart(SomeOf(beams, kMaxNumBeamsSearched), kThinM);
  if (ends.size() > kMaxNumEnds) {
    std::vector<BeamEnd> some;
    for (size_t i = 0; i < kMaxNumEnds; ++i) some.push_back(ends[i * ends.size() / kMaxNumEnds]);
    ends = std::move(some);
  }
  const PoseSearchResult found = SearchPoses(*field_, ends, {});
  located->num_tried = found.num_windows;
  located->complete = found.complete;
  std::vector<PlanarPose> poses;
  const std::vector<Beam> few = SomeOf(beams, kNumFewBeams);
  for (const FieldPose& pose : found.poses) {
    // By the walls nearest to ends, or by those that beams meet first: the better, where walls are dense the
    // second, where the pose is far off the first.
    const PlanarPose by_ends = RefineInField(ends, pose.pose),
                     by_beams = model_.Refine(few, kRefineSigmas[0], pose.pose);
    const bool ends_fit =
        model_.Weigh(few, by_ends).log_likelihood >= model_.Weigh(few, by_beams).log_likelihood;
    poses.push_back(ends_fit ? by_ends : by_beams);
  }
  return poses;
}

Result<std::vector<PlanarPose>> ScanLocator::PosesBySegments(const ScanView& scan,
                                                             LocatedScan* located) const {
  std::vector<PlanarPose> poses;
  InterpretationTreeOptions options = options_.tree;
  // What stands in a room may be most of what is seen: a second try allows for more of it.
  for (const double ratio : {options.max_null_ratio, std::max(0.6, options.max_null_ratio)}) {
    options.max_null_ratio = ratio;
    CAIRN_ASSIGN_OR_RETURN(const InterpretationTreeResult found,
                           SearchInterpretations(*index_, scan.segments, options));
    located->num_tried += found.num_nodes;
    located->complete = located->complete && found.complete;
    for (const Interpretation& solution : found.solutions) poses.push_back(solution.pose);
    if (!poses.empty() || ratio == std::max(0.6, ratio)) break;
  }
  return poses;
}

// The segments that lie at walls seen from a hypothesis, and what of them is hidden there.
void ScanLocator::Interpret(const std::vector<ScanSegment>& segments, ScanHypothesis* found) const {
  const FoundInterpretations fits(*plan_, segments, options_.tree);
  found->labels.assign(segments.size(), -1);
  double sum = 0;
  for (int segment = 0; segment < std::ssize(segments); ++segment) {
    double least = 1;
    for (LabelIdx label = 0; label < plan_->num_labels(); ++label) {
      const double misfit = fits.Misfit(*found, segment, label);
      if (misfit >= least) continue;
      least = misfit;
      found->labels[segment] = label;
    }
    if (found->labels[segment] < 0) continue;
    if (!fits.IsSeen(*found, segment)) {
      found->labels[segment] = -1;
      continue;
    }
    ++found->num_matched;
    found->matched_length_m += segments[segment].Length();
    sum += SquaredOffsets(*plan_, segments[segment], found->labels[segment], found->pose);
  }
  found->hidden_length_m =
      HiddenLength(*plan_, segments, found->pose, 2 * options_.tree.position_tolerance_m);
  if (found->num_matched > 0) found->rms_m = std::sqrt(sum / (2 * found->num_matched));
}

Result<LocatedScan> ScanLocator::Locate(const ScanView& scan) const {
  LocatedScan located;
  const auto num_met =
      std::count_if(scan.beams.begin(), scan.beams.end(), [](const Beam& beam) { return beam.met; });
  if (num_met < 3) {
    return MakeError(ErrorCode::kNoData, "{} of {} beams met something; a pose needs at least three", num_met,
                     scan.beams.size());
  }
  std::vector<PlanarPose> poses;
  if (options_.search == "beams") {
    poses = PosesByBeams(scan.beams, &located);
  } else {
    CAIRN_ASSIGN_OR_RETURN(poses, PosesBySegments(scan, &located));
  }
  const double weight = WeightOfABeam(scan.beams);
  const auto covariance_of = [&](const WeighedPose& pose) {
    return model_.Covariance(scan.beams, pose.evidence.sigma_m, pose.pose);
  };
  // The best by some of the beams, then refined and weighed by all.
  const std::vector<Beam> few = SomeOf(scan.beams, kNumFewBeams);
  const std::vector<Beam> refining = SomeOf(scan.beams, kMaxNumBeamsRefined);
  std::vector<WeighedPose> weighed;
  for (const PlanarPose& pose : poses) weighed.push_back({pose, model_.Weigh(few, pose)});
  BestFirst(&weighed);
  RemoveTheSame(&weighed);
  const double few_weight = WeightOfABeam(few);
  std::vector<PoseGroup> groups = GroupPoses(weighed, few_weight, kNumRefined, covariance_of);
  for (PoseGroup& group : groups) {
    WeighedPose& pose = group.best;
    pose.evidence = model_.Weigh(scan.beams, pose.pose);
    PlanarPose refined = pose.pose;
    for (const double sigma_m : kRefineSigmas) refined = model_.Refine(refining, sigma_m, refined);
    const BeamEvidence evidence = model_.Weigh(scan.beams, refined);
    if (evidence.log_likelihood > pose.evidence.log_likelihood) pose = {refined, evidence};
  }
  std::stable_sort(groups.begin(), groups.end(), [](const PoseGroup& a, const PoseGroup& b) {
    return a.best.evidence.log_likelihood > b.best.evidence.log_likelihood;
  });
  const auto is_same = [](const PoseGroup& a, const PoseGroup& b) {
    return (a.best.pose.position - b.best.pose.position).norm() < kSameM &&
           std::abs(WrapAngle(a.best.pose.heading_rad - b.best.pose.heading_rad)) < kSameRad;
  };
  for (size_t i = 0; i < groups.size(); ++i) {
    const PoseGroup& group = groups[i];
    if (std::any_of(groups.begin(), groups.begin() + static_cast<std::ptrdiff_t>(i),
                    [&](const PoseGroup& other) { return is_same(other, group); }))
      continue;
    ScanHypothesis found;
    found.pose = group.best.pose;
    found.explained_ratio = group.best.evidence.explained_ratio;
    found.probability =
        std::exp(weight * (group.best.evidence.log_likelihood - groups.front().best.evidence.log_likelihood));
    found.covariance = covariance_of(group.best);
    SpreadAlong(group, &found);
    located.hypotheses.push_back(std::move(found));
  }
  if (located.hypotheses.empty()) return located;
  std::stable_sort(
      located.hypotheses.begin(), located.hypotheses.end(),
      [](const ScanHypothesis& a, const ScanHypothesis& b) { return a.probability > b.probability; });
  const double evidence =
      weight * (groups.front().best.evidence.log_likelihood - model_.WeighWithoutWalls(scan.beams));
  double sum = std::exp(kByChance - evidence);
  for (const ScanHypothesis& found : located.hypotheses) sum += found.probability;
  const double least = options_.least_odds * located.hypotheses.front().probability;
  // Where not all were refined, the others are no less likely than the last.
  if (groups.size() == kNumRefined && located.hypotheses.back().probability >= least)
    located.complete = false;
  std::erase_if(located.hypotheses, [&](const ScanHypothesis& found) { return found.probability < least; });
  if (located.hypotheses.size() > kMaxNumHypotheses) located.hypotheses.resize(kMaxNumHypotheses);
  for (ScanHypothesis& found : located.hypotheses) {
    found.probability /= sum;
    Interpret(scan.segments, &found);
  }
  return located;
}

}  // namespace cairn
