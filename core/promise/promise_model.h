#pragma once

#include <vector>

namespace cairn {

// What a map promises a robot: with a probability, that so many landmarks are matched and that the camera's
// pose is within these limits.
struct PromiseTerms {
  int min_matches = 10;       // REQUIRES: > 0
  double max_error_m = 0.1;   // or the map's units; REQUIRES: > 0
  double max_error_deg = 5;   // REQUIRES: > 0
  double probability = 0.95;  // REQUIRES: in (0, 1)
  friend bool operator==(const PromiseTerms&, const PromiseTerms&) = default;
};

// What a map lets expect of an image.
struct Expectation {
  double num_matches = 0;  // sum of the probabilities that its landmarks are matched
  // Standard deviation of the camera's place by these matches alone, m: square root of the trace of its
  // covariance.
  double sigma_m = 0;
};

// How a left-out image fared, beside what was expected of it.
struct PromiseTrial {
  Expectation expected;
  bool is_right = false;  // localized within the terms' limits
  int num_matches = 0;    // inliers; 0 unless right
  double error_m = 0;
};

// From what is expected to what happens.  The number of matches is negative binomial: a Poisson number whose
// mean varies from image to image (blur, light, what stands in the way) as a gamma distribution of this
// shape. The error of the place is that of a normal distribution in space (Maxwell's).
struct PromiseModel {
  double match_ratio = 1;  // matches to expect, per expected match
  double shape = 5;        // of the gamma distribution; infinitely many: Poisson
  double error_ratio = 1;  // true standard deviation over the stated one

  // P(at least terms.min_matches are matched and the place is within terms.max_error_m).
  double Probability(const Expectation& expected, const PromiseTerms& terms) const;
  // The fewest expected matches, and the largest standard deviation, m, with which each of the two conditions
  // alone holds with the square root of terms.probability.
  double NeededMatches(const PromiseTerms& terms) const;
  double LargestSigmaM(const PromiseTerms& terms) const;

  friend bool operator==(const PromiseModel&, const PromiseModel&) = default;
};

// P(N >= least), N negative binomial of this mean and shape.
double NegativeBinomialTail(int least, double mean, double shape);

// The ratios by moments of the images that were localized right, the shape by maximum likelihood of all.
// Without a right image: the values above, and no promise is kept (match_ratio = 0).
PromiseModel FitPromiseModel(const std::vector<PromiseTrial>& trials);

// How often promises of about the same probability were kept.
struct PromiseBin {
  double least = 0;  // probabilities from here to the next bin's
  int num = 0;
  int num_kept = 0;
  double mean_promised = 0;  // of the num
  friend bool operator==(const PromiseBin&, const PromiseBin&) = default;
};
struct PromiseOutcome {
  double probability = 0;
  bool is_kept = false;
};
// Bins without an outcome are left out.
std::vector<PromiseBin> CalibrationCurve(const std::vector<PromiseOutcome>& outcomes);

}  // namespace cairn
