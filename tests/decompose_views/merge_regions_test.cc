#include "stages/decompose_views/merge_regions.h"

#include <algorithm>
#include <iterator>
#include <map>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/decompose_views/plan_fixture.h"

namespace cairn::decompose_views {
namespace {

int NumDifferent(const std::vector<LabelIdx>& a, const std::vector<LabelIdx>& b) {
  std::vector<LabelIdx> different;
  std::set_symmetric_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(different));
  return static_cast<int>(different.size());
}

// Of the neighbours of a region that are larger: that whose labels differ least, of these the one with the
// longest common border; -1: none.
FaceIdx BestNeighbour(const Views& views, FaceIdx face) {
  std::map<FaceIdx, double> borders;
  for (const ViewLink& link : views.links) {
    if (link.a != face && link.b != face) continue;
    borders[link.a == face ? link.b : link.a] +=
        (views.plan.Metres(views.vertices[link.start]) - views.plan.Metres(views.vertices[link.end])).norm();
  }
  FaceIdx best = -1;
  for (const auto& [other, length] : borders) {
    if (views.Area(other) <= views.Area(face)) continue;
    const int num = NumDifferent(views.LabelSet(other), views.LabelSet(face));
    const int least = best < 0 ? 1 << 20 : NumDifferent(views.LabelSet(best), views.LabelSet(face));
    if (num < least || (num == least && length > borders[best])) best = other;
  }
  return best;
}

TEST(MergeSmallRegions, JoinsTheSmallestToTheNeighbourThatSeesNearlyTheSame) {
  int num_best = 0, num_joined = 0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    Random random(MixSeed(61, seed));
    std::string text;
    for (int i = 0; i < 4; ++i)
      text += fmt::format("{},{},{},{}\n", random.Uniform(0, 6), random.Uniform(0, 6), random.Uniform(0, 6),
                          random.Uniform(0, 6));
    const Views exact = Decomposed(text).views;
    std::vector<std::pair<double, FaceIdx>> areas;
    for (FaceIdx face = 0; face < exact.num_faces(); ++face) areas.emplace_back(exact.Area(face), face);
    std::sort(areas.begin(), areas.end());
    if (areas.size() < 3 || areas[0].first < 1e-6) continue;
    const FaceIdx smallest = areas[0].second, best = BestNeighbour(exact, smallest);
    // None is smaller than the smallest.
    Views same = exact;
    EXPECT_EQ(MergeSmallRegions(areas[0].first, &same).num_regions, 0);
    EXPECT_EQ(same.num_faces(), exact.num_faces());
    Views merged = exact;
    const MergeLoss loss = MergeSmallRegions(0.5 * (areas[0].first + areas[1].first), &merged);
    EXPECT_TRUE(CheckViews(merged, "merged").ok());
    if (loss.num_regions == 0) continue;  // it would leave a pinched corner
    ++num_joined;
    EXPECT_EQ(loss.num_regions, 1);
    EXPECT_EQ(merged.num_faces(), exact.num_faces() - 1);
    EXPECT_DOUBLE_EQ(loss.area_m2, areas[0].first);
    ASSERT_GE(best, 0);
    const FaceIdx joined = FaceLocator(merged).Find(exact.Centroid(smallest));
    ASSERT_GE(joined, 0);
    const bool is_best = merged.LabelSet(joined) == exact.LabelSet(best) &&
                         std::abs(merged.Area(joined) - exact.Area(best) - areas[0].first) < 1e-9;
    num_best += is_best;
    if (is_best) {
      EXPECT_EQ(loss.num_labels, NumDifferent(exact.LabelSet(smallest), exact.LabelSet(best)));
      EXPECT_EQ(merged.index[joined].num_labels, exact.index[best].num_labels);
    }
  }
  EXPECT_GT(num_joined, 20);
  EXPECT_GE(num_best, 0.9 * num_joined);
}

TEST(MergeSmallRegions, LeavesNoneThatIsSmallAndFitsToALargerOne) {
  // Threshold by threshold; what is lost is what was joined, and borders are those that are left.
  const Views exact = Decomposed("0,0,3,0.3\n3.2,1,2,4\n1,2,0.4,5\n4,3,5,0.7").views;
  double total = 0;
  for (FaceIdx face = 0; face < exact.num_faces(); ++face) total += exact.Area(face);
  int64_t num_before = 0;
  for (const double least : {0.02, 0.1, 0.5, 2.0}) {
    Views merged = exact;
    const MergeLoss loss = MergeSmallRegions(least, &merged);
    EXPECT_TRUE(CheckViews(merged, "merged").ok());
    EXPECT_EQ(merged.num_faces() + loss.num_regions, exact.num_faces());
    EXPECT_GT(loss.num_regions, num_before);
    num_before = loss.num_regions;
    double area = 0;
    int num_small = 0;
    for (FaceIdx face = 0; face < merged.num_faces(); ++face) {
      area += merged.Area(face);
      num_small += merged.Area(face) < least;
    }
    EXPECT_NEAR(area, total, 1e-6);
    EXPECT_LE(num_small, 1);
    for (const ViewLink& link : merged.links) EXPECT_LT(link.a, link.b);
    // Once more changes nothing.
    Views again = merged;
    EXPECT_EQ(MergeSmallRegions(least, &again).num_regions, 0);
    EXPECT_EQ(again.links.size(), merged.links.size());
  }
}

}  // namespace
}  // namespace cairn::decompose_views
