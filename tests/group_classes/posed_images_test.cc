#include "stages/group_classes/tracks/posed_images.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::group_classes {
namespace {

using testing::ElementsAre;

// Cameras in a row, 0.3 m apart, that look at a point 2 m ahead; the image folds 70.3 px off its middle.  The
// last one's keypoint lies beyond the fold.
TEST(TriangulateTracks, AKeypointThatItsCameraHasNoRayForIsNoPartOfAPoint) {
  Camera camera;
  camera.model = CameraModel::kSimpleRadial;
  camera.width = camera.height = 200;
  camera.params = {100, 0, 0, -0.3};
  const Eigen::Vector3d point(0.5, 0.1, 2);
  MatchedFeatures matched;
  PosedImages posed;
  posed.cameras = {camera};
  Track track;
  for (int i = 0; i < 4; ++i) {
    Pose pose;
    pose.translation = Eigen::Vector3d(-0.3 * i, 0, 0);
    posed.feature_idx.push_back(i);
    posed.camera_idx.push_back(0);
    posed.stated.push_back(pose);
    const Eigen::Vector2d pixel = i == 3 ? Eigen::Vector2d(71, 0) : *ImageFromCamera(camera, pose * point);
    matched.features.push_back(
        {.keypoints = {{static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 2, 0}},
         .descriptors = {}});
    track.push_back({i, 0});
  }
  posed.poses = posed.stated;
  EXPECT_TRUE(RayOf(matched, posed, track[2]).has_value());
  EXPECT_FALSE(RayOf(matched, posed, track[3]).has_value());
  const std::vector<Triangulation> points = TriangulateTracks(matched, {track}, posed, {}, 1);
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0].outcome, TriangulateOutcome::kOk);
  EXPECT_THAT(points[0].inliers, ElementsAre(0, 1, 2));
  EXPECT_LT((points[0].position - point).norm(), 1e-4);
}

}  // namespace
}  // namespace cairn::group_classes
