#include "stages/match_features/pairs/predict_pairs.h"

#include <algorithm>

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

// In memory that keeps everything, unless less is given.
PairPredictor PredictorOf(const std::vector<PairPredictor::View>& views, int64_t max_num_bytes = 1 << 20) {
  PairPredictor predictor(testing::TempDir() + "/predicted", max_num_bytes);
  for (const PairPredictor::View& view : views) predictor.AddView(view);
  return predictor;
}

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

struct Matched {
  int idx1, idx2;
  std::vector<Match> matches;
};

// What a predictor of these views and matches predicts first.
IndexPairs Predict(const std::vector<PairPredictor::View>& views, const std::vector<Matched>& matched,
                   int min_num_expected, const IndexPairs& tried, double max_ray_angle_deg = 90,
                   int num_threads = 2, int64_t max_num_bytes = 1 << 20) {
  PairPredictor predictor = PredictorOf(views, max_num_bytes);
  for (const auto& [idx1, idx2, matches] : matched) predictor.Add(idx1, idx2, matches);
  NoProgress progress;
  return IdxsOf(
      *predictor.Predict(tried, {min_num_expected, max_ray_angle_deg, 16, 1e-3}, num_threads, progress));
}

TEST(PredictPairs, ImagesThatMatchAThirdAreExpectedToMatch) {
  //   features 0 .. 9      0 - 1: 0 .. 5, 1 - 2: 4 .. 9, so 4 and 5 go from 0 to 2; 3 matches nothing
  const std::vector<PairPredictor::View> views = {At(0), At(0.01), At(0.02), At(0.03)};
  const std::vector<Matched> matched = {{0, 1, Same(0, 6)}, {1, 2, Same(4, 10)}};
  const IndexPairs tried = {{0, 1}, {1, 2}};
  EXPECT_THAT(Predict(views, matched, 2, tried), ElementsAre(Pair(0, 2)));
  EXPECT_THAT(Predict(views, matched, 3, tried), IsEmpty());
  EXPECT_THAT(Predict(views, matched, 1, {{0, 1}, {0, 2}, {1, 2}}), IsEmpty());
}

TEST(PredictPairs, APairSaysHowManyMatchesItIsExpectedToHave) {
  //   0 - 1: 0 .. 5, 1 - 2: 4 .. 9, 1 - 3: 5 .. 9
  PairPredictor predictor = PredictorOf({At(0), At(0.01), At(0.02), At(0.03)});
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
    return Predict(views, {{0, 1, Same(0, 10)}, {1, 2, Same(0, 10)}}, 10, {{0, 1}, {1, 2}}).size();
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
    PairPredictor predictor = PredictorOf(views);
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
    PairPredictor predictor = PredictorOf(views);
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
  const std::vector<PairPredictor::View> views = {At(0), At(0.01), At(3)};
  const std::vector<Matched> matched = {{0, 1, Same(0, 10)}, {1, 2, Same(0, 10)}};
  const IndexPairs tried = {{0, 1}, {1, 2}};
  EXPECT_THAT(Predict(views, matched, 10, tried, 50), ElementsAre(Pair(0, 2)));
  EXPECT_THAT(Predict(views, matched, 1, tried, 40), IsEmpty());
}

TEST(PredictPairs, ChainsThatThePosesContradictDoNotCount) {
  // Image 1 matches points i of image 0 and points i + 5 of image 2, which lie elsewhere on the wall.
  const std::vector<PairPredictor::View> views = {At(0), At(0.01), At(0.5), At(Eigen::Vector3d(0.3, 0, 6))};
  std::vector<Match> shifted;
  for (uint32_t i = 0; i < 5; ++i) shifted.push_back({i, i + 5});
  // Image 3 sees the wall from behind.
  const std::vector<Matched> matched = {{0, 1, Same(0, 10)}, {1, 2, shifted}, {1, 3, Same(0, 10)}};
  EXPECT_THAT(Predict(views, matched, 1, {{0, 1}, {1, 2}, {1, 3}}), IsEmpty());
}

