#include "runtime/drive/start_hypotheses.h"

#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/vocabulary/document_scores.h"
#include "core/world/appearance_graph.h"
#include "runtime/map/appearance_map.h"
#include "tests/option_limits.h"
#include "tests/runtime/visual_map/visual_memory.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// Two wings, 0 to 4 and 5 to 9, that look alike except for their third places, and lead to a hall:
//   0 - 1 - 2 - 3 - 4
//                     \ 10 - 11
//   5 - 6 - 7 - 8 - 9 /
std::vector<std::vector<WordIdx>> WingWords() {
  std::vector<std::vector<WordIdx>> words;
  for (int wing = 0; wing < 2; ++wing) {
    for (WordIdx place = 0; place < 5; ++place) {
      words.push_back({4 * place, 4 * place + 1, 4 * place + 2, 4 * place + 3, 4 * place + 4, 4 * place + 5});
      if (place == 2) words.back() = {8 + 30 * wing, 9 + 30 * wing, 10 + 30 * wing, 11 + 30 * wing};
    }
  }
  words.push_back({80, 81, 82, 83});
  words.push_back({83, 84, 85, 86});
  return words;
}
const std::vector<std::pair<int, int>> kWingLinks = {{0, 1}, {1, 2}, {2, 3}, {3, 4},  {4, 10}, {5, 6},
                                                     {6, 7}, {7, 8}, {8, 9}, {9, 10}, {10, 11}};

PlaceModel ModelOf(const MapRows& rows) {
  const auto map = Map::FromRows(rows);
  EXPECT_TRUE(map.ok()) << map.error().message;
  const Result<PlaceModel> model = PlaceModel::Make(**map);
  EXPECT_TRUE(model.ok()) << model.error().message;
  return *model;
}

MapRows Wings() { return VisualMemory(WingWords(), kWingLinks, std::vector<double>(12, 1.0)); }
PlaceScores LookAt(const PlaceModel& model, int place) {
  return model.Look(DescriptorsOf(WingWords()[place]));
}

TEST(PlaceModel, AUniquePlaceGivesAPeakAndTwinsGiveTwo) {
  const PlaceModel model = ModelOf(Wings());
  const PlaceScores unique = LookAt(model, 10), twins = LookAt(model, 1);
  EXPECT_GT(unique.probabilities[10], 0.99);
  EXPECT_NEAR(unique.scores[10], 1, 1e-6);
  EXPECT_NEAR(twins.probabilities[1], twins.probabilities[6], 1e-9);
  EXPECT_GT(twins.probabilities[1], 0.4);
  EXPECT_NEAR(std::accumulate(twins.probabilities.begin(), twins.probabilities.end(), 0.0), 1, 1e-9);
}

TEST(PlaceModel, ExpectsWhatAnImageOfThePlaceSays) {
  const PlaceModel model = ModelOf(Wings());
  for (NodeIdx node = 0; node < model.num_nodes(); ++node)
    EXPECT_EQ(model.Expected(node), LookAt(model, node).probabilities);
}

TEST(PlaceModel, SaysWhichImagesShowAPlaceAndWhichPlaceAnImage) {
  MapRows rows = Wings();
  rows.appearance[3].images = {3, 4};  // two images of one place
  rows.appearance[3].links = rows.appearance[4].links;
  rows.appearance.erase(rows.appearance.begin() + 4);
  for (MapAppearanceNode& node : rows.appearance) {
    for (auto& link : node.links) link.node -= link.node > 4 ? 1 : 0;
  }
  const PlaceModel model = ModelOf(rows);
  EXPECT_THAT(model.ImagesOfNode(3), ElementsAre(3, 4));
  EXPECT_EQ(model.NodeOfImage(4), 3);
  EXPECT_EQ(model.NodeOfImage(5), 4);
  EXPECT_EQ(model.NodeOfImage(12), -1);
  EXPECT_EQ(model.NodeOfImage(-1), -1);
}

