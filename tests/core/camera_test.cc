#include "core/camera.h"

#include <gtest/gtest.h>

#include "core/random.h"

namespace cairn {
namespace {

Camera MakeCamera(CameraModel model, std::vector<double> params) {
  Camera camera;
  camera.model = model;
  camera.width = 640;
  camera.height = 480;
  camera.params = std::move(params);
  return camera;
}

std::vector<Camera> OneOfEachModel() {
  return {MakeCamera(CameraModel::kSimplePinhole, {500, 320, 240}),
          MakeCamera(CameraModel::kPinhole, {500, 510, 320, 240}),
          MakeCamera(CameraModel::kSimpleRadial, {500, 320, 240, -0.1}),
          MakeCamera(CameraModel::kRadial, {500, 320, 240, -0.2, 0.05}),
          MakeCamera(CameraModel::kOpenCv, {500, 510, 320, 240, -0.2, 0.05, 1e-3, -2e-3}),
          MakeCamera(CameraModel::kOpenCvFisheye, {300, 300, 320, 240, 0.02, -0.01, 1e-3, 1e-4}),
          MakeCamera(CameraModel::kFullOpenCv,
                     {500, 510, 320, 240, -0.2, 0.05, 1e-3, -2e-3, 0.01, 0.02, 0.01, 0.001})};
}

TEST(Camera, UnprojectionInvertsProjectionForEveryModel) {
  for (const Camera& camera : OneOfEachModel()) {
    ASSERT_TRUE(CheckCamera(camera).ok());
    Random random(1);
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d point(random.Uniform(-0.6, 0.6), random.Uniform(-0.45, 0.45), 1);
      const auto pixel = ImageFromCamera(camera, 3 * point);
      ASSERT_TRUE(pixel);
      const auto ray = CameraFromImage(camera, *pixel);
      ASSERT_TRUE(ray) << CameraModelName(camera.model);
      EXPECT_NEAR((*ray - point.head<2>()).norm(), 0, 1e-7) << CameraModelName(camera.model);
    }
  }
}

TEST(Camera, PointBehindTheCameraIsNotSeen) {
  for (const Camera& camera : OneOfEachModel()) {
    EXPECT_FALSE(ImageFromCamera(camera, {0, 0, -1}));
    EXPECT_FALSE(ImageFromCamera(camera, {0, 0, 0}));
  }
}

TEST(Camera, NamesAndNumbersAreColmaps) {
  EXPECT_EQ(*CameraModelFromName("OPENCV_FISHEYE"), CameraModel::kOpenCvFisheye);
  EXPECT_EQ(*CameraModelFromId(6), CameraModel::kFullOpenCv);
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
}

}  // namespace
}  // namespace cairn
