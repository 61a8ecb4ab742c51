#include "stages/reconstruct/view_graph/average_rotations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn::reconstruct {
namespace {

using testing::ElementsAre;

Eigen::Quaterniond Turn(double deg, const Eigen::Vector3d& axis) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(deg), axis.normalized()));
}

ViewPair Pair(int image1, int image2, const Eigen::Quaterniond& rotation, double weight = 1) {
  ViewPair pair;
  pair.image1 = image1;
  pair.image2 = image2;
  pair.cam2_from_cam1.rotation = rotation;
  pair.strength = pair.weight = weight;
  return pair;
}

// 20 images that turn by some 18 degrees from one to the next, each paired with the next three, within
// `noise_deg`.
struct Ring {
  std::vector<Eigen::Quaterniond> rotations;
  std::vector<ViewPair> pairs;
};

Ring MakeRing(double noise_deg) {
  Random random(3);
  const auto noise = [&] {
    return Turn(random.Normal(0, noise_deg), {random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1)});
  };
  Ring ring;
  for (int i = 0; i < 20; ++i) ring.rotations.push_back(Turn(18 * i, {0.1, 1, 0.05 * (i % 3)}));
  for (int i = 0; i < 20; ++i) {
    for (int k = 1; k <= 3; ++k) {
      const int j = (i + k) % 20;
      ring.pairs.push_back(
          Pair(std::min(i, j), std::max(i, j),
               noise() * ring.rotations[std::max(i, j)] * ring.rotations[std::min(i, j)].conjugate()));
    }
  }
  return ring;
}

// Largest error of a rotation relative to the first image's, degrees.
double LargestErrorDeg(const std::vector<Eigen::Quaterniond>& found,
                       const std::vector<Eigen::Quaterniond>& truth) {
  double largest = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    const Eigen::Quaterniond a = found[i] * found[0].conjugate(), b = truth[i] * truth[0].conjugate();
    largest = std::max(largest, DegFromRad(a.angularDistance(b)));
  }
  return largest;
}

TEST(AverageRotations, ExactPairsGiveExactRotations) {
  const Ring ring = MakeRing(0);
  EXPECT_LT(LargestErrorDeg(AverageRotations(20, ring.pairs, {}), ring.rotations), 1e-4);
  for (const ViewPair& pair : ring.pairs) EXPECT_LT(RotationErrorDeg(pair, ring.rotations), 1e-5);
}

TEST(AverageRotations, NoiseIsSharedByTheCycle) {
  const Ring ring = MakeRing(1);
  const double along_tree = LargestErrorDeg(RotationsAlongTree(20, ring.pairs), ring.rotations);
  const double averaged = LargestErrorDeg(AverageRotations(20, ring.pairs, {}), ring.rotations);
  EXPECT_LT(averaged, 2.5);
  EXPECT_LT(averaged, along_tree);
}

TEST(AverageRotations, AFifthOfThePairsMayBeWrongIfTheyAreLighter) {
  Ring ring = MakeRing(0.3);
  for (size_t p = 0; p < ring.pairs.size(); p += 5) {
    ring.pairs[p].cam2_from_cam1.rotation = Turn(90, {0, 1, 0}) * ring.pairs[p].cam2_from_cam1.rotation;
    ring.pairs[p].weight = 0.5;
  }
  const std::vector<Eigen::Quaterniond> found = AverageRotations(20, ring.pairs, {});
  EXPECT_LT(LargestErrorDeg(found, ring.rotations), 2);
  for (size_t p = 0; p < ring.pairs.size(); ++p) {
    if (p % 5 == 0) {
      EXPECT_NEAR(RotationErrorDeg(ring.pairs[p], found), 90, 4) << p;
    } else {
      EXPECT_LT(RotationErrorDeg(ring.pairs[p], found), 3) << p;
    }
  }
}

// Two wrong pairs of little weight agree with each other and outnumber the right one.
TEST(AverageRotations, AHeavyPairIsBelievedRatherThanTwoLightOnes) {
  const Eigen::Quaterniond right = Turn(10, {0, 1, 0}), wrong = Turn(70, {0, 1, 0});
  const std::vector<ViewPair> pairs = {Pair(0, 1, right, 1), Pair(0, 1, wrong, 0.2), Pair(0, 1, wrong, 0.2)};
  const std::vector<Eigen::Quaterniond> found = AverageRotations(2, pairs, {});
  EXPECT_LT(RotationErrorDeg(pairs[0], found), 0.5);
  EXPECT_NEAR(RotationErrorDeg(pairs[1], found), 60, 0.5);
}

TEST(RotationsAlongTree, FollowsThePairsOfMostWeightInEitherDirection) {
  const Eigen::Quaterniond a = Turn(30, {1, 0, 0}), b = Turn(-40, {0, 0, 1});
  const std::vector<ViewPair> pairs = {Pair(0, 2, a * b, 0.1), Pair(0, 1, a, 0.9), Pair(1, 2, b, 0.8)};
  const std::vector<Eigen::Quaterniond> found = RotationsAlongTree(3, pairs);
  EXPECT_LT(RotationErrorDeg(pairs[1], found), 1e-6);
  EXPECT_LT(RotationErrorDeg(pairs[2], found), 1e-6);
  EXPECT_GT(RotationErrorDeg(pairs[0], found), 1);
  EXPECT_EQ(AverageRotations(1, {}, {}).size(), 1u);
}

TEST(RotationErrorDeg, IsThatOfTheNearestThatExplainsThePair) {
  ViewPair pair = Pair(0, 1, Turn(40, {0, 1, 0}));
  const std::vector<Eigen::Quaterniond> rotations = {Turn(0, {0, 1, 0}), Turn(10, {0, 1, 0})};
  EXPECT_NEAR(RotationErrorDeg(pair, rotations), 30, 1e-6);
  pair.alternatives.push_back({Turn(12, {0, 1, 0}), {}});
  EXPECT_NEAR(RotationErrorDeg(pair, rotations), 2, 1e-6);
}

TEST(ConnectedParts, AreListedLargestFirstWithoutLonelyImages) {
  const Eigen::Quaterniond none = Eigen::Quaterniond::Identity();
  const std::vector<ViewPair> pairs = {Pair(0, 5, none), Pair(2, 6, none), Pair(6, 3, none),
                                       Pair(1, 7, none)};
  EXPECT_THAT(ConnectedParts(9, pairs),
              ElementsAre(ElementsAre(2, 3, 6), ElementsAre(0, 5), ElementsAre(1, 7)));
  EXPECT_TRUE(ConnectedParts(4, {}).empty());
}

}  // namespace
}  // namespace cairn::reconstruct
