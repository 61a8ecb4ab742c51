#include "core/camera/camera.h"

#include <cmath>
#include <string>
#include <utility>
#include <vector>

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

// Where COLMAP sees (x/z, y/z), written as its camera models are.
Eigen::Vector2d ByColmapsFormula(const Camera& camera, double u, double v) {
  const PooledVector<double>& p = camera.params;
  const auto radial = [](double squared, const std::vector<double>& k) {
    double sum = 0;
    for (size_t i = 0; i < k.size(); ++i) sum += k[i] * std::pow(squared, static_cast<double>(i + 1));
    return sum;
  };
  const double r = std::hypot(u, v), theta = std::atan(r);
  const double uf = r > 0 ? u * theta / r : u, vf = r > 0 ? v * theta / r : v;  // of a fisheye
  const double r2 = r * r, theta2 = theta * theta;
  const auto decentered = [](double x, double y, double p1, double p2) {
    const double squared = x * x + y * y;
    return Eigen::Vector2d(2 * p1 * x * y + p2 * (squared + 2 * x * x),
                           2 * p2 * x * y + p1 * (squared + 2 * y * y));
  };
  switch (camera.model) {
    case CameraModel::kSimplePinhole:
      return {p[0] * u + p[1], p[0] * v + p[2]};
    case CameraModel::kPinhole:
      return {p[0] * u + p[2], p[1] * v + p[3]};
    case CameraModel::kSimpleRadial:
      return {p[0] * u * (1 + p[3] * r2) + p[1], p[0] * v * (1 + p[3] * r2) + p[2]};
    case CameraModel::kRadial: {
      const double ratio = 1 + radial(r2, {p[3], p[4]});
      return {p[0] * u * ratio + p[1], p[0] * v * ratio + p[2]};
    }
    case CameraModel::kOpenCv: {
      const double ratio = 1 + radial(r2, {p[4], p[5]});
      const Eigen::Vector2d d = decentered(u, v, p[6], p[7]);
      return {p[0] * (u * ratio + d.x()) + p[2], p[1] * (v * ratio + d.y()) + p[3]};
    }
    case CameraModel::kOpenCvFisheye: {
      const double ratio = 1 + radial(theta2, {p[4], p[5], p[6], p[7]});
      return {p[0] * uf * ratio + p[2], p[1] * vf * ratio + p[3]};
    }
    case CameraModel::kFullOpenCv: {
      const double ratio = (1 + radial(r2, {p[4], p[5], p[8]})) / (1 + radial(r2, {p[9], p[10], p[11]}));
      const Eigen::Vector2d d = decentered(u, v, p[6], p[7]);
      return {p[0] * (u * ratio + d.x()) + p[2], p[1] * (v * ratio + d.y()) + p[3]};
    }
    case CameraModel::kFov: {
      const double ratio =
          r > 0 ? std::atan(r * 2 * std::tan(p[4] / 2)) / (r * p[4]) : 2 * std::tan(p[4] / 2) / p[4];
      return {p[0] * u * ratio + p[2], p[1] * v * ratio + p[3]};
    }
    case CameraModel::kSimpleRadialFisheye:
      return {p[0] * uf * (1 + p[3] * theta2) + p[1], p[0] * vf * (1 + p[3] * theta2) + p[2]};
    case CameraModel::kRadialFisheye: {
      const double ratio = 1 + radial(theta2, {p[3], p[4]});
      return {p[0] * uf * ratio + p[1], p[0] * vf * ratio + p[2]};
    }
    case CameraModel::kThinPrismFisheye: {
      const double ratio = 1 + radial(theta2, {p[4], p[5], p[8], p[9]});
      const Eigen::Vector2d d = decentered(uf, vf, p[6], p[7]);
      return {p[0] * (uf * ratio + d.x() + p[10] * theta2) + p[2],
              p[1] * (vf * ratio + d.y() + p[11] * theta2) + p[3]};
    }
    case CameraModel::kEquirectangular: {
      const double longitude = std::atan2(u, 1), latitude = std::atan2(v, std::hypot(u, 1));
      return {camera.width * (0.5 + longitude / (2 * M_PI)), camera.height * (0.5 + latitude / M_PI)};
    }
  }
  return {};
}

