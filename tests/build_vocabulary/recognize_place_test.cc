#include "core/recognize_place.h"

#include <gtest/gtest.h>

namespace cairn {
namespace {

// Six words and four documents; words 0 to 3 are in one document each (word i in document i), word 4 in
// two (0 and 1), word 5 in all.
Vocabulary FourPlaces() {
  Vocabulary vocabulary;
  vocabulary.document_ids = {1, 2, 3, 4};
  vocabulary.inverted_files = {{{0, 1}}, {{1, 1}},         {{2, 1}},
                               {{3, 1}}, {{0, 1}, {1, 1}}, {{0, 1}, {1, 1}, {2, 1}, {3, 1}}};
  WeightVocabulary(&vocabulary);
  return vocabulary;
}

PlaceOptions Options(int min_num_words, double min_background_ratio) {
  PlaceOptions options;
  options.min_num_words = min_num_words;
  options.min_background_ratio = min_background_ratio;
  return options;
}

TEST(RecognizePlace, NamesTheBestDocumentThatStandsOut) {
  // Only document 2 shares the word: its score is 1, the mean 1 / 4, the ratio 4.
  const auto place = RecognizePlace(FourPlaces(), {2, 2}, Options(1, 3.9));
  ASSERT_TRUE(place);
  EXPECT_EQ(place->document, 2);
  EXPECT_FLOAT_EQ(place->score, 1);
}

TEST(RecognizePlace, RefusesWhatScoresAlikeWithMany) {
  // Words 0 to 3 once each: documents 2 and 3 score 1/2 each, 0 and 1 less: far from twice the mean.
  EXPECT_FALSE(RecognizePlace(FourPlaces(), {0, 1, 2, 3}, Options(1, 2)));
  EXPECT_TRUE(RecognizePlace(FourPlaces(), {0, 1, 2, 3}, Options(1, 1)));  // no such test
  // Twins share word 4: best score over mean = 4 / 2, a tie that goes to the first.
  EXPECT_FALSE(RecognizePlace(FourPlaces(), {4}, Options(1, 2.1)));
  EXPECT_EQ(RecognizePlace(FourPlaces(), {4}, Options(1, 1.9))->document, 0);
}

TEST(RecognizePlace, RefusesBlankImagesAndFewWords) {
  EXPECT_FALSE(RecognizePlace(FourPlaces(), {}, Options(1, 1)));
  EXPECT_FALSE(RecognizePlace(FourPlaces(), {2, 2}, Options(3, 1)));
  EXPECT_FALSE(RecognizePlace(FourPlaces(), {2, 5, 5, 5}, Options(2, 1)));  // word 5 says nothing
  EXPECT_FALSE(RecognizePlace(Vocabulary(), {}, Options(1, 1)));
}

}  // namespace
}  // namespace cairn
