#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/promise/view_distance.h"
#include "core/world/feature_class.h"

namespace cairn {

// A class from a survey image.
struct ExpectedMatch {
  int32_t view = 0;       // position in ExpectedMatches::views
  float probability = 0;  // that a robot about one view's radius from there finds the class again
};

// logit P(seen) = sum of weights x features; see expected_matches.cc for the features.
inline constexpr int kNumMatchFeatures = 7;
using MatchWeights = std::array<double, kNumMatchFeatures>;

struct ExpectedMatches {
  std::vector<int32_t> views;  // positions in Classes::images
  double depth = 1;            // median distance of what survey images see, m or the map's units
  std::vector<std::vector<ExpectedMatch>> of_class;  // per class of Classes::classes, ascending images
  MatchWeights weights{};
  int64_t num_learnt_from = 0;  // pairs of a class and an image
};

// Learns from the survey when a class that others saw is seen: for every image and every class in its view,
// from the sights in other views alone.  O(classes * images that could see them).  Same result for
// any number of threads.
ExpectedMatches LearnMatches(const Classes& classes, const ViewOptions& options, int num_threads);

}  // namespace cairn
