#include "runtime/paths/fewest_looks.h"

#include <bit>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/decompose_views/plan_fixture.h"

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
