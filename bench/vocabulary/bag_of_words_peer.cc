#include "bench/vocabulary/bag_of_words_peer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/base/random.h"

namespace cairn {
namespace {

float SquaredDistance(const std::vector<float>& a, const std::vector<float>& b) {
  float sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

std::vector<float> ToFloats(const uint8_t* descriptor) {
  return std::vector<float>(descriptor, descriptor + kSiftDescriptorDim);
}

// k-means++
std::vector<std::vector<float>> DrawCentres(const std::vector<std::vector<float>>& training,
                                            const std::vector<int>& members, int branching, uint64_t seed) {
  Random random(seed);
  std::vector<std::vector<float>> centres = {
      training[members[random.UniformInt(0, static_cast<int64_t>(members.size()) - 1)]]};
  std::vector<double> nearest(members.size(), std::numeric_limits<double>::max());
  while (static_cast<int>(centres.size()) < branching) {
    double total = 0;
    for (size_t i = 0; i < members.size(); ++i) {
      nearest[i] = std::min<double>(nearest[i], SquaredDistance(training[members[i]], centres.back()));
      total += nearest[i];
    }
    if (total == 0) break;
    double target = random.Uniform() * total;
    size_t chosen = 0;
    while (chosen + 1 < members.size() && target >= nearest[chosen]) target -= nearest[chosen++];
    centres.push_back(training[members[chosen]]);
  }
  return centres;
}

int Nearest(const std::vector<std::vector<float>>& centres, const std::vector<float>& descriptor) {
  int nearest = 0;
  float least = std::numeric_limits<float>::max();
  for (size_t k = 0; k < centres.size(); ++k) {
    const float distance = SquaredDistance(centres[k], descriptor);
    if (distance < least) least = distance, nearest = static_cast<int>(k);
  }
  return nearest;
}

}  // namespace

void BagOfWordsPeer::Train(const DescriptorMatrix& training, const Options& options) {
  std::vector<std::vector<float>> floats(training.rows());
  for (Eigen::Index i = 0; i < training.rows(); ++i) floats[i] = ToFloats(training.row(i).data());
  std::vector<int> members(floats.size());
  std::iota(members.begin(), members.end(), 0);
  uint64_t next_stream = 0;
  Split(&root_, floats, members, 0, options, &next_stream);
}

void BagOfWordsPeer::Split(Node* node, const std::vector<std::vector<float>>& training,
                           const std::vector<int>& members, int level, const Options& options,
                           uint64_t* next_stream) {
  std::vector<std::vector<float>> centres;
  if (level < options.depth && members.size() > 1) {
    centres = DrawCentres(training, members, options.branching, MixSeed(options.seed, (*next_stream)++));
  }
  if (centres.size() < 2) {
    node->word = num_words_++;
    return;
  }
  std::vector<int> nearest(members.size(), -1);
  for (int iteration = 0; iteration < options.max_num_iterations; ++iteration) {
    bool is_changed = false;
    std::vector<std::vector<float>> sums(centres.size(), std::vector<float>(kSiftDescriptorDim, 0.f));
    std::vector<int> counts(centres.size(), 0);
    for (size_t i = 0; i < members.size(); ++i) {
      const int centre = Nearest(centres, training[members[i]]);
      is_changed |= centre != nearest[i];
      nearest[i] = centre;
      ++counts[centre];
      for (int d = 0; d < kSiftDescriptorDim; ++d) sums[centre][d] += training[members[i]][d];
    }
    if (!is_changed) break;
    for (size_t k = 0; k < centres.size(); ++k) {
      if (counts[k] == 0) continue;
      for (int d = 0; d < kSiftDescriptorDim; ++d) centres[k][d] = sums[k][d] / static_cast<float>(counts[k]);
    }
  }
  for (size_t k = 0; k < centres.size(); ++k) {
    std::vector<int> of_child;
    for (size_t i = 0; i < members.size(); ++i) {
      if (nearest[i] == static_cast<int>(k)) of_child.push_back(members[i]);
    }
    node->children.push_back(std::make_unique<Node>());
    node->children.back()->descriptor = centres[k];
    Split(node->children.back().get(), training, of_child, level + 1, options, next_stream);
  }
}

int BagOfWordsPeer::Word(const uint8_t* descriptor) const {
  const std::vector<float> floats = ToFloats(descriptor);
  const Node* node = &root_;
  while (!node->children.empty()) {
    const Node* nearest = nullptr;
    float least = std::numeric_limits<float>::max();
    for (const auto& child : node->children) {
      const float distance = SquaredDistance(child->descriptor, floats);
      if (distance < least) least = distance, nearest = child.get();
    }
    node = nearest;
  }
  return node->word;
}

BagOfWordsPeer::Bag BagOfWordsPeer::Transform(const DescriptorMatrix& descriptors) const {
  Bag bag;
  for (Eigen::Index i = 0; i < descriptors.rows(); ++i) {
    const int word = Word(descriptors.row(i).data());
    const double weight = weights_.empty() ? 1 : weights_[word];
    if (weight > 0) bag[word] += weight;
  }
  double norm = 0;
  for (const auto& [word, weight] : bag) norm += weight;
  for (auto& [word, weight] : bag) weight /= norm;
  return bag;
}

void BagOfWordsPeer::AddDocuments(const std::vector<const DescriptorMatrix*>& documents) {
  weights_.clear();
  std::vector<Bag> bags;
  std::vector<int> num_documents_with(num_words_, 0);
  for (const DescriptorMatrix* descriptors : documents) {
    bags.push_back(Transform(*descriptors));  // counts, except for a factor
    for (const auto& [word, weight] : bags.back()) ++num_documents_with[word];
  }
  for (const int number : num_documents_with) {
    weights_.push_back(number > 0 ? std::log(static_cast<double>(documents.size()) / number) : 0);
  }
  inverted_files_.assign(num_words_, {});
  for (size_t i = 0; i < bags.size(); ++i) {
    double norm = 0;
    for (auto& [word, weight] : bags[i]) norm += weight *= weights_[word];
    for (const auto& [word, weight] : bags[i]) {
      if (weight > 0) inverted_files_[word].emplace_back(static_cast<int>(i), weight / norm);
    }
  }
}

std::vector<std::pair<double, int>> BagOfWordsPeer::Query(const Bag& bag, int max_num_documents) const {
  std::map<int, double> scores;  // |q - d|_1 = 2 + sum over shared words of |q - d| - |q| - |d|
  for (const auto& [word, query_weight] : bag) {
    for (const auto& [document, weight] : inverted_files_[word]) {
      scores[document] += std::abs(query_weight - weight) - query_weight - weight;
    }
  }
  std::vector<std::pair<double, int>> ranked;
  for (const auto& [document, sum] : scores) ranked.emplace_back(sum, document);
  std::sort(ranked.begin(), ranked.end());
  if (static_cast<int>(ranked.size()) > max_num_documents) ranked.resize(max_num_documents);
  for (auto& [score, document] : ranked) score = -score / 2;
  return ranked;
}

}  // namespace cairn
