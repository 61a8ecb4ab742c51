#include "runtime/paths/fewest_looks.h"

#include <algorithm>
#include <bit>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/decompose_views/plan_fixture.h"
#include "tests/runtime/paths/plan_oracle.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

NumberSet SetOf(const std::vector<int>& numbers, size_t num = 70) {
  NumberSet set(num);
  for (const int number : numbers) set.Insert(number);
  return set;
}

TEST(NumberSet, HoldsNumbersBeyondAWord) {
  NumberSet set = SetOf({1, 63, 64, 69});
  EXPECT_EQ(set.Size(), 4);
  EXPECT_TRUE(set.Contains(63));
  EXPECT_TRUE(set.Contains(64));
  EXPECT_FALSE(set.Contains(0));
  EXPECT_FALSE(set.Contains(65));
  EXPECT_TRUE(set.Meets(SetOf({0, 69})));
  EXPECT_FALSE(set.Meets(SetOf({0, 2, 68})));
  EXPECT_TRUE(SetOf({1, 69}).IsWithin(set));
  EXPECT_FALSE(SetOf({1, 68}).IsWithin(set));
  set.EraseAll(SetOf({1, 2, 69}));
  EXPECT_EQ(set.Size(), 2);
  set.InsertAll(SetOf({5}));
  EXPECT_EQ(set.Size(), 3);
  set.KeepAll(SetOf({5, 64}));
  EXPECT_EQ(set.Size(), 2);
  EXPECT_TRUE(set.Contains(5));
  EXPECT_TRUE(set.Contains(64));
}

TEST(FewSets, TakesOneInPlaceOfTwo) {
  // Greedy takes 0 (given), then {1..4}, then two more for 5 and 6; with {1, 2, 5} and {3, 4, 6} two are
  // enough.
  const std::vector<NumberSet> sets{SetOf({0}), SetOf({1, 2, 3, 4}), SetOf({1, 2, 5}), SetOf({3, 4, 6})};
  EXPECT_EQ(FewSets(sets, std::vector<double>(7, 1), 1), (std::vector<size_t>{0, 2, 3}));
  // Two that greed takes are replaced by one that holds what the others leave.
  const std::vector<NumberSet> other{SetOf({0, 1}), SetOf({2, 3, 4, 5}), SetOf({6, 7, 8, 9}),
                                     SetOf({2, 6, 10}), SetOf({3, 7, 11})};
  EXPECT_EQ(FewSets(other, std::vector<double>(12, 1), 1).size(), 5u);
}

TEST(FewSets, ExchangesUntilNoOneStandsForTwo) {
  // Greed takes {1, 2} and {3, 4}, by the weight of 2 and 4, then {2, 5} and {4, 6}; {1, 3} stands for the
  // first two.  The same again for 7 to 12.
  const std::vector<NumberSet> sets{SetOf({0}),     SetOf({1, 2}),   SetOf({3, 4}), SetOf({2, 5}),
                                    SetOf({4, 6}),  SetOf({1, 3}),   SetOf({7, 8}), SetOf({9, 10}),
                                    SetOf({8, 11}), SetOf({10, 12}), SetOf({7, 9})};
  const std::vector<double> weights{1, 1, 5, 1, 5, 0.5, 0.5, 1, 5, 1, 5, 0.5, 0.5};
  std::vector<size_t> chosen = FewSets(sets, weights, 1);
  std::sort(chosen.begin(), chosen.end());
  EXPECT_EQ(chosen, (std::vector<size_t>{0, 3, 4, 5, 8, 9, 10}));
}

TEST(FewSets, LeavesOutTheNeedlessBeforeItExchanges) {
  // The first choice, {1, 2, 3, 4}, is needless after the next two.  {1, 2, 5} would do for one of them and
  // it.
  const std::vector<NumberSet> sets{SetOf({0}), SetOf({1, 2, 3, 4}), SetOf({1, 2, 5}), SetOf({1, 2, 5, 7}),
                                    SetOf({3, 4, 6, 7})};
  EXPECT_EQ(FewSets(sets, {1, 1.5, 1.5, 1.5, 1.5, 1, 1, 1}, 1), (std::vector<size_t>{0, 3, 4}));
}