TEST(Camera, EveryModelIsColmapsFormula) {
  std::vector<Camera> cameras = OneOfEachModel();
  for (const Camera& camera : StrongOnes()) cameras.push_back(camera);
  // Each of the parameters after the middle alone.
  for (size_t p = 4; p < 12; ++p) {
    for (const CameraModel model : {CameraModel::kFullOpenCv, CameraModel::kThinPrismFisheye}) {
      PooledVector<double> params = {300, 310, 320, 240, 0, 0, 0, 0, 0, 0, 0, 0};
      params[p] = 0.1;
      cameras.push_back(MakeCamera(model, std::move(params)));
    }
  }
  for (const Camera& camera : cameras) {
    for (const double u : {-0.4, 0.0, 0.1, 0.5}) {
      for (const double v : {-0.3, 0.0, 0.2}) {
        const auto pixel = ImageFromCamera(camera, {2 * u, 2 * v, 2});
        ASSERT_TRUE(pixel) << CameraModelName(camera.model);
        EXPECT_LT((*pixel - ByColmapsFormula(camera, u, v)).norm(), 1e-9)
            << CameraModelName(camera.model) << " " << u << " " << v;
      }
    }
  }
}

TEST(Camera, WithoutAFieldOfViewTheModelIsAPinhole) {
  const Camera pinhole = MakeCamera(CameraModel::kPinhole, {300, 310, 320, 240});
  for (const double omega : {0.0, 1e-7, -1e-7, 2e-6}) {
    const Camera camera = MakeCamera(CameraModel::kFov, {300, 310, 320, 240, omega});
    EXPECT_LT((*ImageFromCamera(camera, {1, -2, 4}) - *ImageFromCamera(pinhole, {1, -2, 4})).norm(), 1e-6);
    EXPECT_LT((*BearingFromImage(camera, {100, 200}) - *BearingFromImage(pinhole, {100, 200})).norm(), 1e-9);
    EXPECT_LT((*CameraFromImage(camera, {100, 200}) - *CameraFromImage(pinhole, {100, 200})).norm(), 1e-9);
  }
  const Camera wide = MakeCamera(CameraModel::kFov, {300, 310, 320, 240, 0.9});
  const Camera same = MakeCamera(CameraModel::kFov, {300, 310, 320, 240, -0.9});
  EXPECT_EQ(*ImageFromCamera(wide, {1, -2, -0.1}), *ImageFromCamera(same, {1, -2, -0.1}));
  EXPECT_EQ(*BearingFromImage(wide, {100, 200}), *BearingFromImage(same, {100, 200}));
}

TEST(Camera, AFieldOfViewEndsBehindTheCamera) {
  // 180 degrees off the axis lie pi / omega focal lengths from the middle.
  const Camera camera = MakeCamera(CameraModel::kFov, {100, 100, 0, 0, 1});
  const Eigen::Vector3d bearing = *BearingFromImage(camera, {314.1, 0});
  EXPECT_LT((bearing + Eigen::Vector3d::UnitZ()).norm(), 0.002);
  EXPECT_FALSE(BearingFromImage(camera, {314.2, 0}));
}

TEST(Camera, WhatLiesOnTheAxisIsSeenInTheMiddle) {
  for (const Camera& camera : OneOfEachModel()) {
    EXPECT_LT((*ImageFromCamera(camera, {0, 0, 3}) - camera.PrincipalPoint()).norm(), 1e-12);
    for (const double beside : {0.0, 1e-13, 1e-8, 1e-4}) {
      const Eigen::Vector3d bearing =
          *BearingFromImage(camera, camera.PrincipalPoint() + Eigen::Vector2d(beside, 0));
      EXPECT_NEAR(bearing.z(), 1, 1e-9) << CameraModelName(camera.model);
      if (camera.model == CameraModel::kFov) continue;  // its middle is drawn larger
      EXPECT_NEAR(bearing.x(), beside / camera.FocalX(), 2e-12) << CameraModelName(camera.model);
    }
  }
}

