#include "stages/reconstruct/verdict/find_loops.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn::reconstruct {
namespace {

// The returns of a drive to the sight of one image, each by the image that has most points in common.
std::vector<LoopPair> ReturnsTo(int image, const Covisibility& covisibility, int end,
                                const FindLoopsOptions& options) {
  std::vector<LoopPair> returns;
  int last_in_sight = image;
  bool is_away = false;
  for (const CommonPoints& sight : covisibility.WithCommonPoints(image, options.min_num_points_in_sight)) {
    if (sight.image <= image || sight.image >= end) continue;
    const bool is_return = sight.image - last_in_sight > options.min_num_images_away;
    is_away = is_away || is_return;
    last_in_sight = sight.image;
    if (!is_away) continue;
    if (is_return) returns.push_back({image, sight.image, 0, 0});
    LoopPair& pair = returns.back();
    if (sight.num_points <= pair.num_points) continue;
    pair.image2 = sight.image;
    pair.num_points = sight.num_points;
  }
  return returns;
}

// Of pairs that are of one loop the one that has most points in common; then the next.
std::vector<LoopPair> BestOfEachLoop(std::vector<LoopPair> pairs, int first, const std::vector<double>& way,
                                     double max_same_ratio) {
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const LoopPair& a, const LoopPair& b) { return a.num_points > b.num_points; });
  const auto distance = [&](int image_a, int image_b) {
    return std::abs(way[image_a - first] - way[image_b - first]);
  };
  std::vector<LoopPair> loops;
  for (const LoopPair& pair : pairs) {
    const bool is_known = std::any_of(loops.begin(), loops.end(), [&](const LoopPair& loop) {
      const double same = max_same_ratio * std::max(loop.way, pair.way);
      return distance(loop.image1, pair.image1) <= same && distance(loop.image2, pair.image2) <= same;
    });
    if (!is_known) loops.push_back(pair);
  }
  std::sort(loops.begin(), loops.end(), [](const LoopPair& a, const LoopPair& b) {
    return std::pair(a.image1, a.image2) < std::pair(b.image1, b.image2);
  });
  return loops;
}

// `spans`: ascending.
std::vector<OpenStretch> StretchesInNoLoop(const std::vector<std::pair<int, int>>& spans, int first, int end,
                                           const std::vector<double>& way, double min_length) {
  std::vector<OpenStretch> stretches;
  const auto add = [&](int image1, int image2) {
    const double length = way[image2 - first] - way[image1 - first];
    if (image2 > image1 && length >= min_length) stretches.push_back({image1, image2, length});
  };
  int spanned = first;  // all before this image is in a loop, or in a stretch
  for (const auto& [image1, image2] : spans) {
    if (image1 > spanned) add(spanned, image1);
    spanned = std::max(spanned, image2);
  }
  if (!spans.empty()) add(spanned, end - 1);
  return stretches;
}

}  // namespace

Loops FindLoops(const Covisibility& covisibility, int first, int end, const std::vector<double>& way,
                double median_step, const TiedImages& tied, const FindLoopsOptions& options) {
  Loops loops;
  for (int image = first; image < end; ++image) {
    for (LoopPair& pair : ReturnsTo(image, covisibility, end, options)) {
      pair.way = way[pair.image2 - first] - way[pair.image1 - first];
      if (pair.num_points >= options.min_num_points && pair.way >= options.min_way_steps * median_step)
        loops.pairs.push_back(pair);
    }
  }
  loops.loops = BestOfEachLoop(loops.pairs, first, way, options.max_same_ratio);
  std::vector<std::pair<int, int>> spans;
  for (const LoopPair& pair : loops.pairs) spans.emplace_back(pair.image1, pair.image2);
  if (tied.image2 > tied.image1) spans.emplace_back(tied.image1, tied.image2);
  std::sort(spans.begin(), spans.end());
  loops.open_stretches = StretchesInNoLoop(spans, first, end, way, options.min_way_steps * median_step);
  return loops;
}

}  // namespace cairn::reconstruct
