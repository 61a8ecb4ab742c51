
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/link_appearance/dominating_set/connected_bound.h"
#include "stages/link_appearance/dominating_set/greedy_dominating_set.h"
#include "stages/link_appearance/dominating_set/improve_dominating_set.h"
#include "tests/link_appearance/graphs.h"

namespace cairn::link_appearance {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

// A second implementation of the source's steps: colours, no gains, no queue; on one component.
std::vector<NodeIdx> StepsOfTheSource(const AppearanceGraph& graph) {
  enum Colour { kWhite, kGray, kBlack };
  std::vector<Colour> colour(graph.num_nodes(), kWhite);
  const auto num_white = [&](NodeIdx node) {
    int num = 0;
    for (const auto& n : graph.Neighbours(node)) num += colour[n.node] == kWhite;
    return num;
  };
  std::vector<NodeIdx> black;
  for (;;) {
    NodeIdx best = -1;
    for (NodeIdx node = 0; node < graph.num_nodes(); ++node) {
      const bool is_candidate = black.empty() ? colour[node] == kWhite : colour[node] == kGray;
      if (is_candidate && (best < 0 || num_white(node) > num_white(best))) best = node;
    }
    colour[best] = kBlack;
    for (const auto& n : graph.Neighbours(best)) {
      if (colour[n.node] == kWhite) colour[n.node] = kGray;
    }
    black.push_back(best);
    if (std::count(colour.begin(), colour.end(), kWhite) == 0) return black;
  }
}

AppearanceGraph LargestComponent(const AppearanceGraph& graph) {
  std::vector<NodeIdx> largest;
  for (const auto& nodes : FindComponents(graph).nodes) {
    if (nodes.size() > largest.size()) largest = nodes;
  }
  return InducedSubgraph(graph, largest);
}

TEST(GreedyDominatingSet, FollowsTheStepsOnAHandSizedGraph) {
  //      0   5        1 and 4 have four neighbours each: 1, then 4 (three whites) before 3 (one),
  //      |   |        then 3, by which 8 is seen.
  //  2 - 1 - 4 - 6
  //      |   |
  //  8 - 3   7
  const AppearanceGraph graph = GraphOf(9, {{1, 0}, {1, 2}, {1, 3}, {1, 4}, {4, 5}, {4, 6}, {4, 7}, {3, 8}});
  EXPECT_THAT(GreedyDominatingSet(Domination(graph, {})), ElementsAre(1, 4, 3));
}

TEST(GreedyDominatingSet, TiesGoToTheSmallestNode) {
  // A ring of six: all alike.  0, then 1 before 5, then 2 or 5 (5 sees 4, 2 sees 3), and the last white.
  EXPECT_THAT(GreedyDominatingSet(Domination(PathGraph(6, true), {})), ElementsAre(0, 1, 2, 3));
}

TEST(GreedyDominatingSet, IsTheSourcesOnRandomGraphs) {
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const AppearanceGraph graph =
        LargestComponent(GeometricGraph(60, 6 + static_cast<double>(seed) / 4, seed));
    EXPECT_EQ(GreedyDominatingSet(Domination(graph, {})), StepsOfTheSource(graph)) << "seed " << seed;
  }
}

TEST(GreedyDominatingSet, IsThatOfEachComponentByItself) {
  const AppearanceGraph graph = GeometricGraph(150, 4, 3);
  const AppearanceComponents components = FindComponents(graph);
  ASSERT_GT(components.nodes.size(), 3u);
  std::vector<NodeIdx> expected;
  for (const auto& nodes : components.nodes) {
    for (const NodeIdx node : StepsOfTheSource(InducedSubgraph(graph, nodes)))
      expected.push_back(nodes[node]);
  }
  EXPECT_THAT(GreedyDominatingSet(Domination(graph, {})), testing::UnorderedElementsAreArray(expected));
}