TEST(Camera, FocalLengthsAndMiddle) {
  const Camera one = MakeCamera(CameraModel::kRadial, {300, 320, 240, -0.3, 0.1});
  EXPECT_EQ(one.FocalX(), 300);
  EXPECT_EQ(one.FocalY(), 300);
  EXPECT_EQ(one.PrincipalPoint(), Eigen::Vector2d(320, 240));
  const Camera two = MakeCamera(CameraModel::kPinhole, {300, 310, 320, 240});
  EXPECT_EQ(two.FocalX(), 300);
  EXPECT_EQ(two.FocalY(), 310);
  EXPECT_EQ(two.MeanFocal(), 305);
  EXPECT_EQ(two.PrincipalPoint(), Eigen::Vector2d(320, 240));
  // 640 px for 360 degrees, 480 for 180.
  const Camera panorama = MakeCamera(CameraModel::kEquirectangular, {});
  EXPECT_NEAR(panorama.FocalX(), 101.859, 1e-3);
  EXPECT_NEAR(panorama.FocalY(), 152.789, 1e-3);
  EXPECT_EQ(panorama.PrincipalPoint(), Eigen::Vector2d(320, 240));
  const Camera guessed = GuessCamera(7, 640, 480), upright = GuessCamera(7, 480, 640);
  EXPECT_EQ(guessed.camera_id, 7u);
  EXPECT_EQ(guessed.params, (PooledVector<double>{768, 320, 240}));
  EXPECT_EQ(upright.params, (PooledVector<double>{768, 240, 320}));
  EXPECT_FALSE(guessed.has_focal_prior);
  EXPECT_EQ(guessed.model, CameraModel::kSimplePinhole);
}

TEST(Camera, NormalisedCoordinatesEnd86DegreesOffTheAxis) {
  const Camera camera = MakeCamera(CameraModel::kSimpleRadialFisheye, {100, 0, 0, 0});
  EXPECT_NEAR(CameraFromImage(camera, {149.9, 0})->x(), std::tan(1.499), 1e-9);
  EXPECT_FALSE(CameraFromImage(camera, {150.1, 0}));
}

// Where the map with decentering or a thin prism folds, by its coefficients, in a direction: the determinant
// of its Jacobian is 0 there.
TEST(Camera, DecenteredImagesEndAtTheirFolds) {
  struct Fold {
    double p1, p2, sx, sy, x, y, angle;
  };
  for (const Fold& fold : {
           Fold{0, -0.2, 0, 0, 1, 0, 1 / 1.2},           // 1 + 6 p2 x
           Fold{0, 0.2, 0, 0, -1, 0, 1 / 1.2},           //
           Fold{-0.2, 0, 0, 0, 0, 1, 1 / 1.2},           // 1 + 6 p1 y
           Fold{0.6, 0, 0, 0, 1, 0, 1 / 1.2},            // 1 - (2 p1 x)^2
           Fold{0, 0.6, 0, 0, 0, 1, 1 / 1.2},            // 1 - (2 p2 y)^2
           Fold{0, 0, -0.6, 0, 1, 0, 1 / 1.2},           // 1 + 2 sx x
           Fold{0, 0, 0, -0.6, 0, 1, 1 / 1.2},           // 1 + 2 sy y
           Fold{0, 0, -0.6, -0.6, 1, 1, M_SQRT2 / 2.4},  // 1 + 2 sx x + 2 sy y
           Fold{0, 0, -0.6, 0.4, 1, -1, M_SQRT2 / 2},    //
       }) {
    const Camera camera = MakeCamera(CameraModel::kThinPrismFisheye,
                                     {100, 100, 0, 0, 0, 0, fold.p1, fold.p2, 0, 0, fold.sx, fold.sy});
    const Eigen::Vector2d direction = Eigen::Vector2d(fold.x, fold.y).normalized();
    const auto seen = [&](double angle) {
      return ImageFromCamera(
          camera,
          (std::sin(angle) * direction).homogeneous().cwiseProduct(Eigen::Vector3d(1, 1, std::cos(angle))));
    };
    const auto before = seen(0.99 * fold.angle);
    ASSERT_TRUE(before) << fold.p1 << " " << fold.p2 << " " << fold.sx << " " << fold.sy;
    EXPECT_FALSE(seen(1.01 * fold.angle)) << fold.p1 << " " << fold.p2 << " " << fold.sx << " " << fold.sy;
    EXPECT_FALSE(seen(1.9 * fold.angle));
    const auto bearing = BearingFromImage(camera, *before);
    ASSERT_TRUE(bearing);
    EXPECT_NEAR(std::acos(bearing->z()), 0.99 * fold.angle, 1e-6);
  }
}