TEST(PlaceModel, AnImageWithoutFeaturesCouldBeAnywhere) {
  const PlaceModel model = ModelOf(Wings());
  const PlaceScores nothing = model.Look(DescriptorMatrix(0, kSiftDescriptorDim));
  EXPECT_THAT(nothing.scores, testing::Each(0));
  EXPECT_THAT(nothing.probabilities, testing::Each(testing::DoubleEq(1.0 / 12)));
  EXPECT_EQ(StartHypotheses::Make(model, nothing, 11).error().code, ErrorCode::kNoData);
}

TEST(PlaceModel, NeedsWordsAndAGraph) {
  MapRows rows = Wings();
  rows.appearance.clear();
  EXPECT_THAT(PlaceModel::Make(**Map::FromRows(rows)).error().message, HasSubstr("no appearance graph"));
  rows = Wings();
  rows.vocabulary = {};
  EXPECT_THAT(PlaceModel::Make(**Map::FromRows(rows)).error().message, HasSubstr("words = \"survey\""));
}

TEST(StartHypotheses, OutliveTheModelThatTheyWereMadeOf) {
  auto model = std::make_unique<PlaceModel>(ModelOf(Wings()));
  const PlaceScores first = LookAt(*model, 6), second = LookAt(*model, 7);
  StartHypotheses starts = *StartHypotheses::Make(*model, first, 11);
  StartHypotheses same = starts;
  model.reset();
  EXPECT_EQ(starts.Observe(second), same.Observe(second));
  EXPECT_GT(starts.hypotheses()[starts.followed()].posterior, 0.9);
  EXPECT_EQ(starts.hypotheses()[0].posterior, same.hypotheses()[0].posterior);
}

TEST(StartHypotheses, TwinsAreToldApartWhereTheyDiffer) {
  const PlaceModel model = ModelOf(Wings());
  const Result<StartHypotheses> made = StartHypotheses::Make(model, LookAt(model, 6), 11);
  ASSERT_TRUE(made.ok()) << made.error().message;
  StartHypotheses starts = *made;
  ASSERT_EQ(starts.hypotheses().size(), 2);
  EXPECT_EQ(starts.hypotheses()[starts.followed()].start, 1);  // as likely, the first one
  EXPECT_THAT(starts.hypotheses()[0].path.nodes, ElementsAre(1, 2, 3, 4, 10, 11));
  EXPECT_EQ(starts.hypotheses()[0].posterior, 0.5);
  EXPECT_EQ(starts.Observe(LookAt(model, 7)), HypothesisVerdict::kSwitch);  // differs from 2
  EXPECT_EQ(starts.hypotheses()[starts.followed()].start, 6);
  EXPECT_GT(starts.hypotheses()[1].posterior, 0.93);
  EXPECT_EQ(starts.Whereabouts(1), 7);
  EXPECT_THAT(starts.Replan(1)->nodes, ElementsAre(7, 8, 9, 10, 11));
  starts.Restart();
  EXPECT_EQ(starts.num_images(), 0);
  EXPECT_EQ(starts.Whereabouts(1), 6);
  EXPECT_GT(starts.hypotheses()[1].posterior, 0.93);
  EXPECT_EQ(starts.Observe(LookAt(model, 7)), HypothesisVerdict::kFollow);
}

TEST(StartHypotheses, ARefutedStartIsNotFollowedAgain) {
  const PlaceModel model = ModelOf(Wings());
  StartHypotheses starts = *StartHypotheses::Make(model, LookAt(model, 6), 11);
  ASSERT_EQ(starts.hypotheses()[starts.followed()].start, 1);
  EXPECT_TRUE(starts.Refute());
  EXPECT_EQ(starts.hypotheses()[starts.followed()].start, 6);
  EXPECT_EQ(starts.hypotheses()[0].posterior, 0);
  EXPECT_EQ(starts.hypotheses()[1].posterior, 1);
  starts.Restart();
  EXPECT_EQ(starts.Observe(LookAt(model, 2)), HypothesisVerdict::kFollow) << "whatever it sees";
  EXPECT_FALSE(starts.Refute()) << "no other is left";
}

