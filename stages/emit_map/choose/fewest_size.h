#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace cairn::emit_map {

// How a map of so many landmarks fared on left-out images, beside the map of all.
struct SizeTrial {
  size_t num_landmarks = 0;
  int num_right = 0;           // images localized within the limits
  double log_error_ratio = 0;  // logarithm of ErrorRatio (leave_out_images.h)
};

// A size, and which of the left-out images it localizes.
struct TriedSize {
  SizeTrial trial;
  std::vector<char> is_right;  // per image
};

// The trials with what chance decides taken out: an image that some number of landmarks localizes and a
// larger one does not is not lost for want of landmarks, so it counts as localized by all of them.  Of a
// hundred images one or two are like that (their view shows what other places show as well), and one may be
// lost. `tried`: ascending by size, the same images in each.
std::vector<SizeTrial> WithoutChance(const std::vector<TriedSize>& tried);

struct SizeTerms {
  double min_num_right = 0;
  double max_log_error_ratio = 0;
};

// The fewest landmarks that meet both terms, judged by all sizes that were tried at once: with few images,
// two sizes that hardly differ fare differently by chance, and the first one that happens to do is too small.
// More landmarks do no worse, so both figures are taken from their isotonic regression over the size
// [Barlow, Bartholomew, Bremner, Brunk, "Statistical inference under order restrictions", 1972]: the nearest
// sequence, by squares, that never gets worse.  Between two tried sizes of which only the larger one's errors
// are small enough, they are linear in log n.  Nothing where no size will do.
// REQUIRES: sizes > 0, each once.
std::optional<size_t> FewestThatDo(std::vector<SizeTrial> trials, const SizeTerms& terms);

// The non-decreasing sequence with the least sum of squared differences, by pooling adjacent violators.
std::vector<double> IsotonicRegression(const std::vector<double>& values);

}  // namespace cairn::emit_map
