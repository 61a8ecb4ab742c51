#include "core/promise/promise_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace cairn {
namespace {

constexpr double kLeastMean = 1e-9;
// Shapes that are tried, by a constant factor.
constexpr double kFewestShape = 0.5;
constexpr double kMostShape = 500;
constexpr int kNumShapes = 61;
constexpr std::array<double, 8> kBinEdges = {0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.995};

// log P(N = n)
double LogNegativeBinomial(int n, double mean, double shape) {
  mean = std::max(mean, kLeastMean);
  return std::lgamma(n + shape) - std::lgamma(shape) - std::lgamma(n + 1.0) +
         shape * std::log(shape / (shape + mean)) + n * std::log(mean / (shape + mean));
}

// P(|e| <= x), e normal with unit variance along each of three axes.
double MaxwellCdf(double x) {
  return std::erf(x / std::numbers::sqrt2) - std::sqrt(2 / std::numbers::pi) * x * std::exp(-x * x / 2);
}

// The x in [low, high] from which on `is_enough` holds, by halving.
template <class Condition>
double FirstThat(double low, double high, const Condition& is_enough) {
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (is_enough(middle) ? high : low) = middle;
  }
  return high;
}

}  // namespace

double NegativeBinomialTail(int least, double mean, double shape) {
  double below = 0;
  for (int n = 0; n < least; ++n) below += std::exp(LogNegativeBinomial(n, mean, shape));
  return std::clamp(1 - below, 0.0, 1.0);
}

double PromiseModel::Probability(const Expectation& expected, const PromiseTerms& terms) const {
  if (!(match_ratio * expected.num_matches > 0)) return 0;
  // The stated sigma is that of three axes together.
  const double per_axis = error_ratio * expected.sigma_m / std::sqrt(3.0);
  const double within = per_axis > 0 ? MaxwellCdf(terms.max_error_m / per_axis) : 1;
  return within * NegativeBinomialTail(terms.min_matches, match_ratio * expected.num_matches, shape);
}

double PromiseModel::NeededMatches(const PromiseTerms& terms) const {
  constexpr double kMost = 1e6;
  if (!(match_ratio > 0)) return kMost;
  return FirstThat(0, kMost, [&](double matches) {
    return NegativeBinomialTail(terms.min_matches, match_ratio * matches, shape) >=
           std::sqrt(terms.probability);
  });
}

double PromiseModel::LargestSigmaM(const PromiseTerms& terms) const {
  constexpr double kMostSigmas = 40;
  const double num_sigmas =
      FirstThat(0, kMostSigmas, [&](double x) { return MaxwellCdf(x) >= std::sqrt(terms.probability); });
  return terms.max_error_m / num_sigmas * std::sqrt(3.0) / error_ratio;
}

PromiseModel FitPromiseModel(const std::vector<PromiseTrial>& trials) {
  double matches = 0, expected = 0, ratio2 = 0;
  int num_right = 0, num_with_sigma = 0;
  for (const PromiseTrial& trial : trials) {
    if (!trial.is_right) continue;
    ++num_right;
    matches += trial.num_matches;
    expected += trial.expected.num_matches;
    if (!(trial.expected.sigma_m > 0)) continue;
    ++num_with_sigma;
    ratio2 += trial.error_m * trial.error_m / (trial.expected.sigma_m * trial.expected.sigma_m);
  }
  PromiseModel model;
  if (num_right == 0 || !(expected > 0)) {
    model.match_ratio = 0;
    return model;
  }
  model.match_ratio = matches / expected;
  // E |e|^2 is the trace of e's covariance.
  if (num_with_sigma > 0 && ratio2 > 0) model.error_ratio = std::sqrt(ratio2 / num_with_sigma);
  double best = 0;
  for (int i = 0; i < kNumShapes; ++i) {
    const double shape = kFewestShape * std::pow(kMostShape / kFewestShape, i / (kNumShapes - 1.0));
    double log_likelihood = 0;
    for (const PromiseTrial& trial : trials)
      log_likelihood += LogNegativeBinomial(trial.is_right ? trial.num_matches : 0,
                                            model.match_ratio * trial.expected.num_matches, shape);
    if (i == 0 || log_likelihood > best) best = log_likelihood, model.shape = shape;
  }
  return model;
}

std::vector<PromiseBin> CalibrationCurve(const std::vector<PromiseOutcome>& outcomes) {
  std::vector<PromiseBin> bins;
  for (size_t b = 0; b < kBinEdges.size(); ++b) {
    PromiseBin bin{.least = kBinEdges[b]};
    double sum = 0;
    for (const PromiseOutcome& outcome : outcomes) {
      if (outcome.probability < kBinEdges[b] ||
          (b + 1 < kBinEdges.size() && outcome.probability >= kBinEdges[b + 1]))
        continue;
      ++bin.num;
      bin.num_kept += outcome.is_kept ? 1 : 0;
      sum += outcome.probability;
    }
    if (bin.num == 0) continue;
    bin.mean_promised = sum / bin.num;
    bins.push_back(bin);
  }
  return bins;
}

}  // namespace cairn
