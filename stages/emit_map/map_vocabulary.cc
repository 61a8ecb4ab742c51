#include "stages/emit_map/map_vocabulary.h"

#include <algorithm>

#include "core/blocks/map_documents.h"

namespace cairn::emit_map {
namespace {

// Landmarks below every node.
std::vector<int64_t> CountLandmarks(const Vocabulary& tree, const DescriptorMatrix& descriptors) {
  std::vector<int64_t> of_word(tree.num_words(), 0);
  for (Eigen::Index i = 0; i < descriptors.rows(); ++i) {
    ++of_word[QuantizeDescriptor(tree, descriptors.row(i).data())];
  }
  std::vector<int64_t> counts(tree.nodes.size(), 0);
  for (size_t node = tree.nodes.size(); node-- > 0;) {  // children come after their parent
    if (tree.nodes[node].num_children == 0) counts[node] = of_word[tree.nodes[node].word];
    for (int i = 0; i < tree.nodes[node].num_children; ++i)
      counts[node] += counts[tree.nodes[node].first_child + i];
  }
  return counts;
}

}  // namespace

Vocabulary CutVocabulary(const Vocabulary& tree, const DescriptorMatrix& landmark_descriptors,
                         const std::vector<MapImage>& images, const std::vector<char>& is_document,
                         double landmarks_per_word) {
  const std::vector<int64_t> counts = CountLandmarks(tree, landmark_descriptors);
  Vocabulary cut;
  cut.kind = tree.kind;
  std::vector<int32_t> kept = {0};  // nodes of `tree`, breadth first
  std::vector<int> depths = {0};
  for (size_t i = 0; i < kept.size(); ++i) {
    VocabularyNode& node = cut.nodes.emplace_back();
    const VocabularyNode& old = tree.nodes[kept[i]];
    if (static_cast<double>(counts[kept[i]]) <= landmarks_per_word) continue;
    for (int child = 0; child < old.num_children; ++child) {
      if (counts[old.first_child + child] == 0) continue;
      kept.push_back(old.first_child + child);
      depths.push_back(depths[i] + 1);
      ++node.num_children;
    }
    cut.branching = std::max(cut.branching, node.num_children);
  }
  cut.depth = depths.back();
  cut.centres.resize(static_cast<Eigen::Index>(kept.size()), tree.centres.cols());
  for (size_t i = 0; i < kept.size(); ++i)
    cut.centres.row(static_cast<Eigen::Index>(i)) = tree.centres.row(kept[i]);
  (void)NumberVocabularyNodes(&cut);  // the counts are right by construction

  AddDocuments(landmark_descriptors, images, is_document, &cut);
  return cut;
}

Vocabulary SurveyVocabulary(const Vocabulary& vocabulary, const std::vector<MapImage>& images,
                            const std::vector<char>& is_document) {
  Vocabulary survey = vocabulary;
  survey.document_ids.clear();
  for (size_t i = 0; i < images.size(); ++i) {
    if (is_document[i]) survey.document_ids.push_back(images[i].image_id);
  }
  std::vector<int32_t> new_of_old(vocabulary.document_ids.size(), -1);
  for (size_t old = 0; old < vocabulary.document_ids.size(); ++old) {
    const auto found = std::lower_bound(survey.document_ids.begin(), survey.document_ids.end(),
                                        vocabulary.document_ids[old]);
    if (found != survey.document_ids.end() && *found == vocabulary.document_ids[old])
      new_of_old[old] = static_cast<int32_t>(found - survey.document_ids.begin());
  }
  for (std::vector<Posting>& postings : survey.inverted_files) {
    for (Posting& posting : postings) posting.document = new_of_old[posting.document];
    std::erase_if(postings, [](const Posting& posting) { return posting.document < 0; });
  }
  WeightVocabulary(&survey);
  return survey;
}

}  // namespace cairn::emit_map