TEST(StartHypotheses, WithoutSwitchingTheFirstChoiceIsFollowed) {
  const PlaceModel model = ModelOf(Wings());
  StartHypotheses starts = *StartHypotheses::Make(model, LookAt(model, 6), 11, {.switching = false});
  EXPECT_EQ(starts.Observe(LookAt(model, 7)), HypothesisVerdict::kFollow);
  EXPECT_EQ(starts.hypotheses()[starts.followed()].start, 1);
  EXPECT_GT(starts.hypotheses()[1].posterior, 0.93);
}

TEST(StartHypotheses, AnImageOfAnotherPlaceMeansCarriedAway) {
  const PlaceModel model = ModelOf(Wings());
  StartHypotheses starts = *StartHypotheses::Make(model, LookAt(model, 1), 11);
  EXPECT_EQ(starts.Observe(LookAt(model, 11)), HypothesisVerdict::kLost);
  starts = *StartHypotheses::Make(model, LookAt(model, 1), 11, {.min_reachable_ratio = 0});
  EXPECT_NE(starts.Observe(LookAt(model, 11)), HypothesisVerdict::kLost);
}

// p(X_0 | Z_0:T) summed over all ways of the robot, one by one.
double SumOverWays(const PlaceModel& model, const std::vector<PlaceScores>& images, NodeIdx node, size_t t,
                   const StartHypothesesOptions& options) {
  if (t == images.size()) return 1;
  const auto lengths =
      PathLengths(model.appearance().graph, node, model.appearance().is_kept, options.reach_links);
  double sum = 0, num_reached = 0;
  for (NodeIdx next = 0; next < model.num_nodes(); ++next) {
    if (lengths[next] < 0) continue;
    ++num_reached;
    const double j = JeffreyDivergence(images[t].probabilities, model.Expected(next), options.uniform_ratio);
    sum += std::exp(-j * j / 2) / std::sqrt(2 * std::numbers::pi) *
           SumOverWays(model, images, next, t + 1, options);
  }
  return sum / num_reached;
}

TEST(StartHypotheses, AnImageThatSharesNothingWithAnyPlaceWithinReachLeavesPosteriorsFinite) {
  const PlaceModel model = ModelOf(Wings());
  StartHypotheses starts = *StartHypotheses::Make(
      model, LookAt(model, 6), 11,
      {.reach_links = 1, .compared_nodes = "all", .uniform_ratio = 1e-9, .min_reachable_ratio = 0});
  EXPECT_EQ(starts.Observe(LookAt(model, 11)), HypothesisVerdict::kFollow);
  EXPECT_NEAR(starts.hypotheses()[0].posterior, 0.5, 1e-6);
  EXPECT_NEAR(starts.hypotheses()[1].posterior, 0.5, 1e-6);
  // Of the start that is refuted nothing is left, however well it explains the image.
  ASSERT_TRUE(starts.Refute());
  EXPECT_EQ(starts.Observe(LookAt(model, 2)), HypothesisVerdict::kFollow);
  EXPECT_EQ(starts.hypotheses()[1].posterior, 1);
}

TEST(StartHypotheses, PosteriorIsTheSumOverAllWays) {
  Random random(5);
  std::vector<std::vector<WordIdx>> words(10);
  for (std::vector<WordIdx>& of_image : words) {
    for (WordIdx word = 0; word < 40; ++word) {
      if (random.Uniform() < 0.3) of_image.push_back(word);
    }
  }
  std::vector<std::pair<int, int>> links;
  for (int i = 0; i + 1 < 10; ++i) links.emplace_back(i, i + 1);
  const PlaceModel model = ModelOf(VisualMemory(words, links, std::vector<double>(10, 0.5)));
  const StartHypothesesOptions options{
      .min_score_ratio = 0.01, .compared_nodes = "all", .uniform_ratio = 0.5, .switching = false};
  const auto look = [&](int i) { return model.Look(DescriptorsOf(words[i])); };
  StartHypotheses starts = *StartHypotheses::Make(model, look(3), 9, options);
  ASSERT_GE(starts.hypotheses().size(), 2);
  std::vector<PlaceScores> images;
  for (const int place : {4, 5, 5, 7}) {
    images.push_back(look(place));
    starts.Observe(images.back());
    std::vector<double> expected;
    double sum = 0;
    for (const StartHypothesis& hypothesis : starts.hypotheses())
      sum += expected.emplace_back(SumOverWays(model, images, hypothesis.start, 0, options));
    for (size_t i = 0; i < expected.size(); ++i)
      EXPECT_NEAR(starts.hypotheses()[i].posterior, expected[i] / sum, 1e-9);
  }
}

