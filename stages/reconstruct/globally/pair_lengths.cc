#include "stages/reconstruct/globally/pair_lengths.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/base/quantiles.h"
#include "stages/reconstruct/view_graph/differences.h"

namespace cairn::reconstruct {
namespace {

constexpr double kMaxDepthSigma = 0.3;  // of a depth's logarithm
constexpr size_t kMinNumDepths = 12;    // of a pair, and that two pairs share
// With so many of an image's pairs, those with most depths, its others are compared.
constexpr size_t kNumCompared = 5;
constexpr double kLeastRatioSigma =
    0.02;                            // of a ratio's logarithm: the pairs' directions are not exact, either
constexpr double kUnknownSigma = 3;  // of the logarithm of a length of which nothing is known

const std::vector<PairDepth>& DepthsFrom(const PairDepths& pair, int image) {
  return image == pair.image1 ? pair.from1 : pair.from2;
}

// log(length of pair b / length of pair a) and its standard deviation.
std::optional<std::pair<double, double>> LogRatio(const std::vector<PairDepth>& a,
                                                  const std::vector<PairDepth>& b) {
  std::vector<double> differences;
  for (size_t i = 0, k = 0; i < a.size() && k < b.size();) {
    const KeypointIdx at_a = a[i].keypoint_idx, at_b = b[k].keypoint_idx;
    if (at_a == at_b) differences.push_back(a[i].log_depth - b[k].log_depth);
    i += at_a <= at_b ? 1 : 0;
    k += at_b <= at_a ? 1 : 0;
  }
  if (differences.size() < kMinNumDepths) return std::nullopt;
  const double median = Median(differences);
  const auto num = static_cast<double>(differences.size());
  for (double& difference : differences) difference = std::abs(difference - median);
  const double sigma = kSigmaOfMad * Median(differences) * kSigmaOfMedian / std::sqrt(num);
  return std::pair(median, std::hypot(sigma, kLeastRatioSigma));
}

}  // namespace

PairDepths DepthsOf(const ViewPair& pair, const std::vector<Eigen::Vector3d>& bearings1,
                    const std::vector<Eigen::Vector3d>& bearings2, double sigma_rad) {
  PairDepths depths{.image1 = pair.image1, .image2 = pair.image2, .from1 = {}, .from2 = {}};
  const Eigen::Vector3d way = pair.cam2_from_cam1.translation.normalized();
  for (size_t m = 0; m < pair.matches.size(); ++m) {
    // depth1 a + way = depth2 b; of lines that miss each other, where they are nearest.
    const Eigen::Vector3d a = pair.cam2_from_cam1.rotation * bearings1[m], &b = bearings2[m];
    const Eigen::Vector3d normal = a.cross(b);
    const double depth1 = b.cross(way).dot(normal) / normal.squaredNorm(),
                 depth2 = a.cross(way).dot(normal) / normal.squaredNorm();
    if (!(depth1 > 0 && depth2 > 0 && sigma_rad < kMaxDepthSigma * normal.norm())) continue;
    depths.from1.push_back({pair.matches[m].idx1, std::log(depth1)});
    depths.from2.push_back({pair.matches[m].idx2, std::log(depth2)});
  }
  for (std::vector<PairDepth>* from : {&depths.from1, &depths.from2}) {
    if (from->size() < kMinNumDepths) from->clear();
    std::sort(from->begin(), from->end(),
              [](const PairDepth& x, const PairDepth& y) { return x.keypoint_idx < y.keypoint_idx; });
  }
  return depths;
}

std::vector<double> PairLengths(int num_images, const std::vector<PairDepths>& pairs,
                                const std::vector<KnownLength>& known) {
  std::vector<std::vector<int>> of_images(num_images);
  for (size_t p = 0; p < pairs.size(); ++p) {
    if (pairs[p].from1.empty()) continue;
    of_images[pairs[p].image1].push_back(static_cast<int>(p));
    of_images[pairs[p].image2].push_back(static_cast<int>(p));
  }
  // Nodes: one whose length is the unit, then the pairs.
  std::vector<Link> links;
  std::vector<double> logs;
  std::vector<bool> is_compared(pairs.size(), false), is_known(pairs.size(), false);
  for (int image = 0; image < num_images; ++image) {
    std::vector<int>& here = of_images[image];
    std::stable_sort(here.begin(), here.end(),
                     [&](int a, int b) { return pairs[a].from1.size() > pairs[b].from1.size(); });
    for (size_t i = 0; i < std::min(here.size(), kNumCompared); ++i) {
      for (size_t k = i + 1; k < here.size(); ++k) {
        const auto ratio = LogRatio(DepthsFrom(pairs[here[i]], image), DepthsFrom(pairs[here[k]], image));
        if (!ratio) continue;
        links.push_back({1 + here[i], 1 + here[k], ratio->second});
        logs.push_back(ratio->first);
        is_compared[here[i]] = is_compared[here[k]] = true;
      }
    }
  }
  for (const KnownLength& length : known) {
    links.push_back({0, 1 + length.pair, length.sigma});
    logs.push_back(length.log_length);
    is_known[length.pair] = true;
  }
  for (size_t p = 0; p < pairs.size(); ++p) {
    if (is_known[p]) continue;
    links.push_back({0, 1 + static_cast<int>(p), kUnknownSigma});
    logs.push_back(0);
  }
  const Eigen::MatrixXd found =
      SolveDifferencesRobustly(static_cast<int>(1 + pairs.size()), links,
                               Eigen::Map<const Eigen::VectorXd>(logs.data(), std::ssize(logs)));
  std::vector<double> lengths(pairs.size(), 0);
  for (size_t p = 0; p < pairs.size(); ++p) {
    if (is_compared[p]) lengths[p] = std::exp(found(static_cast<Eigen::Index>(1 + p), 0));
  }
  return lengths;
}

}  // namespace cairn::reconstruct
