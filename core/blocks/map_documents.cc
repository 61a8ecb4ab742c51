#include "core/blocks/map_documents.h"

#include <map>
#include <utility>

namespace cairn {

std::vector<char> DocumentImages(const MapRows& rows) {
  if (rows.documents == "all") return std::vector<char>(rows.images.size(), 1);
  std::vector<char> is_document(rows.images.size(), 0);
  for (const MapAppearanceNode& node : rows.appearance) {
    if (!node.is_kept) continue;
    for (const int32_t image : node.images) is_document[image] = 1;
  }
  return is_document;
}

void AddDocuments(const DescriptorMatrix& landmark_descriptors, const std::vector<MapImage>& images,
                  const std::vector<char>& is_document, Vocabulary* tree) {
  std::vector<WordIdx> words(landmark_descriptors.rows());
  for (Eigen::Index i = 0; i < landmark_descriptors.rows(); ++i) {
    words[i] = QuantizeDescriptor(*tree, landmark_descriptors.row(i).data());
  }
  for (size_t image = 0; image < images.size(); ++image) {
    if (!is_document[image]) continue;
    const auto document = static_cast<int32_t>(tree->document_ids.size());
    tree->document_ids.push_back(images[image].image_id);
    std::map<WordIdx, int32_t> num_seen;
    for (const LandmarkIdx landmark : images[image].landmarks) ++num_seen[words[landmark]];
    for (const auto& [word, count] : num_seen) tree->inverted_files[word].push_back({document, count});
  }
  WeightVocabulary(tree);
}

MapRows WithAllDocuments(MapRows rows) {
  rows.documents = "all";
  if (rows.vocabulary.nodes.empty()) return rows;
  rows.vocabulary.document_ids.clear();
  for (std::vector<Posting>& postings : rows.vocabulary.inverted_files) postings.clear();
  AddDocuments(rows.descriptors, rows.images, DocumentImages(rows), &rows.vocabulary);
  return rows;
}

}  // namespace cairn
