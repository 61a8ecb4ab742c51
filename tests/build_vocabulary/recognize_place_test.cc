#include "core/vocabulary/recognize_place.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/option_limits.h"

namespace cairn::build_vocabulary {
namespace {

// Four documents of two words each, all their own: document i has words 2 i and 2 i + 1.  Word 8 is in all.
Vocabulary FourPlaces() {
  Vocabulary vocabulary;
  vocabulary.document_ids = {1, 2, 3, 4};
  vocabulary.inverted_files.resize(9);
  for (int document = 0; document < 4; ++document) {
    for (const int word : {2 * document, 2 * document + 1, 8})
      vocabulary.inverted_files[word].push_back({document, 1});
  }
  WeightVocabulary(&vocabulary);
  return vocabulary;
}

PlaceOptions Options(int min_num_words, double max_log10_chance) {
  PlaceOptions options;
  options.min_num_words = min_num_words;
  options.max_log10_chance = max_log10_chance;
  return options;
}

TEST(RecognizePlace, CountsDocumentsThatShareAsMuchByChance) {
  const Vocabulary vocabulary = FourPlaces();
  const auto chance = [&](const std::vector<WordIdx>& words, int32_t document) {
    return Log10NumDocumentsByChance(vocabulary, CountWords(words), document);
  };
  // Each word is in a quarter of the documents.  The one word shared: 4 * 1/4; both of two: 4 * 1/16; how
  // often they occur does not count, nor does what all have.
  EXPECT_NEAR(chance({2}, 1), 0, 1e-9);
  EXPECT_NEAR(chance({2, 3}, 1), std::log10(0.25), 1e-9);
  EXPECT_NEAR(chance({2, 2, 2, 3, 8, 8}, 1), std::log10(0.25), 1e-9);
  // One of two: exp(-2 KL(1/2 || 1/4)) = 3/4 is the bound, 7/16 the truth.
  EXPECT_NEAR(chance({2, 4}, 1), std::log10(4 * 0.75), 1e-9);
  // None: all may be so.
  EXPECT_NEAR(chance({4, 6}, 0), std::log10(4.0), 1e-9);
  EXPECT_NEAR(chance({}, 0), std::log10(4.0), 1e-9);
  EXPECT_NEAR(chance({8, 8}, 0), std::log10(4.0), 1e-9);
}

TEST(RecognizePlace, WordsOfAllDocumentsAndDocumentsWithoutWordsSayNothing) {
  // Word 0 is in all three documents that have words, words 1 to 3 in one each.
  Vocabulary vocabulary;
  vocabulary.document_ids = {1, 2, 3, 4};
  vocabulary.inverted_files = {{{0, 1}, {1, 1}, {2, 1}, {3, 1}}, {{0, 1}}, {{1, 1}}, {{2, 1}}};
  WeightVocabulary(&vocabulary);
  // One word shared of one that counts: the document has 2 of 7 / 4 words, so p = 1 - (3/4)^(8/7).
  EXPECT_NEAR(Log10NumDocumentsByChance(vocabulary, CountWords({0, 1}), 0),
              std::log10(4 * (1 - std::pow(0.75, 8.0 / 7))), 1e-9);
  vocabulary.inverted_files[0].pop_back();
  WeightVocabulary(&vocabulary);
  EXPECT_NEAR(Log10NumDocumentsByChance(vocabulary, CountWords({0, 1}), 3), std::log10(4.0), 1e-9);
}

TEST(RecognizePlace, NeverPromisesLessThanChanceGives) {
  // 200 documents in which words of different frequency lie at random: the bound against all subsets of the
  // words that a query of ten may share.
  Random random(5);
  Vocabulary vocabulary;
  constexpr int kNumDocuments = 200, kNumWords = 10;
  for (int i = 0; i < kNumDocuments; ++i) vocabulary.document_ids.push_back(i + 1);
  vocabulary.inverted_files.resize(kNumWords + kNumDocuments);
  for (int word = 0; word < kNumWords; ++word) {
    for (int document = 0; document < kNumDocuments; ++document) {
      if (random.Uniform() < 0.02 * (word + 1)) vocabulary.inverted_files[word].push_back({document, 1});
    }
  }
  // A word of its own for each document: 20 in all, so that their lengths are alike.
  for (int document = 0; document < kNumDocuments; ++document) {
    vocabulary.inverted_files[kNumWords + document].push_back({document, 1});
  }
  WeightVocabulary(&vocabulary);
  const BagOfWords bag = CountWords({0, 1, 2, 3, 4, 5, 6, 7, 8, 9});
  double mean_words = 0;
  for (const int num_words : vocabulary.document_num_words) mean_words += num_words / double{kNumDocuments};
  for (int document = 0; document < kNumDocuments; ++document) {
    std::vector<double> p;
    double shared = 0;
    for (int word = 0; word < kNumWords; ++word) {
      const auto& postings = vocabulary.inverted_files[word];
      p.push_back(1 - std::pow(1 - postings.size() / double{kNumDocuments},
                               vocabulary.document_num_words[document] / mean_words));
      for (const Posting& posting : postings) shared += posting.document == document ? -std::log(p[word]) : 0;
    }
    double exact = 0;
    for (int subset = 0; subset < 1 << kNumWords; ++subset) {
      double probability = 1, sum = 0;
      for (int word = 0; word < kNumWords; ++word) {
        const bool has = subset >> word & 1;
        probability *= has ? p[word] : 1 - p[word];
        sum += has ? -std::log(p[word]) : 0;
      }
      if (sum >= shared - 1e-9) exact += probability;
    }
    const double bound = Log10NumDocumentsByChance(vocabulary, bag, document);
    EXPECT_GE(bound, std::log10(kNumDocuments * exact) - 1e-9);
    EXPECT_LE(bound, std::log10(kNumDocuments * exact) + 1.3);  // and is not far off
  }
}

TEST(RecognizePlace, NamesTheBestDocumentThatIsNoChance) {
  const auto place = RecognizePlace(FourPlaces(), {4, 5}, Options(1, -0.6));  // log10(0.25) = -0.602
  ASSERT_TRUE(place);
  EXPECT_EQ(place->document, 2);
  EXPECT_FLOAT_EQ(place->score, 1);
  EXPECT_FALSE(RecognizePlace(FourPlaces(), {4, 5}, Options(1, -0.61)));
}

TEST(RecognizePlace, RefusesOneWordHoweverRare) {
  EXPECT_FALSE(RecognizePlace(FourPlaces(), {4, 4, 4, 4}, Options(1, -0.1)));
  EXPECT_TRUE(RecognizePlace(FourPlaces(), {4, 4, 4, 4}, Options(1, 0.1)));
}

TEST(RecognizePlace, RefusesBlankImagesAndFewWords) {
  EXPECT_FALSE(RecognizePlace(FourPlaces(), {}, Options(1, 9)));
  EXPECT_FALSE(RecognizePlace(FourPlaces(), {4, 5}, Options(3, 9)));
  EXPECT_TRUE(RecognizePlace(FourPlaces(), {4, 5}, Options(2, 9)));
  EXPECT_FALSE(RecognizePlace(FourPlaces(), {4, 8, 8, 8}, Options(2, 9)));  // word 8 says nothing
  EXPECT_FALSE(RecognizePlace(Vocabulary(), {}, Options(1, 9)));
}

TEST(RecognizePlace, OptionsHaveLimits) { ExpectLimits<PlaceOptions>({{"min_num_words", "1", "0"}}); }

TEST(RecognizePlace, HoldsForAMillionDocuments) {
  // Words in one of a million documents each, worth 13.8: e^(64 * 13.8) is no double.  Two are shared.
  Vocabulary vocabulary;
  for (int i = 0; i < 1000000; ++i) vocabulary.document_ids.push_back(i + 1);
  vocabulary.inverted_files.resize(3);
  for (int i = 0; i < 1000000; ++i) vocabulary.inverted_files[2].push_back({i, 1});
  for (const int i : {7, 8}) vocabulary.inverted_files[i - 7].push_back({7, 1});
  WeightVocabulary(&vocabulary);
  // Document 7 has three times the usual number of words: 10^6 * (3 / 10^6)^2.
  EXPECT_NEAR(Log10NumDocumentsByChance(vocabulary, CountWords({0, 1}), 7), std::log10(9e-6), 1e-3);
}

}  // namespace
}  // namespace cairn::build_vocabulary
