#include "stages/match_features/pairs/predict_pairs.h"

#include <algorithm>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/pose.h"

namespace cairn::match_features {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

// Ten points on a wall at z = 3; feature i of every view is the ray to point i.
PairPredictor::View At(const Eigen::Vector3d& center) {
  PairPredictor::View view;
  view.center = center;
  view.focal_px = 500;
  for (int i = 0; i < 10; ++i) {
    const Eigen::Vector3d point(0.05 * i, 0.3 * (i % 3) - 0.3, 3);
    view.rays.emplace_back((point - center).normalized().cast<float>());
  }
  return view;
}
PairPredictor::View At(double x) { return At(Eigen::Vector3d(x, 0, 0)); }

// Matches i - i of the features [begin, end).
std::vector<Match> Same(uint32_t begin, uint32_t end) {
  std::vector<Match> matches;
  for (uint32_t i = begin; i < end; ++i) matches.push_back({i, i});
  return matches;
}

IndexPairs IdxsOf(const std::vector<PredictedPair>& predicted) {
  IndexPairs pairs;
  for (const PredictedPair& pair : predicted) pairs.push_back(pair.idxs);
  return pairs;
}

// Works on a copy: a call of its own changes what later ones return.
IndexPairs Predict(PairPredictor predictor, int min_num_expected, const IndexPairs& tried,
                   double max_ray_angle_deg = 90, int num_threads = 2) {
  NoProgress progress;
  return IdxsOf(
      *predictor.Predict(tried, {min_num_expected, max_ray_angle_deg, 16, 1e-3}, num_threads, progress));
}

TEST(PredictPairs, ImagesThatMatchAThirdAreExpectedToMatch) {
  //   features 0 .. 9      0 - 1: 0 .. 5, 1 - 2: 4 .. 9, so 4 and 5 go from 0 to 2; 3 matches nothing
  PairPredictor predictor({At(0), At(0.01), At(0.02), At(0.03)});
  predictor.Add(0, 1, Same(0, 6));
  predictor.Add(1, 2, Same(4, 10));
  const IndexPairs tried = {{0, 1}, {1, 2}};
  EXPECT_THAT(Predict(predictor, 2, tried), ElementsAre(Pair(0, 2)));
  EXPECT_THAT(Predict(predictor, 3, tried), IsEmpty());
  EXPECT_THAT(Predict(predictor, 1, {{0, 1}, {0, 2}, {1, 2}}), IsEmpty());
}

TEST(PredictPairs, APairSaysHowManyMatchesItIsExpectedToHave) {
  //   0 - 1: 0 .. 5, 1 - 2: 4 .. 9, 1 - 3: 5 .. 9
  PairPredictor predictor({At(0), At(0.01), At(0.02), At(0.03)});
  predictor.Add(0, 1, Same(0, 6));
  predictor.Add(1, 2, Same(4, 10));
  predictor.Add(1, 3, Same(5, 10));
  NoProgress progress;
  const auto predicted = *predictor.Predict({{0, 1}, {1, 2}, {1, 3}}, {1, 90, 16, 1e-3}, 1, progress);
  ASSERT_THAT(IdxsOf(predicted), ElementsAre(Pair(0, 2), Pair(0, 3), Pair(2, 3)));
  EXPECT_EQ(predicted[0].num_expected, 2);
  EXPECT_EQ(predicted[1].num_expected, 1);
  EXPECT_EQ(predicted[2].num_expected, 5);
}

TEST(PredictPairs, AChainByWayOfALaterGenerationThanBothEndsDoesNotCount) {
  //   0 - 1 - 2, by generations
  const auto predicted = [](int generation0, int generation1, int generation2) {
    std::vector<PairPredictor::View> views = {At(0), At(0.01), At(0.02)};
    views[0].generation = generation0;
    views[1].generation = generation1;
    views[2].generation = generation2;
    PairPredictor predictor(views);
    predictor.Add(0, 1, Same(0, 10));
    predictor.Add(1, 2, Same(0, 10));
    return Predict(predictor, 10, {{0, 1}, {1, 2}}).size();
  };
  EXPECT_EQ(predicted(0, 1, 0), 0u);
  EXPECT_EQ(predicted(0, 2, 1), 0u);
  EXPECT_EQ(predicted(0, 1, 1), 1u);
  EXPECT_EQ(predicted(2, 1, 0), 1u);
  EXPECT_EQ(predicted(1, 0, 1), 1u);
}

TEST(PredictPairs, APairIsExpectedTheSameWhicheverImageIsOfTheLaterGeneration) {
  //   features 0 .. 9      point 0 of image 0 goes by way of image 1 to features 0 and 1 of image 2, which
  //   show the same point: of image 0 one feature leads there, of image 2 two
  const auto num_expected = [](int generation0, int generation2) {
    std::vector<PairPredictor::View> views = {At(0), At(0.01), At(0.02)};
    views[2].rays[1] = views[2].rays[0];
    views[0].generation = generation0;
    views[2].generation = generation2;
    PairPredictor predictor(views);
    predictor.Add(0, 1, Same(0, 1));
    predictor.Add(1, 2, {{0, 0}, {0, 1}});
    NoProgress progress;
    return predictor.Predict({{0, 1}, {1, 2}}, {1, 90, 16, 1e-3}, 1, progress)->at(0).num_expected;
  };
  EXPECT_EQ(num_expected(0, 0), 1);
  EXPECT_EQ(num_expected(0, 1), 1);
  EXPECT_EQ(num_expected(1, 0), 1);
}

TEST(PredictPairs, WhatIsKnownOfAGenerationIsNotLookedForAndLeavesTheOthersAlone) {
  //   generation  0 0 0 1 1      0 - 1 - 2 and 1 - 3 - 4
  std::vector<PairPredictor::View> views;
  for (int i = 0; i < 5; ++i) {
    views.push_back(At(0.01 * i));
    views.back().generation = i < 3 ? 0 : 1;
  }
  const auto predict = [&](const std::set<int>& without, PairPredictor* predictor, const IndexPairs& known) {
    NoProgress progress;
    return IdxsOf(*predictor->Predict(known, {1, 90, 16, 1e-3}, 2, progress, without));
  };
  const IndexPairs tried = {{0, 1}, {1, 2}, {1, 3}, {3, 4}};
  const auto matched = [&] {
    PairPredictor predictor(views);
    for (const auto& [i, j] : tried) predictor.Add(i, j, Same(0, 10));
    return predictor;
  };
  PairPredictor all = matched(), later = matched(), earlier = matched(), none = matched();
  EXPECT_THAT(predict({}, &all, tried), ElementsAre(Pair(0, 2), Pair(0, 3), Pair(1, 4), Pair(2, 3)));
  EXPECT_THAT(predict({0}, &later, tried), ElementsAre(Pair(0, 3), Pair(1, 4), Pair(2, 3)));
  EXPECT_THAT(predict({1}, &earlier, tried), ElementsAre(Pair(0, 2)));
  EXPECT_THAT(predict({0, 1}, &none, tried), IsEmpty());
  // The next round predicts the same, whichever was known in this one.
  const IndexPairs known = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {1, 4}, {2, 3}, {3, 4}};
  for (PairPredictor* predictor : {&all, &later, &earlier, &none}) {
    predictor->Add(0, 3, Same(0, 10));
    EXPECT_THAT(predict({}, predictor, known), ElementsAre(Pair(0, 4)));
  }
}

