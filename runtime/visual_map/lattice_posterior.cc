#include "runtime/visual_map/lattice_posterior.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

namespace cairn {
namespace {

// Places count as equally likely when they differ by less than this part.
constexpr double kSameLikelihood = 1e-9;

}  // namespace

// [Sala06 §VI-C] "the maximum-likelihood pose estimate"
int32_t LikeliestPlace(const VisualMap& map, std::span<const double> at_place) {
  const double largest = *std::max_element(at_place.begin(), at_place.end());
  std::vector<int32_t> likeliest;
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (int32_t place = 0; place < static_cast<int32_t>(at_place.size()); ++place) {
    if (at_place[place] < (1 - kSameLikelihood) * largest) continue;
    likeliest.push_back(place);
    middle += map.places()[place];
  }
  middle /= static_cast<double>(likeliest.size());
  return *std::min_element(likeliest.begin(), likeliest.end(), [&](int32_t a, int32_t b) {
    return (map.places()[a] - middle).norm() < (map.places()[b] - middle).norm();
  });
}

double KlDivergence(std::span<const double> p, std::span<const double> q, double uniform_weight) {
  const auto count = static_cast<double>(p.size());
  // [Sala06 §VI-C] "we mixed a uniform distribution with a small weight with each distribution"
  const auto mixed = [&](double share) { return (1 - uniform_weight) * share + uniform_weight / count; };
  double divergence = 0;
  for (size_t i = 0; i < p.size(); ++i) {
    // [Sala06 §VI-C] D = sum over x of p_d(x) log(p_d(x) / p_all(x))
    if (const double share = mixed(p[i]); share > 0) divergence += share * std::log(share / mixed(q[i]));
  }
  return divergence;
}

}  // namespace cairn
