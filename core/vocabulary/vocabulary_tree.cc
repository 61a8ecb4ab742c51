#include "core/vocabulary/vocabulary_tree.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/vocabulary/document_scores.h"
#include "core/vocabulary/nearest_centre.h"

namespace cairn {

Status NumberVocabularyNodes(Vocabulary* vocabulary) {
  const int64_t num_nodes = static_cast<int64_t>(vocabulary->nodes.size());
  int64_t next_child = 1;
  WordIdx next_word = 0;
  for (int64_t i = 0; i < num_nodes; ++i) {
    VocabularyNode& node = vocabulary->nodes[i];
    if (node.num_children == 0) {
      node.first_child = -1;
      node.word = next_word++;
      continue;
    }
    if (node.num_children < 0 || next_child <= i || next_child + node.num_children > num_nodes) {
      return MakeError(ErrorCode::kCorrupt, "vocabulary node {}: {} children do not fit {} nodes", i,
                       node.num_children, num_nodes);
    }
    node.first_child = static_cast<int32_t>(next_child);
    node.word = -1;
    next_child += node.num_children;
  }
  if (num_nodes > 0 && next_child != num_nodes) {
    return MakeError(ErrorCode::kCorrupt, "vocabulary: {} nodes, but children for {}", num_nodes, next_child);
  }
  vocabulary->inverted_files.resize(next_word);
  return Ok();
}

void WeightVocabulary(Vocabulary* vocabulary) {
  const double num_documents = static_cast<double>(vocabulary->document_ids.size());
  vocabulary->idf.assign(vocabulary->num_words(), 0.f);
  std::vector<double> squared_norms(vocabulary->document_ids.size(), 0.0);
  vocabulary->document_num_words.assign(vocabulary->document_ids.size(), 0);
  for (int word = 0; word < vocabulary->num_words(); ++word) {
    const std::vector<Posting>& postings = vocabulary->inverted_files[word];
    if (postings.empty()) continue;
    // [Mariottini11 §IV] inverse document frequency; |v_d| to normalise by
    vocabulary->idf[word] =
        static_cast<float>(std::log(num_documents / static_cast<double>(postings.size())));
    for (const Posting& posting : postings) {
      const double weight = static_cast<double>(posting.count) * vocabulary->idf[word];
      squared_norms[posting.document] += weight * weight;
      ++vocabulary->document_num_words[posting.document];
    }
  }
  vocabulary->document_norms.resize(squared_norms.size());
  for (size_t i = 0; i < squared_norms.size(); ++i) {
    vocabulary->document_norms[i] = static_cast<float>(std::sqrt(squared_norms[i]));
  }
}

WordIdx QuantizeDescriptor(const Vocabulary& vocabulary, const uint8_t* descriptor) {
  if (vocabulary.nodes.empty()) return -1;
  // [Mariottini11 §IV] the leaf that a descriptor's path ends at is its word
  const VocabularyNode* node = &vocabulary.nodes[0];
  const DescriptorSpace space = vocabulary.kind.space();
  while (node->num_children > 0) {
    const uint8_t* centres =
        vocabulary.centres.data() + static_cast<size_t>(node->first_child) * space.num_values;
    node =
        &vocabulary.nodes[node->first_child + NearestCentre(centres, node->num_children, descriptor, space)];
  }
  return node->word;
}

std::vector<WordIdx> QuantizeDescriptors(const Vocabulary& vocabulary, const DescriptorMatrix& descriptors) {
  std::vector<WordIdx> words(descriptors.rows());
  for (Eigen::Index row = 0; row < descriptors.rows(); ++row) {
    words[row] = QuantizeDescriptor(vocabulary, descriptors.row(row).data());
  }
  std::sort(words.begin(), words.end());
  return words;
}

std::vector<ScoredDocument> RankDocuments(const Vocabulary& vocabulary, const std::vector<WordIdx>& words,
                                          int max_num_documents) {
  const std::vector<double> scores = ScoreDocuments(vocabulary, CountWords(words));
  std::vector<ScoredDocument> scored;
  for (size_t i = 0; i < scores.size(); ++i) {
    if (scores[i] > 0) scored.push_back({static_cast<int32_t>(i), static_cast<float>(scores[i])});
  }
  const size_t num_kept = std::min<size_t>(scored.size(), std::max(0, max_num_documents));
  std::partial_sort(scored.begin(), scored.begin() + num_kept, scored.end(),
                    [](const ScoredDocument& a, const ScoredDocument& b) {
                      return std::pair(-a.score, a.document) < std::pair(-b.score, b.document);
                    });
  scored.resize(num_kept);
  return scored;
}

std::vector<ScoredDocument> QueryVocabulary(const Vocabulary& vocabulary, const DescriptorMatrix& descriptors,
                                            int max_num_documents) {
  if (vocabulary.nodes.empty()) return {};
  return RankDocuments(vocabulary, QuantizeDescriptors(vocabulary, descriptors), max_num_documents);
}

}  // namespace cairn
