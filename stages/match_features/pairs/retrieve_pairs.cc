#include "stages/match_features/pairs/retrieve_pairs.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "core/base/parallel.h"
#include "core/features/features.h"
#include "core/vocabulary/grow_vocabulary.h"

namespace cairn::match_features {
namespace {

// Largest number of descriptors from which a tree is grown here: 13 MB, a few seconds.
constexpr int64_t kMaxNumTrainingDescriptors = 100'000;
// Finer words than the map's: they need not represent landmarks, only distinguish images.
constexpr GrowVocabularyOptions kTreeOptions = {.descriptors_per_word = 10,
                                                .min_num_descriptors_to_split = 10};
// Number of images whose descriptors are in memory at a time.
constexpr int kBlockSize = 64;

// Every n-th descriptor of the images in their order, with n such that there are at most
// kMaxNumTrainingDescriptors.
Result<DescriptorMatrix> SampleDescriptors(SQLite::Database& database, const MatchImages& images,
                                           int64_t num_descriptors, const Progress& progress) {
  const int64_t step = (num_descriptors + kMaxNumTrainingDescriptors - 1) / kMaxNumTrainingDescriptors;
  DescriptorMatrix sample((num_descriptors + step - 1) / step, images.descriptor_kind.num_values);
  int64_t first = 0;  // number of the image's first descriptor
  for (const MatchImage& image : images.images) {
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while reading features");
    CAIRN_ASSIGN_OR_RETURN(const DescriptorMatrix descriptors,
                           ReadDatabaseDescriptors(database, image.image_id, images.descriptor_kind));
    if (descriptors.rows() != image.num_features) {  // what the sample was sized by
      return MakeError(ErrorCode::kCorrupt, "{}: image {} has {} descriptors, and {} by its rows",
                       DatabasePath(database), image.name, descriptors.rows(), image.num_features);
    }
    for (int64_t i = (first + step - 1) / step * step; i < first + descriptors.rows(); i += step) {
      sample.row(i / step) = descriptors.row(i - first);
    }
    first += descriptors.rows();
  }
  return sample;
}

}  // namespace

ImageSimilarity::ImageSimilarity(const std::vector<std::vector<WordIdx>>& words, int num_words)
    : vectors_(words.size()), inverted_files_(num_words) {
  std::vector<int> num_images_with(num_words, 0);
  for (size_t i = 0; i < words.size(); ++i) {
    for (size_t begin = 0, end = 0; begin < words[i].size(); begin = end) {
      while (end < words[i].size() && words[i][end] == words[i][begin]) ++end;
      vectors_[i].push_back({words[i][begin], static_cast<float>(end - begin)});
      ++num_images_with[words[i][begin]];
    }
  }
  for (size_t i = 0; i < vectors_.size(); ++i) {
    double squared_norm = 0;
    for (Entry& entry : vectors_[i]) {
      entry.weight *=
          static_cast<float>(std::log(static_cast<double>(words.size()) / num_images_with[entry.word]));
      squared_norm += static_cast<double>(entry.weight) * entry.weight;
    }
    for (Entry& entry : vectors_[i]) {
      if (entry.weight == 0) continue;  // a word of all images
      entry.weight = static_cast<float>(entry.weight / std::sqrt(squared_norm));
      inverted_files_[entry.word].push_back({static_cast<int>(i), entry.weight});
    }
  }
}

std::vector<int> ImageSimilarity::Ranked(int idx) const {
  std::vector<double> scores(vectors_.size(), 0.0);
  for (const Entry& entry : vectors_[idx]) {
    for (const Posting& posting : inverted_files_[entry.word]) {
      scores[posting.image] += static_cast<double>(entry.weight) * posting.weight;
    }
  }
  std::vector<int> ranked;
  for (int i = 0; i < static_cast<int>(scores.size()); ++i) {
    if (i != idx && scores[i] > 0) ranked.push_back(i);
  }
  std::sort(ranked.begin(), ranked.end(),
            [&](int a, int b) { return std::pair(-scores[a], a) < std::pair(-scores[b], b); });
  return ranked;
}

Result<Vocabulary> VocabularyForRetrieval(SQLite::Database& database, const MatchImages& images,
                                          const std::string& vocabulary_path, uint64_t seed, int num_threads,
                                          Progress& progress) {
  if (!vocabulary_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(Vocabulary vocabulary, ReadVocabulary(vocabulary_path));
    CAIRN_RETURN_IF_ERROR(CheckSameKind(vocabulary.kind, images.descriptor_kind, vocabulary_path));
    if (vocabulary.num_words() > 1) return vocabulary;
    return MakeError(ErrorCode::kNoData,
                     "{}: a vocabulary of {} word(s) cannot distinguish images; build it from images with "
                     "features, or leave --vocabulary out: one is then grown from the images at hand",
                     vocabulary_path, vocabulary.num_words());
  }
  int64_t num_descriptors = 0;
  for (const MatchImage& image : images.images) num_descriptors += image.num_features;
  CAIRN_ASSIGN_OR_RETURN(const DescriptorMatrix sample,
                         SampleDescriptors(database, images, num_descriptors, progress));
  return GrowVocabulary(sample, images.descriptor_kind, num_descriptors, kTreeOptions, seed, num_threads,
                        progress);
}

Result<std::vector<std::vector<WordIdx>>> QuantizeImages(SQLite::Database& database,
                                                         const MatchImages& images,
                                                         const std::vector<int>& idxs,
                                                         const Vocabulary& vocabulary, int num_threads,
                                                         Progress& progress) {
  const int num_images = static_cast<int>(idxs.size());
  std::vector<std::vector<WordIdx>> words(num_images);
  progress.Begin("compare images", num_images, "images");
  for (int begin = 0; begin < num_images; begin += kBlockSize) {
    std::vector<DescriptorMatrix> block(std::min(kBlockSize, num_images - begin));
    for (size_t i = 0; i < block.size(); ++i) {
      if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while comparing images");
      CAIRN_ASSIGN_OR_RETURN(
          block[i],
          ReadDatabaseDescriptors(database, images.images[idxs[begin + i]].image_id, images.descriptor_kind));
    }
    ParallelFor(static_cast<int64_t>(block.size()), num_threads, [&](int64_t i) {
      words[begin + i] = QuantizeDescriptors(vocabulary, block[i]);
      progress.Advance();
    });
  }
  progress.End();
  return words;
}

std::vector<std::vector<int>> RetrievedPartners(const ImageSimilarity& similarity,
                                                const std::vector<int>& idxs, int num_retrieved,
                                                int num_threads) {
  std::vector<std::vector<int>> partners(idxs.size());
  ParallelFor(static_cast<int64_t>(idxs.size()), num_threads, [&](int64_t i) {
    partners[i] = similarity.MostSimilar(idxs[i], num_retrieved, [](int) { return true; });
  });
  return partners;
}

std::vector<std::vector<int>> LoopPartners(const ImageSimilarity& similarity, const std::vector<int>& idxs,
                                           const std::vector<int>& order, int window, int num_loops,
                                           int num_threads) {
  std::vector<int> place(order.size());  // of each image in the order
  for (int i = 0; i < static_cast<int>(order.size()); ++i) place[order[i]] = i;
  std::vector<std::vector<int>> partners(idxs.size());
  ParallelFor(static_cast<int64_t>(idxs.size()), num_threads, [&](int64_t i) {
    partners[i] = similarity.MostSimilar(
        idxs[i], num_loops, [&](int other) { return std::abs(place[other] - place[idxs[i]]) > window; });
  });
  return partners;
}

}  // namespace cairn::match_features