TEST(GreedyDominatingSet, EveryDemandIsMetAndTheSetHangsTogether) {
  for (const DominationOptions& options :
       {DominationOptions{.num_dominators = 2}, DominationOptions{.num_dominators = 3},
        DominationOptions{.strong_num_inliers = 100},
        DominationOptions{.num_dominators = 2, .strong_num_inliers = 60}}) {
    for (uint64_t seed = 0; seed < 10; ++seed) {
      const AppearanceGraph graph = GeometricGraph(120, 8, seed);
      const Domination domination(graph, options);
      const std::vector<char> kept = NodeMarks(120, GreedyDominatingSet(domination));
      EXPECT_TRUE(domination.IsConnected(kept));
      EXPECT_THAT(domination.Undominated(kept), IsEmpty());
      for (NodeIdx node = 0; node < 120; ++node) {
        int num_dominators = 0;
        for (const auto& n : graph.Neighbours(node)) num_dominators += kept[n.node];
        EXPECT_TRUE(kept[node] ||
                    num_dominators >= std::min(options.num_dominators, graph.NumNeighbours(node)));
      }
    }
  }
}

TEST(GreedyDominatingSet, StrongLinksAreTakenBeforeManyWeakOnes) {
  //   0, 1 and 2 hang on both 3 and 4, by 20 inliers on 3 and by 200 on 4.
  std::vector<AppearanceLink> links = {{3, 4, 200}};
  for (const NodeIdx node : {0, 1, 2}) {
    links.push_back({node, 3, 20});
    links.push_back({node, 4, 200});
  }
  const AppearanceGraph graph(5, links);
  EXPECT_THAT(GreedyDominatingSet(Domination(graph, {})), ElementsAre(3));
  EXPECT_THAT(GreedyDominatingSet(Domination(graph, {.strong_num_inliers = 100})), ElementsAre(4));
}

TEST(GreedyDominatingSet, BeginningsOfTheOrderAreConnectedAndGoOnToAllNodes) {
  const AppearanceGraph graph = LargestComponent(GeometricGraph(80, 8, 1));
  const Domination domination(graph, {});
  const std::vector<NodeIdx> order = GreedyDominatingSet(domination, graph.num_nodes());
  EXPECT_EQ(static_cast<int>(order.size()), graph.num_nodes());
  for (size_t n = 1; n <= order.size(); ++n) {
    const std::vector<NodeIdx> first(order.begin(), order.begin() + n);
    EXPECT_EQ(GreedyDominatingSet(domination, static_cast<int>(n)), first);
    EXPECT_TRUE(domination.IsConnected(NodeMarks(graph.num_nodes(), first)));
  }
}

TEST(GreedyDominatingSet, OneNodeNoLinksAndNoNodesHaveSets) {
  EXPECT_THAT(GreedyDominatingSet(Domination(AppearanceGraph(0, {}), {})), IsEmpty());
  EXPECT_THAT(GreedyDominatingSet(Domination(AppearanceGraph(1, {}), {})), ElementsAre(0));
  EXPECT_THAT(GreedyDominatingSet(Domination(AppearanceGraph(3, {}), {})), UnorderedElementsAre(0, 1, 2));
  EXPECT_THAT(GreedyDominatingSet(Domination(AppearanceGraph(3, {}), {.min_component_nodes = 2})), IsEmpty());
}

TEST(ImproveDominatingSet, FindsTheSmallestSetOfSmallGraphs) {
  for (uint64_t seed = 0; seed < 25; ++seed) {
    const AppearanceGraph graph = LargestComponent(GeometricGraph(15, 4, seed));
    for (const int m : {1, 2}) {
      const Domination domination(graph, {.num_dominators = m});
      const std::vector<NodeIdx> improved =
          ImproveDominatingSet(domination, GreedyDominatingSet(domination), {.num_tries = 500}, seed);
      EXPECT_EQ(static_cast<int>(improved.size()), SmallestSize(domination)) << "seed " << seed << " m " << m;
    }
  }
}

