#include "core/recognize_place.h"

#include <algorithm>
#include <limits>

namespace cairn {

OptionTable DescribeOptions(PlaceOptions* o) {
  return {
      {.name = "min_num_words",
       .value = &o->min_num_words,
       .help = "an image with fewer descriptors whose word scores is of no place",
       .min = 1},
      {.name = "min_background_ratio",
       .value = &o->min_background_ratio,
       .help = "nor is one whose best score is less than this times the mean of all images'; 1: all are",
       .min = 1},
  };
}

std::optional<ScoredDocument> RecognizePlace(const Vocabulary& vocabulary, const std::vector<WordIdx>& words,
                                             const PlaceOptions& options) {
  const auto num_scoring =
      std::count_if(words.begin(), words.end(), [&](WordIdx word) { return vocabulary.idf[word] > 0; });
  if (num_scoring < options.min_num_words) return std::nullopt;
  const std::vector<ScoredDocument> scored =
      RankDocuments(vocabulary, words, std::numeric_limits<int>::max());
  if (scored.empty()) return std::nullopt;
  double sum = 0;
  for (const ScoredDocument& document : scored) sum += document.score;
  const double mean = sum / static_cast<double>(vocabulary.document_ids.size());
  if (scored.front().score < options.min_background_ratio * mean) return std::nullopt;
  return scored.front();
}

}  // namespace cairn
