#include "stages/reconstruct/globally/image_ways.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "stages/reconstruct/globally/pair_lengths.h"
#include "stages/reconstruct/view_graph/differences.h"

namespace cairn::reconstruct {
namespace {

// Standard deviations of a way, as a part of it and of the unit; in units, of one whose length nothing tells
// (without parallax it is short), and of a step that only is one.
constexpr double kSigmaRatio = 0.05, kLeastSigma = 0.02, kShortSigma = 0.5, kStepSigma = 2;
// Matches of a pair whose way weighs as much as a motion.
constexpr double kTypicalNumMatches = 200;
// Of the logarithm of a step's length about the unit, and of one that a motion tells.
constexpr double kLogStepSigma = 0.7, kLogMotionSigma = 0.05;
// A step that tears a drive, over a typical one; and how many of them are not longer than that.
constexpr double kTornStep = 5, kTypicalQuantile = 0.75;
// Standard deviation of a step as it is, as a part of it and of the unit.
constexpr double kSameStepRatio = 0.3, kLeastSameStep = 0.1;

PairDepths DepthsOfMatches(ViewPair pair, const BearingOf& bearing_of, double sigma_rad) {
  std::vector<Eigen::Vector3d> bearings1, bearings2;
  std::erase_if(pair.matches, [&](const Match& match) {
    const auto bearing1 = bearing_of(pair.image1, match.idx1), bearing2 = bearing_of(pair.image2, match.idx2);
    if (!bearing1 || !bearing2) return true;
    bearings1.push_back(*bearing1);
    bearings2.push_back(*bearing2);
    return false;
  });
  return DepthsOf(pair, bearings1, bearings2, sigma_rad);
}

// By images, in units.
std::map<std::pair<int, int>, KnownLength> KnownLengths(const std::vector<ImageMotion>& motions,
                                                        const std::vector<std::pair<int, int>>& steps,
                                                        double unit) {
  std::map<std::pair<int, int>, KnownLength> known;
  for (const auto& [from, to] : steps)
    known[std::minmax(from, to)] = {.pair = 0, .log_length = 0, .sigma = kLogStepSigma};
  for (const ImageMotion& motion : motions) {
    // Of a turn on the spot no ratio says anything.
    const double length = motion.Way().norm() / unit;
    if (length <= kLeastSigma) continue;
    known[std::minmax(motion.image1, motion.image2)] = {
        .pair = 0,
        .log_length = std::log(length),
        .sigma = std::hypot(kLogMotionSigma, kLeastSigma / length)};
  }
  return known;
}

}  // namespace

std::vector<Way> WaysBy(const std::vector<Eigen::Quaterniond>& rotations, const std::vector<ViewPair>& pairs,
                        const std::vector<ImageMotion>& motions,
                        const std::vector<std::pair<int, int>>& steps, const BearingOf& bearing_of,
                        double sigma_rad, bool weigh_by_matches, int num_threads) {
  // A typical step.
  const double median_way_m = MedianWayM(motions), unit = median_way_m > 0 ? median_way_m : 1;
  std::vector<PairDepths> depths(pairs.size());
  ParallelFor(std::ssize(pairs), num_threads,
              [&](int64_t p) { depths[p] = DepthsOfMatches(pairs[p], bearing_of, sigma_rad); });
  const auto known_by_images = KnownLengths(motions, steps, unit);
  std::vector<KnownLength> known;
  for (size_t p = 0; p < pairs.size(); ++p) {
    const auto found = known_by_images.find(std::minmax(pairs[p].image1, pairs[p].image2));
    if (found == known_by_images.end()) continue;
    known.push_back(found->second);
    known.back().pair = static_cast<int>(p);
  }
  std::vector<Way> ways;
  const std::vector<double> lengths = PairLengths(static_cast<int>(rotations.size()), depths, known);
  for (size_t p = 0; p < pairs.size(); ++p) {
    const Eigen::Vector3d direction =
        rotations[pairs[p].image1].conjugate() * pairs[p].cam2_from_cam1.Center().normalized();
    ways.push_back(
        {pairs[p].image1, pairs[p].image2, unit * lengths[p] * direction,
         unit * (lengths[p] > 0 ? kLeastSigma + kSigmaRatio * lengths[p] : kShortSigma),
         weigh_by_matches ? static_cast<double>(pairs[p].matches.size()) / kTypicalNumMatches : 1});
  }
  for (const ImageMotion& motion : motions) {
    ways.push_back({motion.image1, motion.image2, rotations[motion.image1].conjugate() * motion.Way(),
                    kLeastSigma * unit + kSigmaRatio * motion.Way().norm()});
  }
  for (const auto& [from, to] : steps) ways.push_back({from, to, Eigen::Vector3d::Zero(), kStepSigma * unit});
  return ways;
}

std::vector<Eigen::Vector3d> CentersAlong(int num_images, const std::vector<Way>& ways) {
  std::vector<Link> links;
  Eigen::MatrixXd differences(std::ssize(ways), 3);
  for (const Way& way : ways) {
    differences.row(std::ssize(links)) = way.way.transpose();
    links.push_back({way.from, way.to, way.sigma, way.weight});
  }
  const Eigen::MatrixXd found = SolveDifferencesRobustly(num_images, links, differences);
  std::vector<Eigen::Vector3d> centers;
  for (int i = 0; i < num_images; ++i) centers.emplace_back(found.row(i).transpose());
  return centers;
}

std::vector<double> StepLengths(const std::vector<Eigen::Vector3d>& centers,
                                const std::vector<std::pair<int, int>>& steps) {
  std::vector<double> lengths;
  for (const auto& [from, to] : steps) lengths.push_back((centers[to] - centers[from]).norm());
  return lengths;
}

double TypicalLength(const std::vector<double>& lengths) { return Quantile(lengths, kTypicalQuantile); }

bool IsTorn(const std::vector<Eigen::Vector3d>& centers, const std::vector<std::pair<int, int>>& steps) {
  const std::vector<double> lengths = StepLengths(centers, steps);
  return !lengths.empty() &&
         *std::max_element(lengths.begin(), lengths.end()) > kTornStep * TypicalLength(lengths);
}

bool IsTornMore(const std::vector<Eigen::Vector3d>& centers, const std::vector<Eigen::Vector3d>& moved,
                const std::vector<std::pair<int, int>>& steps) {
  const std::vector<double> before = StepLengths(centers, steps), after = StepLengths(moved, steps);
  if (before.empty()) return false;
  const double most = kTornStep * TypicalLength(before);
  const auto num_torn = [&](const std::vector<double>& lengths) {
    return std::count_if(lengths.begin(), lengths.end(), [&](double length) { return length > most; });
  };
  return num_torn(after) > num_torn(before);
}

std::vector<Way> WithStepsOf(const std::vector<Eigen::Vector3d>& centers,
                             const std::vector<std::pair<int, int>>& steps, std::vector<Way> ways) {
  std::vector<double> ratios;
  for (const Way& way : ways) {
    const double length = (centers[way.to] - centers[way.from]).norm();
    if (way.way.norm() > 0 && length > 0) ratios.push_back(way.way.norm() / length);
  }
  if (ratios.empty()) return ways;
  const double scale = UpperMedian(ratios);
  for (const auto& [from, to] : steps) {
    const Eigen::Vector3d way = scale * (centers[to] - centers[from]);
    ways.push_back({from, to, way, kLeastSameStep + kSameStepRatio * way.norm()});
  }
  return ways;
}

}  // namespace cairn::reconstruct
