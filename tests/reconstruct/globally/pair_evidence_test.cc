#include "stages/reconstruct/globally/pair_evidence.h"

#include <gtest/gtest.h>

namespace cairn::reconstruct {
namespace {

Eigen::Quaterniond AboutZ(double deg) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(deg), Eigen::Vector3d::UnitZ()));
}

// Three images turned by 10, 30 and 100 degrees.  Keypoints see points at (image, keypoint, 0); the last of
// each sees none.
struct Survey {
  std::vector<Pose> cams_from_world = {{AboutZ(10), {1, 2, 3}}, {AboutZ(30), {}}, {AboutZ(100), {}}};
  std::vector<std::vector<Eigen::Vector3d>> points = std::vector<std::vector<Eigen::Vector3d>>(3);
  std::vector<ViewPair> pairs;

  explicit Survey(int num_matches) {
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < num_matches; ++k) points[i].emplace_back(i, k, 0);
    }
    for (const auto& [image1, image2] : {std::pair(0, 1), {1, 2}}) {
      ViewPair& pair = pairs.emplace_back();
      pair.image1 = image1;
      pair.image2 = image2;
      pair.cam2_from_cam1 = {AboutZ(20), {1, 0, 0}};
      for (int k = 0; k < num_matches; ++k)
        pair.matches.push_back({static_cast<KeypointIdx>(k), static_cast<KeypointIdx>(num_matches - 1 - k)});
    }
    pairs[1].alternatives = {{AboutZ(-15), {1, 0, 0}}};
  }

  PairEvidence Evidence() const {
    return EvidenceOf(pairs, {true, false}, cams_from_world,
                      [&](int image, KeypointIdx keypoint) -> const Eigen::Vector3d* {
                        return keypoint + 1 < points[image].size() ? &points[image][keypoint] : nullptr;
                      });
  }
};

TEST(PairEvidence, CountsMatchesForAndAgainst) {
  const PairEvidence evidence = Survey(40).Evidence();
  ASSERT_EQ(evidence.links.size(), 2u);
  EXPECT_EQ(evidence.links[0].weight, 40);
  EXPECT_EQ(evidence.links[1].weight, -40);
  EXPECT_EQ(evidence.links[1].image1, 1);
  EXPECT_EQ(evidence.links[1].image2, 2);
}

// The first pair has its images as the map has them; the second would have image 2 turned by 50 degrees less,
// or 85.
TEST(PairEvidence, TurnsAreThoseOfSurroundings) {
  const PairEvidence evidence = Survey(40).Evidence();
  ASSERT_EQ(evidence.turns.size(), 3u);
  const double turned[] = {0, 50, 85};
  for (int t = 0; t < 3; ++t)
    EXPECT_NEAR(DegFromRad(evidence.turns[t].turn.angularDistance(AboutZ(turned[t]))), 0, 1e-9) << t;
  EXPECT_EQ(evidence.turns[2].image1, 1);
  EXPECT_EQ(evidence.turns[2].image2, 2);
}

TEST(PairEvidence, PointsAreOfMatchesWithOneOnBothSides) {
  const PairEvidence evidence = Survey(40).Evidence();
  ASSERT_EQ(evidence.points.size(), 2u * 38);
  EXPECT_EQ(evidence.points[0].in1, Eigen::Vector3d(0, 1, 0));
  EXPECT_EQ(evidence.points[0].in2, Eigen::Vector3d(1, 38, 0));
  EXPECT_EQ(evidence.points[75].in1, Eigen::Vector3d(1, 38, 0));
  EXPECT_EQ(evidence.points[75].in2, Eigen::Vector3d(2, 1, 0));
}

// Every fourth of 200.
TEST(PairEvidence, PointsOfManyMatchesAreSpread) {
  const PairEvidence evidence = Survey(200).Evidence();
  ASSERT_EQ(evidence.points.size(), 2u * 49);
  EXPECT_EQ(evidence.points[1].in1, Eigen::Vector3d(0, 8, 0));
}

}  // namespace
}  // namespace cairn::reconstruct
