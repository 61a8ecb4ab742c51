#include "core/vocabulary/recognize_place.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn {
namespace {

// A word of the image and the worth of sharing it, -ln of its probability p.
struct Chance {
  double p = 0;
  double worth = 0;
};

// Slope over t of the logarithm of the bound, sum_w ln(1 - p_w + p_w e^(t worth_w)) - t shared.
double Slope(const std::vector<Chance>& words, double shared, double t) {
  double slope = -shared;
  for (const Chance& word : words) {
    slope += word.worth / (1 + (1 - word.p) * std::exp((1 - t) * word.worth));  // p = e^-worth
  }
  return slope;
}

double LogBound(const std::vector<Chance>& words, double shared, double t) {
  double bound = -t * shared;
  for (const Chance& word : words) {
    const double x = (t - 1) * word.worth;
    bound += x > 0 ? x + std::log1p((1 - word.p) * std::exp(-x)) : std::log1p(std::exp(x) - word.p);
  }
  return bound;
}

}  // namespace

OptionTable DescribeOptions(PlaceOptions* o) {
  return {
      {.name = "min_num_words",
       .value = &o->min_num_words,
       .help = "an image with fewer descriptors whose words score shows no place of the survey",
       .min = 1},
      {.name = "max_log10_chance",
       .value = &o->max_log10_chance,
       .help = "nor is one of whose words more than 10^this images would share as much by chance"},
  };
}

double Log10NumDocumentsByChance(const Vocabulary& vocabulary, const BagOfWords& bag, int32_t document) {
  const auto num_documents = static_cast<double>(vocabulary.document_ids.size());
  double num_word_postings = 0;
  for (const int32_t num_words : vocabulary.document_num_words) num_word_postings += num_words;
  const double length = vocabulary.document_num_words[document] * num_documents / num_word_postings;
  std::vector<Chance> words;
  double shared = 0;
  for (const WordCount& entry : bag) {
    const std::vector<Posting>& postings = vocabulary.inverted_files[entry.word];
    const double p = -std::expm1(length * std::log1p(-static_cast<double>(postings.size()) / num_documents));
    if (!(p > 0 && p < 1)) continue;  // a word of no image, or of all
    words.push_back({p, -std::log(p)});
    const auto at = std::lower_bound(postings.begin(), postings.end(), document,
                                     [](const Posting& posting, int32_t d) { return posting.document < d; });
    if (at != postings.end() && at->document == document) shared += words.back().worth;
  }
  // The bound is convex in t; 64 is as good as infinite (every word shared).
  double low = 0, high = 64;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (Slope(words, shared, middle) < 0 ? low : high) = middle;
  }
  return (std::min(0.0, LogBound(words, shared, low)) + std::log(num_documents)) / std::log(10.0);
}

std::optional<ScoredDocument> RecognizePlace(const Vocabulary& vocabulary, const std::vector<WordIdx>& words,
                                             const PlaceOptions& options) {
  const auto num_scoring =
      std::count_if(words.begin(), words.end(), [&](WordIdx word) { return vocabulary.idf[word] > 0; });
  if (num_scoring < options.min_num_words) return std::nullopt;
  const std::vector<ScoredDocument> best = RankDocuments(vocabulary, words, 1);
  if (best.empty()) return std::nullopt;
  const double chance = Log10NumDocumentsByChance(vocabulary, CountWords(words), best.front().document);
  if (chance > options.max_log10_chance) return std::nullopt;
  return best.front();
}

}  // namespace cairn
