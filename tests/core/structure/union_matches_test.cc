#include "core/structure/union_matches.h"

#include <algorithm>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

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

// Follows matches one after the other, by whole sets.
std::vector<Track> UnionByBruteForce(const std::vector<int>& num_keypoints, std::vector<ScoredMatch> matches,
                                     int64_t* num_conflicts) {
  std::stable_sort(matches.begin(), matches.end(), [](const ScoredMatch& a, const ScoredMatch& b) {
    return std::tuple(-a.dot_product, a.element1, a.element2) <
           std::tuple(-b.dot_product, b.element1, b.element2);
  });
  std::vector<std::set<TrackElement>> sets;
  for (int image = 0; image < std::ssize(num_keypoints); ++image) {
    for (int k = 0; k < num_keypoints[image]; ++k) sets.push_back({E(image, k)});
  }
  *num_conflicts = 0;
  for (const ScoredMatch& match : matches) {
    const auto has = [](const TrackElement& element) {
      return [element](const std::set<TrackElement>& set) { return set.count(element) > 0; };
    };
    const auto set1 = std::find_if(sets.begin(), sets.end(), has(match.element1));
    const auto set2 = std::find_if(sets.begin(), sets.end(), has(match.element2));
    if (set1 == set2) continue;
    std::set<int> images;
    for (const auto& set : {*set1, *set2}) {
      for (const TrackElement& element : set) images.insert(element.image_idx);
    }
    if (images.size() < set1->size() + set2->size()) {
      ++*num_conflicts;
      continue;
    }
    set1->insert(set2->begin(), set2->end());
    sets.erase(set2);
  }
  std::vector<Track> tracks;
  for (const auto& set : sets) {
    if (set.size() > 1) tracks.emplace_back(set.begin(), set.end());
  }
  std::sort(tracks.begin(), tracks.end());
  return tracks;
}

TEST(UnionMatches, JoinsAsMatchesFollowedOneByOne) {
  const std::vector<int> num_keypoints = {9, 0, 30, 4, 17};
  for (const int num_matches : {1, 31, 32, 33, 34, 64, 65, 66, 200}) {
    Random random(num_matches);
    std::vector<ScoredMatch> matches;
    while (std::ssize(matches) < num_matches) {
      const auto element = [&](int image) {
        return E(image, static_cast<int>(random.UniformInt(0, num_keypoints[image] - 1)));
      };
      const int image1 = static_cast<int>(random.UniformInt(0, 3)),
                image2 = static_cast<int>(random.UniformInt(image1 + 1, 4));
      if (image1 == 1 || image2 == 1) continue;
      const TrackElement element1 = element(image1), element2 = element(image2);
      matches.push_back({element1, element2, static_cast<int32_t>(random.UniformInt(0, 20))});
    }
    int64_t num_conflicts = 0, num_expected = 0;
    EXPECT_EQ(Union(num_keypoints, matches, &num_conflicts),
              UnionByBruteForce(num_keypoints, matches, &num_expected))
        << num_matches;
    EXPECT_EQ(num_conflicts, num_expected) << num_matches;
  }
}

}  // namespace
}  // namespace cairn
