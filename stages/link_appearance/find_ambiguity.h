#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/geometry/floor_pose.h"
#include "core/options/options.h"
#include "core/vocabulary/document_scores.h"
#include "core/vocabulary/vocabulary_tree.h"
#include "core/world/appearance.h"

namespace cairn::link_appearance {

// Which places a robot can tell from others by looking, and which it takes for another.
struct AmbiguityOptions {
  // Of ProbabilitiesOfScores.  REQUIRES: > 0
  double score_exponent = kScoreExponent;
  // What the entropy of an image is taken over.  "images": all of them [Mariottini11 eq. 1], so that it is
  // the greater, the more images show the same place, and the smaller, the less alike two images of one place
  // are. "places": images that are linked or lie nearer to each other than confusable_distance_m count as
  // one, and the image itself scores what one taken again at its place would: as much as the best other one,
  // and no less than nine of ten images do with their neighbours. Then it tells places apart, however
  // densely they were surveyed.
  std::string entropy_over = "places";
  // Two places are confusable when each scores at least this part of what the other one's best look-alike
  // does.  REQUIRES: in (0, 1]
  double confusable_score_ratio = 0.6;
  // And when they lie at least so far apart: nearer ones see the same things.  REQUIRES: > 0
  double confusable_distance_m = 3;
  // Most confusable places of one, those that score most.  REQUIRES: >= 0
  int max_num_confusable = 8;
};
OptionTable DescribeOptions(AmbiguityOptions* options);

// Sets every node's entropy [Mariottini11 eq. 1] and the confusable pairs.  The distribution of an image is
// that of the scores that it gets as a query, its own included (see entropy_over); of several images at one
// node, their mean; nodes collect their images'.  Pairs are found among nodes with places (one per node; none
// without poses) that are not linked: what is linked shows the same.  An image that the vocabulary lacks
// could be anywhere. Same result for any number of threads.  O(nodes * postings of their words).  Errors:
// InvalidArgument (an option), Cancelled.
Status FindAmbiguity(const Vocabulary& vocabulary, const std::vector<std::optional<FloorPose>>& places,
                     const AmbiguityOptions& options, int num_threads, Progress* progress,
                     Appearance* appearance);

}  // namespace cairn::link_appearance