TEST(PredictPairs, RaysTooFarApartDoNotCount) {
  // From 3 m aside the rays to the wall at 3 m differ by 45 degrees, 49 at its far end.
  PairPredictor predictor({At(0), At(0.01), At(3)});
  predictor.Add(0, 1, Same(0, 10));
  predictor.Add(1, 2, Same(0, 10));
  const IndexPairs tried = {{0, 1}, {1, 2}};
  EXPECT_THAT(Predict(predictor, 10, tried, 50), ElementsAre(Pair(0, 2)));
  EXPECT_THAT(Predict(predictor, 1, tried, 40), IsEmpty());
}

TEST(PredictPairs, ChainsThatThePosesContradictDoNotCount) {
  // Image 1 matches points i of image 0 and points i + 5 of image 2, which lie elsewhere on the wall.
  PairPredictor predictor({At(0), At(0.01), At(0.5), At(Eigen::Vector3d(0.3, 0, 6))});
  predictor.Add(0, 1, Same(0, 10));
  std::vector<Match> shifted;
  for (uint32_t i = 0; i < 5; ++i) shifted.push_back({i, i + 5});
  predictor.Add(1, 2, shifted);
  // Image 3 sees the wall from behind.
  predictor.Add(1, 3, Same(0, 10));
  EXPECT_THAT(Predict(predictor, 1, {{0, 1}, {1, 2}, {1, 3}}), IsEmpty());
}

