#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/features/features.h"
#include "core/files/database.h"

namespace cairn {

using WordIdx = int32_t;

// Hierarchical k-means tree over descriptors [Mariottini11 §IV]: an inner node has up to `branching`
// children, a leaf is a visual word.  Nodes are stored breadth first; node 0 is the root.
struct VocabularyNode {
  int32_t first_child = -1;  // index of the first of `num_children` consecutive nodes; -1 at a leaf
  int32_t num_children = 0;
  WordIdx word = -1;  // 0 .. num_words - 1 at a leaf, else -1
};

// One entry of a word's inverted file: how often the word occurs in a document.
struct Posting {
  int32_t document = 0;  // index into `document_ids`
  int32_t count = 0;     // at least 1
  friend bool operator==(const Posting&, const Posting&) = default;
};

// A tree with TF-IDF inverted files over the documents (survey images) that it was filled with.
struct Vocabulary {
  int branching = 0;
  int depth = 0;
  std::vector<VocabularyNode> nodes;
  DescriptorKind kind;       // of the descriptors whose words these are
  DescriptorMatrix centres;  // row i: centre of node i, of a descriptor's norm (row 0 unused)
  std::vector<std::vector<Posting>> inverted_files;  // per word, ascending document; empty for a stopped word
  std::vector<ImageId> document_ids;                 // ascending

  // Made from the inverted files by WeightVocabulary.
  std::vector<float> idf;  // per word: ln(documents / documents with the word); 0 for an empty file
  std::vector<float> document_norms;        // per document: L2 norm of its vector (count * idf)
  std::vector<int32_t> document_num_words;  // per document: different words of it

  int num_words() const { return static_cast<int>(inverted_files.size()); }
};

// Numbers the nodes: sets `first_child` and `word` of every node and sizes `inverted_files`, from the nodes'
// `num_children` alone, breadth first.
// Errors: Corrupt when the counts do not add up to the number of nodes.
Status NumberVocabularyNodes(Vocabulary* vocabulary);
// Sets `idf`, `document_norms` and `document_num_words` from the inverted files.
void WeightVocabulary(Vocabulary* vocabulary);

// The leaf that a descriptor falls to: at each node the child whose centre has the largest dot product with
// it, ties to the smaller index.  -1 for an empty tree.
WordIdx QuantizeDescriptor(const Vocabulary& vocabulary, const uint8_t* descriptor);

struct ScoredDocument {
  int32_t document = 0;
  float score = 0;  // 1 - |q - d|^2 / 2 = q . d of the L2-normalised vectors, in [0, 1]
};
// The words that descriptors fall to, ascending, one for each of them.
std::vector<WordIdx> QuantizeDescriptors(const Vocabulary& vocabulary, const DescriptorMatrix& descriptors);

// Documents with a positive score for `words` (ascending, in the tree), best first, ties by document, at most
// `max_num_documents`.  Reads shared words only.
std::vector<ScoredDocument> RankDocuments(const Vocabulary& vocabulary, const std::vector<WordIdx>& words,
                                          int max_num_documents);
// The same for the words of descriptors.
std::vector<ScoredDocument> QueryVocabulary(const Vocabulary& vocabulary, const DescriptorMatrix& descriptors,
                                            int max_num_documents);

// vocabulary.db (schemas/vocabulary.sql).
Result<Vocabulary> ReadVocabulary(const std::string& path);
Status WriteVocabulary(const Vocabulary& vocabulary, const std::string& path);
// The same tables in an open database, which a map has too.  They throw SQLite::Exception: call them inside
// WithDatabaseErrors.  Every count, length and index is checked.
Result<Vocabulary> ReadVocabularyTables(SQLite::Database& database, const std::string& path);
void WriteVocabularyTables(SQLite::Database& database, const Vocabulary& vocabulary);
// CREATE TABLE statements of these tables.
extern const char* const kVocabularySchema;

}  // namespace cairn
