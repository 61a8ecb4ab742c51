#include "runtime/drive/joint_way.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/world/appearance_graph.h"
#include "runtime/drive/ways_to_goal.h"
#include "runtime/map/appearance_map.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

using testing::ElementsAre;

// Nodes with the places of their images, all looking along +x.
struct Building {
  AppearanceMap appearance;
  std::vector<Pose> poses;
};

Building Make(const std::vector<Eigen::Vector2d>& places, const std::vector<std::pair<int, int>>& links,
              const std::vector<std::pair<int, int>>& look_alikes) {
  Building building;
  const size_t num = places.size();
  std::vector<AppearanceLink> of_graph;
  for (const auto& [a, b] : links) of_graph.push_back({a, b, 100});
  AppearanceMap& appearance = building.appearance;
  appearance.graph = AppearanceGraph(static_cast<int>(num), of_graph);
  appearance.is_kept.assign(num, 1);
  appearance.entropy.assign(num, 0);
  appearance.look_alikes.resize(num);
  for (const auto& [a, b] : look_alikes) {
    appearance.look_alikes[a].push_back({b, 1});
    appearance.look_alikes[b].push_back({a, 1});
  }
  for (const Eigen::Vector2d& place : places) building.poses.push_back(PoseAt({place.x(), place.y(), 0}, 0));
  return building;
}

// Nobody gets lost: links cost their metres.
RouteOptions Metres() {
  RouteOptions options;
  options.weight = "risk";
  options.lost_ratio = 0;
  options.faint_link_inliers = 0.1;
  options.wrong_place_m = 30;
  return options;
}

// Two halves of a building, 10 m apart, that look alike but for 3 and 8; the goal lies below the left one.
//
//   3 - .              8 - .
//   |     \            |     \                  3 - 2 as well as 8 - 7 are linked
//   0 - 1 - 2          5 - 6 - 7
//           |                  |
//           4 (goal)  - - - - -
Building TwoHalves() {
  return Make({{0, 0}, {1, 0}, {2, 0}, {0, 1}, {2, -5}, {10, 0}, {11, 0}, {12, 0}, {10, 1}},
              {{0, 1}, {1, 2}, {0, 3}, {2, 3}, {2, 4}, {5, 6}, {6, 7}, {5, 8}, {7, 8}, {4, 7}},
              {{0, 5}, {1, 6}, {2, 7}});
}
// The sum of the lengths of links on a way (ways_to_goal.h), which the tests of PlanRoute check.
double LengthM(const Building& building, const std::vector<NodeIdx>& way) {
  const RouteOptions options = Metres();
  const LinkCosts costs(building.appearance, building.poses, options);
  double length = 0;
  for (size_t k = 1; k < way.size(); ++k) length += costs.LengthM(way[k - 1], way[k]);
  return length;
}

TEST(FindJointWays, OneStartLeadsTheShortestWay) {
  const Building building = TwoHalves();
  const auto ways = FindJointWays(building.appearance, building.poses, {{0, 1}}, 4, Metres(), false);
  EXPECT_THAT(ways.at(0).path.nodes, ElementsAre(0, 1, 2, 4));
  EXPECT_NEAR(ways[0].path.cost, LengthM(building, {0, 1, 2, 4}), 1e-9);
  EXPECT_NEAR(ways[0].expected_cost, LengthM(building, {0, 1, 2, 4}), 1e-9);
}

TEST(FindJointWays, LeadByThePlaceThatTellsStartsApart) {
  const Building building = TwoHalves();
  const auto ways =
      FindJointWays(building.appearance, building.poses, {{0, 0.5}, {5, 0.5}}, 4, Metres(), false);
  EXPECT_THAT(ways.at(0).path.nodes, ElementsAre(0, 3, 2, 4));
  const double by_three = LengthM(building, {0, 3, 2, 4}), from_zero = LengthM(building, {0, 1, 2, 4});
  const double by_eight = LengthM(building, {5, 8, 7, 4}), from_five = LengthM(building, {5, 6, 7, 4});
  EXPECT_NEAR(ways[0].path.cost, by_three, 1e-9);
  // A robot that began at 5 sees at 8 that it is not at 3, and goes back.
  EXPECT_NEAR(ways[0].expected_cost, 0.5 * by_three + 0.5 * (2 * LengthM(building, {0, 3}) + from_five),
              1e-9);
  EXPECT_THAT(ways.at(1).path.nodes, ElementsAre(5, 8, 7, 4));
  EXPECT_NEAR(ways[1].expected_cost, 0.5 * by_eight + 0.5 * (2 * LengthM(building, {5, 8}) + from_zero),
              1e-9);
}

