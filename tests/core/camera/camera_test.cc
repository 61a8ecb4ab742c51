#include "core/camera/camera.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "core/base/random.h"
#include "core/geometry/pose.h"

namespace cairn {
namespace {

Camera MakeCamera(CameraModel model, PooledVector<double> params) {
  Camera camera;
  camera.model = model;
  camera.width = 640;
  camera.height = 480;
  camera.params = std::move(params);
  return camera;
}

std::vector<Camera> OneOfEachModel() {
  return {
      MakeCamera(CameraModel::kSimplePinhole, {500, 320, 240}),
      MakeCamera(CameraModel::kPinhole, {500, 510, 320, 240}),
      MakeCamera(CameraModel::kSimpleRadial, {500, 320, 240, -0.1}),
      MakeCamera(CameraModel::kRadial, {500, 320, 240, -0.2, 0.05}),
      MakeCamera(CameraModel::kOpenCv, {500, 510, 320, 240, -0.2, 0.05, 1e-3, -2e-3}),
      MakeCamera(CameraModel::kOpenCvFisheye, {300, 300, 320, 240, 0.02, -0.01, 1e-3, 1e-4}),
      MakeCamera(CameraModel::kFullOpenCv,
                 {500, 510, 320, 240, -0.2, 0.05, 1e-3, -2e-3, 0.01, 0.02, 0.01, 0.001}),
      MakeCamera(CameraModel::kFov, {300, 310, 320, 240, 0.9}),
      MakeCamera(CameraModel::kSimpleRadialFisheye, {300, 320, 240, 0.02}),
      MakeCamera(CameraModel::kRadialFisheye, {300, 320, 240, 0.02, -0.005}),
      MakeCamera(CameraModel::kThinPrismFisheye,
                 {300, 310, 320, 240, 0.02, -0.005, 1e-3, -2e-3, 1e-3, -1e-4, 5e-4, -5e-4}),
      MakeCamera(CameraModel::kEquirectangular, {}),
  };
}

// Models that see beyond 90 degrees off the axis.
bool IsWide(const Camera& camera) {
  return camera.model == CameraModel::kOpenCvFisheye || camera.model >= CameraModel::kFov;
}

// Distortion that real lenses have at its worst, over the whole image.
std::vector<Camera> StrongOnes() {
  return {
      MakeCamera(CameraModel::kSimpleRadial, {400, 300, 250, 0.8}),  // pincushion
      MakeCamera(CameraModel::kSimpleRadial, {400, 300, 250, -0.12}),
      MakeCamera(CameraModel::kRadial, {300, 310, 240, -0.3, 0.1}),  // action camera, barrel
      MakeCamera(CameraModel::kOpenCv, {300, 290, 310, 240, -0.28, 0.08, 0.01, -0.02}),
      MakeCamera(CameraModel::kFullOpenCv,
                 {250, 250, 320, 240, 0.7, 0.3, 1e-3, -1e-3, 0.02, 1.1, 0.5, 0.1}),  // rational, wide angle
      MakeCamera(CameraModel::kFov, {200, 200, 320, 240, 1.4}),
      MakeCamera(CameraModel::kOpenCvFisheye, {190, 190, 322, 238, -0.03, 0.01, -0.005, 0.0006}),
      MakeCamera(CameraModel::kSimpleRadialFisheye, {190, 322, 238, -0.03}),
      MakeCamera(CameraModel::kRadialFisheye, {190, 322, 238, 0.1, -0.01}),
      MakeCamera(CameraModel::kThinPrismFisheye,
                 {190, 195, 322, 238, -0.03, 0.01, 0.01, -0.01, -0.001, 1e-4, 0.01, -0.01}),
  };
}

TEST(Camera, ProjectionInvertsUnprojectionOverTheWholeImageForEveryModel) {
  std::vector<Camera> cameras = OneOfEachModel();
  for (const Camera& camera : StrongOnes()) cameras.push_back(camera);
  for (const Camera& camera : cameras) {
    ASSERT_TRUE(CheckCamera(camera).ok());
    for (double y = 0.5; y < camera.height; y += 9.25) {
      for (double x = 0.5; x < camera.width; x += 9.25) {
        const auto bearing = BearingFromImage(camera, {x, y});
        ASSERT_TRUE(bearing) << CameraModelName(camera.model) << " " << x << " " << y;
        EXPECT_NEAR(bearing->norm(), 1, 1e-14);
        const auto pixel = ImageFromCamera(camera, 3 * *bearing);
        ASSERT_TRUE(pixel) << CameraModelName(camera.model) << " " << x << " " << y;
        EXPECT_NEAR((*pixel - Eigen::Vector2d(x, y)).norm(), 0, 1e-10 * camera.MeanFocal())
            << CameraModelName(camera.model) << " " << x << " " << y;
      }
    }
  }
}

TEST(Camera, UnprojectionInvertsProjectionForEveryModel) {
  for (const Camera& camera : OneOfEachModel()) {
    Random random(1);
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d point(random.Uniform(-0.6, 0.6), random.Uniform(-0.45, 0.45), 1);
      const auto pixel = ImageFromCamera(camera, 3 * point);
      ASSERT_TRUE(pixel);
      const auto bearing = BearingFromImage(camera, *pixel);
      ASSERT_TRUE(bearing) << CameraModelName(camera.model);
      EXPECT_NEAR((*bearing - point.normalized()).norm(), 0, 1e-10) << CameraModelName(camera.model);
      const auto ray = CameraFromImage(camera, *pixel);
      ASSERT_TRUE(ray) << CameraModelName(camera.model);
      EXPECT_NEAR((*ray - point.head<2>()).norm(), 0, 1e-10) << CameraModelName(camera.model);
    }
  }
}

TEST(Camera, WideModelsSeeBeyondNinetyDegrees) {
  const double angle = RadFromDeg(100);
  for (const Camera& camera : OneOfEachModel()) {
    for (int i = 0; i < 8; ++i) {
      const double around = i * M_PI / 4 + 0.1;
      const Eigen::Vector3d bearing(std::sin(angle) * std::cos(around), std::sin(angle) * std::sin(around),
                                    std::cos(angle));
      const auto pixel = ImageFromCamera(camera, 2 * bearing);
      ASSERT_EQ(pixel.has_value(), IsWide(camera)) << CameraModelName(camera.model);
      if (!pixel) continue;
      const auto back = BearingFromImage(camera, *pixel);
      ASSERT_TRUE(back) << CameraModelName(camera.model);
      EXPECT_NEAR((*back - bearing).norm(), 0, 1e-10) << CameraModelName(camera.model);
      EXPECT_FALSE(CameraFromImage(camera, *pixel)) << "no (x/z, y/z) beyond 90 degrees";
    }
  }
}

TEST(Camera, AFoldedImageGivesNothingRatherThanAWrongRay) {
  // r (1 - 0.3 r^2) grows until r^2 = 1 / 0.9 and is 0.7027 there: no ray comes to 0.71, and rays from
  // farther off the axis, which the polynomial would bring back into the image, are not seen.
  const Camera camera = MakeCamera(CameraModel::kSimpleRadial, {100, 0, 0, -0.3});
  const double fold = std::sqrt(1 / 0.9);
  EXPECT_TRUE(BearingFromImage(camera, {70.2, 0}));
  EXPECT_FALSE(BearingFromImage(camera, {71, 0}));
  EXPECT_TRUE(ImageFromCamera(camera, {0.999 * fold, 0, 1}));
  EXPECT_FALSE(ImageFromCamera(camera, {1.001 * fold, 0, 1}));
  EXPECT_FALSE(ImageFromCamera(camera, {0, 1.7, 1})) << "1.7 (1 - 0.3 * 2.89) = 0.226 lies inside the image";
}

// Every pixel of a folding camera gives the nearest ray that a search over rays finds, or nothing where that
// search finds none.
TEST(Camera, UnprojectionAgreesWithASearchAlongTheRadius) {
  for (const std::vector<double>& k :
       std::vector<std::vector<double>>{{-0.5, 0.2}, {-0.4, 0.04}, {0.3, -0.2}, {-1.0, 0.9}, {0.1, -0.9}}) {
    const Camera camera = MakeCamera(CameraModel::kRadial, {1, 0, 0, k[0], k[1]});
    for (double target = 0.01; target < 2; target += 0.037) {
      double nearest = -1;
      double last = 0;
      for (double r = 1e-4; r < 5; r += 1e-4) {
        const double image = r * (1 + k[0] * r * r + k[1] * r * r * r * r);
        if (image < last) break;  // the fold
        if (image >= target) {
          nearest = r;
          break;
        }
        last = image;
      }
      const auto ray = CameraFromImage(camera, {0, target});
      ASSERT_EQ(ray.has_value(), nearest > 0) << target << " " << k[0] << " " << k[1];
      if (ray) {
        EXPECT_NEAR(ray->y(), nearest, 2e-4);
      }
    }
  }
}

TEST(Camera, WildParametersNeverGiveARayThatDoesNotProjectBack) {
  Random random(3);
  int num_rays = 0;
  for (int i = 0; i < 3000; ++i) {
    for (Camera camera : OneOfEachModel()) {
      for (double& param : camera.params) {
        if (std::abs(param) < 1) param = random.Uniform(-1, 1);  // the others are f, cx, cy
      }
      const Eigen::Vector2d target(random.Uniform(0, 640), random.Uniform(0, 480));
      const auto bearing = BearingFromImage(camera, target);
      if (!bearing) continue;
      ++num_rays;
      const auto pixel = ImageFromCamera(camera, *bearing);
      ASSERT_TRUE(pixel) << CameraModelName(camera.model);
      EXPECT_NEAR((*pixel - target).norm(), 0, 1e-7) << CameraModelName(camera.model);
    }
  }
  EXPECT_GT(num_rays, 10000);
}

TEST(Camera, PointBehindTheCameraIsNotSeen) {
  for (const Camera& camera : OneOfEachModel()) {
    EXPECT_FALSE(ImageFromCamera(camera, {0, 0, 0}));
    const bool is_panorama = camera.model == CameraModel::kEquirectangular;
    EXPECT_EQ(ImageFromCamera(camera, {0, 0, -1}).has_value(), is_panorama);
  }
}

TEST(Camera, PanoramaLooksAheadInItsMiddleAndRightAtThreeQuarters) {
  const Camera camera = MakeCamera(CameraModel::kEquirectangular, {});
  EXPECT_NEAR((*BearingFromImage(camera, {320, 240}) - Eigen::Vector3d(0, 0, 1)).norm(), 0, 1e-12);
  EXPECT_NEAR((*BearingFromImage(camera, {480, 240}) - Eigen::Vector3d(1, 0, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((*BearingFromImage(camera, {320, 0}) - Eigen::Vector3d(0, -1, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((*BearingFromImage(camera, {0, 240}) - Eigen::Vector3d(0, 0, -1)).norm(), 0, 1e-12);
}

TEST(Camera, NamesAndNumbersAreColmaps) {
  EXPECT_EQ(*CameraModelFromName("OPENCV_FISHEYE"), CameraModel::kOpenCvFisheye);
  EXPECT_EQ(*CameraModelFromId(6), CameraModel::kFullOpenCv);
  EXPECT_EQ(*CameraModelFromId(10), CameraModel::kThinPrismFisheye);
  EXPECT_EQ(*CameraModelFromName("FOV"), CameraModel::kFov);
  EXPECT_EQ(CameraModelFromId(1000).error().code, ErrorCode::kUnsupported) << "panoramas are not COLMAP's";
  EXPECT_EQ(CameraModelFromName("SPHERICAL").error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(CameraModelFromId(42).error().code, ErrorCode::kUnsupported);
}

TEST(Camera, ImpossibleIntrinsicsAreErrors) {
  EXPECT_FALSE(CheckCamera(MakeCamera(CameraModel::kPinhole, {500, 510, 320})).ok());
  EXPECT_FALSE(CheckCamera(MakeCamera(CameraModel::kSimplePinhole, {-500, 320, 240})).ok());
  EXPECT_FALSE(CheckCamera(MakeCamera(CameraModel::kSimplePinhole, {std::nan(""), 320, 240})).ok());
  Camera flat = MakeCamera(CameraModel::kSimplePinhole, {500, 320, 240});
  flat.height = 0;
  EXPECT_FALSE(CheckCamera(flat).ok());
  EXPECT_FALSE(CheckCamera(MakeCamera(CameraModel::kFov, {500, 500, 320, 240, 3.2})).ok());
}

}  // namespace
}  // namespace cairn
