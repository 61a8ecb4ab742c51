#include "stages/match_features/pairs/frustum_overlap.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <numeric>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/base/pooled.h"

namespace cairn::match_features {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

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

using Ranking = std::vector<std::vector<OverlapPartner>>;  // of each image

Ranking Rank(const std::vector<PosedCamera>& images, const FrustumOverlapOptions& options = {}) {
  NoProgress progress;
  Ranking ranking(images.size());
  std::vector<int> idxs(images.size());
  std::iota(idxs.begin(), idxs.end(), 0);
  EXPECT_TRUE(
      RankOverlaps(images, idxs, options, 2, progress,
                   [&](int idx, const std::vector<OverlapPartner>& partners) { ranking[idx] = partners; })
          .ok());
  return ranking;
}

std::vector<int> IdxsOf(const std::vector<OverlapPartner>& partners) {
  std::vector<int> idxs;
  for (const OverlapPartner& partner : partners) idxs.push_back(partner.idx);
  return idxs;
}

TEST(FrustumOverlap, FrustaThatShareSceneAreMatchedOthersAreNot) {
  //  0 and 1 side by side, both ahead; 2 looks backwards; 3 is far away
  const Ranking ranking = Rank({At(0, 0), At(0.3, 0), At(0, 180), At(50, 0)});
  EXPECT_THAT(IdxsOf(ranking[0]), ElementsAre(1));
  EXPECT_THAT(IdxsOf(ranking[1]), ElementsAre(0));
  EXPECT_THAT(IdxsOf(ranking[2]), IsEmpty());
  EXPECT_THAT(IdxsOf(ranking[3]), IsEmpty());
}

TEST(FrustumOverlap, PartnersAreInTheOrderOfTheMeanOfBothOverlaps) {
  //  0 . 1 2 . . 3    all look ahead, 0.2 m a mark: the nearest is the one of largest overlap
  const std::vector<PosedCamera> images = {At(0, 0), At(0.4, 0), At(0.6, 0), At(1.2, 0)};
  const Ranking ranking = Rank(images);
  EXPECT_THAT(IdxsOf(ranking[0]), ElementsAre(1, 2, 3));
  EXPECT_THAT(IdxsOf(ranking[1]), ElementsAre(2, 0, 3));
  for (int i = 0; i < 4; ++i) {
    for (const OverlapPartner& partner : ranking[i]) {
      const PosedCamera &a = images[i], &b = images[partner.idx];
      EXPECT_FLOAT_EQ(partner.overlap,
                      static_cast<float>(0.5 * (FrustumOverlap(a, b, {}) + FrustumOverlap(b, a, {}))));
    }
  }
}

TEST(FrustumOverlap, OfEqualOverlapsTheSmallerIndexIsFirst) {
  EXPECT_THAT(IdxsOf(Rank({At(0, 0), At(1, 0), At(0, 0), At(0, 0)})[1]), ElementsAre(0, 2, 3));
}

TEST(FrustumOverlap, OneDirectionIsEnough) {
  //  1 stands before 0 and looks at a part of what that sees
  PosedCamera before = At(0, 0);
  before.cam_from_world.translation = Eigen::Vector3d(0, 0, -3);
  const double back = FrustumOverlap(At(0, 0), before, {}), there = FrustumOverlap(before, At(0, 0), {});
  ASSERT_GT(there, 2 * back);
  FrustumOverlapOptions options = {.min_overlap_ratio = there};
  EXPECT_THAT(IdxsOf(Rank({At(0, 0), before}, options)[0]), ElementsAre(1));
  EXPECT_THAT(IdxsOf(Rank({before, At(0, 0)}, options)[0]), ElementsAre(1));
  options.min_overlap_ratio = there + 1e-9;
  EXPECT_THAT(IdxsOf(Rank({At(0, 0), before}, options)[0]), IsEmpty());
}

TEST(FrustumOverlap, WithoutASmallestOverlapAllAreEachOthersPartners) {
  const Ranking ranking = Rank({At(0, 0), At(0.3, 0), At(0, 180), At(500, 0)}, {.min_overlap_ratio = 0});
  EXPECT_THAT(IdxsOf(ranking[0]), ElementsAre(1, 2, 3));
  EXPECT_THAT(IdxsOf(ranking[3]), ElementsAre(0, 1, 2));
}

TEST(FrustumOverlap, RankingLooksAtAllThatAreWithinReach) {
  // As by pairs, of cameras of two kinds in a space in which most are out of each other's reach.
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<PosedCamera> images;
  for (int i = 0; i < 150; ++i) {
    PosedCamera image = At(0, 0);
    if (i % 3 == 0) {
      image.camera.model = CameraModel::kOpenCvFisheye;
      image.camera.params = {150, 150, 310, 250, 0.02, -0.01, 0.002, 0};
    }
    const Eigen::Vector3d axis(uniform(random), uniform(random), uniform(random));
    image.cam_from_world.rotation = Eigen::AngleAxisd(3 * uniform(random), axis.normalized());
    image.cam_from_world.translation =
        -(image.cam_from_world.rotation *
          Eigen::Vector3d(40 * uniform(random), 3 * uniform(random), uniform(random)));
    images.push_back(image);
  }
  const FrustumOverlapOptions options;
  const Ranking ranking = Rank(images, options);
  int num_partners = 0, num_apart = 0;
  for (int i = 0; i < 150; ++i) {
    std::vector<int> expected;
    for (int j = 0; j < 150; ++j) {
      num_apart += (images[i].cam_from_world.Center() - images[j].cam_from_world.Center()).norm() > 25;
      if (i != j && std::max(FrustumOverlap(images[i], images[j], options),
                             FrustumOverlap(images[j], images[i], options)) >= options.min_overlap_ratio)
        expected.push_back(j);
    }
    EXPECT_THAT(IdxsOf(ranking[i]), testing::UnorderedElementsAreArray(expected)) << i;
    num_partners += static_cast<int>(expected.size());
  }
  EXPECT_GT(num_partners, 500);
  EXPECT_GT(num_apart, 5000);
}

TEST(FrustumOverlap, OverlapOfAnImageWithItselfIsFull) {
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

TEST(FrustumOverlap, OverlapIsThePartOfTheSamplesThatTheOtherCameraSeesWellEnough) {
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

// The same two cameras somewhere else in the world.
PosedCamera Moved(const PosedCamera& image, const Pose& new_from_old) {
  return {image.camera, image.cam_from_world * new_from_old.Inverse()};
}

std::vector<Pose> SomePlaces() {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Pose> places;
  for (int i = 0; i < 50; ++i) {
    Pose place;
    place.rotation = Eigen::AngleAxisd(3 * uniform(random),
                                       Eigen::Vector3d(uniform(random), 1, uniform(random)).normalized());
    place.translation = 30 * Eigen::Vector3d(uniform(random), uniform(random), uniform(random));
    places.push_back(place);
  }
  return places;
}

TEST(FrustumOverlap, SamplesOnTheBorderOfTheImageAreSeenWhereverItStands) {
  //  Of depths 1, 2, 4, 8, 16 m the first column is seen by a camera to the right, moved by half a column's
  //  width at 1 m, on its image's left border; and by one to the left, which sees the last one, on its right
  //  border.
  const FrustumOverlapOptions options = {.near_m = 1, .far_m = 16};
  const double move_m = 640.0 / 6 / 2 / 500;
  for (const Pose& place : SomePlaces()) {
    for (const double side : {-1.0, 1.0}) {
      const PosedCamera image = Moved(At(0, 0), place);
      EXPECT_EQ(FrustumOverlap(image, Moved(At(side * move_m, 0), place), options), 1.0);
      EXPECT_EQ(FrustumOverlap(image, Moved(At(side * (move_m + 1e-4), 0), place), options), 1 - 5 / 150.0);
      PosedCamera above = At(0, 0);
      above.cam_from_world.translation.y() = side * 480.0 / 5 / 2 / 500;
      EXPECT_EQ(FrustumOverlap(image, Moved(above, place), options), 1.0);
      above.cam_from_world.translation.y() *= 1.001;
      EXPECT_EQ(FrustumOverlap(image, Moved(above, place), options), 1 - 6 / 150.0);
    }
  }
}

TEST(FrustumOverlap, SamplesAtTheLargestRatioAndAngleAreSeenWhereverTheCamerasStand) {
  //  A camera stands farther back on a sample's ray, so that its distance is the largest allowed, of the
  //  samples before it larger than that; no other sample is on a ray that both share.
  const FrustumOverlapOptions options = {.near_m = 1, .far_m = 16, .max_view_angle_deg = 0};
  const Eigen::Vector3d sample =
      4 * Eigen::Vector3d((3.5 / 6 * 640 - 320) / 500, (1.5 / 5 * 480 - 240) / 500, 1);
  for (const Pose& place : SomePlaces()) {
    const PosedCamera image = Moved(At(0, 0), place);
    PosedCamera behind = At(0, 0);
    behind.cam_from_world.translation = (options.max_scale_ratio - 1) * sample;
    EXPECT_EQ(FrustumOverlap(image, Moved(behind, place), options), 3 / 150.0);
    behind.cam_from_world.translation *= 1.001;
    EXPECT_EQ(FrustumOverlap(image, Moved(behind, place), options), 2 / 150.0);
  }
}

TEST(FrustumOverlap, OpposedViewsOfOneWallAreNotMatched) {
  // Facing each other 4 m apart: the same scene lies in both frusta, seen from opposite sides.
  PosedCamera opposite = At(0, 180);
  opposite.cam_from_world.translation = opposite.cam_from_world.rotation * Eigen::Vector3d(0, 0, -4);
  EXPECT_LT(FrustumOverlap(At(0, 0), opposite, {}), 0.05);
}

}  // namespace
}  // namespace cairn::match_features
