#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/vocabulary/vocabulary_tree.h"
#include "stages/match_features/pairs/image_features.h"
#include "stages/match_features/pairs/select_pairs.h"

namespace cairn::match_features {

// Images that look alike, by the words of a vocabulary tree [Nister06: scalable recognition with a vocabulary
// tree]: each image is a vector of its words' counts times their inverse document frequency, images are
// compared by the cosine of their vectors, through inverted files.
class ImageSimilarity {
 public:
  // `words[i]`: the words of image i, ascending.  REQUIRES: each in [0, num_words)
  ImageSimilarity(const std::vector<std::vector<WordIdx>>& words, int num_words);

  // The images most like image `idx` for which `accept` holds, best first, ties to the smaller index, at most
  // `max_num`.  Images without a common word are never among them.  Cost: the postings of its words.
  template <typename Accept>
  std::vector<int> MostSimilar(int idx, int max_num, const Accept& accept) const {
    std::vector<int> similar;
    for (const int other : Ranked(idx)) {
      if (static_cast<int>(similar.size()) == max_num) break;
      if (accept(other)) similar.push_back(other);
    }
    return similar;
  }

 private:
  struct Entry {
    WordIdx word;
    float weight;  // of the vector with norm 1
  };
  struct Posting {
    int image;
    float weight;
  };
  std::vector<int> Ranked(int idx) const;

  std::vector<std::vector<Entry>> vectors_;           // per image
  std::vector<std::vector<Posting>> inverted_files_;  // per word
};

// The vocabulary.db at `vocabulary_path`, of which only the tree is used, so it may have been made from other
// images.  Empty: a tree grown from an even sample of the descriptors at hand, the same for any number of
// threads.  Errors: NoData (a vocabulary without words), those of ReadVocabulary, Corrupt, Cancelled;
// throws SQLite::Exception.
Result<Vocabulary> VocabularyForRetrieval(SQLite::Database& database, const MatchImages& images,
                                          const std::string& vocabulary_path, uint64_t seed, int num_threads,
                                          Progress& progress);

// The words of images, ascending, in the order of `idxs` (indices into images.images).  Features are read one
// block of images at a time.  Errors: Corrupt, Cancelled; throws SQLite::Exception.
Result<std::vector<std::vector<WordIdx>>> QuantizeImages(SQLite::Database& database,
                                                         const MatchImages& images,
                                                         const std::vector<int>& idxs,
                                                         const Vocabulary& vocabulary, int num_threads,
                                                         Progress& progress);

// For each image of `idxs` the `num_retrieved` images most like it.
std::vector<std::vector<int>> RetrievedPartners(const ImageSimilarity& similarity,
                                                const std::vector<int>& idxs, int num_retrieved,
                                                int num_threads);

// Loop candidates: for each image of `idxs` the `num_loops` images most like it of those farther than
// `window` from it in `order` (image indices).
std::vector<std::vector<int>> LoopPartners(const ImageSimilarity& similarity, const std::vector<int>& idxs,
                                           const std::vector<int>& order, int window, int num_loops,
                                           int num_threads);

}  // namespace cairn::match_features