TEST(PredictPairs, AFeatureCountsOnceAndTheOrderOfMatchesDoesNotMatter) {
  // Point 0 goes from image 0 to image 3 by way of 1 and of 2.
  PairPredictor there({At(0), At(0.01), At(0.02), At(0.03)}), back = there;
  const std::vector<std::pair<int, int>> pairs = {{0, 1}, {0, 2}, {1, 3}, {2, 3}};
  for (const auto& [i, j] : pairs) there.Add(i, j, Same(0, 1));
  for (size_t k = pairs.size(); k-- > 0;) back.Add(pairs[k].first, pairs[k].second, Same(0, 1));
  EXPECT_THAT(Predict(there, 1, pairs), ElementsAre(Pair(0, 3), Pair(1, 2)));
  EXPECT_THAT(Predict(there, 2, pairs), IsEmpty());
  EXPECT_EQ(Predict(back, 1, pairs, 90, 1), Predict(there, 1, pairs, 90, 4));
}

TEST(PredictPairs, LaterCallsFindWhatAllMatchesAtOncePredict) {
  // Twelve views of the wall, the matches of random pairs of them added in five parts.
  Random random(5);
  std::vector<PairPredictor::View> views;
  for (int i = 0; i < 12; ++i) views.push_back(At(0.01 * i));
  PairPredictor in_parts(views);
  std::vector<std::tuple<int, int, std::vector<Match>>> added;
  IndexPairs tried;
  NoProgress progress;
  int num_predicted = 0;
  for (int part = 0; part < 5; ++part) {
    for (int k = 0; k < 4; ++k) {
      const int i = static_cast<int>(random.UniformInt(0, 10)),
                j = static_cast<int>(random.UniformInt(i + 1, 11));
      const auto begin = static_cast<uint32_t>(random.UniformInt(0, 7));
      added.emplace_back(i, j, Same(begin, begin + 3));
      in_parts.Add(i, j, Same(begin, begin + 3));
      tried.emplace_back(i, j);
    }
    std::sort(tried.begin(), tried.end());
    PairPredictor at_once(views);
    for (const auto& [i, j, matches] : added) at_once.Add(i, j, matches);
    const IndexPairs predicted = IdxsOf(*in_parts.Predict(tried, {2, 90, 16, 1e-3}, 2, progress));
    EXPECT_EQ(predicted, Predict(at_once, 2, tried)) << part;
    num_predicted += static_cast<int>(predicted.size());
    tried.insert(tried.end(), predicted.begin(), predicted.end());
    std::sort(tried.begin(), tried.end());
  }
  EXPECT_GT(num_predicted, 10);
  EXPECT_THAT(*in_parts.Predict(tried, {2, 90, 16, 1e-3}, 2, progress), IsEmpty()) << "nothing was added";
}

}  // namespace
}  // namespace cairn::match_features
