#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/base/progress.h"
#include "core/features/features.h"
#include "core/options/options.h"
#include "core/vocabulary/grow_vocabulary.h"
#include "core/vocabulary/vocabulary_tree.h"

namespace cairn::build_vocabulary {

// Learns the visual words of a place, and notes which survey image shows which of them, so that the images
// most like a robot's view are found in a few milliseconds.  Before: extract_features.  After: emit_map.
// Implements [Mariottini11 §IV]: hierarchical k-means with branching k = 10; each leaf is a word with an
// inverted file; documents are weighted by word count times inverse document frequency.  Differs from it
// as core/vocabulary/grow_vocabulary.h says.
struct BuildVocabularyOptions {
  GrowVocabularyOptions tree;
  // Most descriptors that train the tree, drawn evenly from all; the inverted files always cover all.
  // REQUIRES: >= 1
  int max_num_training_descriptors = 200000;
  // Stop list [Mariottini11 §VII-A]: words that occur in more than this part of the images do not score (the
  // source gives no value; 1 = no stop list).  REQUIRES: in (0, 1]
  double max_document_ratio = 1;
  // vocabulary.db of an earlier compilation, whose tree is used again, so that a place that did not change
  // keeps its words and deltas between maps stay small (docs/updates.md); empty: a tree is grown.
  std::string tree_from;
};
OptionTable DescribeOptions(BuildVocabularyOptions* options);

// A survey image's descriptors, of the survey's kind.
struct ImageDescriptors {
  ImageId image_id = 0;
  DescriptorMatrix descriptors;
};

// A survey's descriptors that are read image by image, twice: those of a large one do not fit into memory.
struct DescriptorSource {
  std::vector<ImageId> image_ids;    // ascending
  std::vector<int> num_descriptors;  // per image
  // Those of an image, by its index; is called by one thread at a time.
  std::function<Result<DescriptorMatrix>(size_t)> read;
};

// With a tree, its words are used and none is grown; its documents are ignored.  No clock, and no files but
// what the source reads; the same tree for any number of threads (all sums are of integers).  An image
// without descriptors is a document without words.  If all descriptors are equal, the tree is one word; with
// fewer distinct descriptors than branches, each is a word.  Cost: training descriptors * depth * rounds *
// branching dot products.  Memory: the training descriptors, some 64 MiB of others,
// and eight bytes for each word of an image.
// Errors: InvalidArgument (an option; images not in ascending order), NoData (no descriptors), Cancelled; the
// source's.
Result<Vocabulary> BuildVocabulary(const DescriptorSource& images, const DescriptorKind& kind,
                                   const BuildVocabularyOptions& options, uint64_t seed, int num_threads,
                                   Progress& progress, const Vocabulary* tree = nullptr);
Result<Vocabulary> BuildVocabulary(const std::vector<ImageDescriptors>& images, const DescriptorKind& kind,
                                   const BuildVocabularyOptions& options, uint64_t seed, int num_threads,
                                   Progress& progress, const Vocabulary* tree = nullptr);

}  // namespace cairn::build_vocabulary