TEST(FindJointWays, WhoPlansAnewGoesOnFromWhereItIs) {
  const Building building = TwoHalves();
  const auto ways =
      FindJointWays(building.appearance, building.poses, {{0, 0.5}, {5, 0.5}}, 4, Metres(), true);
  EXPECT_THAT(ways.at(0).path.nodes, ElementsAre(0, 3, 2, 4));
  EXPECT_NEAR(ways[0].expected_cost,
              0.5 * LengthM(building, {0, 3, 2, 4}) + 0.5 * LengthM(building, {5, 8, 7, 4}), 1e-9);
}

TEST(FindJointWays, AnUnlikelyStartIsWorthNoDetour) {
  const Building building = TwoHalves();
  const auto ways =
      FindJointWays(building.appearance, building.poses, {{0, 0.99}, {5, 0.01}}, 4, Metres(), false);
  EXPECT_THAT(ways.at(0).path.nodes, ElementsAre(0, 1, 2, 4));
}

// The goal has a look-alike where the robot would be: it would stop there.
TEST(FindJointWays, AGoalThatIsMistakenCostsAWrongPlace) {
  const Building building =
      Make({{0, 0}, {1, 0}, {10, 0}, {11, 0}, {5, 0}}, {{0, 1}, {2, 3}, {1, 4}, {2, 4}}, {{0, 2}, {1, 3}});
  const auto ways =
      FindJointWays(building.appearance, building.poses, {{0, 0.5}, {2, 0.5}}, 1, Metres(), false);
  EXPECT_THAT(ways.at(0).path.nodes, ElementsAre(0, 1));
  const double from_other = 5 + 4;  // 2 - 4 - 1
  EXPECT_NEAR(ways[0].expected_cost, 0.5 * 1 + 0.5 * (2 * 1 + 30 + from_other), 1e-9);
}

TEST(FindJointWays, WithoutScaleStartsCountAsToldApart) {
  const Building building = TwoHalves();
  const auto ways = FindJointWays(building.appearance, {}, {{0, 0.5}, {5, 0.5}}, 4, Metres(), false);
  // Every link is a metre: among ways of three the one through the smallest nodes.
  EXPECT_THAT(ways.at(0).path.nodes, ElementsAre(0, 1, 2, 4));
  EXPECT_NEAR(ways[0].expected_cost, 0.5 * 3 + 0.5 * 3, 1e-9);
}

// Random buildings in two halves, against all ways of a few links.
class Oracle {
 public:
  Oracle(const Building& building, const std::vector<PossibleStart>& starts, NodeIdx goal, bool replans)
      : building_(building), starts_(starts), goal_(goal), replans_(replans) {}

