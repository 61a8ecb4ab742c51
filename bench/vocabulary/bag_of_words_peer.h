#pragma once

#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "core/features/features.h"

namespace cairn {

// The usual way of vocabulary trees in SLAM programs, made after DBoW2's description [Galvez-Lopez12] (Debian
// has no package of it): a tree of nodes with a float descriptor each, bags of words in std::map, L1-normed
// tf-idf vectors, L1 score 1 - |q - d|_1 / 2 accumulated over inverted files, one thread.  Here only to
// compare with.
class BagOfWordsPeer {
 public:
  struct Options {
    int branching = 10;
    int depth = 5;
    int max_num_iterations = 10;  // DBoW2 has no limit
    uint64_t seed = 0;
  };
  using Bag = std::map<int, double>;

  // `training` rows as floats; nodes of one descriptor are not split.
  void Train(const DescriptorMatrix& training, const Options& options);
  // All documents, in order; sets the weights.
  void AddDocuments(const std::vector<const DescriptorMatrix*>& documents);

  int Word(const uint8_t* descriptor) const;
  Bag Transform(const DescriptorMatrix& descriptors) const;
  // Best documents first.
  std::vector<std::pair<double, int>> Query(const Bag& bag, int max_num_documents) const;
  int num_words() const { return num_words_; }

 private:
  struct Node {
    std::vector<float> descriptor;
    std::vector<std::unique_ptr<Node>> children;
    int word = -1;
  };
  void Split(Node* node, const std::vector<std::vector<float>>& training, const std::vector<int>& members,
             int level, const Options& options, uint64_t* next_stream);

  Node root_;
  int num_words_ = 0;
  std::vector<double> weights_;
  std::vector<std::vector<std::pair<int, double>>> inverted_files_;
};

}  // namespace cairn
