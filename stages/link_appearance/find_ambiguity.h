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

// Which places a robot can tell from others by their appearance, and which it may mistake for others.
struct AmbiguityOptions {
  // Exponent of ProbabilitiesOfScores.  REQUIRES: > 0
  double score_exponent = kScoreExponent;
  // What the entropy of an image is taken over.  "images": all of them [Mariottini11 eq. 1], so it grows with
  // the number of images of the same place, and falls with the difference between two images of one place.
  // "places": images that are linked or lie nearer to each other than confusable_distance_m count as one, and
  // the image itself gets the score that one taken again at its place would get: that of the best other one,
  // but at least what nine of ten images score with their neighbours.  Then it describes places independently
  // of how densely they were surveyed.
  std::string entropy_over = "places";
  // Two places are confusable when each scores at least this part of the score of the other one's best
  // look-alike.  REQUIRES: in (0, 1]
  double confusable_score_ratio = 0.6;
  // And when they lie at least this far apart: nearer ones show the same things.  REQUIRES: > 0
  double confusable_distance_m = 3;
  // Most confusable places of a place, the best-scoring ones.  REQUIRES: >= 0
  int max_num_confusable = 8;
};
OptionTable DescribeOptions(AmbiguityOptions* options);

// Sets every node's entropy [Mariottini11 eq. 1] and the confusable pairs.  The distribution of an image is
// that of the scores that it gets as a query, its own included (see entropy_over); for several images at one
// node, their mean; the probability of a node is the sum over its images.  Pairs are found among nodes with
// places (one per node; none without poses) that are not linked: linked nodes show the same.  Nodes of
// `look_alikes` (may be null) are confusable wherever they lie and however they score: their images match. An
// image that the vocabulary lacks could be anywhere.  Same result for any number of threads.  O(nodes *
// postings of their words).  Errors: InvalidArgument (an option), Cancelled.
Status FindAmbiguity(const Vocabulary& vocabulary, const std::vector<std::optional<FloorPose>>& places,
                     const AmbiguityOptions& options, int num_threads, Progress* progress,
                     Appearance* appearance, const AppearanceGraph* look_alikes = nullptr);

}  // namespace cairn::link_appearance