  double Least(NodeIdx node) const {
    std::vector<double> cost(building_.poses.size(), 1e9);
    cost[goal_] = 0;
    for (size_t round = 0; round < cost.size(); ++round) {
      for (const AppearanceLink& link : building_.appearance.graph.Links()) {
        const double metres = LengthM(building_, {link.node1, link.node2});
        cost[link.node1] = std::min(cost[link.node1], cost[link.node2] + metres);
        cost[link.node2] = std::min(cost[link.node2], cost[link.node1] + metres);
      }
    }
    return cost[node];
  }
  // Of following this way of the first start.
  double Expected(const std::vector<NodeIdx>& way, double wrong_place_m) const {
    double expected = starts_[0].probability * LengthM(building_, way);
    for (size_t j = 1; j < starts_.size(); ++j) {
      const Eigen::Vector3d offset =
          building_.poses[starts_[j].node].Center() - building_.poses[starts_[0].node].Center();
      double gone = 0, after = wrong_place_m + Least(starts_[j].node);
      for (size_t k = 1; k < way.size(); ++k) {
        gone += LengthM(building_, {way[k - 1], way[k]});
        const int there = NodeAt(building_.poses[way[k]].Center() + offset);
        const auto& alike = building_.appearance.look_alikes[way[k]];
        if (std::any_of(alike.begin(), alike.end(), [&](const auto& other) { return other.node == there; }))
          continue;
        after = Least(replans_ && there >= 0 ? there : starts_[j].node);
        break;
      }
      expected += starts_[j].probability * ((replans_ ? 1 : 2) * gone + after);
    }
    return expected;
  }
  double Best(int max_num_links, double wrong_place_m) const {
    double best = std::numeric_limits<double>::infinity();
    std::vector<NodeIdx> way = {starts_[0].node};
    const std::function<void()> extend = [&] {
      if (way.back() == goal_) {
        best = std::min(best, Expected(way, wrong_place_m));
        return;
      }
      if (static_cast<int>(way.size()) > max_num_links) return;
      for (const auto& neighbour : building_.appearance.graph.Neighbours(way.back())) {
        way.push_back(neighbour.node);
        extend();
        way.pop_back();
      }
    };
    extend();
    return best;
  }

 private:
  int NodeAt(const Eigen::Vector3d& place) const {
    for (size_t node = 0; node < building_.poses.size(); ++node) {
      if ((building_.poses[node].Center() - place).norm() < 1e-6) return static_cast<int>(node);
    }
    return -1;
  }

  const Building& building_;
  const std::vector<PossibleStart>& starts_;
  NodeIdx goal_;
  bool replans_;
};

TEST(FindJointWays, NoWayOfFewLinksIsCheaper) {
  int num_detours = 0;
  for (uint64_t seed = 0; seed < 60; ++seed) {
    Random random(seed);
    constexpr int kHalf = 5;
    std::vector<Eigen::Vector2d> places;
    std::vector<std::pair<int, int>> links, alike;
    for (int i = 0; i < kHalf; ++i)
      places.emplace_back(4 * i + random.Uniform(0, 2), random.Uniform(0, 8));  // none within 1 m
    for (int i = 0; i < kHalf; ++i) places.push_back(places[i] + Eigen::Vector2d(100, 0));
    places.emplace_back(50, 20);
    for (int half = 0; half < 2; ++half) {
      for (int i = 0; i < kHalf; ++i) {
        for (int k = i + 1; k < kHalf; ++k) {
          if (k == i + 1 || random.Uniform() < 0.4) links.push_back({half * kHalf + i, half * kHalf + k});
        }
      }
    }
    links.push_back({kHalf - 1, 2 * kHalf});
    links.push_back({2 * kHalf - 1, 2 * kHalf});
    for (int i = 0; i < kHalf; ++i) {
      if (i == 0 || random.Uniform() < 0.6) alike.push_back({i, kHalf + i});
    }
    const Building building = Make(places, links, alike);
    const double p = random.Uniform(0.1, 0.9);
    const std::vector<PossibleStart> starts = {{0, p}, {kHalf, 1 - p}};
    const NodeIdx goal = seed % 3 == 0 ? kHalf - 1 : 2 * kHalf;
    for (const bool replans : {false, true}) {
      const Oracle oracle(building, starts, goal, replans);
      const JointWay way =
          FindJointWays(building.appearance, building.poses, starts, goal, Metres(), replans)[0];
      EXPECT_NEAR(way.expected_cost, oracle.Expected(way.path.nodes, 30), 1e-9) << seed;
      EXPECT_LE(way.expected_cost, oracle.Best(6, 30) + 1e-9) << seed;
      num_detours += way.path.cost > oracle.Least(0) + 1e-9;
    }
  }
  EXPECT_GE(num_detours, 5) << "too few cases in which a detour pays";
}

}  // namespace
}  // namespace cairn
