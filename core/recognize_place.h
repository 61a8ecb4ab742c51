#pragma once

#include <optional>
#include <vector>

#include "core/options.h"
#include "core/vocabulary_tree.h"

namespace cairn {

// Whether an image shows a place of the survey at all, and which.  The source always answers with the image
// that scores best [Mariottini11 §IV]; a picture of a blank wall, or of another building, is of no place.
struct PlaceOptions {
  // Fewer words that score: no place.  REQUIRES: >= 1
  int min_num_words = 10;
  // The best score as a multiple of the mean of all documents' (those that share nothing count as zero): what
  // belongs to no place scores much the same with all.  1: no such test.  REQUIRES: >= 1
  double min_background_ratio = 3;
};
OptionTable DescribeOptions(PlaceOptions* options);

// The document most like `words` (ascending), ties to the smaller; none where that says nothing.
std::optional<ScoredDocument> RecognizePlace(const Vocabulary& vocabulary, const std::vector<WordIdx>& words,
                                             const PlaceOptions& options = {});

}  // namespace cairn