TEST(FewSets, HoldsAllAndIsNearTheLeast) {
  int num_sets = 0, num_least = 0;
  for (uint64_t seed = 0; seed < 150; ++seed) {
    Random random(MixSeed(41, seed));
    const int num = 14;
    std::vector<NumberSet> sets;
    std::vector<unsigned> masks;
    for (int i = 0; i < 11; ++i) {
      sets.emplace_back(num);
      masks.push_back(0);
      for (int k = 0; k < num; ++k) {
        if (random.Uniform() > 0.25) continue;
        sets.back().Insert(k);
        masks.back() |= 1u << k;
      }
    }
    unsigned all = 0;
    for (const unsigned mask : masks) all |= mask;
    int least = 100;
    for (unsigned choice = 1; choice < 1u << 11; choice += 2) {  // set 0 is one of them
      unsigned held = 0;
      for (int i = 0; i < 11; ++i) held |= (choice >> i & 1) != 0 ? masks[i] : 0;
      if (held == all) least = std::min(least, std::popcount(choice));
    }
    const std::vector<size_t> chosen = FewSets(sets, std::vector<double>(num, 1), 1);
    EXPECT_EQ(chosen[0], 0u);
    unsigned held = 0;
    for (const size_t i : chosen) held |= masks[i];
    EXPECT_EQ(held, all);
    EXPECT_LE(chosen.size(), least + 1u);
    num_sets += static_cast<int>(chosen.size());
    num_least += least;
  }
  EXPECT_LE(num_sets, 1.05 * num_least);
}

TEST(FewSets, StopsWhenTheShareIsHeld) {
  const std::vector<NumberSet> sets{SetOf({0}), SetOf({1}), SetOf({2}), SetOf({3})};
  const std::vector<double> weights{1, 2, 3, 4};
  EXPECT_EQ(FewSets(sets, weights, 0.5), (std::vector<size_t>{0, 3}));
  EXPECT_EQ(FewSets(sets, weights, 0.51), (std::vector<size_t>{0, 3, 2}));
  EXPECT_EQ(FewSets(sets, weights, 0.05), (std::vector<size_t>{0}));
}

// A corridor, y from 0 to 1, with `num` rooms of 2 m x 2 m above it, each with a door of 0.4 m in the middle
// of its lower wall, and walls of 0.5 m between them.
std::string Comb(int num) {
  std::string walls = fmt::format("0,0,{0},0\n{0},0,{0},1\n0,1,0,0\n", 3 * num);
  for (int i = 0; i < num; ++i) {
    const double x = 3 * i;
    walls += fmt::format("{},1,{},1\n{},1,{},1\n", x, x + 1.3, x + 1.7, x + 3);
    walls += fmt::format("{0},1,{0},3\n{0},3,{1},3\n{1},3,{1},1\n", x + 0.5, x + 2.5);
  }
  return walls;
}

std::vector<Witness> WitnessesAt(const PlanSpace& space, const std::vector<Vec2>& places) {
  std::vector<Witness> witnesses;
  for (const Vec2& place : places) witnesses.push_back({LookAround(space, place), NumberSet(1)});
  return witnesses;
}

TEST(LeastNumLooks, EachRoomNeedsOne) {
  const Views views = decompose_views::Decomposed(Comb(4)).views;
  const PlanSpace space(views);
  // The corner of each room, and its middle, which sees the corridor: those of the corners are taken.
  std::vector<Vec2> places;
  for (int i = 0; i < 4; ++i) {
    places.emplace_back(3 * i + 1.5, 2);
    places.emplace_back(3 * i + 0.6, 1.1);
  }
  EXPECT_EQ(LeastNumLooks(WitnessesAt(space, places), 0), 4);
  EXPECT_EQ(LeastNumLooks(WitnessesAt(space, {places[0], places[1]}), 0), 1);
  EXPECT_EQ(LeastNumLooks({}, 0), 0);
}

