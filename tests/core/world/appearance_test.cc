#include "core/world/appearance.h"

#include <algorithm>
#include <array>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/files/file.h"
#include "tests/core/world/edited_database.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Neighbour = AppearanceGraph::Neighbour;

//   0 - 1 - 2     3 - 4     5
//    \     /
//     - - -
AppearanceGraph ThreeParts() {
  return AppearanceGraph(6, {{3, 4, 40}, {1, 2, 12}, {0, 2, 2}, {0, 1, 10}, {0, 1, 5}});
}

TEST(AppearanceGraph, ListsNeighboursAscendingWithTheInliersOfAllTheirLinks) {
  const AppearanceGraph graph = ThreeParts();
  EXPECT_EQ(graph.num_nodes(), 6);
  EXPECT_EQ(graph.num_links(), 4);
  EXPECT_THAT(graph.Neighbours(0), ElementsAre(Neighbour{1, 15}, Neighbour{2, 2}));
  EXPECT_THAT(graph.Neighbours(1), ElementsAre(Neighbour{0, 15}, Neighbour{2, 12}));
  EXPECT_THAT(graph.Neighbours(2), ElementsAre(Neighbour{0, 2}, Neighbour{1, 12}));
  EXPECT_THAT(graph.Neighbours(4), ElementsAre(Neighbour{3, 40}));
  EXPECT_THAT(graph.Neighbours(5), IsEmpty());
  EXPECT_EQ(graph.NumNeighbours(2), 2);
  EXPECT_THAT(graph.Links(), ElementsAre(AppearanceLink{0, 1, 15}, AppearanceLink{0, 2, 2},
                                         AppearanceLink{1, 2, 12}, AppearanceLink{3, 4, 40}));
  EXPECT_EQ(AppearanceGraph().num_nodes(), 0);
}

// Random links, and the same as a table.
struct RandomGraph {
  int num_nodes = 0;
  std::map<std::pair<NodeIdx, NodeIdx>, int32_t> table;
  AppearanceGraph graph;

  explicit RandomGraph(uint64_t seed) {
    Random random(seed);
    num_nodes = static_cast<int>(random.UniformInt(1, 12));
    std::vector<AppearanceLink> links;
    for (int64_t left = random.UniformInt(0, 20); left > 0 && num_nodes > 1; --left) {
      const auto a = static_cast<NodeIdx>(random.UniformInt(0, num_nodes - 2));
      const auto b = static_cast<NodeIdx>(random.UniformInt(a + 1, num_nodes - 1));
      links.push_back({a, b, static_cast<int32_t>(random.UniformInt(1, 9))});
      table[{a, b}] += links.back().num_inliers;
    }
    graph = AppearanceGraph(num_nodes, links);
  }
  bool Linked(NodeIdx a, NodeIdx b) const { return table.count({std::min(a, b), std::max(a, b)}) > 0; }
  // Links on the shortest paths over marked nodes, by going one link further until nothing changes.
  std::vector<int> Lengths(NodeIdx start, const std::vector<char>& marked, int max_links) const {
    std::vector<int> lengths(num_nodes, -1);
    lengths[start] = 0;
    for (int length = 0; length < max_links; ++length) {
      for (NodeIdx a = 0; a < num_nodes; ++a) {
        for (NodeIdx b = 0; b < num_nodes && lengths[a] == length; ++b) {
          if (Linked(a, b) && marked[b] && lengths[b] < 0) lengths[b] = length + 1;
        }
      }
    }
    return lengths;
  }
};

TEST(AppearanceGraph, AgreesWithATableOfLinks) {
  for (uint64_t seed = 0; seed < 100; ++seed) {
    const RandomGraph random(seed);
    const int n = random.num_nodes;
    std::vector<AppearanceLink> links;
    for (const auto& [nodes, num_inliers] : random.table)
      links.push_back({nodes.first, nodes.second, num_inliers});
    ASSERT_EQ(random.graph.Links(), links) << seed;
    const std::vector<char> all(n, 1);
    const AppearanceComponents components = FindComponents(random.graph);
    for (NodeIdx a = 0; a < n; ++a) {
      const std::vector<int> lengths = random.Lengths(a, all, n);
      for (NodeIdx b = 0; b < n; ++b) {
        EXPECT_EQ(random.graph.AreLinked(a, b), random.Linked(a, b));
        EXPECT_EQ(components.component_of[a] == components.component_of[b], lengths[b] >= 0);
      }
      const auto& own = components.nodes[components.component_of[a]];
      EXPECT_TRUE(std::binary_search(own.begin(), own.end(), a));
      EXPECT_TRUE(std::is_sorted(own.begin(), own.end()));
    }
    for (size_t i = 1; i < components.nodes.size(); ++i)
      EXPECT_LT(components.nodes[i - 1][0], components.nodes[i][0]);
  }
}

