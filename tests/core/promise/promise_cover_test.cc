#include "core/promise/promise_cover.h"

#include <algorithm>
#include <bit>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

using Sights = std::vector<std::vector<ExpectedMatch>>;

bool Meets(const CoverProblem& problem, const std::vector<size_t>& chosen) {
  std::vector<double> given(problem.demands.size(), 0);
  for (const size_t i : chosen) {
    for (const ExpectedMatch& match : (*problem.of_class)[i]) given[match.view] += match.probability;
  }
  for (size_t v = 0; v < given.size(); ++v) {
    if (given[v] < problem.demands[v] - 1e-5) return false;
  }
  return true;
}

Sights RandomSights(size_t num_classes, int num_nodes, double density, Random* random) {
  Sights sights(num_classes);
  for (std::vector<ExpectedMatch>& of_class : sights) {
    for (int node = 0; node < num_nodes; ++node) {
      if (random->Uniform() < density)
        of_class.push_back({node, static_cast<float>(0.1 + 0.8 * random->Uniform())});
    }
  }
  return sights;
}

TEST(Demands, AreWhatIsNeededOrPartOfWhatThereIs) {
  const Sights sights = {{{0, 0.5F}, {1, 0.5F}}, {{0, 0.75F}}};
  EXPECT_THAT(Demands(sights, 3, 1.25, 0.5), ElementsAre(1.25, 0.25, 0));
}

TEST(CoverFast, TakesThoseThatMeetMost) {
  const Sights sights = {{{0, 0.5F}}, {{1, 0.5F}}, {{0, 0.5F}, {1, 0.5F}}, {}};
  EXPECT_THAT(CoverFast({&sights, {0.5, 0.5}}), ElementsAre(2));
  EXPECT_THAT(CoverFast({&sights, {0.5, 0}}), ElementsAre(0));  // a tie: the smaller position
  EXPECT_THAT(CoverFast({&sights, {0, 0}}), IsEmpty());
  EXPECT_THAT(CoverFast({&sights, {1, 0.5}}), ElementsAre(0, 2));
}

TEST(CoverFast, GivesBackWhatTurnedOutNotToBeNeeded) {
  // The broad one comes first, then both narrow ones are needed all the same.
  const Sights sights = {{{0, 0.6F}, {1, 0.6F}}, {{0, 0.9F}, {2, 0.1F}}, {{1, 0.9F}, {3, 0.1F}}};
  EXPECT_THAT(CoverFast({&sights, {0.9, 0.9, 0.1, 0.1}}), ElementsAre(1, 2));
}

TEST(CoverFast, KeepsWhatIsTaken) {
  const Sights sights = {{{0, 0.5F}}, {{0, 0.9F}}, {{1, 0.5F}}};
  EXPECT_THAT(CoverFast({&sights, {0.9, 0}}, {0, 2}), ElementsAre(0, 1, 2));
}

TEST(CoverBest, BoundAndCoverEncloseTheBestOfAll) {
  Random random(3);
  int num_optimal = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const Sights sights = RandomSights(12, 5, 0.5, &random);
    CoverProblem problem{.of_class = &sights};
    problem.demands = Demands(sights, 5, 1.5, 0.9);
    size_t fewest = sights.size();
    for (unsigned set = 0; set < 1U << sights.size(); ++set) {
      if (static_cast<size_t>(std::popcount(set)) >= fewest) continue;
      std::vector<size_t> chosen;
      for (size_t i = 0; i < sights.size(); ++i) {
        if ((set >> i & 1U) != 0) chosen.push_back(i);
      }
      if (Meets(problem, chosen)) fewest = chosen.size();
    }
    const LandmarkCover cover = CoverBest(problem, {.num_threads = 1});
    EXPECT_TRUE(Meets(problem, cover.chosen));
    EXPECT_TRUE(std::is_sorted(cover.chosen.begin(), cover.chosen.end()));
    EXPECT_LE(cover.lower_bound, static_cast<int64_t>(fewest));
    EXPECT_GE(cover.lower_bound + 1, static_cast<int64_t>(fewest));  // the relaxation is tight here
    EXPECT_GE(cover.chosen.size(), fewest);
    EXPECT_LE(cover.chosen.size(), fewest + 1);
    EXPECT_LE(cover.chosen.size(), CoverFast(problem).size());
    num_optimal += cover.chosen.size() == fewest ? 1 : 0;
  }
  EXPECT_GE(num_optimal, 32);
}

TEST(CoverBest, SameForAnyNumberOfThreadsAndCloseOnLargeProblems) {
  Random random(4);
  const Sights sights = RandomSights(3000, 200, 0.05, &random);
  CoverProblem problem{.of_class = &sights};
  problem.demands = Demands(sights, 200, 15, 0.9);
  const LandmarkCover one = CoverBest(problem, {.num_threads = 1});
  const LandmarkCover three = CoverBest(problem, {.num_threads = 3});
  EXPECT_EQ(one.chosen, three.chosen);
  EXPECT_EQ(one.lower_bound, three.lower_bound);
  EXPECT_TRUE(Meets(problem, one.chosen));
  EXPECT_LT(static_cast<double>(one.chosen.size()), 1.05 * static_cast<double>(one.lower_bound));
}

TEST(CoverBest, NothingIsDemandedOfNothing) {
  const Sights none;
  const LandmarkCover cover = CoverBest({&none, {}}, {});
  EXPECT_THAT(cover.chosen, IsEmpty());
  EXPECT_EQ(cover.lower_bound, 0);
}

}  // namespace
}  // namespace cairn
