#include "stages/reconstruct/registration/place_piece.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/camera/camera.h"

namespace cairn::reconstruct {
namespace {

// Cameras along a line that look at points, in the world and, as a piece, in a frame of their own.
struct PieceScene {
  Similarity world_from_piece{
      0.5, Eigen::Quaterniond(Eigen::AngleAxisd(2, Eigen::Vector3d(1, -1, 2).normalized())), {3, -5, 1}};
  Piece piece;
  std::vector<ImageFix> fixes;
  std::vector<Pose> cams_from_world;

  explicit PieceScene(int num_images, double noise_px = 0) {
    Camera camera;
    camera.model = CameraModel::kSimplePinhole;
    camera.width = 640;
    camera.height = 480;
    camera.params = {500, 320, 240};
    Random random(2);
    std::vector<Eigen::Vector3d> points;  // of the piece
    for (int k = 0; k < 60; ++k)
      points.emplace_back(random.Uniform(-3, 6), random.Uniform(-2, 2), random.Uniform(4, 9));
    for (int i = 0; i < num_images; ++i) {
      piece.images.push_back(i);
      const Pose pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.03 * i, Eigen::Vector3d::UnitY())),
                      Eigen::Vector3d(-0.5 * i, 0.1 * (i % 2), 0)};
      piece.cam_from_piece.push_back(pose);
      ImageFix fix{.image = i, .matches = {}, .poses = {{TransformPose(world_from_piece, pose), 0}}};
      cams_from_world.push_back(fix.poses[0].cam_from_world);
      for (const Eigen::Vector3d& point : points) {
        const auto pixel = ImageFromCamera(camera, pose * point);
        if (!pixel) continue;
        const Eigen::Vector2d seen =
            *pixel + Eigen::Vector2d(random.Normal(0, noise_px), random.Normal(0, noise_px));
        fix.matches.push_back({*MakePixelRay(camera, seen), world_from_piece * point});
        ++fix.poses[0].num_inliers;
      }
      fixes.push_back(fix);
    }
  }

  std::optional<PiecePlace> Place() const { return PlacePiece(piece, fixes, {}); }
};

TEST(PlacePiece, TheSimilarityOfExactMatchesIsExact) {
  const PieceScene scene(6);
  const auto place = scene.Place();
  ASSERT_TRUE(place);
  EXPECT_NEAR(place->world_from_piece.scale, 0.5, 1e-9);
  EXPECT_LT(place->world_from_piece.rotation.angularDistance(scene.world_from_piece.rotation), 1e-9);
  EXPECT_LT((place->world_from_piece.translation - scene.world_from_piece.translation).norm(), 1e-8);
  EXPECT_EQ(place->num_supported, 6);
  EXPECT_EQ(place->num_matches_elsewhere, 0);
  for (size_t i = 0; i < 6; ++i)
    EXPECT_EQ(place->num_inliers[i], static_cast<int>(scene.fixes[i].matches.size()));
}

// Fixes that are a little off are not the last word: all matches are.
TEST(PlacePiece, FixesThatAreOffAreRefined) {
  PieceScene scene(6, 0.5);
  for (ImageFix& fix : scene.fixes)
    fix.poses[0].cam_from_world.translation.x() += fix.image % 2 == 0 ? 0.01 : -0.01;
  const auto place = scene.Place();
  ASSERT_TRUE(place);
  EXPECT_EQ(place->num_supported, 6);
  for (size_t i = 0; i < 6; ++i) {
    const Pose found = TransformPose(place->world_from_piece, scene.piece.cam_from_piece[i]);
    EXPECT_LT(CenterErrorM(found, scene.cams_from_world[i]), 0.002);
    EXPECT_LT(RotationErrorDeg(found, scene.cams_from_world[i]), 0.05);
  }
}

TEST(PlacePiece, WrongFixesAndWrongMatchesAreOutvoted) {
  PieceScene scene(8);
  Random random(4);
  for (size_t i = 0; i < 3; ++i) {
    scene.fixes[i].poses[0].cam_from_world.translation += Eigen::Vector3d(2, 1, 0);
    for (PointMatch& match : scene.fixes[i].matches)
      match.position += Eigen::Vector3d(random.Uniform(1, 5), 3, 0);
  }
  const auto place = scene.Place();
  ASSERT_TRUE(place);
  EXPECT_EQ(place->num_supported, 5);
  EXPECT_NEAR(place->world_from_piece.scale, 0.5, 1e-6);
}

// What is seen here is there a second time: every second point of it.
TEST(PlacePiece, ASecondPlaceIsSaid) {
  PieceScene scene(8);
  const Eigen::Vector3d shift(20, 0, 0);
  int here = 0, there = 0;
  for (ImageFix& fix : scene.fixes) {
    Pose shifted = fix.poses[0].cam_from_world;
    shifted.translation -= shifted.rotation * shift;
    const std::vector<PointMatch> matches = fix.matches;
    for (size_t k = 0; k < matches.size(); ++k) {
      if (k % 2 == 1) fix.matches.push_back({matches[k].ray, matches[k].position + shift});
    }
    const auto num_there = static_cast<int>(fix.matches.size() - matches.size());
    fix.poses.push_back({shifted, num_there});
    here += std::min(50, static_cast<int>(matches.size()));
    there += std::min(50, num_there);
  }
  const auto place = scene.Place();
  ASSERT_TRUE(place);
  EXPECT_EQ(place->num_supported, 8);
  EXPECT_EQ(place->num_matches, here);
  EXPECT_EQ(place->num_matches_elsewhere, there);
}

// What half of the images see here, the other half sees there: two halves, not a place that is there twice.
TEST(PlacePiece, HalvesInTwoPlacesAreNoLookAlikes) {
  PieceScene scene(8);
  const Eigen::Vector3d shift(20, 0, 0);
  for (size_t i = 5; i < 8; ++i) {
    scene.fixes[i].poses[0].cam_from_world.translation -=
        scene.fixes[i].poses[0].cam_from_world.rotation * shift;
    for (PointMatch& match : scene.fixes[i].matches) match.position += shift;
  }
  const auto place = scene.Place();
  ASSERT_TRUE(place);
  EXPECT_EQ(place->num_supported, 5);
  EXPECT_EQ(place->num_matches_elsewhere, 0);
}

TEST(PlacePiece, TooFewFixesArePlacedNowhere) {
  PieceScene scene(5);
  for (size_t i = 1; i < 5; ++i) scene.fixes[i].poses[0].num_inliers = 11;
  EXPECT_FALSE(scene.Place());
  scene.fixes[3].poses[0].num_inliers = 12;
  EXPECT_TRUE(scene.Place());
}

// Images that turned on the spot say nothing of the scale.
TEST(PlacePiece, ImagesAtOnePlaceGiveNoScale) {
  PieceScene scene(3);
  for (size_t i = 0; i < 3; ++i)
    scene.piece.cam_from_piece[i].translation =
        scene.piece.cam_from_piece[i].rotation * Eigen::Vector3d(0, 0, 0);
  EXPECT_FALSE(scene.Place());
}

TEST(PlacePiece, AnImageAloneIsWhereItsFixIs) {
  const PieceScene scene(1, 0.3);
  const auto place = scene.Place();
  ASSERT_TRUE(place);
  EXPECT_EQ(place->num_supported, 1);
  const Pose found = TransformPose(place->world_from_piece, scene.piece.cam_from_piece[0]);
  EXPECT_LT(CenterErrorM(found, scene.cams_from_world[0]), 0.01);
}

}  // namespace
}  // namespace cairn::reconstruct
