#include "stages/build_vocabulary/build_vocabulary.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/features/features.h"

namespace cairn::build_vocabulary {
namespace {

// Stream of the seed; the other streams grow the tree.
constexpr uint64_t kSampleStream = 0;

// `count` of the numbers below `total`, drawn without repetition, ascending.
std::vector<int64_t> Draw(int64_t total, int64_t count, uint64_t seed) {
  std::vector<int64_t> numbers(total);
  std::iota(numbers.begin(), numbers.end(), int64_t{0});
  if (count >= total) return numbers;
  Random random(seed);
  for (int64_t i = 0; i < count; ++i) std::swap(numbers[i], numbers[random.UniformInt(i, total - 1)]);
  numbers.resize(count);
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

DescriptorMatrix TrainingDescriptors(const std::vector<ImageDescriptors>& images, const DescriptorKind& kind,
                                     int64_t num_descriptors, int max_num_training_descriptors,
                                     uint64_t seed) {
  const std::vector<int64_t> drawn =
      Draw(num_descriptors, max_num_training_descriptors, MixSeed(seed, kSampleStream));
  DescriptorMatrix training(static_cast<Eigen::Index>(drawn.size()), kind.num_values);
  size_t image = 0;
  int64_t first = 0;  // number of the image's first descriptor
  for (size_t i = 0; i < drawn.size(); ++i) {
    while (drawn[i] >= first + images[image].descriptors.rows()) first += images[image++].descriptors.rows();
    training.row(i) = images[image].descriptors.row(drawn[i] - first);
  }
  return training;
}

void FillInvertedFiles(const std::vector<ImageDescriptors>& images, double max_document_ratio,
                       int num_threads, Progress& progress, Vocabulary* vocabulary) {
  std::vector<std::vector<WordIdx>> words(images.size());  // ascending
  progress.Begin("filling inverted files", static_cast<int64_t>(images.size()), "images");
  ParallelFor(static_cast<int64_t>(images.size()), num_threads, [&](int64_t i) {
    words[i] = QuantizeDescriptors(*vocabulary, images[i].descriptors);
    progress.Advance();
  });
  progress.End();
  for (size_t i = 0; i < images.size(); ++i) {
    vocabulary->document_ids.push_back(images[i].image_id);
    for (const WordIdx word : words[i]) {
      // [Mariottini11 §IV] the word's inverted file: the images that have it, and how often
      std::vector<Posting>& postings = vocabulary->inverted_files[word];
      if (postings.empty() || postings.back().document != static_cast<int32_t>(i)) {
        postings.push_back({static_cast<int32_t>(i), 0});
      }
      ++postings.back().count;
    }
  }
  const double max_length = max_document_ratio * static_cast<double>(images.size());
  for (std::vector<Posting>& postings : vocabulary->inverted_files) {
    if (static_cast<double>(postings.size()) > max_length) postings = {};  // [Mariottini11 §VII-A] stop list
  }
}

}  // namespace

OptionTable DescribeOptions(BuildVocabularyOptions* o) {
  OptionTable table = {
      {.name = "branching",
       .value = &o->tree.branching,
       .help = "most children of a node [Mariottini11: 10]",
       .min = 2,
       .max = 256},
      {.name = "depth",
       .value = &o->tree.depth,
       .help = "levels below the root [Mariottini11: 4]; 0: from the data",
       .min = 0,
       .max = 8},
      {.name = "descriptors_per_word",
       .value = &o->tree.descriptors_per_word,
       .help = "descriptors a word should hold on average when the depth comes from the data",
       .min = 1},
      {.name = "min_num_descriptors_to_split",
       .value = &o->tree.min_num_descriptors_to_split,
       .help = "a node with fewer training descriptors is not split",
       .min = 2},
      {.name = "max_num_training_descriptors",
       .value = &o->max_num_training_descriptors,
       .help = "most descriptors that train the tree",
       .min = 1},
      {.name = "max_num_iterations",
       .value = &o->tree.max_num_iterations,
       .help = "most rounds of k-means per node",
       .min = 1},
      {.name = "max_document_ratio",
       .value = &o->max_document_ratio,
       .help = "words in more than this part of the images do not score (stop list); 1: all score",
       .min = 1e-9,
       .max = 1},
      {.name = "tree_from",
       .value = &o->tree_from,
       .help = "vocabulary.db of an earlier compilation, whose words are used again; absolute or relative to "
               "the recipe; empty: words are learnt"},
  };
  AddCondition({"depth", {"0"}}, {"descriptors_per_word"}, &table);
  AddCondition({"tree_from", {""}},
               {"branching", "depth", "descriptors_per_word", "min_num_descriptors_to_split",
                "max_num_training_descriptors", "max_num_iterations"},
               &table);
  return table;
}

Result<Vocabulary> BuildVocabulary(const std::vector<ImageDescriptors>& images, const DescriptorKind& kind,
                                   const BuildVocabularyOptions& options, uint64_t seed, int num_threads,
                                   Progress& progress, const Vocabulary* tree) {
  BuildVocabularyOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  int64_t num_descriptors = 0;
  for (size_t i = 0; i < images.size(); ++i) {
    if (i > 0 && images[i].image_id <= images[i - 1].image_id) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "build_vocabulary: image {} after image {}; expected ascending ids",
                       images[i].image_id, images[i - 1].image_id);
    }
    num_descriptors += images[i].descriptors.rows();
  }
  if (num_descriptors == 0) {
    return MakeError(ErrorCode::kNoData,
                     "build_vocabulary: no descriptors in {} images; are the images blank?", images.size());
  }
  Vocabulary vocabulary;
  if (tree != nullptr) {
    CAIRN_RETURN_IF_ERROR(CheckSameKind(kind, tree->kind, "build_vocabulary: the survey"));
    vocabulary.kind = tree->kind;
    vocabulary.branching = tree->branching;
    vocabulary.depth = tree->depth;
    vocabulary.nodes = tree->nodes;
    vocabulary.centres = tree->centres;
    CAIRN_RETURN_IF_ERROR(NumberVocabularyNodes(&vocabulary));
  } else {
    const DescriptorMatrix training =
        TrainingDescriptors(images, kind, num_descriptors, options.max_num_training_descriptors, seed);
    CAIRN_ASSIGN_OR_RETURN(vocabulary, GrowVocabulary(training, kind, num_descriptors, options.tree, seed,
                                                      num_threads, progress));
  }
  FillInvertedFiles(images, options.max_document_ratio, num_threads, progress, &vocabulary);
  WeightVocabulary(&vocabulary);
  return vocabulary;
}

}  // namespace cairn::build_vocabulary
