#include "stages/build_vocabulary/build_vocabulary.h"

#include <algorithm>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/features/features.h"

namespace cairn::build_vocabulary {
namespace {

// Stream of the seed; the other streams grow the tree.
constexpr uint64_t kSampleStream = 0;

// What is in memory at once: images, and bytes of their descriptors, or one image.
constexpr size_t kNumImagesAtOnce = 256;
constexpr int64_t kNumBytesAtOnce = int64_t{64} << 20;

// `count` of the numbers below `total`, or all, drawn without repetition, ascending: the first of all numbers
// after each of them has changed places with one at random [Fisher-Yates], of which only those that are no
// longer at their own are kept.
std::vector<int64_t> Draw(int64_t total, int64_t count, uint64_t seed) {
  std::vector<int64_t> numbers;
  if (count >= total) {
    numbers.resize(total);
    std::iota(numbers.begin(), numbers.end(), int64_t{0});
    return numbers;
  }
  Random random(seed);
  std::unordered_map<int64_t, int64_t> moved;  // by the place where it is
  const auto take = [&](int64_t place) {
    const auto found = moved.find(place);
    return found == moved.end() ? place : found->second;
  };
  for (int64_t i = 0; i < count; ++i) {
    const int64_t place = random.UniformInt(i, total - 1);
    numbers.push_back(take(place));
    moved[place] = take(i);
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

Result<DescriptorMatrix> ReadImage(const DescriptorSource& images, size_t i) {
  CAIRN_ASSIGN_OR_RETURN(DescriptorMatrix descriptors, images.read(i));
  if (descriptors.rows() != images.num_descriptors[i]) {
    return MakeError(ErrorCode::kCorrupt, "build_vocabulary: image {} has {} descriptors, expected {}",
                     images.image_ids[i], descriptors.rows(), images.num_descriptors[i]);
  }
  return descriptors;
}

Result<DescriptorMatrix> TrainingDescriptors(const DescriptorSource& images, const DescriptorKind& kind,
                                             int64_t num_descriptors, int max_num_training_descriptors,
                                             uint64_t seed, Progress& progress) {
  const std::vector<int64_t> drawn =
      Draw(num_descriptors, max_num_training_descriptors, MixSeed(seed, kSampleStream));
  DescriptorMatrix training(static_cast<Eigen::Index>(drawn.size()), kind.num_values);
  progress.Begin("reading descriptors", std::ssize(images.image_ids), "images");
  int64_t first = 0;  // number of the image's first descriptor
  size_t next = 0;
  for (size_t image = 0; image < images.image_ids.size(); ++image) {
    const int64_t end = first + images.num_descriptors[image];
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while reading descriptors");
    if (next < drawn.size() && drawn[next] < end) {
      CAIRN_ASSIGN_OR_RETURN(const DescriptorMatrix descriptors, ReadImage(images, image));
      for (; next < drawn.size() && drawn[next] < end; ++next)
        training.row(static_cast<Eigen::Index>(next)) = descriptors.row(drawn[next] - first);
    }
    first = end;
    progress.Advance();
  }
  progress.End();
  return training;
}

Status FillInvertedFiles(const DescriptorSource& images, double max_document_ratio, int num_threads,
                         Progress& progress, Vocabulary* vocabulary) {
  const size_t num_images = images.image_ids.size();
  progress.Begin("filling inverted files", static_cast<int64_t>(num_images), "images");
  for (size_t begin = 0, end = 0; begin < num_images; begin = end) {
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while filling inverted files");
    std::vector<DescriptorMatrix> descriptors;
    for (int64_t num_bytes = 0; end < num_images && end - begin < kNumImagesAtOnce; ++end) {
      num_bytes += int64_t{images.num_descriptors[end]} * vocabulary->kind.num_values;
      if (end > begin && num_bytes > kNumBytesAtOnce) break;
      CAIRN_ASSIGN_OR_RETURN(descriptors.emplace_back(), ReadImage(images, end));
    }
    std::vector<std::vector<WordIdx>> words(descriptors.size());  // ascending
    ParallelFor(std::ssize(descriptors), num_threads, [&](int64_t i) {
      words[i] = QuantizeDescriptors(*vocabulary, descriptors[i]);
      progress.Advance();
    });
    for (size_t i = 0; i < words.size(); ++i) {
      const auto document = static_cast<int32_t>(begin + i);
      vocabulary->document_ids.push_back(images.image_ids[begin + i]);
      for (const WordIdx word : words[i]) {
        // [Mariottini11 §IV] the word's inverted file: the images that have it, and how often
        std::vector<Posting>& postings = vocabulary->inverted_files[word];
        if (postings.empty() || postings.back().document != document) postings.push_back({document, 0});
        ++postings.back().count;
      }
    }
  }
  progress.End();
  const double max_length = max_document_ratio * static_cast<double>(num_images);
  for (std::vector<Posting>& postings : vocabulary->inverted_files) {
    if (static_cast<double>(postings.size()) > max_length) postings = {};  // [Mariottini11 §VII-A] stop list
  }
  return Ok();
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

Result<Vocabulary> BuildVocabulary(const DescriptorSource& images, const DescriptorKind& kind,
                                   const BuildVocabularyOptions& options, uint64_t seed, int num_threads,
                                   Progress& progress, const Vocabulary* tree) {
  BuildVocabularyOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  int64_t num_descriptors = 0;
  const std::vector<ImageId>& ids = images.image_ids;
  for (size_t i = 0; i < ids.size(); ++i) {
    if (i > 0 && ids[i] <= ids[i - 1]) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "build_vocabulary: image {} after image {}; expected ascending ids", ids[i],
                       ids[i - 1]);
    }
    num_descriptors += images.num_descriptors[i];
  }
  if (num_descriptors == 0) {
    return MakeError(ErrorCode::kNoData,
                     "build_vocabulary: no descriptors in {} images; are the images blank?", ids.size());
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
    CAIRN_ASSIGN_OR_RETURN(const DescriptorMatrix training,
                           TrainingDescriptors(images, kind, num_descriptors,
                                               options.max_num_training_descriptors, seed, progress));
    CAIRN_ASSIGN_OR_RETURN(vocabulary, GrowVocabulary(training, kind, num_descriptors, options.tree, seed,
                                                      num_threads, progress));
  }
  CAIRN_RETURN_IF_ERROR(
      FillInvertedFiles(images, options.max_document_ratio, num_threads, progress, &vocabulary));
  WeightVocabulary(&vocabulary);
  return vocabulary;
}

Result<Vocabulary> BuildVocabulary(const std::vector<ImageDescriptors>& images, const DescriptorKind& kind,
                                   const BuildVocabularyOptions& options, uint64_t seed, int num_threads,
                                   Progress& progress, const Vocabulary* tree) {
  DescriptorSource source;
  for (const ImageDescriptors& image : images) {
    source.image_ids.push_back(image.image_id);
    source.num_descriptors.push_back(static_cast<int>(image.descriptors.rows()));
  }
  source.read = [&](size_t i) -> Result<DescriptorMatrix> { return images[i].descriptors; };
  return BuildVocabulary(source, kind, options, seed, num_threads, progress, tree);
}

}  // namespace cairn::build_vocabulary
