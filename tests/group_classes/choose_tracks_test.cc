#include "stages/group_classes/tracks/choose_tracks.h"

#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::group_classes {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(Spread, KeepsSixteenFromTheFirstToTheLast) {
  std::vector<int> inliers(16);
  std::iota(inliers.begin(), inliers.end(), 3);
  EXPECT_EQ(Spread(inliers), inliers);
  inliers.resize(31);
  std::iota(inliers.begin(), inliers.end(), 3);
  EXPECT_THAT(Spread(inliers), ElementsAre(3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31, 33));
}

// A track through images, and how it is triangulated where all of its keypoints agree.
struct Chosen {
  std::vector<Track> tracks;
  std::vector<Triangulation> triangulations;
  void Add(const std::vector<int>& images, TriangulateOutcome outcome = TriangulateOutcome::kOk) {
    Track track;
    Triangulation triangulation;
    triangulation.outcome = outcome;
    for (const int image : images) {
      triangulation.inliers.push_back(static_cast<int>(track.size()));
      track.push_back({image, static_cast<KeypointIdx>(tracks.size())});
    }
    tracks.push_back(track);
    triangulations.push_back(triangulation);
  }
};

TEST(ChooseTracks, TheLongestFirstUntilEveryImageHasEnough) {
  //  images   0 1 2 3
  //  track 0  # #         of the two pairs the first one; the three of images 0 to 2 are
  //  track 1  # # #       enough for these, of image 3 there is one more
  //  track 2  # #
  //  track 3  # # #
  //  track 4    # #  not triangulated
  //  track 5    #   #
  Chosen some;
  some.Add({0, 1});
  some.Add({0, 1, 2});
  some.Add({0, 1});
  some.Add({0, 1, 2});
  some.Add({1, 2}, TriangulateOutcome::kSmallAngle);
  some.Add({1, 3});
  const auto choose = [&](const std::vector<char>& is_counted, int num_keypoints) {
    return ChooseTracks(some.tracks, some.triangulations, is_counted, num_keypoints);
  };
  EXPECT_THAT(choose({1, 1, 1, 1}, 1), ElementsAre(1, 5));
  EXPECT_THAT(choose({1, 1, 1, 1}, 2), ElementsAre(1, 3, 5));
  EXPECT_THAT(choose({1, 1, 1, 1}, 3), ElementsAre(1, 3, 0, 5));
  EXPECT_THAT(choose({1, 1, 1, 1}, 4), ElementsAre(1, 3, 0, 2, 5));
  EXPECT_THAT(choose({1, 1, 1, 0}, 2), ElementsAre(1, 3));
  EXPECT_THAT(choose({0, 0, 0, 1}, 2), ElementsAre(5));
  EXPECT_THAT(choose({0, 0, 0, 0}, 2), IsEmpty());
}

TEST(ChooseTracks, OutliersCountForNoImage) {
  Chosen some;
  some.Add({0, 1, 2});
  some.Add({0, 2});
  some.triangulations[0].inliers = {0, 1};
  EXPECT_THAT(ChooseTracks(some.tracks, some.triangulations, {0, 0, 1}, 1), ElementsAre(1));
}

}  // namespace
}  // namespace cairn::group_classes
