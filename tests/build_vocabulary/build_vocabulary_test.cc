#include "stages/build_vocabulary/build_vocabulary.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <numeric>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/files/file.h"
#include "core/vocabulary/split_node.h"
#include "tests/recorded_progress.h"

namespace cairn::build_vocabulary {
namespace {

// A random descriptor with squared norm near 512^2.
Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim> RandomDescriptor(Random& random) {
  Eigen::Matrix<double, 1, kSiftDescriptorDim> direction;
  for (int i = 0; i < kSiftDescriptorDim; ++i) direction[i] = std::pow(random.Uniform(), 3);
  direction *= 512 / direction.norm();
  return direction.array().min(255).round().cast<uint8_t>();
}

// `num_images` images of `num_descriptors` random descriptors each.
std::vector<ImageDescriptors> RandomImages(int num_images, int num_descriptors, uint64_t seed) {
  Random random(seed);
  std::vector<ImageDescriptors> images(num_images);
  for (int i = 0; i < num_images; ++i) {
    images[i].image_id = 10 * (i + 1);
    images[i].descriptors.resize(num_descriptors, kSiftDescriptorDim);
    for (int row = 0; row < num_descriptors; ++row) images[i].descriptors.row(row) = RandomDescriptor(random);
  }
  return images;
}

Result<Vocabulary> Build(const std::vector<ImageDescriptors>& images, const BuildVocabularyOptions& options,
                         int num_threads = 2, uint64_t seed = 7) {
  NoProgress progress;
  return BuildVocabulary(images, {}, options, seed, num_threads, progress);
}

std::string FileBytes(const Vocabulary& vocabulary, const std::string& name) {
  const std::string path = testing::TempDir() + "/" + name;
  std::filesystem::remove(path);
  EXPECT_TRUE(WriteVocabulary(vocabulary, path).ok());
  return *ReadFile(path);
}

TEST(BuildVocabulary, TakesOverTheWordsOfAnEarlierTree) {
  const auto before = RandomImages(6, 300, 1), after = RandomImages(6, 300, 2);
  const Vocabulary tree = *Build(before, {});
  NoProgress progress;
  const Vocabulary same = *BuildVocabulary(before, {}, {}, 8, 2, progress, &tree);
  EXPECT_EQ(FileBytes(same, "same.db"), FileBytes(tree, "tree.db"));
  const Vocabulary other = *BuildVocabulary(after, {}, {}, 8, 2, progress, &tree);
  EXPECT_EQ(other.centres, tree.centres);
  EXPECT_EQ(other.num_words(), tree.num_words());
  EXPECT_NE(other.inverted_files, tree.inverted_files);
  int64_t num_features = 0;
  for (const auto& postings : other.inverted_files) {
    for (const Posting& posting : postings) num_features += posting.count;
  }
  EXPECT_EQ(num_features, 6 * 300);
}

TEST(BuildVocabulary, SameBytesForAnyNumberOfThreads) {
  const auto images = RandomImages(12, 900, 1);
  const std::string one = FileBytes(*Build(images, {}, 1), "vocabulary_1.db");
  EXPECT_EQ(FileBytes(*Build(images, {}, 2), "vocabulary_2.db"), one);
  EXPECT_EQ(FileBytes(*Build(images, {}, 7), "vocabulary_7.db"), one);
}

TEST(BuildVocabulary, SplitOfSomeRowsIsThatOfThemAlone) {
  const DescriptorMatrix rows = RandomImages(1, 60, 4)[0].descriptors;
  std::vector<int32_t> odd, all(30);
  DescriptorMatrix odd_rows(30, kSiftDescriptorDim);
  for (int i = 0; i < 30; ++i) {
    odd.push_back(2 * i + 1);
    all[i] = i;
    odd_rows.row(i) = rows.row(2 * i + 1);
  }
  const std::vector<NodeChild> of_some = SplitNode(rows, {}, odd, 5, 10, 9, 1);
  const std::vector<NodeChild> alone = SplitNode(odd_rows, {}, all, 5, 10, 9, 1);
  ASSERT_EQ(of_some.size(), alone.size());
  ASSERT_GE(of_some.size(), 2u);
  for (size_t i = 0; i < alone.size(); ++i) {
    EXPECT_EQ(of_some[i].centre, alone[i].centre);
    ASSERT_EQ(of_some[i].members.size(), alone[i].members.size());
    for (size_t k = 0; k < alone[i].members.size(); ++k) {
      EXPECT_EQ(of_some[i].members[k], 2 * alone[i].members[k] + 1);
    }
  }
}

TEST(BuildVocabulary, TellsHowFarItIs) {
  BuildVocabularyOptions options;
  options.tree.depth = 2;
  options.tree.min_num_descriptors_to_split = 2;
  RecordedProgress progress;
  ASSERT_TRUE(BuildVocabulary(RandomImages(5, 100, 2), {}, options, 7, 2, progress).ok());
  progress.ExpectAllDone();
  ASSERT_GE(progress.tasks.size(), 2u);
  EXPECT_EQ(progress.tasks[1].name, "training vocabulary");
  EXPECT_EQ(progress.tasks[1].total, 2 * 500);  // each level has all
}

TEST(BuildVocabulary, SeedChangesTheTree) {
  const auto images = RandomImages(4, 300, 1);
  EXPECT_NE(FileBytes(*Build(images, {}, 1, 1), "seed_1.db"),
            FileBytes(*Build(images, {}, 1, 2), "seed_2.db"));
}

TEST(BuildVocabulary, DepthFollowsTheNumberOfDescriptors) {
  BuildVocabularyOptions options;
  options.tree.descriptors_per_word = 40;
  // Words wanted: 100 / 40 = 2.5 (nearest power of ten: 10^0, at least one level), 4000 / 40 = 100 = 10^2.
  EXPECT_EQ(Build(RandomImages(2, 50, 1), options)->depth, 1);
  EXPECT_EQ(Build(RandomImages(4, 1000, 1), options)->depth, 2);
  // By default 4000 / 3 = 1333, nearest to 10^3.
  EXPECT_EQ(Build(RandomImages(4, 1000, 1), {})->depth, 3);
}

TEST(BuildVocabulary, EveryDescriptorIsInTheFileOfItsWord) {
  const auto images = RandomImages(5, 200, 3);
  const Vocabulary vocabulary = *Build(images, {});
  int64_t total = 0;
  for (const auto& postings : vocabulary.inverted_files) {
    for (size_t i = 0; i < postings.size(); ++i) {
      total += postings[i].count;
      if (i > 0) {
        EXPECT_LT(postings[i - 1].document, postings[i].document);
      }
    }
  }
  EXPECT_EQ(total, 5 * 200);
  for (size_t i = 0; i < images.size(); ++i) {
    const WordIdx word = QuantizeDescriptor(vocabulary, images[i].descriptors.row(17).data());
    EXPECT_THAT(vocabulary.inverted_files[word], testing::Contains(testing::Field(&Posting::document, i)));
  }
}

TEST(BuildVocabulary, NodeWithFewDescriptorsIsNotSplit) {
  BuildVocabularyOptions options;
  options.tree.depth = 6;
  options.tree.min_num_descriptors_to_split = 50;
  const Vocabulary vocabulary = *Build(RandomImages(1, 400, 3), options);
  EXPECT_LT(vocabulary.num_words(), 400);
  EXPECT_GT(vocabulary.num_words(), 10);
}

TEST(BuildVocabulary, FewerDescriptorsThanBranchesMakeAWordEach) {
  const auto images = RandomImages(1, 4, 5);
  const Vocabulary vocabulary = *Build(images, {});
  EXPECT_EQ(vocabulary.num_words(), 4);
  std::set<WordIdx> words;
  for (int i = 0; i < 4; ++i)
    words.insert(QuantizeDescriptor(vocabulary, images[0].descriptors.row(i).data()));
  EXPECT_EQ(words.size(), 4u);
}

TEST(BuildVocabulary, EqualDescriptorsMakeOneWord) {
  std::vector<ImageDescriptors> images = RandomImages(2, 30, 5);
  for (ImageDescriptors& image : images) {
    for (int row = 0; row < 30; ++row) image.descriptors.row(row).setConstant(45);
  }
  const Vocabulary vocabulary = *Build(images, {});
  ASSERT_EQ(vocabulary.num_words(), 1);
  EXPECT_THAT(vocabulary.inverted_files[0], testing::ElementsAre(Posting{0, 30}, Posting{1, 30}));
  EXPECT_EQ(QuantizeDescriptor(vocabulary, images[0].descriptors.row(0).data()), 0);
  EXPECT_EQ(vocabulary.idf[0], 0.f);  // ln(2 / 2): tells nothing apart
  EXPECT_TRUE(QueryVocabulary(vocabulary, images[0].descriptors, 10).empty());
}

TEST(BuildVocabulary, StopListSilencesWordsOfManyImages) {
  std::vector<ImageDescriptors> images = RandomImages(4, 40, 8);
  Random random(1);
  const auto common = RandomDescriptor(random);
  for (ImageDescriptors& image : images) image.descriptors.row(0) = common;
  BuildVocabularyOptions options;
  options.tree.depth = 3;
  options.tree.min_num_descriptors_to_split = 2;
  options.max_document_ratio = 0.5;
  const Vocabulary vocabulary = *Build(images, options);
  const WordIdx word = QuantizeDescriptor(vocabulary, common.data());
  EXPECT_TRUE(vocabulary.inverted_files[word].empty());
  EXPECT_EQ(vocabulary.idf[word], 0.f);
  for (const auto& postings : vocabulary.inverted_files) EXPECT_LE(postings.size(), 2u);
}

TEST(BuildVocabulary, ImageWithoutDescriptorsIsADocumentWithoutWords) {
  std::vector<ImageDescriptors> images = RandomImages(3, 50, 8);
  images[1].descriptors.resize(0, kSiftDescriptorDim);
  const Vocabulary vocabulary = *Build(images, {});
  EXPECT_EQ(vocabulary.document_ids.size(), 3u);
  EXPECT_EQ(vocabulary.document_norms[1], 0.f);
}

TEST(BuildVocabulary, NoDescriptorsIsAnError) {
  EXPECT_EQ(Build({}, {}).error().code, ErrorCode::kNoData);
  EXPECT_EQ(Build(RandomImages(3, 0, 1), {}).error().code, ErrorCode::kNoData);
}

TEST(BuildVocabulary, OptionOutsideItsRangeIsAnError) {
  BuildVocabularyOptions options;
  options.tree.branching = 1;
  EXPECT_EQ(Build(RandomImages(1, 10, 1), options).error().code, ErrorCode::kInvalidArgument);
}

// As a source that is read image by image has them.
DescriptorSource SourceOf(const std::vector<ImageDescriptors>& images) {
  DescriptorSource source;
  for (const ImageDescriptors& image : images) {
    source.image_ids.push_back(image.image_id);
    source.num_descriptors.push_back(static_cast<int>(image.descriptors.rows()));
  }
  source.read = [&images](size_t i) -> Result<DescriptorMatrix> { return images[i].descriptors; };
  return source;
}

TEST(BuildVocabulary, OfMoreImagesThanAreReadAtOnceEachIsADocument) {
  const std::vector<ImageDescriptors> images = RandomImages(600, 5, 3);
  NoProgress progress;
  const Vocabulary vocabulary = *BuildVocabulary(SourceOf(images), {}, {}, 7, 2, progress);
  EXPECT_EQ(FileBytes(vocabulary, "source.db"), FileBytes(*Build(images, {}), "images.db"));
  ASSERT_EQ(vocabulary.document_ids.size(), 600u);
  std::vector<std::map<int32_t, int32_t>> expected(vocabulary.num_words());
  for (int32_t i = 0; i < 600; ++i) {
    EXPECT_EQ(vocabulary.document_ids[i], images[i].image_id);
    for (int row = 0; row < 5; ++row)
      ++expected[QuantizeDescriptor(vocabulary, images[i].descriptors.row(row).data())][i];
  }
  for (int word = 0; word < vocabulary.num_words(); ++word) {
    std::map<int32_t, int32_t> found;
    for (const Posting& posting : vocabulary.inverted_files[word]) found[posting.document] = posting.count;
    EXPECT_EQ(found, expected[word]);
    EXPECT_EQ(found.size(), vocabulary.inverted_files[word].size());
  }
}

TEST(BuildVocabulary, TrainsWithDescriptorsDrawnFromAll) {
  const std::vector<ImageDescriptors> images = RandomImages(7, 40, 3);
  BuildVocabularyOptions options;
  options.max_num_training_descriptors = 100;
  const uint64_t seed = 7;
  // All numbers, the first hundred of which change places with others.
  std::vector<int> numbers(280);
  std::iota(numbers.begin(), numbers.end(), 0);
  Random random(MixSeed(seed, 0));
  for (int i = 0; i < 100; ++i) std::swap(numbers[i], numbers[random.UniformInt(i, 279)]);
  numbers.resize(100);
  std::sort(numbers.begin(), numbers.end());
  DescriptorMatrix training(100, kSiftDescriptorDim);
  for (int i = 0; i < 100; ++i) training.row(i) = images[numbers[i] / 40].descriptors.row(numbers[i] % 40);
  NoProgress progress;
  const Vocabulary expected = *GrowVocabulary(training, {}, 280, options.tree, seed, 1, progress);
  const Vocabulary found = *Build(images, options, 2, seed);
  EXPECT_EQ(found.centres, expected.centres);
  // As many as there are, all of them.
  options.max_num_training_descriptors = 280;
  EXPECT_EQ(Build(images, options)->centres, Build(images, {})->centres);
  options.max_num_training_descriptors = 279;
  EXPECT_NE(FileBytes(*Build(images, options), "most.db"), FileBytes(*Build(images, {}), "all.db"));
}

TEST(BuildVocabulary, WhatASourceCannotReadIsItsError) {
  const std::vector<ImageDescriptors> images = RandomImages(300, 5, 3);
  NoProgress progress;
  for (const size_t unreadable : {0, 2, 299}) {
    DescriptorSource source = SourceOf(images);
    source.read = [&](size_t i) -> Result<DescriptorMatrix> {
      if (i == unreadable) return MakeError(ErrorCode::kIo, "image {} is gone", i);
      return images[i].descriptors;
    };
    const Result<Vocabulary> vocabulary = BuildVocabulary(source, {}, {}, 7, 2, progress);
    ASSERT_FALSE(vocabulary.ok());
    EXPECT_EQ(vocabulary.error().code, ErrorCode::kIo);
    // With a tree only the second reading is left.
    const Vocabulary tree = *Build(images, {});
    EXPECT_EQ(BuildVocabulary(source, {}, {}, 7, 2, progress, &tree).error().code, ErrorCode::kIo);
  }
  DescriptorSource longer = SourceOf(images);
  longer.num_descriptors[4] = 6;
  const Result<Vocabulary> vocabulary = BuildVocabulary(longer, {}, {}, 7, 2, progress);
  ASSERT_FALSE(vocabulary.ok());
  EXPECT_EQ(vocabulary.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(vocabulary.error().message, testing::HasSubstr("image 50 has 5 descriptors, expected 6"));
}

TEST(BuildVocabulary, SubsampledTrainingStillFilesEveryDescriptor) {
  BuildVocabularyOptions options;
  options.max_num_training_descriptors = 100;
  const Vocabulary vocabulary = *Build(RandomImages(5, 200, 3), options);
  int64_t total = 0;
  for (const auto& postings : vocabulary.inverted_files) {
    for (const Posting& posting : postings) total += posting.count;
  }
  EXPECT_EQ(total, 1000);
}

}  // namespace
}  // namespace cairn::build_vocabulary
