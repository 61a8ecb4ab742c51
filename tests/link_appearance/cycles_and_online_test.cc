#include <algorithm>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/link_appearance/dominating_set/greedy_dominating_set.h"
#include "stages/link_appearance/dominating_set/online_dominating_set.h"
#include "stages/link_appearance/dominating_set/restore_cycles.h"
#include "tests/link_appearance/graphs.h"

namespace cairn::link_appearance {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

// Longest path over kept nodes between two nodes that are linked, or one node with itself: -1 for none.
int LongestDetour(const AppearanceGraph& graph, const std::vector<char>& kept) {
  int longest = 0;
  for (NodeIdx i = 0; i < graph.num_nodes(); ++i) {
    for (const auto& j : graph.Neighbours(i)) {
      if (kept[i] && kept[j.node]) continue;
      // From i over kept nodes only: the link itself is not one of the sparse graph's where neither is kept.
      int length = kept[i] || kept[j.node] ? 1 : -1;
      for (const auto& a : graph.Neighbours(i)) {
        if (!kept[a.node] || kept[i] || kept[j.node]) continue;
        const std::vector<int> lengths = PathLengths(graph, a.node, kept, graph.num_nodes());
        for (const auto& b : graph.Neighbours(j.node)) {
          if (!kept[b.node] || lengths[b.node] < 0) continue;
          const int whole = lengths[b.node] + 2;
          if (length < 0 || whole < length) length = whole;
        }
      }
      if (length < 0) return -1;
      longest = std::max(longest, length);
    }
  }
  return longest;
}

TEST(RestoreCycles, ClosesARingThatPruningBroke) {
  // A ring of 12 without two neighbours, 0 and 11: from 1 to 10 it is 9 links over the rest.
  const AppearanceGraph ring = PathGraph(12, true);
  std::vector<NodeIdx> kept;
  for (NodeIdx node = 1; node <= 10; ++node) kept.push_back(node);
  EXPECT_THAT(RestoreCycles(ring, kept, 9), ElementsAre(0, 11));
  EXPECT_THAT(RestoreCycles(ring, kept, 10), IsEmpty());
}

TEST(RestoreCycles, ANodeBetweenTwoFarKeptOnesComesBack) {
  // i = j: a ring of 8 without 0; its neighbours 1 and 7 are 6 links apart.
  const AppearanceGraph ring = PathGraph(8, true);
  EXPECT_THAT(RestoreCycles(ring, {1, 2, 3, 4, 5, 6, 7}, 6), ElementsAre(0));
  EXPECT_THAT(RestoreCycles(ring, {1, 2, 3, 4, 5, 6, 7}, 7), IsEmpty());
}

TEST(RestoreCycles, FormerNeighboursAreAtMostCPlusOneLinksApart) {
  for (uint64_t seed = 0; seed < 12; ++seed) {
    const AppearanceGraph graph = GeometricGraph(150, 6, seed);
    const Domination domination(graph, {});
    for (const int c : {2, 3, 5, 8}) {
      std::vector<NodeIdx> kept = GreedyDominatingSet(domination);
      const std::vector<NodeIdx> added = RestoreCycles(graph, kept, c);
      kept.insert(kept.end(), added.begin(), added.end());
      const std::vector<char> marks = NodeMarks(150, kept);
      EXPECT_TRUE(domination.IsConnected(marks));
      const int longest = LongestDetour(graph, marks);
      EXPECT_GE(longest, 0);
      EXPECT_LE(longest, c + 1) << "seed " << seed << ", c " << c;
    }
  }
}

TEST(RestoreCycles, PathsBecomeAtMostCMinusOneTimesAsLongAndTwoLinks) {
  const AppearanceGraph graph = GeometricGraph(150, 7, 4);
  const std::vector<char> all(150, 1);
  const int c = 4;
  std::vector<NodeIdx> kept = GreedyDominatingSet(Domination(graph, {}));
  const std::vector<NodeIdx> added = RestoreCycles(graph, kept, c);
  kept.insert(kept.end(), added.begin(), added.end());
  const std::vector<char> marks = NodeMarks(150, kept);
  for (NodeIdx from = 0; from < 150; ++from) {
    const std::vector<int> full = PathLengths(graph, from, all, 150);
    std::vector<int> sparse(150, 1 << 20);
    std::vector<int> lengths = PathLengths(graph, from, marks, 150);
    for (NodeIdx to = 0; to < 150; ++to) {
      if (full[to] <= 0) continue;
      int shortest = 1 << 20;  // the last link leads from a kept node to `to`
      for (const auto& n : graph.Neighbours(to)) {
        if ((marks[n.node] || n.node == from) && lengths[n.node] >= 0 &&
            (n.node != from || marks[to] || marks[from])) {
          shortest = std::min(shortest, lengths[n.node] + 1);
        }
      }
      EXPECT_LE(shortest, (c - 1) * full[to] + 2) << from << " to " << to;
    }
  }
}

TEST(OnlineDominatingSet, StaysConnectedAndDominatingWithBoundedChanges) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const AppearanceGraph graph = GeometricGraph(120, 5, seed);
    OnlineDominatingSet online(3);
    std::vector<AppearanceLink> links;
    std::vector<char> before;
    for (NodeIdx node = 0; node < graph.num_nodes(); ++node) {
      std::vector<AppearanceGraph::Neighbour> earlier;
      for (const auto& n : graph.Neighbours(node)) {
        if (n.node < node) earlier.push_back(n);
      }
      const AppearanceGraph old_graph(node, links);
      const AppearanceComponents old_components = FindComponents(old_graph);
      std::set<int> joined;
      for (const auto& n : earlier) joined.insert(old_components.component_of[n.node]);
      for (const auto& n : earlier) links.push_back({n.node, node, n.num_inliers});

      const OnlineDominatingSet::Change change = online.Add(earlier);
      EXPECT_LE(change.kept.size(), joined.size() + 1);
      EXPECT_LE(change.dropped.size(), 3u);
      const AppearanceGraph now(node + 1, links);
      const Domination domination(now, {});
      const std::vector<char> marks = NodeMarks(node + 1, online.kept());
      ASSERT_TRUE(domination.IsConnected(marks)) << "seed " << seed << ", node " << node;
      ASSERT_THAT(domination.Undominated(marks), IsEmpty()) << "seed " << seed << ", node " << node;
      // What is told is what changed.
      before.push_back(0);
      for (const NodeIdx kept : change.kept) before[kept] = 1;
      for (const NodeIdx dropped : change.dropped) before[dropped] = 0;
      EXPECT_EQ(before, marks);
    }
  }
}

TEST(OnlineDominatingSet, AnArrivalThatIsSeenChangesNothing) {
  OnlineDominatingSet online(3);
  EXPECT_THAT(online.Add({}).kept, ElementsAre(0));
  const OnlineDominatingSet::Change change = online.Add({{0, 30}});
  EXPECT_THAT(change.kept, IsEmpty());
  EXPECT_THAT(change.dropped, IsEmpty());
  EXPECT_THAT(online.kept(), ElementsAre(0));
}

TEST(OnlineDominatingSet, AnArrivalJoinsTwoPlaces) {
  //  0 - 1     2 - 3     then 4 sees 1 and 3, of which neither is kept
  OnlineDominatingSet online(0);
  online.Add({});
  online.Add({{0, 30}});
  online.Add({});
  online.Add({{2, 30}});
  EXPECT_THAT(online.Add({{1, 30}, {3, 30}}).kept, ElementsAre(1, 3, 4));
}

}  // namespace
}  // namespace cairn::link_appearance
