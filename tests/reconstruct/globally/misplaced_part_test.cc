#include "stages/reconstruct/globally/misplaced_part.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn::reconstruct {
namespace {

using ::testing::ElementsAre;

constexpr int kNumFirst = 10, kNumImages = 16;

// Two rooms, the images 0 to 9 and 10 to 15.  The map has the second where a panel of it, a square of a
// metre, lies on one of the first that looks alike; pairs that see places all over both say where it is.
struct Folded {
  Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();  // of the second room, where the map has it
  std::vector<std::vector<int>> pieces = {{}, {}}, clusters;
  PairEvidence evidence;

  void Add(int image1, int image2, double weight, const Eigen::Isometry3d& relation,
           const std::vector<Eigen::Vector3d>& in1) {
    evidence.links.push_back({image1, image2, weight});
    evidence.turns.push_back({image1, image2, Eigen::Quaterniond(relation.linear())});
    for (const Eigen::Vector3d& point : in1)
      evidence.points.push_back({image1, image2, point, relation.inverse() * point});
  }
};

// `num_true`: points that each of the true pairs shares.
Folded MakeFolded(int num_true) {
  Folded folded;
  folded.truth = Eigen::Translation3d(7, -2, 0.1) * Eigen::AngleAxisd(1.5, Eigen::Vector3d::UnitZ());
  Random random(3);
  const auto anywhere = [&](int num) {
    std::vector<Eigen::Vector3d> places;
    for (int i = 0; i < num; ++i)
      places.emplace_back(random.Uniform(0, 8), random.Uniform(0, 6), random.Uniform(0, 2.5));
    return places;
  };
  const auto on_panel = [&](int num) {
    std::vector<Eigen::Vector3d> places;
    for (int i = 0; i < num; ++i) places.emplace_back(random.Uniform(0, 1), 3, random.Uniform(0, 1));
    return places;
  };
  const Eigen::Isometry3d here = Eigen::Isometry3d::Identity();
  for (int i = 0; i < kNumImages; ++i) {
    folded.clusters.push_back({i});
    folded.pieces[i < kNumFirst ? 0 : 1].push_back(i);
    for (int k = i + 1; k < kNumImages; ++k) {
      if ((i < kNumFirst) == (k < kNumFirst)) {
        folded.Add(i, k, 300, here, anywhere(40));
      } else if (i < 3 && k < kNumFirst + 3) {
        folded.Add(i, k, 200, here, on_panel(60));  // more matches than what is true
      } else {
        folded.Add(i, k, -30, folded.truth, anywhere(num_true));
      }
    }
  }
  return folded;
}

std::optional<MisplacedPart> Find(const Folded& folded, int num_threads = 2) {
  return FindMisplacedPart(folded.pieces, folded.clusters, folded.evidence, {.tolerance = 0.1}, num_threads);
}

TEST(MisplacedPart, IsMovedToWhereItSharesMoreOfSpace) {
  const auto part = Find(MakeFolded(12));
  ASSERT_TRUE(part);
  EXPECT_THAT(part->images, ElementsAre(10, 11, 12, 13, 14, 15));
  EXPECT_TRUE(part->move.isApprox(MakeFolded(12).truth, 1e-6)) << part->move.matrix();
  // 540 matches on a panel of 10 x 10 cells, 612 elsewhere.
  EXPECT_GT(part->num_cells_here, 50);
  EXPECT_LE(part->num_cells_here, 121);
  EXPECT_GT(part->num_cells_there, 500);
}

TEST(MisplacedPart, IsOnlyMovedToWhereItMayStand) {
  const Folded folded = MakeFolded(12);
  std::vector<MisplacedPart> asked;
  const auto find = [&](bool may_stand) {
    return FindMisplacedPart(folded.pieces, folded.clusters, folded.evidence, {.tolerance = 0.1}, 1,
                             [&](const MisplacedPart& part) {
                               asked.push_back(part);
                               return may_stand;
                             });
  };
  EXPECT_FALSE(find(false));
  ASSERT_FALSE(asked.empty());
  EXPECT_TRUE(asked[0].move.isApprox(folded.truth, 1e-6));  // where most of space is shared comes first
  for (size_t k = 1; k < asked.size(); ++k) {
    EXPECT_GE(asked[k - 1].num_cells_there - asked[k - 1].num_cells_here,
              asked[k].num_cells_there - asked[k].num_cells_here);
  }
  EXPECT_TRUE(find(true));
}

TEST(MisplacedPart, StaysWhereMostHoldsIt) { EXPECT_FALSE(Find(MakeFolded(2))); }

TEST(MisplacedPart, MustShareEnoughMoreThere) {
  const Folded folded = MakeFolded(12);
  const auto find = [&](const MisplacedPartOptions& options) {
    return FindMisplacedPart(folded.pieces, folded.clusters, folded.evidence, options, 1);
  };
  const auto part = Find(folded);
  ASSERT_TRUE(part);
  const double gain = static_cast<double>(part->num_cells_there) / part->num_cells_here;
  EXPECT_TRUE(find({.tolerance = 0.1, .min_gain = gain - 0.01}));
  EXPECT_FALSE(find({.tolerance = 0.1, .min_gain = gain + 0.01}));
  EXPECT_TRUE(find({.tolerance = 0.1, .min_num_cells = part->num_cells_there}));
  EXPECT_FALSE(find({.tolerance = 0.1, .min_num_cells = part->num_cells_there + 1}));
}

// Whichever side the first piece is on, the smaller one moves.
TEST(MisplacedPart, IsTheSmallerSide) {
  Folded folded = MakeFolded(12);
  std::swap(folded.pieces[0], folded.pieces[1]);
  const auto part = Find(folded);
  ASSERT_TRUE(part);
  EXPECT_THAT(part->images, ElementsAre(10, 11, 12, 13, 14, 15));
  EXPECT_TRUE(part->move.isApprox(folded.truth, 1e-6));
}

// Turns are known to a degree, points to centimetres, and a third of what pairs match is wrong: all that
// agrees decides where the part goes.
TEST(MisplacedPart, IsMovedByAllThatAgrees) {
  Folded folded = MakeFolded(30);
  Random random(5);
  const auto noise = [&](double sigma) {
    return Eigen::Vector3d(random.Normal(0, sigma), random.Normal(0, sigma), random.Normal(0, sigma));
  };
  for (SharedTurn& turn : folded.evidence.turns) {
    const Eigen::Vector3d by = noise(0.02);
    turn.turn = turn.turn * Eigen::Quaterniond(Eigen::AngleAxisd(by.norm(), by.normalized()));
  }
  for (size_t k = 0; k < folded.evidence.points.size(); ++k) {
    folded.evidence.points[k].in2 += k % 3 == 0 ? noise(2) : noise(0.02);
  }
  const auto part = Find(folded);
  ASSERT_TRUE(part);
  EXPECT_THAT(part->images, ElementsAre(10, 11, 12, 13, 14, 15));
  for (const Eigen::Vector3d& corner : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(8, 6, 2.5)}) {
    const Eigen::Vector3d here = folded.truth.inverse() * corner;
    EXPECT_LT((part->move * here - corner).norm(), 0.02);
  }
}

