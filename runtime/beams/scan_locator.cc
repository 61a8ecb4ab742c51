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
#include "runtime/beams/beam_model.h"
#include "runtime/beams/plan_rays.h"
#include "runtime/beams/pose_search.h"
#include "runtime/beams/wall_field.h"
#include "runtime/laser/found_interpretations.h"
#include "runtime/laser/rank_interpretations.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

// Ends of beams are thinned to this distance for the search and the first refinement, metres.
constexpr double kThinM = 0.15;
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
// Searches by segments that found nothing are tried again with so many of no wall.
constexpr double kSecondNullRatio = 0.6;
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

// Where the beams ended that are searched with.
std::vector<BeamEnd> SearchedEnds(const std::vector<Beam>& beams) {
  std::vector<BeamEnd> ends = EndsApart(SomeOf(beams, kMaxNumBeamsSearched), kThinM);
  if (ends.size() <= kMaxNumEnds) return ends;
  std::vector<BeamEnd> some;
  for (size_t i = 0; i < kMaxNumEnds; ++i) some.push_back(ends[i * ends.size() / kMaxNumEnds]);
  return some;
}

bool AreTheSame(const PlanarPose& a, const PlanarPose& b) {
  return (a.position - b.position).norm() < kSameM &&
         std::abs(WrapAngle(a.heading_rad - b.heading_rad)) < kSameRad;
}

void BestFirst(std::vector<WeighedPose>* poses) {
  std::stable_sort(poses->begin(), poses->end(), [](const WeighedPose& a, const WeighedPose& b) {
    return a.evidence.log_likelihood > b.evidence.log_likelihood;
  });
}

// Without those that are the same as a better one.
void RemoveTheSame(std::vector<WeighedPose>* poses) {
  std::vector<WeighedPose> kept;
  for (const WeighedPose& pose : *poses) {
    const auto same = std::find_if(kept.begin(), kept.end(), [&](const WeighedPose& other) {
      return AreTheSame(other.pose, pose.pose);
    });
    if (same == kept.end()) {
      kept.push_back(pose);
    } else {
      same->is_expected = same->is_expected || pose.is_expected;
    }
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
  bool is_expected = false;      // any of them
};

struct PoseGroups {
  std::vector<PoseGroup> groups;
  bool complete = true;  // false: more than `most` were not expected
};

// Groups of poses, which are the best first: `most` of them, and all with an expected pose.
// `covariance_of(pose)`, `weight`: of a beam.
template <typename CovarianceOf>
PoseGroups GroupPoses(const std::vector<WeighedPose>& poses, double weight, size_t most,
                      CovarianceOf&& covariance_of) {
  PoseGroups found;
  size_t num_others = 0;
  std::vector<char> taken(poses.size(), 0);
  for (size_t i = 0; i < poses.size(); ++i) {
    if (taken[i] != 0) continue;
    if (!poses[i].is_expected && num_others == most) {
      found.complete = false;
      continue;
    }
    PoseGroup group{.best = poses[i], .is_expected = poses[i].is_expected};
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
      for (auto member = first; member <= last; ++member) {
        taken[member->second] = 1;
        group.is_expected = group.is_expected || poses[member->second].is_expected;
      }
    }
    taken[i] = 1;
    num_others += group.is_expected ? 0 : 1;
    found.groups.push_back(group);
  }
  return found;
}

// A group's hypothesis: of a row its middle, as uncertain along it as it is long.
void SpreadAlong(const PoseGroup& group, ScanHypothesis* found) {
  const auto [along, sigma] = LeastKnown(found->covariance);
  const double length = group.high_m - group.low_m;
  found->determined = IsDetermined(found->covariance);
  if (group.along == Vec2::Zero() || sigma <= kKnownM) return;
  found->pose.position += 0.5 * (group.low_m + group.high_m) * group.along;
  const double variance = length * length / 12 + kSameM * kSameM;  // of a uniform distribution
  // Along it the row's length is the standard deviation; what the heading errs with it becomes as much less.
  Eigen::Matrix3d scaling = Eigen::Matrix3d::Identity();
  scaling.topLeftCorner<2, 2>() += (std::sqrt(variance) / sigma - 1) * along * along.transpose();
  found->covariance = (scaling * found->covariance * scaling.transpose()).eval();
  found->probability *= std::max(1.0, length / kRowUnitM);
}

}  // namespace

