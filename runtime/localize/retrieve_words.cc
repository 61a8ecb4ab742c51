// Survey images that share words with the query: of the vocabulary, or, without one, landmarks as words.
#include <algorithm>
#include <cmath>
#include <functional>

#include "core/blocks/map_blocks.h"
#include "core/features/descriptor_distance.h"
#include "core/features/descriptor_matcher.h"
#include "core/vocabulary/vocabulary_tree.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/appearance_map.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

// Images by q . d / (|q| |d|), best first, ties by image; those with a score near enough to the best one's.
std::vector<Candidate> BestImages(const std::vector<double>& dots, double query_norm,
                                  const std::function<double(size_t)>& document_norm,
                                  const RetrieveOptions& options) {
  std::vector<Candidate> scored;
  for (size_t image = 0; image < dots.size(); ++image) {
    if (dots[image] <= 0) continue;
    // As float, so that the last bits of a sum in another order do not decide.
    const auto score = static_cast<float>(std::min(1.0, dots[image] / (query_norm * document_norm(image))));
    scored.push_back({static_cast<int32_t>(image), score});
  }
  const size_t num_kept = std::min<size_t>(scored.size(), options.max_num_candidates);
  std::partial_sort(scored.begin(), scored.begin() + static_cast<std::ptrdiff_t>(num_kept), scored.end(),
                    [](const Candidate& a, const Candidate& b) {
                      return std::pair(-a.score, a.image) < std::pair(-b.score, b.image);
                    });
  scored.resize(num_kept);
  // [Mariottini11 fn 4] candidates exceed "a percentage of the maximum value"
  while (!scored.empty() && scored.back().score < options.min_score_ratio * scored.front().score)
    scored.pop_back();
  return scored;
}

// How many images are documents, and which ones where not all are.
struct Documents {
  double count = 0;
  std::shared_ptr<const AppearanceMap> kept;  // null: all images are
  bool Has(int64_t image) const {
    if (!kept) return true;
    const NodeIdx node = kept->node_of_image[image];
    return node >= 0 && kept->is_kept[node];
  }
};

Result<Documents> DocumentsOf(const Map& map) {
  Documents documents{.count = static_cast<double>(map.num_images())};
  if (map.head().documents == "all") return documents;
  CAIRN_ASSIGN_OR_RETURN(documents.kept, map.Appearance());
  documents.count = documents.kept->num_kept_images;
  return documents;
}

Result<std::vector<Candidate>> RetrieveByVocabulary(const Map& map, const DescriptorMatrix& descriptors,
                                                    const RetrieveOptions& options) {
  CAIRN_ASSIGN_OR_RETURN(const auto tree, map.VocabularyTree());
  CAIRN_ASSIGN_OR_RETURN(const auto norms, map.DocumentNorms());
  std::vector<WordIdx> words(descriptors.rows());
  for (Eigen::Index i = 0; i < descriptors.rows(); ++i) {
    words[i] = QuantizeDescriptor(*tree, descriptors.row(i).data());
  }
  std::sort(words.begin(), words.end());

  // Sums over the words in ascending order: the same for any order of the descriptors.
  CAIRN_ASSIGN_OR_RETURN(const Documents documents, DocumentsOf(map));
  std::vector<double> dots(map.num_images(), 0.0);
  double squared_norm = 0;
  std::shared_ptr<const WordBlock> block;
  for (size_t begin = 0, end = 0; begin < words.size(); begin = end) {
    const WordIdx word = words[begin];
    while (end < words.size() && words[end] == word) ++end;
    if (!block || word >= block->first + static_cast<int64_t>(block->postings.size())) {
      CAIRN_ASSIGN_OR_RETURN(block, map.Words(map.directory().OrdinalOf(BlockKind::kWords, word)));
    }
    const std::vector<Posting>& postings = block->postings[word - block->first];
    if (postings.empty()) continue;
    // [Mariottini11 §IV] the query vector's entry, a word's count times its inverse document frequency
    const double idf = std::log(documents.count / static_cast<double>(postings.size()));
    const double query_weight = static_cast<double>(end - begin) * idf;
    squared_norm += query_weight * query_weight;
    for (const Posting& posting : postings) dots[posting.document] += query_weight * idf * posting.count;
  }
  return BestImages(
      dots, std::sqrt(squared_norm), [&](size_t image) { return (*norms)[image]; }, options);
}

Result<std::vector<Candidate>> RetrieveByLandmarks(const Map& map, const Query& query,
                                                   const RetrieveOptions& options) {
  CAIRN_ASSIGN_OR_RETURN(const auto all, map.AllLandmarks());
  std::vector<BestTwo> nearest, unused;
  FindBestTwo(query.packed, all->packed, &nearest, &unused);
  const double min_dot = kSquaredDescriptorNorm * std::cos(options.max_word_angle_rad);
  std::vector<int> counts(all->idx.size(), 0);
  for (const BestTwo& word : nearest) {
    if (word.idx < 0 || word.best < min_dot) continue;
    if (DescriptorAngleRad(word.best) <= options.max_word_ratio * DescriptorAngleRad(word.second))
      ++counts[word.idx];
  }
  CAIRN_ASSIGN_OR_RETURN(const Documents documents, DocumentsOf(map));
  // With the plus, a landmark that every image sees still counts: a map may have one image.
  std::vector<double> idf(counts.size());
  double squared_norm = 0;
  for (size_t i = 0; i < idf.size(); ++i) {
    idf[i] = std::log((static_cast<double>(map.num_images()) + 1) /
                      std::max(1, all->landmarks[i].num_observations));
    squared_norm += counts[i] * idf[i] * counts[i] * idf[i];
  }
  std::vector<double> dots(map.num_images(), 0.0), squared_norms(map.num_images(), 0.0);
  for (int64_t ordinal = 0; ordinal < map.directory().NumBlocks(BlockKind::kImages); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(ordinal));
    for (size_t i = 0; i < block->images.size(); ++i) {
      if (!documents.Has(static_cast<int64_t>(block->first + i))) continue;
      for (const LandmarkIdx landmark : block->images[i].landmarks) {
        const double squared_idf = idf[landmark] * idf[landmark];
        dots[block->first + i] += counts[landmark] * squared_idf;
        squared_norms[block->first + i] += squared_idf;
      }
    }
  }
  return BestImages(
      dots, std::sqrt(squared_norm), [&](size_t image) { return std::sqrt(squared_norms[image]); }, options);
}

}  // namespace

Result<std::vector<Candidate>> RetrieveByWords(const Map& map, const Query& query,
                                               const RetrieveOptions& options) {
  return map.has_words() ? RetrieveByVocabulary(map, query.features.descriptors, options)
                         : RetrieveByLandmarks(map, query, options);
}

}  // namespace cairn
