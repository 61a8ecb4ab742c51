#include "core/camera/panorama.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace cairn {
namespace {

Camera MakePanorama(int width) {
  Camera camera;
  camera.camera_id = 7;
  camera.model = CameraModel::kEquirectangular;
  camera.width = width;
  camera.height = width / 2;
  return camera;
}

TEST(Panorama, ViewNamesRoundTrip) {
  EXPECT_EQ(PanoramaViewName("a/1.jpg", 2, 6), "a/1.jpg#2of6");
  const auto view = ParsePanoramaViewName("a b#1.jpg#11of12");
  ASSERT_TRUE(view);
  EXPECT_EQ(view->panorama_name, "a b#1.jpg");
  EXPECT_EQ(view->view, 11);
  EXPECT_EQ(view->num_views, 12);
  for (const char* name : {"a.jpg", "a#b.jpg", "a.jpg#6of6", "a.jpg#-1of6", "a.jpg#1of", "a.jpg#1ofsix"}) {
    EXPECT_FALSE(ParsePanoramaViewName(name)) << name;
  }
}

TEST(Panorama, ViewsStandWhereThePanoramaStandsAndTurnToItsRight) {
  Pose panorama;
  panorama.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()));
  panorama.translation = {1, 2, 3};
  const std::map<std::string, Pose> poses = {{"p.jpg", panorama}};
  EXPECT_FALSE(FindPose(poses, "q.jpg#0of4"));
  EXPECT_TRUE(FindPose(poses, "p.jpg"));
  const auto ahead = FindPose(poses, "p.jpg#0of4"), right = FindPose(poses, "p.jpg#1of4");
  ASSERT_TRUE(ahead && right);
  EXPECT_NEAR((right->Center() - panorama.Center()).norm(), 0, 1e-12);
  EXPECT_NEAR((ahead->ViewingDirection() - panorama.ViewingDirection()).norm(), 0, 1e-12);
  const Eigen::Vector3d panorama_right = panorama.rotation.conjugate() * Eigen::Vector3d::UnitX();
  EXPECT_NEAR((right->ViewingDirection() - panorama_right).norm(), 0, 1e-12);
}

TEST(Panorama, ABlobIsWhereItsBearingSaysInEveryViewThatShowsIt) {
  const Camera panorama = MakePanorama(512);
  const PanoramaOptions options;
  const Camera camera = PanoramaViewCamera(panorama, options);
  EXPECT_EQ(camera.camera_id, 7u);
  EXPECT_EQ(camera.width, 162);  // 2 * 512 / (2 pi) * tan(45 degrees), to the nearest even number
  for (const double longitude_deg : {-179.9, -100.0, 0.0, 31.0}) {
    for (const double latitude_deg : {-30.0, 22.0}) {
      const double longitude = RadFromDeg(longitude_deg), latitude = RadFromDeg(latitude_deg);
      const Eigen::Vector3d bearing(std::cos(latitude) * std::sin(longitude), std::sin(latitude),
                                    std::cos(latitude) * std::cos(longitude));
      // A smooth blob on the sphere, painted by angle: no seam, no warp.
      cv::Mat image(panorama.height, panorama.width, CV_8UC1);
      for (int y = 0; y < image.rows; ++y) {
        for (int x = 0; x < image.cols; ++x) {
          const double angle =
              std::acos(std::clamp(bearing.dot(*BearingFromImage(panorama, {x + 0.5, y + 0.5})), -1.0, 1.0));
          image.at<uchar>(y, x) = cv::saturate_cast<uchar>(250 * std::exp(-std::pow(angle / 0.05, 2)));
        }
      }
      int num_seen = 0;
      for (int view = 0; view < options.num_panorama_views; ++view) {
        const Pose view_from_panorama = ViewFromPanorama(view, options.num_panorama_views);
        const auto expected = ImageFromCamera(camera, view_from_panorama * bearing);
        if (!expected || (*expected - camera.PrincipalPoint()).cwiseAbs().maxCoeff() > 68) continue;
        ++num_seen;
        const cv::Mat cut = CutPanoramaView(image, camera, view, options.num_panorama_views);
        // The bearings of the pixels around the blob, weighted with their grey.
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (int y = 0; y < cut.rows; ++y) {
          for (int x = 0; x < cut.cols; ++x) {
            const Eigen::Vector3d ray = *BearingFromImage(camera, {x + 0.5, y + 0.5});
            sum += std::pow(ray.z(), 3) * cut.at<uchar>(y, x) * ray;  // a pixel's solid angle goes with cos^3
          }
        }
        const auto found = ImageFromCamera(camera, sum);
        ASSERT_TRUE(found);
        EXPECT_NEAR((*found - *expected).norm(), 0, 0.05)
            << longitude_deg << " " << latitude_deg << " " << view;
      }
      EXPECT_GE(num_seen, 1);
    }
  }
}

TEST(Panorama, EveryDirectionIsKeptByExactlyOneView) {
  const PanoramaOptions options;
  const Camera camera = PanoramaViewCamera(MakePanorama(2048), options);
  for (double longitude = -3.1; longitude < 3.1; longitude += 0.013) {
    int num_kept = 0;
    for (int view = 0; view < options.num_panorama_views; ++view) {
      const auto pixel =
          ImageFromCamera(camera, ViewFromPanorama(view, options.num_panorama_views) *
                                      Eigen::Vector3d(std::sin(longitude), 0.2, std::cos(longitude)));
      if (!pixel) continue;
      Features features;
      features.keypoints = {{static_cast<float>(pixel->x()), static_cast<float>(pixel->y()), 1, 0}};
      features.descriptors = DescriptorMatrix::Zero(1, kSiftDescriptorDim);
      KeepSectorOfView(camera, options.num_panorama_views, &features);
      ASSERT_EQ(static_cast<size_t>(features.descriptors.rows()), features.keypoints.size());
      num_kept += static_cast<int>(features.keypoints.size());
    }
    EXPECT_EQ(num_kept, 1) << longitude;
  }
}

TEST(Panorama, ViewsThatLeaveGapsAreRefused) {
  PanoramaOptions options;
  options.num_panorama_views = 4;
  options.panorama_view_deg = 80;
  EXPECT_FALSE(CheckPanoramaOptions(options).ok());
  options.panorama_view_deg = 90;
  EXPECT_TRUE(CheckPanoramaOptions(options).ok());
}

}  // namespace
}  // namespace cairn
