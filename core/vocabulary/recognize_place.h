#pragma once

#include <optional>
#include <vector>

#include "core/options/options.h"
#include "core/vocabulary/document_scores.h"
#include "core/vocabulary/vocabulary_tree.h"

namespace cairn {

// Whether an image shows a place of the survey at all, and which.  The source always answers with the image
// that scores best [Mariottini11 §IV]; a picture of a blank wall, or of another building, shows no place of
// the survey.
struct PlaceOptions {
  // With fewer words that score: no place.  REQUIRES: >= 1
  int min_num_words = 10;
  // Most documents, as a power of ten, that would share by chance alone what the best one shares
  // (Log10NumDocumentsByChance).  Views of the same things get far below -10, also with a hundred words;
  // images of no place stay near 0 or above, however many words they have.  REQUIRES: none
  double max_log10_chance = -1;
};
OptionTable DescribeOptions(PlaceOptions* options);

// Documents that would share words worth as much as `document` does with `bag`, if words occurred in
// documents by chance, as a power of ten.  Word w, in df_w of N documents, is then in this one, which has l
// times as many different words as the mean, with the probability p_w = 1 - (1 - df_w / N)^l, independently
// of other words, and sharing it is worth -ln p_w.  The sum's tail has Chernoff's bound:
//
//   P(sum >= s) <= min over t >= 0 of  prod_w (1 - p_w + p_w p_w^-t) e^(-t s)
//
// How often a word occurs does not count: one surface repeats it.  At most log10 N, which is the result where
// nothing is shared.  REQUIRES: document is one of the vocabulary's
double Log10NumDocumentsByChance(const Vocabulary& vocabulary, const BagOfWords& bag, int32_t document);

// The document most like `words` (ascending), ties to the smaller; nothing where that is no
// evidence (PlaceOptions).
std::optional<ScoredDocument> RecognizePlace(const Vocabulary& vocabulary, const std::vector<WordIdx>& words,
                                             const PlaceOptions& options = {});

}  // namespace cairn
