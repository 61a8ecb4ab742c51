#include "stages/emit_map/previous/keep_roles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::emit_map {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

// Nodes 0, 1, ..., one image each, of which these are to be kept.
Appearance WithKept(int num_nodes, std::vector<AppearanceLink> links, const std::vector<NodeIdx>& kept) {
  Appearance appearance;
  for (int i = 0; i < num_nodes; ++i) appearance.nodes.push_back({.images = {static_cast<ImageId>(i + 1)}});
  for (const NodeIdx node : kept) appearance.nodes[node].role = NodeRole::kDominating;
  appearance.graph = AppearanceGraph(num_nodes, std::move(links));
  return appearance;
}

// A path 0 - 1 - ... - 6 of links of 20 inliers.
Appearance Path(const std::vector<NodeIdx>& kept) {
  std::vector<AppearanceLink> links;
  for (NodeIdx i = 0; i < 6; ++i) links.push_back({i, i + 1, 20});
  return WithKept(7, links, kept);
}

std::vector<NodeIdx> Kept(Appearance appearance, const std::vector<NodeIdx>& before) {
  KeepRoles(NodeMarks(appearance.graph.num_nodes(), before), &appearance);
  return appearance.Kept();
}

TEST(KeepRoles, WhatWasKeptStaysWhereItIsEnough) {
  EXPECT_THAT(Kept(Path({1, 2, 3, 4, 5}), {1, 2, 3, 4, 5}), ElementsAre(1, 2, 3, 4, 5));
  EXPECT_THAT(Kept(Path({1, 2, 3, 4, 5}), {0, 1, 2, 3, 4, 5}), ElementsAre(0, 1, 2, 3, 4, 5));
  // On a star any leaf would do with its middle; the one that was kept is.
  const Appearance star = WithKept(4, {{0, 1, 9}, {0, 2, 9}, {0, 3, 9}}, {0});
  EXPECT_THAT(Kept(star, {0, 2}), ElementsAre(0, 2));
}

TEST(KeepRoles, NodesWithoutAKeptNeighbourGetTheOneThatIsToBeKept) {
  // 6 is new: of its neighbours none was kept.
  EXPECT_THAT(Kept(Path({1, 2, 3, 4, 5}), {1, 2, 3, 4}), ElementsAre(1, 2, 3, 4, 5));
  // Of two that are to be kept the one with more inliers, of as many the first.
  const auto two = [](int32_t inliers1, int32_t inliers2, const std::vector<NodeIdx>& wanted) {
    return WithKept(4, {{0, 1, inliers1}, {0, 2, inliers2}, {1, 2, 5}, {1, 3, 5}, {2, 3, 5}}, wanted);
  };
  EXPECT_THAT(Kept(two(9, 10, {1, 2}), {}), ElementsAre(2));
  EXPECT_THAT(Kept(two(9, 9, {1, 2}), {}), ElementsAre(1));
  EXPECT_THAT(Kept(two(9, 99, {1}), {}), ElementsAre(1));
}

TEST(KeepRoles, KeptNodesOfAComponentAreConnected) {
  EXPECT_THAT(Kept(Path({1, 2, 3, 4, 5}), {1, 5}), ElementsAre(1, 2, 3, 4, 5));
  // Both ways round a ring of eight are as long: that from the smallest node; and one is enough.
  std::vector<AppearanceLink> links;
  for (NodeIdx i = 0; i < 7; ++i) links.push_back({i, i + 1, 20});
  links.push_back({0, 7, 20});
  EXPECT_THAT(Kept(WithKept(8, links, {0, 1, 2, 3, 4, 5}), {0, 1, 3, 4, 5, 6}),
              ElementsAre(0, 1, 3, 4, 5, 6, 7));
}

TEST(KeepRoles, MFoldDominationAndWeakLinksTakeMore) {
  // Node 0 has three neighbours; links of fewer than 10 inliers count in part.
  Appearance appearance =
      WithKept(4, {{0, 1, 10}, {0, 2, 6}, {0, 3, 10}, {1, 2, 10}, {1, 3, 10}, {2, 3, 10}}, {1, 3});
  appearance.strong_num_inliers = 10;
  EXPECT_THAT(Kept(appearance, {1}), ElementsAre(1));
  EXPECT_THAT(Kept(appearance, {2}), ElementsAre(1, 2)) << "6 of 10 are not enough";
  appearance.num_dominators = 2;
  EXPECT_THAT(Kept(appearance, {1}), ElementsAre(1, 3));
  appearance.num_dominators = 9;
  EXPECT_THAT(Kept(appearance, {}), ElementsAre(1, 2, 3)) << "all that it has";
}

TEST(KeepRoles, ComponentsWithoutANodeToKeepHaveNone) {
  Appearance appearance = WithKept(5, {{0, 1, 9}, {2, 3, 9}}, {1});
  EXPECT_THAT(Kept(appearance, {1, 2, 4}), ElementsAre(1));
  appearance.nodes[4].role = NodeRole::kDominating;
  EXPECT_THAT(Kept(appearance, {1}), ElementsAre(1, 4)) << "a node alone is kept as the graph says";
}

TEST(KeepRoles, RolesAreTheGraphsWhereItsCyclesAreRestored) {
  Appearance appearance = Path({1, 2, 3, 4, 5});
  appearance.max_detour_links = 2;
  EXPECT_THAT(Kept(appearance, {0}), ElementsAre(1, 2, 3, 4, 5));
  appearance.nodes[3].role = NodeRole::kRestored;
  appearance.max_detour_links = 0;
  KeepRoles(NodeMarks(7, {1, 2, 3, 4, 5}), &appearance);
  EXPECT_EQ(appearance.nodes[3].role, NodeRole::kRestored);
  EXPECT_EQ(appearance.nodes[2].role, NodeRole::kDominating);
}

TEST(WereKept, ByTheFirstImageOfANode) {
  MapRows previous;
  previous.images.resize(3);
  previous.appearance = {{.images = {0, 2}, .is_kept = true}, {.images = {1}}};
  Classes classes;
  for (const ImageId id : {5u, 7u, 8u, 9u}) classes.images.push_back({.image_id = id});
  const PreviousMatches matches{.row_of_image = {1, 2, kNotBefore, 0}};
  Appearance appearance;
  appearance.nodes = {
      {.images = {7, 8}}, {.images = {5}}, {.images = {8, 9}}, {.images = {9}}, {.images = {77}}};
  EXPECT_THAT(WereKept(appearance, classes, previous, matches), ElementsAre(1, 0, 0, 1, 0));
}

}  // namespace
}  // namespace cairn::emit_map
