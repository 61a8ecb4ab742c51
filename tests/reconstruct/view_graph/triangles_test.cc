#include "stages/reconstruct/view_graph/triangles.h"

#include <gtest/gtest.h>

namespace cairn::reconstruct {
namespace {

Eigen::Quaterniond Turn(double degrees, const Eigen::Vector3d& axis = Eigen::Vector3d::UnitY()) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(degrees), axis));
}

ViewPair Pair(int image1, int image2, const Eigen::Quaterniond& cam2_from_cam1) {
  ViewPair pair;
  pair.image1 = image1;
  pair.image2 = image2;
  pair.cam2_from_cam1 = {cam2_from_cam1, Eigen::Vector3d::UnitX()};
  return pair;
}

// Of (closed + 0.2) / (triangles + 2).
double Part(double num_closed, double num_triangles) { return (num_closed + 0.2) / (num_triangles + 2); }

// Images 0 to 3, each with each, turned about several axes, and some pairs the other way round.
std::vector<ViewPair> FourImages() {
  const std::vector<Eigen::Quaterniond> rotations = {Turn(0), Turn(20), Turn(50, Eigen::Vector3d::UnitX()),
                                                     Turn(80, Eigen::Vector3d::UnitZ())};
  std::vector<ViewPair> pairs;
  for (int i = 0; i < 4; ++i) {
    for (int j = i + 1; j < 4; ++j) {
      const bool is_turned_round = (i + j) % 2 == 0;
      const int from = is_turned_round ? j : i, to = is_turned_round ? i : j;
      pairs.push_back(Pair(from, to, rotations[to] * rotations[from].conjugate()));
    }
  }
  return pairs;
}

TEST(CloseTriangles, AllOfRightPairsClose) {
  for (const double part : CloseTriangles(4, FourImages(), {}, 2)) EXPECT_DOUBLE_EQ(part, Part(2, 2));
}

TEST(CloseTriangles, NoneOfAWrongPairDoesAndOneLessOfItsNeighbours) {
  std::vector<ViewPair> pairs = FourImages();
  pairs[0].cam2_from_cam1.rotation = Turn(3) * pairs[0].cam2_from_cam1.rotation;
  const std::vector<double> part = CloseTriangles(4, pairs, {}, 1);
  EXPECT_DOUBLE_EQ(part[0], Part(0, 2));
  for (int p = 1; p < 5; ++p) EXPECT_DOUBLE_EQ(part[p], Part(1, 2)) << p;
  EXPECT_DOUBLE_EQ(part[5], Part(2, 2));  // 2 - 3: in no triangle with 0 - 1
}

TEST(CloseTriangles, UpToTwoDegrees) {
  std::vector<ViewPair> pairs = FourImages();
  const Eigen::Quaterniond right = pairs[0].cam2_from_cam1.rotation;
  pairs[0].cam2_from_cam1.rotation = Turn(1.9) * right;
  EXPECT_DOUBLE_EQ(CloseTriangles(4, pairs, {}, 1)[0], Part(2, 2));
  pairs[0].cam2_from_cam1.rotation = Turn(2.1) * right;
  EXPECT_DOUBLE_EQ(CloseTriangles(4, pairs, {}, 1)[0], Part(0, 2));
  EXPECT_DOUBLE_EQ(CloseTriangles(4, pairs, {.max_error_deg = 2.2}, 1)[0], Part(2, 2));
  // The same rotation by the other of its two quaternions.
  pairs[0].cam2_from_cam1.rotation = Eigen::Quaterniond(-right.coeffs());
  EXPECT_DOUBLE_EQ(CloseTriangles(4, pairs, {}, 1)[0], Part(2, 2));
}

// Whichever of three pairs has a second rotation, and it is the right one.
TEST(CloseTriangles, ByAnyRotationThatExplainsAPairAsWell) {
  for (const int p : {0, 1, 3}) {
    std::vector<ViewPair> pairs = FourImages();
    const Pose right = pairs[p].cam2_from_cam1;
    pairs[p].cam2_from_cam1.rotation = Turn(40) * right.rotation;
    EXPECT_DOUBLE_EQ(CloseTriangles(4, pairs, {}, 1)[p], Part(0, 2)) << p;
    pairs[p].alternatives = {right};
    for (const double part : CloseTriangles(4, pairs, {}, 1)) EXPECT_DOUBLE_EQ(part, Part(2, 2)) << p;
  }
}

TEST(CloseTriangles, APairInNoneIsDoubtful) {
  const std::vector<ViewPair> chain = {Pair(0, 1, Turn(0)), Pair(2, 1, Turn(0))};
  EXPECT_DOUBLE_EQ(CloseTriangles(3, chain, {}, 1)[0], 0.1);
  EXPECT_DOUBLE_EQ(CloseTriangles(3, chain, {}, 1)[1], 0.1);
  EXPECT_TRUE(CloseTriangles(0, {}, {}, 1).empty());
}

TEST(CloseTriangles, SameForAnyNumberOfThreads) {
  EXPECT_EQ(CloseTriangles(4, FourImages(), {}, 1), CloseTriangles(4, FourImages(), {}, 7));
}

}  // namespace
}  // namespace cairn::reconstruct
