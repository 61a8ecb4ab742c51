#pragma once

#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/features/features.h"
#include "core/vocabulary/vocabulary_tree.h"

namespace cairn {

// How a vocabulary tree is grown [Mariottini11 §IV].  Differs from it: the depth follows the number of
// descriptors (the source: L = 4), branches without descriptors are pruned, a node that holds too few is not
// split, and k-means runs on directions (largest dot product), as the tree's query does.
struct GrowVocabularyOptions {
  // Most children of a node [Mariottini11: k = 10].  REQUIRES: in [2, 256]
  int branching = 10;
  // Levels below the root [Mariottini11: L = 4]; 0: the depth at which a word gets nearest to
  // descriptors_per_word.  REQUIRES: in [0, 8]
  int depth = 0;
  // Descriptors that a word should hold on average when the depth is chosen (on a logarithmic scale).
  // REQUIRES: >= 1
  double descriptors_per_word = 3;
  // A node below the root with fewer training descriptors than this is not split.  REQUIRES: >= 2
  int min_num_descriptors_to_split = 5;
  // Most rounds of k-means per node.  REQUIRES: >= 1
  int max_num_iterations = 10;
};

// The tree over `training`, which stands for `num_descriptors` (they choose the depth); inverted files empty.
// The same for any number of threads: all sums are of integers.  If all descriptors are equal, the tree is
// one word; with fewer distinct descriptors than branches, each is a word.  Cost: training descriptors *
// depth * rounds * branching dot products.  Errors: Cancelled.
Result<Vocabulary> GrowVocabulary(const DescriptorMatrix& training, const DescriptorKind& kind,
                                  int64_t num_descriptors, const GrowVocabularyOptions& options,
                                  uint64_t seed, int num_threads, Progress& progress);

}  // namespace cairn