TEST(PathLengths, GoOverMarkedNodesAndNoFurtherThanTheyMay) {
  for (uint64_t seed = 0; seed < 100; ++seed) {
    const RandomGraph random(seed);
    Random marks_of(seed);
    std::vector<char> marked(random.num_nodes);
    for (char& mark : marked) mark = marks_of.Uniform() < 0.7;
    for (const int max_links : {0, 1, 2, 3, 100}) {
      for (NodeIdx start = 0; start < random.num_nodes; ++start)
        EXPECT_EQ(PathLengths(random.graph, start, marked, max_links),
                  random.Lengths(start, marked, max_links))
            << seed;
    }
  }
}

TEST(AppearanceGraph, PartsKeepTheLinksBetweenTheirNodes) {
  const AppearanceGraph part = InducedSubgraph(ThreeParts(), {0, 2, 3, 4});
  EXPECT_EQ(part.num_nodes(), 4);
  EXPECT_THAT(part.Links(), ElementsAre(AppearanceLink{0, 1, 2}, AppearanceLink{2, 3, 40}));
  const AppearanceGraph without = WithoutLinksOf(ThreeParts(), 2);
  EXPECT_EQ(without.num_nodes(), 6);
  EXPECT_THAT(without.Links(), ElementsAre(AppearanceLink{0, 1, 15}, AppearanceLink{3, 4, 40}));
  EXPECT_THAT(WithoutLinksOf(ThreeParts(), 0).Links(),
              ElementsAre(AppearanceLink{1, 2, 12}, AppearanceLink{3, 4, 40}));
  EXPECT_THAT(NodeMarks(4, {1, 3}), ElementsAre(0, 1, 0, 1));
}

Appearance Example() {
  Appearance appearance;
  appearance.nodes = {{.images = {1, 2}, .component = 0, .role = NodeRole::kDominating, .entropy = 1.25},
                      {.images = {9}, .component = 0, .role = NodeRole::kDropped},
                      {.images = {4, 7}, .component = 0, .role = NodeRole::kRestored, .entropy = 0},
                      {.images = {}, .component = 1, .role = NodeRole::kDropped, .entropy = 64},
                      {.images = {3}, .component = 1, .role = NodeRole::kDominating},
                      {.images = {5}, .component = 2, .role = NodeRole::kDropped}};
  appearance.graph = ThreeParts();
  appearance.lower_bounds = {2, 1, 0};
  appearance.confusable = {{0, 2, 0.001}, {0, 3, 0.5}, {2, 5, 1}};
  appearance.num_dominators = 2;
  appearance.strong_num_inliers = 30;
  appearance.max_detour_links = 6;
  return appearance;
}

std::string WrittenAppearance() {
  const std::string path = testing::TempDir() + "/appearance_test.db";
  EXPECT_TRUE(WriteAppearance(Example(), path).ok());
  return path;
}

TEST(Appearance, SurvivesItsFile) {
  const Result<Appearance> read = ReadAppearance(WrittenAppearance());
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->nodes, Example().nodes);
  EXPECT_EQ(read->graph.Links(), Example().graph.Links());
  EXPECT_EQ(read->lower_bounds, Example().lower_bounds);
  EXPECT_EQ(read->confusable, Example().confusable);
  EXPECT_EQ(read->num_dominators, 2);
  EXPECT_EQ(read->strong_num_inliers, 30);
  EXPECT_EQ(read->max_detour_links, 6);
}

TEST(Appearance, CountsNodesOfComponentsForWhoReadsTheTable) {
  const SQLite::Database database(WrittenAppearance());
  SQLite::Statement rows(
      database, "SELECT num_nodes, num_kept, lower_bound IS NULL FROM components ORDER BY component_idx");
  std::vector<std::array<int, 3>> found;
  while (rows.executeStep())
    found.push_back({rows.getColumn(0).getInt(), rows.getColumn(1).getInt(), rows.getColumn(2).getInt()});
  EXPECT_THAT(found, ElementsAre(std::array{3, 2, 0}, std::array{2, 1, 0}, std::array{1, 0, 1}));
}

TEST(Appearance, KeptNodesAreThoseWithARole) {
  const Appearance appearance = Example();
  EXPECT_THAT(appearance.Kept(), ElementsAre(0, 2, 4));
  EXPECT_THAT(appearance.KeptImages(), ElementsAre(1, 2, 3, 4, 7));
}

TEST(Appearance, LowerBoundIsTheSumUnlessAComponentThatIsKeptHasNone) {
  Appearance appearance = Example();
  EXPECT_EQ(appearance.LowerBound(), 3);  // no node of the component without a bound is kept
  appearance.nodes[5].role = NodeRole::kDominating;
  EXPECT_EQ(appearance.LowerBound(), 0);
  appearance.lower_bounds[2] = 1;
  EXPECT_EQ(appearance.LowerBound(), 4);
}