TEST(StartHypotheses, LeastEntropyChoosesTheStartAndTheMeanDoesNotPenaliseLength) {
  std::vector<double> entropies(12, 1.0);
  for (const int node : {6, 7, 8, 9}) entropies[node] = 0.2;  // the second wing can be told from others
  std::vector<std::pair<int, int>> links = kWingLinks;
  links.erase(links.begin() + 9);  // and is a detour: 9 - 12 - 13 - 10
  std::vector<std::vector<WordIdx>> words = WingWords();
  words.push_back({90, 91});
  words.push_back({92, 93});
  for (int i = 0; i < 2; ++i) entropies.push_back(0.9);
  links.insert(links.end(), {{9, 12}, {12, 13}, {10, 13}});
  const PlaceModel model = ModelOf(VisualMemory(words, links, entropies));
  const auto followed = [&](const StartHypothesesOptions& options) {
    const StartHypotheses starts = *StartHypotheses::Make(model, LookAt(model, 1), 11, options);
    return starts.hypotheses()[starts.followed()].start;
  };
  EXPECT_EQ(followed({}), 6);  // 0.2 * 3 + 0.55 + 0.9 + 0.95 + 1 = 4 against 5
  EXPECT_EQ(followed({.route = {.weight = "links"}}), 1);
  EXPECT_EQ(followed({.first_choice = "score"}), 1);
  // Over a detour that tells less, 0.6 + 1.1 + 2 + 1.5 + 1 = 6.2 of 7 links against 5 of 5.
  entropies[12] = entropies[13] = 2;
  const PlaceModel longer = ModelOf(VisualMemory(words, links, entropies));
  const auto followed_over = [&](const std::string& way_cost) {
    const StartHypotheses starts =
        *StartHypotheses::Make(longer, LookAt(longer, 1), 11, {.way_cost = way_cost});
    return starts.hypotheses()[starts.followed()].start;
  };
  EXPECT_EQ(followed_over("total"), 1);
  EXPECT_EQ(followed_over("mean"), 6);
}

