#pragma once

#include <cstdint>
#include <vector>

#include "core/features/features.h"
#include "core/vocabulary/vocabulary_tree.h"

namespace cairn {

// How often a word occurs in an image.
struct WordCount {
  WordIdx word = 0;
  int32_t count = 0;  // at least 1
  friend bool operator==(const WordCount&, const WordCount&) = default;
};

// An image as its words, ascending.
using BagOfWords = std::vector<WordCount>;

// `words`: ascending, one for each feature.
BagOfWords CountWords(const std::vector<WordIdx>& words);
BagOfWords CountWords(const Vocabulary& vocabulary, const DescriptorMatrix& descriptors);
// The same for every document, from the inverted files: stopped words are missing.  O(postings).
std::vector<BagOfWords> DocumentWords(const Vocabulary& vocabulary);

// Score of every document, 1 - |q - d|^2 / 2 of the L2-normalised vectors, in [0, 1] [Mariottini11 §IV].
// Reads shared words only.  A bag without words that score gives zeros.
std::vector<double> ScoreDocuments(const Vocabulary& vocabulary, const BagOfWords& bag);

// Indices of scores, best first, ties to the smaller.
std::vector<int32_t> BestFirst(const std::vector<double>& scores);

// --- Scores as probabilities [Mariottini11 §IV: "normalised so as to represent a pdf"; how is not given]

// Within one building, the right place scores about twice as high as its neighbours, and these several times
// as high as a place far away: with 4 the far ones get almost nothing, while twins stay alike.
inline constexpr double kScoreExponent = 4;

// p_j = s_j^exponent / sum_k s_k^exponent: the same for scores of any scale, zero where nothing is shared,
// two equal scores equally likely.  If all scores are zero, all are equally likely.
// REQUIRES: scores >= 0, exponent > 0
std::vector<double> ProbabilitiesOfScores(const std::vector<double>& scores, double exponent);

// H = -sum_j p_j ln p_j, nats [Mariottini11 eq. 1].
double Entropy(const std::vector<double>& probabilities);

// J = D(p || q) + D(q || p), nats [Mariottini11 eq. 6-7], over all bins.  Each distribution is first mixed
// with a share of `uniform_ratio` of the uniform one: a bin that is zero in one of them would make J
// infinite.  REQUIRES: as many bins in both, uniform_ratio in (0, 1]
double JeffreyDivergence(const std::vector<double>& p, const std::vector<double>& q, double uniform_ratio);

}  // namespace cairn