TEST(Appearance, ErrorsNameTheTableAndTheRow) {
  const auto message = [whole = *ReadFile(WrittenAppearance())](const std::string& sql) {
    const Result<Appearance> read = ReadAppearance(EditedDatabase("edited_appearance.db", whole, sql));
    EXPECT_FALSE(read.ok()) << sql;
    return read.ok() ? "" : read.error().message;
  };
  EXPECT_THAT(message("PRAGMA application_id = 7"), HasSubstr("not an appearance graph"));
  EXPECT_THAT(message("DROP TABLE appearance"), HasSubstr("not an appearance graph"));
  EXPECT_THAT(message("PRAGMA user_version = 1"), HasSubstr("appearance version 1, this program reads 2"));
  EXPECT_THAT(message("DELETE FROM appearance"), HasSubstr("table appearance is empty"));
  EXPECT_THAT(message("DELETE FROM components WHERE component_idx = 1"),
              HasSubstr("table components, component 1: missing"));
  EXPECT_THAT(message("UPDATE appearance SET num_components = 4"),
              HasSubstr("6 nodes, 4 links, 3 components; its header says 6, 4, 4"));
  EXPECT_THAT(message("UPDATE appearance SET num_links = 5"), HasSubstr("its header says 6, 5, 3"));
  EXPECT_THAT(message("UPDATE appearance SET num_nodes = 7"), HasSubstr("its header says 7, 4, 3"));
  const std::string missing = "missing, or more than the ";
  EXPECT_THAT(message("UPDATE appearance SET num_nodes = 5"), HasSubstr("node 5: " + missing + "5"));
  EXPECT_THAT(message("DELETE FROM nodes WHERE node_idx = 5"), HasSubstr("5 nodes, 4 links"));
  EXPECT_THAT(message("DELETE FROM nodes WHERE node_idx = 2"), HasSubstr("node 2: " + missing + "6"));
  for (const auto& [column, value] : {std::pair("component_idx", "-1"), std::pair("component_idx", "3"),
                                      std::pair("role", "-1"), std::pair("role", "3")}) {
    EXPECT_THAT(message(std::string("UPDATE nodes SET ") + column + " = " + value + " WHERE node_idx = 1"),
                HasSubstr("node 1: component"));
  }
  EXPECT_THAT(message("UPDATE nodes SET images = x'00' WHERE node_idx = 1"),
              HasSubstr("node 1: a blob of 1"));
  EXPECT_THAT(message("UPDATE nodes SET neighbours = x'00' WHERE node_idx = 1"),
              HasSubstr("node 1: a blob of 1"));
  EXPECT_THAT(message("UPDATE nodes SET num_inliers = x'00' WHERE node_idx = 1"),
              HasSubstr("node 1: a blob of 1"));
  EXPECT_THAT(message("UPDATE nodes SET num_inliers = x'' WHERE node_idx = 0"),
              HasSubstr("node 0: 2 neighbours but 0 numbers of inliers"));
  const auto link_of_3 = [&](const std::string& neighbours, const std::string& num_inliers) {
    return message("UPDATE nodes SET neighbours = x'" + neighbours + "', num_inliers = x'" + num_inliers +
                   "' WHERE node_idx = 3");
  };
  EXPECT_THAT(link_of_3("06000000", "01000000"),
              HasSubstr("node 3: a link to node 6 with 1 inliers is out of"));
  EXPECT_THAT(link_of_3("03000000", "01000000"), HasSubstr("node 3: a link to node 3 with 1 inliers"));
  EXPECT_THAT(link_of_3("04000000", "00000000"), HasSubstr("node 3: a link to node 4 with 0 inliers"));
  EXPECT_THAT(link_of_3("0400000004000000", "0100000001000000"),
              HasSubstr("node 3: a link to node 4 with 1 inliers"));
  EXPECT_THAT(message("UPDATE nodes SET entropy = 64001 WHERE node_idx = 1"),
              HasSubstr("node 1: an entropy of 64001"));
  EXPECT_THAT(message("UPDATE nodes SET entropy = -1 WHERE node_idx = 1"),
              HasSubstr("node 1: an entropy of -1"));
}

TEST(Appearance, ErrorsNameTheConfusablePair) {
  const auto message = [whole = *ReadFile(WrittenAppearance())](const std::string& values) {
    const Result<Appearance> read = ReadAppearance(
        EditedDatabase("edited_appearance.db", whole, "INSERT INTO confusable VALUES (" + values + ")"));
    return read.ok() ? "" : read.error().message;
  };
  EXPECT_EQ(message("4, 5, 1000"), "");
  EXPECT_EQ(message("0, 1, 1"), "");
  EXPECT_THAT(message("4, 5, 1001"), HasSubstr("table confusable: nodes 4 and 5 of 6 with a score of 1001"));
  EXPECT_THAT(message("4, 5, 0"), HasSubstr("with a score of 0"));
  EXPECT_THAT(message("4, 4, 5"), HasSubstr("nodes 4 and 4 of 6"));
  EXPECT_THAT(message("4, 6, 5"), HasSubstr("nodes 4 and 6 of 6"));
  EXPECT_THAT(message("-1, 4, 5"), HasSubstr("nodes -1 and 4 of 6"));
}

}  // namespace
}  // namespace cairn
