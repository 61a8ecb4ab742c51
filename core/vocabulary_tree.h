#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/features.h"
#include "core/ids.h"

namespace cairn {

using WordIdx = int32_t;

// Hierarchical k-means tree over descriptors [Mariottini11 §IV]: an inner node has up to `branching`
// children, a leaf is a visual word.  Nodes are stored breadth first; node 0 is the root.
struct VocabularyNode {
  int32_t first_child = -1;  // index of the first of `num_children` consecutive nodes; -1 at a leaf
  int32_t num_children = 0;
  WordIdx word = -1;  // 0 .. num_words - 1 at a leaf, else -1
};

// One entry of a word's inverted file.
struct Posting {
  int32_t document = 0;  // index into `document_ids`
  float weight = 0;      // tf-idf, normalised so that a document's vector has L2 norm 1
};

// A tree with TF-IDF inverted files over the documents (survey images) that it was filled with.
struct Vocabulary {
  int branching = 0;
  int depth = 0;
  std::vector<VocabularyNode> nodes;
  DescriptorMatrix centres;  // row i: centre of node i (row 0 unused)
  std::vector<float> idf;    // per word: ln(documents / documents with the word); 0 for unused or stopped
  std::vector<std::vector<Posting>> inverted_files;  // per word, ascending document
  std::vector<ImageId> document_ids;                 // ascending

  int num_words() const { return static_cast<int>(idf.size()); }
};

// The leaf that a descriptor falls to: at each node the child with the largest dot product of normalised
// centres, ties to the smaller index.  -1 for an empty tree.
WordIdx QuantizeDescriptor(const Vocabulary& vocabulary, const uint8_t* descriptor);

struct ScoredDocument {
  int32_t document = 0;
  float score = 0;  // 1 - |q - d|^2 / 2 of the L2-normalised vectors, in [0, 1]
};
// Documents that share at least one word with the query, best first; ties by document.  Touches shared words
// only.
std::vector<ScoredDocument> QueryVocabulary(const Vocabulary& vocabulary, const DescriptorMatrix& descriptors,
                                            int max_num_documents);

// vocabulary.db (schemas/vocabulary.sql).
Result<Vocabulary> ReadVocabulary(const std::string& path);
Status WriteVocabulary(const Vocabulary& vocabulary, const std::string& path);

}  // namespace cairn
