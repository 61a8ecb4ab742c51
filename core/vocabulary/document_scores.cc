#include "core/vocabulary/document_scores.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn {

BagOfWords CountWords(const std::vector<WordIdx>& words) {
  BagOfWords bag;
  for (const WordIdx word : words) {
    if (bag.empty() || bag.back().word != word) bag.push_back({word, 0});
    ++bag.back().count;
  }
  return bag;
}

BagOfWords CountWords(const Vocabulary& vocabulary, const DescriptorMatrix& descriptors) {
  if (vocabulary.nodes.empty()) return {};
  return CountWords(QuantizeDescriptors(vocabulary, descriptors));
}

std::vector<BagOfWords> DocumentWords(const Vocabulary& vocabulary) {
  std::vector<BagOfWords> bags(vocabulary.document_ids.size());
  for (WordIdx word = 0; word < vocabulary.num_words(); ++word) {
    for (const Posting& posting : vocabulary.inverted_files[word]) {
      bags[posting.document].push_back({word, posting.count});
    }
  }
  return bags;
}

std::vector<double> ScoreDocuments(const Vocabulary& vocabulary, const BagOfWords& bag) {
  std::vector<double> scores(vocabulary.document_ids.size(), 0.0);
  double squared_norm = 0;
  for (const WordCount& entry : bag) {
    const double idf = vocabulary.idf[entry.word];
    const double weight = entry.count * idf;
    squared_norm += weight * weight;
    for (const Posting& posting : vocabulary.inverted_files[entry.word]) {
      scores[posting.document] += weight * idf * posting.count;
    }
  }
  const double norm = std::sqrt(squared_norm);
  for (size_t i = 0; i < scores.size(); ++i) {
    // [Mariottini11 §IV] q . d = 1 - |q - d|^2 / 2 of the normalised vectors, where the source has |q - d|^2
    if (scores[i] > 0) scores[i] = std::min(1.0, scores[i] / (norm * vocabulary.document_norms[i]));
  }
  return scores;
}

std::vector<int32_t> BestFirst(const std::vector<double>& scores) {
  std::vector<std::pair<double, int32_t>> pairs;  // scores side by side are sorted faster
  pairs.reserve(scores.size());
  for (const double score : scores) pairs.emplace_back(-score, static_cast<int32_t>(pairs.size()));
  std::sort(pairs.begin(), pairs.end());
  std::vector<int32_t> order;
  order.reserve(pairs.size());
  for (const auto& [negative, i] : pairs) order.push_back(i);
  return order;
}

std::vector<double> ProbabilitiesOfScores(const std::vector<double>& scores, double exponent) {
  const double best = scores.empty() ? 0 : *std::max_element(scores.begin(), scores.end());
  std::vector<double> probabilities(scores.size(), 1.0 / static_cast<double>(scores.size()));
  if (best <= 0) return probabilities;
  double sum = 0;
  for (size_t i = 0; i < scores.size(); ++i) {
    // [Mariottini11 §IV] "normalised so as to represent a pdf": how is not given
    probabilities[i] = std::pow(scores[i] / best, exponent);  // at least one is 1: no overflow, no zero sum
    sum += probabilities[i];
  }
  for (double& p : probabilities) p /= sum;
  return probabilities;
}

double Entropy(const std::vector<double>& probabilities) {
  double entropy = 0;
  for (const double p : probabilities) {
    // [Mariottini11 eq. 1] H = -sum_j p_j log p_j, in nats
    if (p > 0) entropy -= p * std::log(p);
  }
  return std::max(0.0, entropy);
}

double JeffreyDivergence(const std::vector<double>& p, const std::vector<double>& q, double uniform_ratio) {
  const double floor = uniform_ratio / static_cast<double>(p.size());
  double divergence = 0;
  for (size_t i = 0; i < p.size(); ++i) {
    if (p[i] == q[i]) continue;
    const double a = (1 - uniform_ratio) * p[i] + floor, b = (1 - uniform_ratio) * q[i] + floor;
    // [Mariottini11 eq. 6-7] D(h || h') + D(h' || h), with D(h || h') = sum h log(h / h'), bin by bin
    divergence += (a - b) * std::log(a / b);
  }
  return divergence;
}

}  // namespace cairn