TEST(Camera, ARationalImageEndsWhereItsDenominatorIsZero) {
  // r / (1 - r^2) grows up to r = 1 and comes from below beyond.
  const Camera camera = MakeCamera(CameraModel::kFullOpenCv, {100, 100, 0, 0, 0, 0, 0, 0, 0, -1, 0, 0});
  EXPECT_NEAR(ImageFromCamera(camera, {0.9, 0, 1})->x(), 90 / 0.19, 1e-9);
  EXPECT_FALSE(ImageFromCamera(camera, {1.1, 0, 1}));
  EXPECT_NEAR(CameraFromImage(camera, {90 / 0.19, 0})->x(), 0.9, 1e-9);
  // r (1 + r^2) / (1 + 2 r^2 + 4 r^4): the numerator (1 + 3 t)(1 + 2 t + 4 t^2) - (1 + t)(4 t + 16 t^2) of
  // its slope is 1 + t - 10 t^2 - 4 t^3, with a root at t = 0.3437.
  const Camera folding = MakeCamera(CameraModel::kFullOpenCv, {100, 100, 0, 0, 1, 0, 0, 0, 0, 2, 4, 0});
  EXPECT_TRUE(ImageFromCamera(folding, {std::sqrt(0.340), 0, 1}));
  EXPECT_FALSE(ImageFromCamera(folding, {std::sqrt(0.348), 0, 1}));
}

TEST(Camera, SizesAndFocalLengthsHaveBounds) {
  const auto check = [](int width, int height, PooledVector<double> params) {
    Camera camera = MakeCamera(CameraModel::kPinhole, std::move(params));
    camera.width = width;
    camera.height = height;
    return CheckCamera(camera).ok();
  };
  EXPECT_TRUE(check(1, 1, {500, 510, 320, 240}));
  EXPECT_TRUE(check(65536, 65536, {500, 510, 320, 240}));
  EXPECT_FALSE(check(0, 480, {500, 510, 320, 240}));
  EXPECT_FALSE(check(640, 0, {500, 510, 320, 240}));
  EXPECT_FALSE(check(65537, 480, {500, 510, 320, 240}));
  EXPECT_FALSE(check(640, 65537, {500, 510, 320, 240}));
  EXPECT_FALSE(check(640, 480, {0, 510, 320, 240}));
  EXPECT_FALSE(check(640, 480, {500, 0, 320, 240}));
  EXPECT_TRUE(check(640, 480, {0.5, 0.5, 320, 240}));
  EXPECT_TRUE(CheckCamera(MakeCamera(CameraModel::kFov, {500, 500, 320, 240, -3.1})).ok());
  EXPECT_FALSE(CheckCamera(MakeCamera(CameraModel::kFov, {500, 500, 320, 240, -3.2})).ok());
  // Only FOV's fifth parameter is an angle.
  EXPECT_TRUE(CheckCamera(MakeCamera(CameraModel::kRadialFisheye, {500, 320, 240, 0, 3.2})).ok());
}

TEST(CameraFromWords, IsColmapsLine) {
  const Camera camera = *CameraFromWords({"1", "PINHOLE", "640", "480", "500", "510.5", "320", "-240"}, 1);
  EXPECT_EQ(camera.model, CameraModel::kPinhole);
  EXPECT_EQ(camera.width, 640);
  EXPECT_EQ(camera.height, 480);
  EXPECT_EQ(camera.params, (PooledVector<double>{500, 510.5, 320, -240}));
  EXPECT_EQ(camera.camera_id, 1u);
  EXPECT_EQ(CameraFromWords({"EQUIRECTANGULAR", "640", "480"}, 0)->params.size(), 0u);
}

