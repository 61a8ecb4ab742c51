#pragma once

#include <cstdint>
#include <vector>

#include "core/error.h"
#include "core/features.h"
#include "core/ids.h"
#include "core/options.h"
#include "core/progress.h"
#include "core/vocabulary_tree.h"

namespace cairn {

// Learns the visual words of a place, and notes which survey image shows which of them, so that the images
// most like a robot's view are found in a few milliseconds.  Before: extract_features.  After: emit_map.
// Implements [Mariottini11 §IV]: hierarchical k-means with branching k = 10; each leaf is a word with an
// inverted file; documents are weighted by word count times inverse document frequency.  Differs from it: the
// depth follows the number of descriptors (the source: L = 4), branches without descriptors are pruned, a
// node that holds too few is not split, and k-means runs on directions (largest dot product), as the tree's
// query does.
struct BuildVocabularyOptions {
  // Most children of a node [Mariottini11: k = 10].  REQUIRES: in [2, 256]
  int branching = 10;
  // Levels below the root [Mariottini11: L = 4]; 0: the depth at which a word gets nearest to
  // descriptors_per_word. REQUIRES: in [0, 8]
  int depth = 0;
  // Descriptors that a word should hold on average when the depth is chosen (on a logarithmic scale).
  // REQUIRES: >= 1
  double descriptors_per_word = 40;
  // A node below the root with fewer training descriptors than this is not split.  REQUIRES: >= 2
  int min_num_descriptors_to_split = 20;
  // Most descriptors that train the tree, drawn evenly from all; the inverted files always cover all.
  // REQUIRES: >= 1
  int max_num_training_descriptors = 200000;
  // Most rounds of k-means per node.  REQUIRES: >= 1
  int max_num_iterations = 10;
  // Stop list [Mariottini11 §VII-A]: words that occur in more than this part of the images do not score (the
  // source gives no value; 1 = no stop list).  REQUIRES: in (0, 1]
  double max_document_ratio = 1;
};
OptionTable DescribeOptions(BuildVocabularyOptions* options);

// A survey image's descriptors.
struct ImageDescriptors {
  ImageId image_id = 0;
  DescriptorMatrix descriptors;
};

// Pure: no files, no clock; the same tree for any number of threads (all sums are of integers).  An image
// without descriptors is a document without words.  If all descriptors are equal, the tree is one word; with
// fewer distinct descriptors than branches, each is a word. Cost: training descriptors * depth * rounds *
// branching dot products. Errors: InvalidArgument (an option; images not in ascending order), NoData (no
// descriptors), Cancelled.
Result<Vocabulary> BuildVocabulary(const std::vector<ImageDescriptors>& images,
                                   const BuildVocabularyOptions& options, uint64_t seed, int num_threads,
                                   Progress& progress);

}  // namespace cairn