bool IsDetermined(const Eigen::Matrix3d& covariance) {
  return LeastKnown(covariance).second <= kKnownM && std::sqrt(covariance(2, 2)) <= kKnownRad;
}

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
      model_(std::make_shared<BeamModel>(views.plan.walls, *rays_,
                                         BeamModelOptions{.sigma_wall_m = options.tree.sigma_wall_m,
                                                          .sigma_wall_deg = options.tree.sigma_wall_deg})) {
  options_.tree.search = options.search == "standard" ? "standard" : "vir";
  options_.tree.first_only = false;
  if (options.search != "beams") index_ = std::make_shared<ViewSearchIndex>(views);
}

Result<ScanLocator> ScanLocator::Make(const Views& views, const ScanLocatorOptions& options) {
  ScanLocatorOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (views.plan.walls.empty()) return MakeError(ErrorCode::kNoData, "a plan without walls");
  if (options.search == "vir" && views.num_faces() == 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "search = vir looks in a plan's regions, but only its walls are given");
  }
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

WeighedPose ScanLocator::Weighed(const std::vector<Beam>& beams, const PlanarPose& pose) const {
  return {pose, model_->Weigh(beams, pose)};
}

std::vector<WeighedPose> ScanLocator::PosesByBeams(const std::vector<BeamEnd>& ends,
                                                   const std::vector<Beam>& few, LocatedScan* located) const {
  const PoseSearchResult found = SearchPoses(*field_, ends, {});
  located->num_tried = found.num_windows;
  located->complete = found.complete;
  std::vector<WeighedPose> poses;
  for (const FieldPose& pose : found.poses) poses.push_back(BestNear(pose.pose, ends, few));
  return poses;
}

WeighedPose ScanLocator::BestNear(const PlanarPose& pose, const std::vector<BeamEnd>& ends,
                                  const std::vector<Beam>& few) const {
  // By the walls nearest to ends, or by those that beams meet first: the better, where walls are dense the
  // second, where the pose is far off the first.
  const WeighedPose by_ends = Weighed(few, RefineByEnds(*field_, plan_->walls, ends, pose)),
                    by_beams = Weighed(few, model_->Refine(few, kRefineSigmas[0], pose));
  return by_ends.evidence.log_likelihood >= by_beams.evidence.log_likelihood ? by_ends : by_beams;
}

