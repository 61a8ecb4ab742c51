#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/progress.h"
#include "core/vocabulary_tree.h"
#include "stages/match_features/image_features.h"
#include "stages/match_features/select_pairs.h"

namespace cairn {

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

// The similarity of the images of a database.  `vocabulary_path` is a vocabulary.db: only its tree is used,
// so that one made from other images serves too.  Empty: a tree is grown from an even sample of the
// descriptors at hand, the same for any number of threads.  Features are read one block of images at a time.
// Errors: NoData (a vocabulary without words), those of ReadVocabulary, Corrupt, Cancelled; throws
// SQLite::Exception.
Result<ImageSimilarity> MeasureSimilarity(SQLite::Database& database, const MatchImages& images,
                                          const std::string& vocabulary_path, uint64_t seed, int num_threads,
                                          Progress& progress);

// Each image with the `num_retrieved` images most like it.
IndexPairs RetrievedPairs(const ImageSimilarity& similarity, int num_images, int num_retrieved,
                          int num_threads);

// Loop candidates: each image with the `num_loops` images most like it of those farther than `window` from it
// in `order` (image indices).
IndexPairs LoopPairs(const ImageSimilarity& similarity, const std::vector<int>& order, int window,
                     int num_loops, int num_threads);

}  // namespace cairn
