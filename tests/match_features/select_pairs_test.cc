#include "stages/match_features/pairs/select_pairs.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/base/pooled.h"
#include "core/base/text.h"

namespace cairn::match_features {
namespace {

using testing::ElementsAre;
using testing::Pair;

// A camera at (x, 0, 0) that looks along z, turned by `yaw_deg` about y.
PosedCamera At(double x, double yaw_deg) {
  PosedCamera image;
  image.camera.model = CameraModel::kSimplePinhole;
  image.camera.width = 640;
  image.camera.height = 480;
  image.camera.params = {500, 320, 240};
  image.cam_from_world.rotation = Eigen::AngleAxisd(RadFromDeg(yaw_deg), Eigen::Vector3d::UnitY());
  image.cam_from_world.translation = image.cam_from_world.rotation * Eigen::Vector3d(-x, 0, 0);
  return image;
}

TEST(SelectPairs, ExhaustiveAndSequencePairsAreAscending) {
  EXPECT_THAT(ExhaustivePairs(3), ElementsAre(Pair(0, 1), Pair(0, 2), Pair(1, 2)));
  EXPECT_THAT(SequencePairs({0, 1, 2, 3}, 1), ElementsAre(Pair(0, 1), Pair(1, 2), Pair(2, 3)));
  EXPECT_TRUE(ExhaustivePairs(1).empty());
  EXPECT_TRUE(ExhaustivePairs(0).empty());
}

TEST(SelectPairs, SequenceFollowsNumbersInNames) {
  EXPECT_THAT(SequencePairs(NaturalOrder({"1.jpg", "10.jpg", "2.jpg"}), 1),
              ElementsAre(Pair(0, 2), Pair(1, 2)));
}

OverlapRanking Rank(const std::vector<PosedCamera>& images) {
  NoProgress progress;
  return *RankOverlaps(images, {}, 2, progress);
}

TEST(SelectPairs, FrustaThatShareSceneAreMatchedOthersAreNot) {
  //  0 and 1 side by side, both ahead; 2 looks backwards; 3 is far away
  const std::vector<PosedCamera> images = {At(0, 0), At(0.3, 0), At(0, 180), At(50, 0)};
  EXPECT_THAT(FrustumPairs(Rank(images)), ElementsAre(Pair(0, 1)));
}

TEST(SelectPairs, SeedsAreThePartnersOfLargestOverlap) {
  //  0 . 1 2 . . 3    all look ahead, 0.2 m a mark: the nearest is the one of largest overlap
  const std::vector<PosedCamera> images = {At(0, 0), At(0.4, 0), At(0.6, 0), At(1.2, 0)};
  const OverlapRanking ranking = Rank(images);
  ASSERT_EQ(ranking[1].size(), 3u);
  EXPECT_EQ(ranking[1][0].idx, 2);
  EXPECT_GT(ranking[1][0].overlap, ranking[1][1].overlap);
  EXPECT_THAT(FrustumSeeds(ranking, 1, 0), ElementsAre(Pair(0, 1), Pair(1, 2), Pair(2, 3)));
  EXPECT_TRUE(FrustumSeeds(ranking, 0, 0).empty());
}

TEST(SelectPairs, ScoutsStandAtEvenDistancesInTheOtherRanks) {
  //  partners of image 0 by rank    1 2 | 3 4 5 6 7 8
  //  two seeds, two scouts          # # |   #     #       the middles of both halves of the rest
  //  two seeds, one scout           # # |       #
  OverlapRanking ranking(9);
  for (int i = 1; i < 9; ++i) ranking[0].push_back({i, 1.0F / static_cast<float>(i)});
  EXPECT_THAT(FrustumSeeds(ranking, 2, 2), ElementsAre(Pair(0, 1), Pair(0, 2), Pair(0, 4), Pair(0, 7)));
  EXPECT_THAT(FrustumSeeds(ranking, 2, 1), ElementsAre(Pair(0, 1), Pair(0, 2), Pair(0, 6)));
  EXPECT_EQ(FrustumSeeds(ranking, 2, 100).size(), 8u);
  EXPECT_EQ(FrustumSeeds(ranking, 100, 2).size(), 8u);
}

TEST(SelectPairs, OverlapOfAnImageWithItselfIsFull) {
  EXPECT_DOUBLE_EQ(FrustumOverlap(At(0, 0), At(0, 0), {}), 1.0);
  EXPECT_DOUBLE_EQ(FrustumOverlap(At(0, 0), At(0, 180), {}), 0.0);
}

// Word by word what FrustumOverlapOptions says, on a pinhole camera.
double OverlapByDefinition(const PosedCamera& image1, const PosedCamera& image2,
                           const FrustumOverlapOptions& options) {
  const PooledVector<double>& params = image2.camera.params;
  const Eigen::Vector3d center1 = image1.cam_from_world.Center(), center2 = image2.cam_from_world.Center();
  int num_seen = 0;
  for (int i = 0; i < 150; ++i) {  // 6 columns, 5 rows, 5 depths
    const double x = (i % 6 + 0.5) / 6 * 640, y = (i / 6 % 5 + 0.5) / 5 * 480;
    const double depth = options.near_m * std::pow(options.far_m / options.near_m, i / 30 / 4.0);
    const Eigen::Vector3d sample =
        image1.cam_from_world.Inverse() *
        Eigen::Vector3d((x - params[1]) / params[0] * depth, (y - params[2]) / params[0] * depth, depth);
    const Eigen::Vector3d in_image2 = image2.cam_from_world * sample;
    const Eigen::Vector2d pixel = params[0] * in_image2.hnormalized() + Eigen::Vector2d(params[1], params[2]);
    const Eigen::Vector3d ray1 = sample - center1, ray2 = sample - center2;
    const double angle_deg = DegFromRad(std::acos(std::min(1.0, ray1.normalized().dot(ray2.normalized()))));
    const double ratio = ray1.norm() / ray2.norm();
    num_seen += in_image2.z() > 0 && pixel.x() >= 0 && pixel.x() <= 640 && pixel.y() >= 0 &&
                pixel.y() <= 480 && angle_deg <= options.max_view_angle_deg &&
                ratio <= options.max_scale_ratio && 1 / ratio <= options.max_scale_ratio;
  }
  return num_seen / 150.0;
}

TEST(SelectPairs, OverlapIsThePartOfTheSamplesThatTheOtherCameraSeesWellEnough) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const double max_view_angle_deg : {20.0, 60.0, 90.0, 150.0}) {
    for (const double max_scale_ratio : {1.3, 3.5}) {
      const FrustumOverlapOptions options = {.max_view_angle_deg = max_view_angle_deg,
                                             .max_scale_ratio = max_scale_ratio};
      int num_overlapping = 0;
      for (int i = 0; i < 300; ++i) {
        PosedCamera image = At(0, 0);
        image.cam_from_world.rotation = Eigen::AngleAxisd(
            2 * uniform(random), Eigen::Vector3d(uniform(random), 1, uniform(random)).normalized());
        image.cam_from_world.translation = std::pow(10, 1.5 * uniform(random)) *
                                           Eigen::Vector3d(uniform(random), uniform(random), uniform(random));
        const double overlap = FrustumOverlap(At(0, 0), image, options);
        EXPECT_DOUBLE_EQ(overlap, OverlapByDefinition(At(0, 0), image, options));
        num_overlapping += overlap > 0;
      }
      EXPECT_GT(num_overlapping, 10);
    }
  }
}

TEST(SelectPairs, OpposedViewsOfOneWallAreNotMatched) {
  // Facing each other 4 m apart: the same scene lies in both frusta, seen from opposite sides.
  PosedCamera opposite = At(0, 180);
  opposite.cam_from_world.translation = opposite.cam_from_world.rotation * Eigen::Vector3d(0, 0, -4);
  EXPECT_LT(FrustumOverlap(At(0, 0), opposite, {}), 0.05);
}

}  // namespace
}  // namespace cairn::match_features
