#include "core/structure/union_matches.h"

#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using testing::ElementsAre;

TrackElement E(int image, int keypoint) { return {image, static_cast<KeypointIdx>(keypoint)}; }

struct ScoredMatch {
  TrackElement element1, element2;
  int32_t dot_product;
};

std::vector<Track> Union(const std::vector<int>& num_keypoints, const std::vector<ScoredMatch>& listed,
                         int64_t* num_conflicts) {
  ScoredMatches matches(num_keypoints);
  for (const ScoredMatch& match : listed) matches.Add(match.element1, match.element2, match.dot_product);
  return UnionMatches(std::move(matches), num_conflicts).value();
}

TEST(UnionMatches, ChainsOfMatchesBecomeOneTrack) {
  //  image   0     1     2     3
  //          0 --- 0 --- 0     0
  //          1     1 --------- 1
  int64_t num_conflicts = 0;
  const std::vector<Track> tracks = Union(
      {2, 2, 1, 2}, {{E(0, 0), E(1, 0), 9}, {E(1, 0), E(2, 0), 8}, {E(1, 1), E(3, 1), 7}}, &num_conflicts);
  EXPECT_THAT(tracks, ElementsAre(ElementsAre(E(0, 0), E(1, 0), E(2, 0)), ElementsAre(E(1, 1), E(3, 1))));
  EXPECT_EQ(num_conflicts, 0);
}

TEST(UnionMatches, ClassIsSplitAtTheWeakestMatchThatWouldRepeatAnImage) {
  //  image   0     1     2
  //          0 --- 0 --- 0      the match (2:0, 0:1) is the least alike and would put keypoints 0 and 1 of
  //          1 --------- ^      image 0 into one class
  int64_t num_conflicts = 0;
  const std::vector<Track> tracks =
      Union({2, 1, 1}, {{E(0, 1), E(2, 0), 5}, {E(0, 0), E(1, 0), 9}, {E(1, 0), E(2, 0), 8}}, &num_conflicts);
  EXPECT_THAT(tracks, ElementsAre(ElementsAre(E(0, 0), E(1, 0), E(2, 0))));
  EXPECT_EQ(num_conflicts, 1);
}

TEST(UnionMatches, ResultDoesNotDependOnTheOrderOfMatches) {
  const std::vector<ScoredMatch> matches = {{E(0, 0), E(1, 0), 5},
                                            {E(1, 0), E(2, 0), 5},
                                            {E(0, 1), E(2, 0), 5},
                                            {E(0, 1), E(1, 1), 5},
                                            {E(1, 1), E(2, 1), 5}};
  int64_t conflicts1 = 0, conflicts2 = 0;
  std::vector<ScoredMatch> reversed(matches.rbegin(), matches.rend());
  EXPECT_EQ(Union({2, 2, 2}, matches, &conflicts1), Union({2, 2, 2}, reversed, &conflicts2));
  EXPECT_EQ(conflicts1, conflicts2);
}

TEST(UnionMatches, NoMatchesNoTracks) {
  int64_t num_conflicts = 0;
  EXPECT_TRUE(Union({5, 5}, {}, &num_conflicts).empty());
  EXPECT_TRUE(Union({}, {}, &num_conflicts).empty());
}

}  // namespace
}  // namespace cairn