TEST(StartHypotheses, SaysWhyThereIsNone) {
  MapRows rows = Wings();
  for (MapAppearanceNode& node : rows.appearance)
    std::erase_if(node.links, [](const auto& l) { return l.node == 11; });
  const PlaceModel model = ModelOf(rows);
  EXPECT_THAT(StartHypotheses::Make(model, LookAt(model, 1), 11).error().message,
              HasSubstr("no way over kept images leads to the goal from any of the 2 places"));
  EXPECT_EQ(StartHypotheses::Make(model, LookAt(model, 1), 12).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(StartHypotheses::Make(model, LookAt(model, 1), 10, {.min_score_ratio = 2}).error().code,
            ErrorCode::kInvalidArgument);
  const PlaceModel without = ModelOf(VisualMemory(WingWords(), kWingLinks));
  EXPECT_THAT(StartHypotheses::Make(without, LookAt(without, 1), 11).error().message,
              HasSubstr("does not say how ambiguous"));
  EXPECT_TRUE(StartHypotheses::Make(without, LookAt(without, 1), 11,
                                    {.first_choice = "score", .route = {.weight = "links"}})
                  .ok());
}

// Two halves 10 m apart that look alike but for 3 and 8, as in joint_way_test.cc, and the goal, 4:
//   0 - 1 - 2 - 4 - 7 - 6 - 5,   0 - 3 - 2 and 5 - 8 - 7 are longer
TEST(StartHypotheses, WaysOfLeastRiskAreThoseOfAllStartsTogether) {
  MapRows rows =
      VisualMemory({{0, 1}, {2}, {3}, {4}, {5}, {0, 1}, {6}, {7}, {8}},
                   {{0, 1}, {1, 2}, {0, 3}, {2, 3}, {2, 4}, {5, 6}, {6, 7}, {5, 8}, {7, 8}, {4, 7}},
                   std::vector<double>(9, 0.0));
  const std::vector<Eigen::Vector3d> places = {{0, 0, 0},  {1, 0, 0},  {2, 0, 0},  {0, 1, 0}, {2, -5, 0},
                                               {10, 0, 0}, {11, 0, 0}, {12, 0, 0}, {10, 1, 0}};
  for (size_t i = 0; i < places.size(); ++i) rows.images[i].cam_from_world = PoseAt(places[i], 0);
  for (int32_t i = 0; i < 3; ++i) rows.appearance[i].look_alikes = {{i + 5, 1}};
  const PlaceModel model = ModelOf(rows);
  PlaceScores first{std::vector<double>(9, 0.0), std::vector<double>(9, 1.0 / 9)};
  first.scores[0] = first.scores[5] = 1;
  StartHypothesesOptions options;
  options.route = {.weight = "risk", .lost_ratio = 0, .faint_link_inliers = 0.1};
  const auto starts = StartHypotheses::Make(model, first, 4, options);
  ASSERT_TRUE(starts.ok()) << starts.error().message;
  ASSERT_EQ(starts->hypotheses().size(), 2);
  EXPECT_THAT(starts->hypotheses()[0].path.nodes, ElementsAre(0, 3, 2, 4));
  EXPECT_THAT(starts->hypotheses()[1].path.nodes, ElementsAre(5, 8, 7, 4));
  first.scores[5] = 0;  // one start: the shortest way
  EXPECT_THAT(StartHypotheses::Make(model, first, 4, options)->hypotheses().at(0).path.nodes,
              ElementsAre(0, 1, 2, 4));
}

TEST(FindPaths, WeighsLinksMatchesAndEntropies) {
  // 0 - 1 - 3 has few matches and ambiguous places, 0 - 2 - 4 - 3 many and clear ones.
  MapRows rows = VisualMemory({{0}, {1}, {2}, {3}, {4}}, {{0, 1}, {0, 2}, {1, 3}, {2, 4}, {3, 4}},
                              {0.5, 3.0, 0.1, 0.5, 0.1});
  for (auto& [node, matches] : std::vector<std::pair<int, int>>{{0, 500}, {1, 20}, {2, 500}, {3, 500}}) {
    for (auto& link : rows.appearance[node].links) link.num_inliers = matches;
  }
  rows.appearance[0].links[0].num_inliers = 20;
  const auto map = *Map::FromRows(rows);
  const auto images = [&](const std::string& weight) {
    return PlanRoute(*map, 0, 3, {.weight = weight})->images;
  };
  EXPECT_THAT(images("links"), ElementsAre(0, 1, 3));
  EXPECT_THAT(images("matches"), ElementsAre(0, 2, 4, 3));
  EXPECT_THAT(images("entropy"), ElementsAre(0, 2, 4, 3));
  EXPECT_NEAR(PlanRoute(*map, 0, 3, {.weight = "entropy"})->cost, 0.3 + 0.1 + 0.3, 1e-9);
  EXPECT_NEAR(PlanRoute(*map, 0, 3, {.weight = "matches"})->cost, 3.0 / 500, 1e-9);
  EXPECT_EQ(PlanRoute(*map, 0, 3, {.weight = "hope"}).error().code, ErrorCode::kInvalidArgument);
}

TEST(StartHypotheses, OptionsHaveTheirRanges) {
  ExpectLimits<StartHypothesesOptions>({{"min_score_ratio", "0.001", "0.0009", "1", "1.001"},
                                        {"max_num_hypotheses", "1", "0"},
                                        {"reach_links", "1", "0"},
                                        {"uniform_ratio", "1e-9", "9e-10", "1", "1.001"},
                                        {"switch_margin", "0", "-0.001", "1", "1.001"},
                                        {"min_reachable_ratio", "0", "-0.001", "1", "1.001"},
                                        {"wrong_place_m", "0", "-0.001"}});
}

}  // namespace
}  // namespace cairn
