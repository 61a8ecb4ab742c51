#include "core/camera/panorama.h"

#include <algorithm>
#include <cmath>
#include <string>

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

TEST(Panorama, TheErrorSaysHowWideViewsMustBe) {
  PanoramaOptions options;
  options.num_panorama_views = 5;
  options.panorama_view_deg = 71;
  EXPECT_NE(CheckPanoramaOptions(options).error().message.find(
                "5 views of it leave gaps in a panorama; expected at least 72"),
            std::string::npos);
  options.panorama_view_deg = 72;
  EXPECT_TRUE(CheckPanoramaOptions(options).ok());
}

TEST(Panorama, AViewHasAPixelAtLeast) {
  EXPECT_EQ(PanoramaViewCamera(MakePanorama(2), PanoramaOptions()).width, 1);
  const Camera camera = PanoramaViewCamera(MakePanorama(512), PanoramaOptions());
  EXPECT_EQ(camera.height, 162);
  EXPECT_NEAR(camera.FocalX(), 512 / (2 * M_PI), 1e-12);
  EXPECT_EQ(camera.FocalX(), camera.FocalY());
  EXPECT_EQ(camera.PrincipalPoint(), Eigen::Vector2d(81, 81));
}

TEST(Panorama, GreyValuesAreLinearBetweenPixelsOverTheSeamAndToThePoles) {
  // Of 8 x 4 pixels, each 45 degrees wide; a view of one pixel looks at the place where its middle ray ends.
  cv::Mat image(4, 8, CV_8UC1, cv::Scalar(0));
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) image.at<uchar>(y, x) = static_cast<uchar>(10 + 10 * x + 40 * y);
  }
  // Looks down by a number of pixels below the equator, at the middle of the image or, of two views, at the
  // seam.
  const auto at = [&](double below, int view) {
    Camera camera;
    camera.model = CameraModel::kSimplePinhole;
    camera.width = camera.height = 1;
    camera.params = {1, 0.5, 0.5 - std::tan(below * M_PI / 4)};
    return static_cast<int>(CutPanoramaView(image, camera, view, 2).at<uchar>(0, 0));
  };
  EXPECT_NEAR(at(0.5, 0), (40 + 50) / 2 + 80, 1);   // in row 2, between columns 3 and 4
  EXPECT_NEAR(at(0, 0), (40 + 50) / 2 + 60, 1);     // between rows 1 and 2
  EXPECT_NEAR(at(0.25, 0), (40 + 50) / 2 + 70, 1);  // nearer to row 2
  EXPECT_NEAR(at(0.5, 1), (10 + 80) / 2 + 80, 1);   // in row 2, between the last column and the first
  EXPECT_NEAR(at(1.9, 0), (40 + 50) / 2 + 120, 1);  // below the middle of the last row
  EXPECT_NEAR(at(-1.9, 0), (40 + 50) / 2, 1);       // above that of the first
}

TEST(Panorama, ThreeTo36ViewsOf20To120DegreesAreAllowed) {
  const auto is_allowed = [](int num_views, double view_deg) {
    PanoramaOptions options{.num_panorama_views = num_views, .panorama_view_deg = view_deg};
    return CheckOptions(DescribeOptions(&options)).ok();
  };
  EXPECT_TRUE(is_allowed(3, 120));
  EXPECT_TRUE(is_allowed(36, 20));
  EXPECT_FALSE(is_allowed(2, 90));
  EXPECT_FALSE(is_allowed(37, 90));
  EXPECT_FALSE(is_allowed(6, 19.9));
  EXPECT_FALSE(is_allowed(6, 120.1));
}

}  // namespace
}  // namespace cairn