TEST(PredictPairs, AFeatureCountsOnceAndTheOrderOfMatchesDoesNotMatter) {
  // Point 0 goes from image 0 to image 3 by way of 1 and of 2.
  const std::vector<PairPredictor::View> views = {At(0), At(0.01), At(0.02), At(0.03)};
  const IndexPairs pairs = {{0, 1}, {0, 2}, {1, 3}, {2, 3}};
  std::vector<Matched> there;
  for (const auto& [i, j] : pairs) there.push_back({i, j, Same(0, 1)});
  const std::vector<Matched> back(there.rbegin(), there.rend());
  EXPECT_THAT(Predict(views, there, 1, pairs), ElementsAre(Pair(0, 3), Pair(1, 2)));
  EXPECT_THAT(Predict(views, there, 2, pairs), IsEmpty());
  EXPECT_EQ(Predict(views, back, 1, pairs, 90, 1), Predict(views, there, 1, pairs, 90, 4));
}

// Twelve views of the wall and random matches of them, the last part of which is added after a first call.
struct Wall {
  std::vector<PairPredictor::View> views;
  std::vector<Matched> matched;
};

Wall RandomWall(int num_pairs) {
  Random random(5);
  Wall wall;
  for (int i = 0; i < 12; ++i) wall.views.push_back(At(0.01 * i));
  for (int k = 0; k < num_pairs; ++k) {
    const int i = static_cast<int>(random.UniformInt(0, 10)),
              j = static_cast<int>(random.UniformInt(i + 1, 11));
    const auto begin = static_cast<uint32_t>(random.UniformInt(0, 7));
    wall.matched.push_back({i, j, Same(begin, begin + 3)});
  }
  return wall;
}

TEST(PredictPairs, LaterCallsFindWhatAllMatchesAtOncePredict) {
  const auto [views, matched] = RandomWall(20);
  for (const int64_t max_num_bytes : {1 << 20, 1}) {  // all in memory; and image by image, all from files
    PairPredictor in_parts = PredictorOf(views, max_num_bytes);
    std::vector<Matched> added;
    IndexPairs tried;
    NoProgress progress;
    int num_predicted = 0;
    for (int part = 0; part < 5; ++part) {
      for (int k = 4 * part; k < 4 * part + 4; ++k) {
        const auto& [i, j, matches] = matched[k];
        in_parts.Add(i, j, matches);
        added.push_back(matched[k]);
        tried.emplace_back(i, j);
      }
      std::sort(tried.begin(), tried.end());
      const IndexPairs predicted = IdxsOf(*in_parts.Predict(tried, {2, 90, 16, 1e-3}, 2, progress));
      EXPECT_EQ(predicted, Predict(views, added, 2, tried)) << part;
      num_predicted += static_cast<int>(predicted.size());
      tried.insert(tried.end(), predicted.begin(), predicted.end());
      std::sort(tried.begin(), tried.end());
    }
    EXPECT_GT(num_predicted, 10);
    EXPECT_THAT(*in_parts.Predict(tried, {2, 90, 16, 1e-3}, 2, progress), IsEmpty()) << "nothing was added";
  }
}

TEST(PredictPairs, MemoryAndThreadsDoNotMatter) {
  const auto [views, matched] = RandomWall(30);
  const IndexPairs all = Predict(views, matched, 2, {});
  EXPECT_GT(all.size(), 20u);
  for (const int64_t max_num_bytes : {1, 500, 2000, 5000}) {
    for (const int num_threads : {1, 3})
      EXPECT_EQ(Predict(views, matched, 2, {}, 90, num_threads, max_num_bytes), all) << max_num_bytes;
  }
}

TEST(PredictPairs, AFolderThatIsNotThereIsNamed) {
  PairPredictor predictor("/nowhere/matches.db", 1);
  for (int i = 0; i < 3; ++i) predictor.AddView(At(0.01 * i));
  predictor.Add(0, 1, Same(0, 10));
  predictor.Add(1, 2, Same(0, 10));
  NoProgress progress;
  const auto predicted = predictor.Predict({}, {1, 90, 16, 1e-3}, 1, progress);
  ASSERT_FALSE(predicted.ok());
  EXPECT_EQ(predicted.error().code, ErrorCode::kIo);
  EXPECT_THAT(predicted.error().message, testing::HasSubstr("/nowhere/matches.db"));
}

}  // namespace
}  // namespace cairn::match_features