TEST(LeastNumLooks, TakesTwoInPlaceOfOne) {
  // In the middles of eight rooms, which have no view in common but by their viewers.  Of each four: the
  // first is taken, for it has the fewest viewers, and the second and the last two have one in common with
  // it; the second has with the last two, which have none.
  const Views views = decompose_views::Decomposed(Comb(8)).views;
  const PlanSpace space(views);
  std::vector<Witness> witnesses;
  const auto add = [&](const std::vector<int>& viewers) {
    const Vec2 middle(3 * static_cast<double>(witnesses.size()) + 1.5, 2);
    witnesses.push_back({LookAround(space, middle), SetOf(viewers)});
  };
  for (const int i : {0, 20}) {
    add({i, i + 1});
    add({i, i + 1, i + 9});
    add({i, i + 5, i + 6});
    add({i + 1, i + 7, i + 8});
  }
  EXPECT_EQ(LeastNumLooks(witnesses, 0), 4);
  witnesses.resize(4, witnesses[0]);
  EXPECT_EQ(LeastNumLooks(witnesses, 0), 2);
  witnesses.resize(2, witnesses[0]);
  EXPECT_EQ(LeastNumLooks(witnesses, 0), 1);
}

TEST(HaveCommonView, IsFoundWhereBothSee) {
  int num_common = 0, num_apart = 0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    Random random(MixSeed(42, seed));
    const PlanOracle oracle(RandomWalls(random, 14, 5));
    const Views views = decompose_views::Decomposed(oracle.Text()).views;
    const PlanSpace space(views);
    std::vector<Vec2> places;
    for (int i = 0; i < 6; ++i) places.emplace_back(random.Uniform(-0.9, 5.9), random.Uniform(-0.9, 5.9));
    const std::vector<Witness> witnesses = WitnessesAt(space, places);
    const std::vector<Vec2> lattice = oracle.Lattice(0.37, 1e-3);
    for (size_t i = 0; i < places.size(); ++i) {
      for (size_t k = 0; k < i; ++k) {
        const bool is_common = HaveCommonView(witnesses[i], witnesses[k], 0);
        const bool both_see = std::any_of(lattice.begin(), lattice.end(), [&](const Vec2& point) {
          return oracle.Sees(places[i], point) && oracle.Sees(places[k], point);
        });
        if (both_see) EXPECT_TRUE(is_common) << oracle.Text();
        (is_common ? num_common : num_apart) += 1;
      }
    }
  }
  EXPECT_GT(num_common, 200);
  EXPECT_GT(num_apart, 20);
}

TEST(HaveCommonView, OnlyOfPlacesWhereTheRobotFits) {
  //  +------------------+------------------+ 3     Through its door each witness sees a strip of the alley
  //  below, |   a              |            b     |       down to y = 0 between x = 4 and 4.6, and
  //  between 4.3 and 4.9:
  //  +------    --------+-----    ---------+ 0.4   they meet beside the wall, up to 0.025 m from it.
  //  |                                     |
  //  +-------------------------------------+ 0
  const Views views = decompose_views::Decomposed(
                          "0,0,10,0\n10,0,10,3\n10,3,0,3\n0,3,0,0\n5,0.4,5,3\n"
                          "0,0.4,2,0.4\n2.2,0.4,6.7,0.4\n6.9,0.4,10,0.4")
                          .views;
  const PlanSpace space(views);
  const auto common = [&](const Vec2& a, const Vec2& b, double radius) {
    const std::vector<Witness> witnesses = WitnessesAt(space, {a, b});
    const bool is_common = HaveCommonView(witnesses[0], witnesses[1], radius);
    EXPECT_EQ(HaveCommonView(witnesses[1], witnesses[0], radius), is_common);
    return is_common;
  };
  EXPECT_TRUE(common({1, 0.6}, {7.9, 0.6}, 0));
  EXPECT_TRUE(common({1, 0.6}, {7.9, 0.6}, 0.02));
  EXPECT_FALSE(common({1, 0.6}, {7.9, 0.6}, 0.03));
  // From higher up, strips that do not meet.
  EXPECT_FALSE(common({1, 0.6}, {8, 0.7}, 0));
  EXPECT_TRUE(common({1, 0.6}, {4, 2}, 0.1));
  // With a viewer in common there is nothing to ask.
  std::vector<Witness> same = WitnessesAt(space, {{1, 0.6}, {8, 0.7}});
  same[0].viewers.Insert(0);
  same[1].viewers.Insert(0);
  EXPECT_TRUE(HaveCommonView(same[0], same[1], 0));
}

}  // namespace
}  // namespace cairn