TEST(CameraFromWords, APanoramasSizeMayBeRepeated) {
  EXPECT_EQ(CameraFromWords({"EQUIRECTANGULAR", "640", "480", "640", "480"}, 0)->params.size(), 0u);
  EXPECT_FALSE(CameraFromWords({"EQUIRECTANGULAR", "640", "480", "640", "481"}, 0).ok());
  EXPECT_FALSE(CameraFromWords({"SIMPLE_PINHOLE", "640", "480", "640", "480"}, 0).ok());
}

TEST(CameraFromWords, OtherWordsAreErrors) {
  const auto error = [](const std::vector<std::string>& words) { return CameraFromWords(words, 1).error(); };
  EXPECT_EQ(error({"1", "PINHOLE", "640"}).message, "expected MODEL WIDTH HEIGHT PARAMS, found 2 fields");
  EXPECT_EQ(error({"1", "PINHOLE", "640"}).code, ErrorCode::kCorrupt);
  EXPECT_EQ(error({"1", "BRICK", "640", "480"}).code, ErrorCode::kUnsupported);
  EXPECT_EQ(error({"1", "PINHOLE", "wide", "480", "5"}).message,
            "image size 'wide x 480' is not two positive integers");
  EXPECT_EQ(error({"1", "PINHOLE", "640", "-480", "5"}).message,
            "image size '640 x -480' is not two positive integers");
  EXPECT_EQ(error({"1", "SIMPLE_PINHOLE", "640", "480", "5", "far", "6"}).message,
            "camera parameter 'far' is not a number");
  EXPECT_EQ(error({"1", "SIMPLE_PINHOLE", "640", "480", "5"}).code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(error({"1", "SIMPLE_PINHOLE", "4294967295", "480", "5", "6", "7"}).code,
            ErrorCode::kInvalidArgument);
}

// Along an axis, where the formula turns back.
TEST(Camera, DistortedAndDecenteredImagesEndWhereTheirFormulaTurnsBack) {
  for (const bool is_along_x : {true, false}) {
    const double p1 = is_along_x ? 0 : -0.1, p2 = is_along_x ? -0.1 : 0;
    for (const Camera& camera :
         {MakeCamera(CameraModel::kOpenCv, {1, 1, 0, 0, -0.1, 0.01, p1, p2}),
          MakeCamera(CameraModel::kOpenCv, {1, 1, 0, 0, 0.2, -0.01, p1, p2}),
          MakeCamera(CameraModel::kFullOpenCv, {1, 1, 0, 0, 0, 0, p1, p2, 0, 0.1, 0, 0}),
          MakeCamera(CameraModel::kFullOpenCv, {1, 1, 0, 0, 0.05, 0.01, p1, p2, 0.002, 0.15, 0.02, 0.003})}) {
      constexpr double kStep = 1e-4;
      const auto at = [&](double r) { return is_along_x ? Eigen::Vector2d(r, 0) : Eigen::Vector2d(0, r); };
      double fold = 0;
      while (ByColmapsFormula(camera, at(fold + kStep).x(), at(fold + kStep).y()).norm() >
             ByColmapsFormula(camera, at(fold).x(), at(fold).y()).norm())
        fold += kStep;
      ASSERT_GT(fold, 0.5);
      ASSERT_LT(fold, 5);
      const auto pixel = ImageFromCamera(camera, at(0.98 * fold).homogeneous());
      ASSERT_TRUE(pixel) << fold;
      EXPECT_FALSE(ImageFromCamera(camera, at(1.02 * fold).homogeneous())) << fold;
      EXPECT_LT((*CameraFromImage(camera, *pixel) - at(0.98 * fold)).norm(), 1e-6);
      EXPECT_FALSE(
          CameraFromImage(camera, at(1.01 * ByColmapsFormula(camera, at(fold).x(), at(fold).y()).norm())));
    }
  }
}

TEST(Camera, ColmapsNumbersAreZeroToTen) {
  for (int id = 0; id <= 10; ++id) {
    EXPECT_EQ(static_cast<int>(*CameraModelFromId(id)), id);
    EXPECT_EQ(*CameraModelFromName(CameraModelName(*CameraModelFromId(id))), *CameraModelFromId(id));
  }
  EXPECT_FALSE(CameraModelFromId(11).ok());
  EXPECT_FALSE(CameraModelFromId(-1).ok());
}

}  // namespace
}  // namespace cairn
