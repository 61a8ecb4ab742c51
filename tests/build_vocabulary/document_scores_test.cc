#include "core/vocabulary/document_scores.h"

#include <cmath>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "stages/build_vocabulary/build_vocabulary.h"

namespace cairn::build_vocabulary {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;

DescriptorMatrix RandomQuery(int count, uint64_t seed) {
  Random random(seed);
  DescriptorMatrix descriptors(count, kSiftDescriptorDim);
  for (Eigen::Index i = 0; i < descriptors.size(); ++i)
    descriptors.data()[i] = static_cast<uint8_t>(random.UniformInt(0, 90));
  return descriptors;
}

Vocabulary RandomVocabulary(int num_images) {
  std::vector<ImageDescriptors> images;
  for (int i = 0; i < num_images; ++i)
    images.push_back({static_cast<ImageId>(i + 1), RandomQuery(40 + i, 7 + i)});
  NoProgress progress;
  return *BuildVocabulary(images, {}, {}, 0, 1, progress);
}

TEST(DocumentScores, AreThoseOfTheQuery) {
  const Vocabulary vocabulary = RandomVocabulary(12);
  const DescriptorMatrix query = RandomQuery(60, 99);
  const std::vector<double> scores = ScoreDocuments(vocabulary, CountWords(vocabulary, query));
  std::vector<double> expected(scores.size(), 0.0);
  for (const ScoredDocument& scored : QueryVocabulary(vocabulary, query, 1000))
    expected[scored.document] = scored.score;
  for (size_t i = 0; i < scores.size(); ++i) EXPECT_NEAR(scores[i], expected[i], 1e-6);
}

TEST(DocumentScores, ADocumentIsItsOwnBestMatch) {
  const Vocabulary vocabulary = RandomVocabulary(12);
  const std::vector<BagOfWords> bags = DocumentWords(vocabulary);
  for (size_t i = 0; i < bags.size(); ++i) {
    EXPECT_EQ(bags[i], CountWords(vocabulary, RandomQuery(40 + static_cast<int>(i), 7 + i)));
    const std::vector<double> scores = ScoreDocuments(vocabulary, bags[i]);
    EXPECT_NEAR(scores[i], 1, 1e-6);
    EXPECT_LE(*std::max_element(scores.begin(), scores.end()), 1);
  }
}

TEST(DocumentScores, NothingSharedScoresNothing) {
  const Vocabulary vocabulary = RandomVocabulary(3);
  EXPECT_THAT(ScoreDocuments(vocabulary, {}), ElementsAre(0, 0, 0));
  EXPECT_TRUE(CountWords(vocabulary, DescriptorMatrix(0, kSiftDescriptorDim)).empty());
  EXPECT_TRUE(CountWords(Vocabulary(), RandomQuery(5, 1)).empty());
}

TEST(ProbabilitiesOfScores, AUniquePlaceGivesAPeakAndTwinsGiveTwo) {
  const std::vector<double> unique = ProbabilitiesOfScores({0.1, 0.5, 0.1, 0.05}, 4);
  EXPECT_GT(unique[1], 0.99);
  EXPECT_LT(Entropy(unique), 0.05);
  const std::vector<double> twins = ProbabilitiesOfScores({0.5, 0.1, 0.5, 0.05}, 4);
  EXPECT_NEAR(twins[0], 0.5, 0.01);
  EXPECT_NEAR(twins[2], 0.5, 0.01);
  EXPECT_NEAR(Entropy(twins), std::log(2.0), 0.03);
}

TEST(ProbabilitiesOfScores, DoNotDependOnTheScaleAndSumToOne) {
  EXPECT_THAT(ProbabilitiesOfScores({0.2, 0.1, 0}, 2),
              ElementsAre(DoubleNear(0.8, 1e-12), DoubleNear(0.2, 1e-12), 0));
  EXPECT_THAT(ProbabilitiesOfScores({2e-200, 1e-200, 0}, 2),
              ElementsAre(DoubleNear(0.8, 1e-12), DoubleNear(0.2, 1e-12), 0));
}

TEST(ProbabilitiesOfScores, ZerosSayNothing) {
  EXPECT_THAT(ProbabilitiesOfScores({0, 0, 0, 0}, 4), ElementsAre(0.25, 0.25, 0.25, 0.25));
  EXPECT_NEAR(Entropy({0.25, 0.25, 0.25, 0.25}), std::log(4.0), 1e-12);
  EXPECT_TRUE(ProbabilitiesOfScores({}, 4).empty());
}

TEST(JeffreyDivergence, IsThatOfTheMixedDistributionsBothWays) {
  const std::vector<double> p = {0.7, 0.3, 0}, q = {0.2, 0.3, 0.5};
  double expected = 0;
  for (int i = 0; i < 3; ++i) {
    const double a = 0.9 * p[i] + 0.1 / 3, b = 0.9 * q[i] + 0.1 / 3;
    expected += a * std::log(a / b) + b * std::log(b / a);
  }
  EXPECT_NEAR(JeffreyDivergence(p, q, 0.1), expected, 1e-12);
  EXPECT_EQ(JeffreyDivergence(p, q, 0.1), JeffreyDivergence(q, p, 0.1));
  EXPECT_EQ(JeffreyDivergence(p, p, 0.1), 0);
  EXPECT_TRUE(std::isfinite(JeffreyDivergence({1, 0}, {0, 1}, 1e-9)));
}

}  // namespace
}  // namespace cairn::build_vocabulary
