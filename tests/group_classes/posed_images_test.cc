#include "stages/group_classes/tracks/posed_images.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/camera/panorama.h"

namespace cairn::group_classes {
namespace {

using testing::DoubleNear;
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

// 1 m on, turned by 0.5 rad; an image without a pose between them; then another survey from where that ended.
TEST(CollectPosedImages, WaysGoFromPoseToPoseAndBetweenSurveysATrackerStartsAnew) {
  const std::vector<std::string> names = {"a/1.jpg", "a/2.jpg", "a/3.jpg", "b/1.jpg", "b/2.jpg"};
  const std::vector<std::optional<Pose>> poses = {
      Pose(), std::nullopt,
      Pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY())), {0, 0, -1}},
      Pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY())), {0, 0, -1}},
      Pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY())), {0, 0, -1}}};
  MatchedFeatures matched;
  matched.cameras[1] = Camera();
  Capture capture;
  for (size_t i = 0; i < names.size(); ++i) {
    matched.images.push_back({static_cast<ImageId>(i + 1), names[i], 1});
    capture.images.push_back({.name = names[i], .camera_id = 1, .cam_from_world = poses[i]});
  }
  const PosedImages posed = CollectPosedImages(matched, capture);
  EXPECT_THAT(posed.feature_idx, ElementsAre(0, 2, 3, 4));
  EXPECT_THAT(posed.way_m,
              ElementsAre(0, DoubleNear(1.5, 1e-9), DoubleNear(10, 1e-9), DoubleNear(1e-4, 1e-12)));
}

// Views of a panorama are as near to each other as if they were one image, however far they are turned.
TEST(CollectPosedImages, ViewsOfAPanoramaAreNoWayApart) {
  const std::vector<std::string> names = {PanoramaViewName("p1.jpg", 0, 6), PanoramaViewName("p1.jpg", 1, 6),
                                          PanoramaViewName("p2.jpg", 0, 6)};
  MatchedFeatures matched;
  matched.cameras[1] = Camera();
  Capture capture;
  for (size_t i = 0; i < names.size(); ++i) {
    Pose pose;
    pose.translation.x() = i == 2 ? -3 : 0;
    if (i == 1) pose.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(1, Eigen::Vector3d::UnitY()));
    matched.images.push_back({static_cast<ImageId>(i + 1), names[i], 1});
    capture.images.push_back({.name = names[i], .camera_id = 1, .cam_from_world = pose});
  }
  EXPECT_THAT(CollectPosedImages(matched, capture).way_m, ElementsAre(0, 1e-4, DoubleNear(4, 1e-9)));
}

}  // namespace
}  // namespace cairn::group_classes