TEST(ImproveDominatingSet, StaysConnectedAndDominatingAndIsNeverLarger) {
  for (uint64_t seed = 0; seed < 8; ++seed) {
    const AppearanceGraph graph = GeometricGraph(200, 7, seed);
    const Domination domination(graph, {.num_dominators = 1 + static_cast<int>(seed % 3)});
    const std::vector<NodeIdx> greedy = GreedyDominatingSet(domination);
    const std::vector<NodeIdx> improved = ImproveDominatingSet(domination, greedy, {.num_tries = 300}, seed);
    EXPECT_LT(improved.size(), greedy.size());
    const std::vector<char> kept = NodeMarks(200, improved);
    EXPECT_TRUE(domination.IsConnected(kept));
    EXPECT_THAT(domination.Undominated(kept), IsEmpty());
    EXPECT_EQ(improved, ImproveDominatingSet(domination, greedy, {.num_tries = 300}, seed));
  }
}

TEST(ImproveDominatingSet, AtAGivenSizeNoMoreIsMissedAndTheSizeStays) {
  for (uint64_t seed = 0; seed < 8; ++seed) {
    const AppearanceGraph graph = LargestComponent(GeometricGraph(120, 9, seed));
    const Domination domination(graph, {});
    const std::vector<NodeIdx> greedy = GreedyDominatingSet(domination, 8);
    const std::vector<NodeIdx> improved =
        ImproveDominatingSet(domination, greedy, {.num_tries = 300}, seed, 8);
    EXPECT_EQ(improved.size(), 8u);
    const std::vector<char> kept = NodeMarks(graph.num_nodes(), improved);
    EXPECT_TRUE(domination.IsConnected(kept));
    EXPECT_LE(domination.Undominated(kept).size(),
              domination.Undominated(NodeMarks(graph.num_nodes(), greedy)).size());
  }
}

TEST(BoundConnectedSet, NeverExceedsTheSmallestSet) {
  for (uint64_t seed = 0; seed < 25; ++seed) {
    const AppearanceGraph graph = LargestComponent(GeometricGraph(14, 4, seed));
    for (const DominationOptions& demands : {DominationOptions{}, DominationOptions{.num_dominators = 2},
                                             DominationOptions{.strong_num_inliers = 120}}) {
      const Domination domination(graph, demands);
      const std::vector<NodeIdx> kept = GreedyDominatingSet(domination);
      const int smallest = SmallestSize(domination);
      for (const char* kind : {"counting", "program"}) {
        const ConnectedBound bound = BoundConnectedSet(domination, kept, {.lower_bound = kind});
        EXPECT_LE(bound.lower_bound, smallest) << kind << ", seed " << seed;
        if (!bound.smaller.empty()) {
          const std::vector<char> marks = NodeMarks(graph.num_nodes(), bound.smaller);
          EXPECT_LT(bound.smaller.size(), kept.size());
          EXPECT_TRUE(domination.IsConnected(marks));
          EXPECT_THAT(domination.Undominated(marks), IsEmpty());
        }
      }
    }
  }
}

TEST(BoundConnectedSet, IsTheSmallestSizeOnGraphsOfThirtyNodes) {
  for (uint64_t seed = 0; seed < 6; ++seed) {
    const AppearanceGraph graph = LargestComponent(GeometricGraph(30, 6, seed));
    const Domination domination(graph, {});
    const std::vector<NodeIdx> kept =
        ImproveDominatingSet(domination, GreedyDominatingSet(domination), {.num_tries = 1000}, seed);
    EXPECT_EQ(BoundConnectedSet(domination, kept, {.lower_bound = "program"}).lower_bound,
              static_cast<int>(kept.size()))
        << "seed " << seed;
  }
}

TEST(BoundConnectedSet, KnowsPathsRingsAndStars) {
  const auto bound = [](const AppearanceGraph& graph, const char* kind) {
    const Domination domination(graph, {});
    return BoundConnectedSet(domination, GreedyDominatingSet(domination), {.lower_bound = kind}).lower_bound;
  };
  EXPECT_EQ(bound(PathGraph(12), "counting"), 10);  // all but the ends
  EXPECT_EQ(bound(PathGraph(12), "program"), 10);
  EXPECT_EQ(bound(PathGraph(12, true), "program"), 10);  // all but two neighbours
  EXPECT_EQ(bound(GraphOf(5, {{0, 1}, {0, 2}, {0, 3}, {0, 4}}), "counting"), 1);
  EXPECT_EQ(bound(PathGraph(12), "none"), 0);
}

}  // namespace
}  // namespace cairn::link_appearance
