#include "stages/group_classes/adjust/camera_models.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/group_classes/circle.h"

namespace cairn::group_classes {
namespace {

using testing::DoubleEq;
using testing::ElementsAre;

Camera Square() {
  Camera camera;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 320, 240};
  return camera;
}

const CameraVariant& Named(const std::vector<CameraVariant>& variants, const std::string& name) {
  const auto found = std::find_if(variants.begin(), variants.end(),
                                  [&](const CameraVariant& variant) { return variant.name == name; });
  EXPECT_NE(found, variants.end()) << name;
  return *found;
}

std::vector<std::string> NamesOf(const Camera& stated) {
  std::vector<std::string> names;
  for (const CameraVariant& variant : CameraVariants(stated, {})) names.push_back(variant.name);
  return names;
}

TEST(CameraVariants, GrowFromAsStatedAndKeepIt) {
  for (const CameraModel model :
       {CameraModel::kSimplePinhole, CameraModel::kPinhole, CameraModel::kSimpleRadial, CameraModel::kRadial,
        CameraModel::kOpenCv, CameraModel::kOpenCvFisheye, CameraModel::kFullOpenCv, CameraModel::kFov,
        CameraModel::kSimpleRadialFisheye, CameraModel::kRadialFisheye, CameraModel::kThinPrismFisheye}) {
    Camera stated;
    stated.model = model;
    stated.width = 640;
    stated.height = 480;
    stated.params.assign(NumCameraParams(model), 0.01);
    for (int i = 0; i < NumFocals(model); ++i) stated.params[i] = 500;
    stated.params[NumFocals(model)] = 322;
    stated.params[NumFocals(model) + 1] = 238;
    const std::vector<CameraVariant> variants = CameraVariants(stated, {});
    ASSERT_GE(variants.size(), 2u) << CameraModelName(model);
    EXPECT_TRUE(variants[0].free.empty());
    for (const CameraVariant& variant : variants) {
      ASSERT_TRUE(CheckCamera(variant.camera).ok()) << CameraModelName(model) << " " << variant.name;
      EXPECT_EQ(variant.free.size(), variant.sigma.size());
      EXPECT_TRUE(std::is_sorted(variant.free.begin(), variant.free.end()));
      // The same lens in the wider model.
      const Eigen::Vector3d point(0.3, -0.4, 1);
      EXPECT_LT((*ImageFromCamera(variant.camera, point) - *ImageFromCamera(stated, point)).norm(), 1e-9)
          << CameraModelName(model) << " " << variant.name;
    }
  }
  Camera panorama;
  panorama.model = CameraModel::kEquirectangular;
  EXPECT_EQ(CameraVariants(panorama, {}).size(), 1u);
}

TEST(CameraVariants, ACalibratedCameraIsTrustedMore) {
  Camera pinhole = Lens(), guessed = GuessCamera(1, 640, 480);
  pinhole.model = CameraModel::kPinhole;
  pinhole.params.resize(4);
  const auto focal_sigma = [](const Camera& camera) {
    for (const CameraVariant& variant : CameraVariants(camera, {})) {
      if (variant.name == "f") return variant.sigma[0] / camera.FocalX();
    }
    return 0.0;
  };
  EXPECT_NEAR(focal_sigma(pinhole), 0.03, 1e-9);
  EXPECT_NEAR(focal_sigma(Lens()), 0.003, 1e-9);
  EXPECT_NEAR(focal_sigma(guessed), 0.3, 1e-9);
}

// What is free, and how much each may change.
TEST(CameraVariants, FreeParametersAreOfTheModelAndSoAreTheirDeviations) {
  const std::vector<CameraVariant> square = CameraVariants(Square(), {});
  EXPECT_THAT(NamesOf(Square()),
              ElementsAre("", "k1", "f", "f k1", "f c k1", "f c k1 k2", "fx fy c k1 k2 p1 p2"));
  EXPECT_EQ(Named(square, "k1").camera.model, CameraModel::kSimpleRadial);
  EXPECT_THAT(Named(square, "k1").free, ElementsAre(3));
  EXPECT_THAT(Named(square, "k1").sigma, ElementsAre(0.1));
  EXPECT_EQ(Named(square, "f").camera.model, CameraModel::kSimplePinhole);
  EXPECT_THAT(Named(square, "f").free, ElementsAre(0));
  EXPECT_EQ(Named(square, "f").difference_sigma, 0);
  EXPECT_THAT(Named(square, "f k1").free, ElementsAre(0, 3));
  EXPECT_THAT(Named(square, "f c k1").sigma, ElementsAre(DoubleEq(15), DoubleEq(9.6), DoubleEq(9.6), 0.1));
  EXPECT_EQ(Named(square, "f c k1 k2").camera.model, CameraModel::kRadial);
  EXPECT_THAT(Named(square, "f c k1 k2").free, ElementsAre(0, 1, 2, 3, 4));
  const CameraVariant& all = Named(square, "fx fy c k1 k2 p1 p2");
  EXPECT_EQ(all.camera.model, CameraModel::kOpenCv);
  EXPECT_THAT(all.free, ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
  EXPECT_DOUBLE_EQ(all.difference_sigma, 0.003 * 500);

  // Two focal lengths that are stated stay two.
  Camera oblong = Lens();
  oblong.model = CameraModel::kPinhole;
  oblong.params.resize(4);
  const std::vector<CameraVariant> two = CameraVariants(oblong, {});
  EXPECT_EQ(Named(two, "k1").camera.model, CameraModel::kOpenCv);
  EXPECT_THAT(Named(two, "k1").free, ElementsAre(4));
  EXPECT_EQ(Named(two, "f").camera.model, CameraModel::kPinhole);
  EXPECT_THAT(Named(two, "f").free, ElementsAre(0, 1));
  EXPECT_DOUBLE_EQ(Named(two, "f").difference_sigma, 0.003 * 505);
  EXPECT_EQ(Named(two, "f k1").camera.model, CameraModel::kOpenCv);
  EXPECT_EQ(Named(two, "f c k1").camera.model, CameraModel::kOpenCv);
  EXPECT_THAT(Named(two, "f c k1 k2").free, ElementsAre(0, 1, 2, 3, 4, 5));
  oblong.params[1] = oblong.params[0];
  EXPECT_EQ(Named(CameraVariants(oblong, {}), "f c k1 k2").camera.model, CameraModel::kRadial);
}

TEST(CameraVariants, DistortedCamerasKeepTheirCoefficientsAndMayHaveMore) {
  Camera radial = Square();
  radial.model = CameraModel::kSimpleRadial;
  radial.params.push_back(-0.05);
  EXPECT_THAT(NamesOf(radial), ElementsAre("", "f", "f c k", "f c k1 k2", "fx fy c k1 k2 p1 p2"));
  EXPECT_THAT(Named(CameraVariants(radial, {}), "f c k").free, ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(Named(CameraVariants(radial, {}), "f c k").sigma,
              ElementsAre(DoubleEq(1.5), DoubleEq(0.96), DoubleEq(0.96), DoubleEq(0.01)));
  EXPECT_THAT(Named(CameraVariants(radial, {}), "f c k1 k2").camera.params,
              ElementsAre(500, 320, 240, -0.05, 0));
  EXPECT_DOUBLE_EQ(Named(CameraVariants(radial, {}), "fx fy c k1 k2 p1 p2").difference_sigma, 0.15);
  radial.model = CameraModel::kRadial;
  radial.params.push_back(0.01);
  EXPECT_THAT(NamesOf(radial), ElementsAre("", "f", "f c k", "fx fy c k1 k2 p1 p2"));
  EXPECT_THAT(Named(CameraVariants(radial, {}), "f c k").free, ElementsAre(0, 1, 2, 3, 4));
  radial.model = CameraModel::kRadialFisheye;
  EXPECT_THAT(NamesOf(radial), ElementsAre("", "f", "f c k", "fx fy c k1 k2 k3 k4"));
  EXPECT_THAT(Named(CameraVariants(radial, {}), "f c k").free, ElementsAre(0, 1, 2, 3, 4));
  EXPECT_EQ(Named(CameraVariants(radial, {}), "fx fy c k1 k2 k3 k4").camera.model,
            CameraModel::kOpenCvFisheye);
  EXPECT_THAT(NamesOf(Lens()), ElementsAre("", "f", "f c k"));
  EXPECT_THAT(Named(CameraVariants(Lens(), {}), "f c k").free, ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
}

}  // namespace
}  // namespace cairn::group_classes