Result<std::vector<WeighedPose>> ScanLocator::PosesBySegments(const ScanView& scan,
                                                              const std::vector<Beam>& few,
                                                              LocatedScan* located) const {
  std::vector<WeighedPose> poses;
  InterpretationTreeOptions options = options_.tree;
  // What stands in a room may be most of what is seen: a second try allows for more of it.
  for (const double ratio : {options.max_null_ratio, std::max(kSecondNullRatio, options.max_null_ratio)}) {
    options.max_null_ratio = ratio;
    CAIRN_ASSIGN_OR_RETURN(const InterpretationTreeResult found,
                           SearchInterpretations(*index_, scan.segments, options));
    located->num_tried += found.num_nodes;
    located->complete = located->complete && found.complete;
    for (const Interpretation& solution : found.solutions) poses.push_back(Weighed(few, solution.pose));
    if (!poses.empty() || ratio >= kSecondNullRatio) break;
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

Result<LocatedScan> ScanLocator::Locate(const ScanView& scan, std::span<const PlanarPose> expected) const {
  return Locate(scan, expected, /*searches=*/true);
}

Result<LocatedScan> ScanLocator::LocateNear(const ScanView& scan,
                                            std::span<const PlanarPose> expected) const {
  return Locate(scan, expected, /*searches=*/false);
}

Result<LocatedScan> ScanLocator::Locate(const ScanView& scan, std::span<const PlanarPose> expected,
                                        bool searches) const {
  LocatedScan located;
  const auto num_met =
      std::count_if(scan.beams.begin(), scan.beams.end(), [](const Beam& beam) { return beam.met; });
  if (num_met < 3) {
    return MakeError(ErrorCode::kNoData, "{} of {} beams met something; a pose needs at least three", num_met,
                     scan.beams.size());
  }
  // The best by some of the beams, then refined and weighed by all.
  const std::vector<Beam> few = SomeOf(scan.beams, kNumFewBeams);
  const std::vector<BeamEnd> ends = SearchedEnds(scan.beams);
  std::vector<WeighedPose> weighed;
  if (searches && options_.search == "beams") {
    weighed = PosesByBeams(ends, few, &located);
  } else if (searches) {
    CAIRN_ASSIGN_OR_RETURN(weighed, PosesBySegments(scan, few, &located));
  }
  for (const PlanarPose& pose : expected) {
    weighed.push_back(BestNear(pose, ends, few));
    weighed.back().is_expected = true;
  }
  BestFirst(&weighed);
  RemoveTheSame(&weighed);
  const double weight = WeightOfABeam(scan.beams);
  const auto covariance_of = [&](const WeighedPose& pose) {
    return model_->Covariance(scan.beams, pose.evidence.sigma_m, pose.pose);
  };
  const std::vector<Beam> refining = SomeOf(scan.beams, kMaxNumBeamsRefined);
  const PoseGroups grouped = GroupPoses(weighed, WeightOfABeam(few), kNumRefined, covariance_of);
  std::vector<PoseGroup> groups = grouped.groups;
  for (PoseGroup& group : groups) {
    PlanarPose refined = group.best.pose;
    for (const double sigma_m : kRefineSigmas) refined = model_->Refine(refining, sigma_m, refined);
    const WeighedPose before = Weighed(scan.beams, group.best.pose), after = Weighed(scan.beams, refined);
    group.best = after.evidence.log_likelihood > before.evidence.log_likelihood ? after : before;
  }
  std::stable_sort(groups.begin(), groups.end(), [](const PoseGroup& a, const PoseGroup& b) {
    return a.best.evidence.log_likelihood > b.best.evidence.log_likelihood;
  });
  std::vector<PoseGroup> apart;
  for (const PoseGroup& group : groups) {
    const auto better = std::find_if(apart.begin(), apart.end(), [&](const PoseGroup& other) {
      return AreTheSame(other.best.pose, group.best.pose);
    });
    if (better == apart.end()) {
      apart.push_back(group);
    } else {
      better->is_expected = better->is_expected || group.is_expected;
    }
  }
  for (const PoseGroup& group : apart) {
    ScanHypothesis found;
    found.pose = group.best.pose;
    found.explained_ratio = group.best.evidence.explained_ratio;
    found.is_expected = group.is_expected;
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
      weight * (groups.front().best.evidence.log_likelihood - model_->WeighWithoutWalls(scan.beams));
  double sum = std::exp(kByChance - evidence);
  for (const ScanHypothesis& found : located.hypotheses) sum += found.probability;
  const double least = options_.least_odds * located.hypotheses.front().probability;
  // Where not all were refined, the others are no less likely than the last that was.
  double last = 0;
  int num_kept = 0;
  std::erase_if(located.hypotheses, [&](const ScanHypothesis& found) {
    if (found.is_expected) return false;
    last = found.probability;
    return found.probability < least || ++num_kept > kMaxNumHypotheses;
  });
  if (!grouped.complete && last >= least) located.complete = false;
  for (ScanHypothesis& found : located.hypotheses) {
    found.probability /= sum;
    Interpret(scan.segments, &found);
  }
  return located;
}

}  // namespace cairn