// Those who look at the panel from both rooms hold on to each other: one cluster, taken for the first room's.
TEST(MisplacedPart, IsCutThroughAClusterThatLooksAtTheLookAlike) {
  Folded folded = MakeFolded(12);
  folded.clusters = {{0, 1, 2, 10, 11, 12}, {3, 4, 5, 6, 7, 8, 9}, {13, 14, 15}};
  folded.pieces = {{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}, {13, 14, 15}};
  for (SignedLink& link : folded.evidence.links) {
    if (link.weight == 200) link.weight = 900;
  }
  const auto part = Find(folded);
  ASSERT_TRUE(part);
  EXPECT_THAT(part->images, ElementsAre(10, 11, 12, 13, 14, 15));
}

TEST(MisplacedPart, IsTheSameForAnyNumberOfThreads) {
  const Folded folded = MakeFolded(12);
  const auto one = Find(folded, 1), four = Find(folded, 4);
  ASSERT_TRUE(one && four);
  EXPECT_EQ(one->images, four->images);
  EXPECT_EQ(one->move.matrix(), four->move.matrix());
}

TEST(MisplacedPart, IsNoneWhereNothingIsShared) {
  EXPECT_FALSE(FindMisplacedPart({}, {}, {}, {}, 1));
  EXPECT_FALSE(FindMisplacedPart({{0, 1}, {2}}, {{0, 1}, {2}},
                                 {.links = {{0, 1, 5}}, .turns = {}, .points = {}}, {}, 1));
}

}  // namespace
}  // namespace cairn::reconstruct
