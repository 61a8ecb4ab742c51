#include "runtime/localize/measurement.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/blocks/map_rows.h"
#include "runtime/localize/refine.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

Camera CameraOf(CameraId id, double focal_px) {
  return {.camera_id = id,
          .model = CameraModel::kSimplePinhole,
          .width = 640,
          .height = 480,
          .params = {focal_px, 320, 240}};
}

Features FeaturesAt(const std::vector<Keypoint>& keypoints, uint8_t value) {
  Features features;
  features.keypoints.assign(keypoints.begin(), keypoints.end());
  features.descriptors = DescriptorMatrix::Constant(static_cast<Eigen::Index>(keypoints.size()), 128, value);
  return features;
}

TEST(IsInImage, ItsEdgesAreInIt) {
  const Camera camera = CameraOf(1, 500);
  for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(0, 0), {640, 480}, {0, 480}, {640, 0}, {3, 4}})
    EXPECT_TRUE(IsInImage(pixel, camera)) << pixel.transpose();
  for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(-0.01, 5), {5, -0.01}, {640.01, 5}, {5, 480.01}})
    EXPECT_FALSE(IsInImage(pixel, camera)) << pixel.transpose();
}

TEST(MakeQuery, AKeypointIsARayWithItsDerivativeAndItsError) {
  const Query query = MakeQuery(FeaturesAt({{.x = 370, .y = 190, .scale = 4}}, 7), CameraOf(1, 500),
                                {.keypoint_sigma_px = 0.3, .keypoint_sigma_per_scale = 0.1});
  ASSERT_EQ(query.rays.size(), size_t{1});
  ASSERT_TRUE(query.rays[0]);
  EXPECT_TRUE(query.rays[0]->ray.isApprox(Eigen::Vector2d(0.1, -0.1), 1e-9));
  EXPECT_TRUE(query.rays[0]->pixel_from_ray.isApprox(500 * Eigen::Matrix2d::Identity(), 1e-6));
  EXPECT_NEAR(query.rays[0]->sigma_px, 0.5, 1e-6);  // 0.3^2 + (0.1 x 4)^2
  EXPECT_EQ(query.packed.size(), 1);
}

TEST(AddFeatures, StandBehindTheOthers) {
  Query query = MakeQuery(FeaturesAt({{.x = 320, .y = 240}}, 7), CameraOf(1, 500), {});
  AddFeatures(FeaturesAt({{.x = 370, .y = 240}, {.x = 420, .y = 240}}, 9), {}, &query);
  ASSERT_EQ(query.rays.size(), size_t{3});
  EXPECT_NEAR(query.rays[2]->ray.x(), 0.2, 1e-6);
  EXPECT_EQ(query.features.keypoints[1].x, 370);
  ASSERT_EQ(query.features.descriptors.rows(), 3);
  for (int row = 0; row < 3; ++row)
    EXPECT_TRUE((query.features.descriptors.row(row).array() == (row == 0 ? 7 : 9)).all()) << row;
  EXPECT_EQ(query.packed.size(), 1) << "they are not matched";
  const std::vector<Query> rig = {query, MakeQuery(FeaturesAt({{.x = 1, .y = 1}}, 1), CameraOf(1, 500), {})};
  EXPECT_EQ(Sighting(std::span<const Query>(rig)).num_features(), 4);
}

TEST(AsFound, IsTheCameraThatWasStatedSo) {
  MapHead head;
  head.stated_cameras = {CameraOf(1, 500), CameraOf(2, 600), CameraOf(3, 500)};
  head.cameras = {CameraOf(1, 510), CameraOf(2, 620), CameraOf(3, 530)};
  const auto focal = [&](const Camera& camera) { return AsFound(head, camera).FocalX(); };
  EXPECT_EQ(focal(CameraOf(2, 600)), 620);
  EXPECT_EQ(focal(CameraOf(1, 500)), 510);
  EXPECT_EQ(focal(CameraOf(3, 500)), 530) << "the one with this number";
  EXPECT_EQ(focal(CameraOf(9, 500)), 510) << "the first stated so";
  EXPECT_EQ(focal(CameraOf(1, 501)), 501) << "none was stated so";
  Camera wider = CameraOf(1, 500), higher = wider, other = wider;
  wider.width = 641;
  higher.height = 481;
  other.model = CameraModel::kPinhole;
  for (const Camera& camera : {wider, higher, other}) EXPECT_EQ(AsFound(head, camera).params, camera.params);
  head.cameras.erase(head.cameras.begin());
  EXPECT_EQ(focal(CameraOf(1, 500)), 500) << "the survey has not found it";
}

TEST(WasLookedFor, WhatTheImageShowsLargeEnough) {
  Query query;
  query.camera = CameraOf(1, 500);
  MapLandmark landmark;
  landmark.scale_m = 0.02;
  EXPECT_TRUE(WasLookedFor(landmark, 1000, query));
  query.min_scale_px = 2;  // 0.02 m x 500 px / 5 m
  EXPECT_TRUE(WasLookedFor(landmark, 5, query));
  EXPECT_FALSE(WasLookedFor(landmark, 5.1, query));
  landmark.scale_m = 0;
  EXPECT_FALSE(WasLookedFor(landmark, 1, query)) << "its size is not known";
}

TEST(CheckSensedUp, IsADirectionWithAnError) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(),
                   kInfinite = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(CheckSensedUp({{0, 0, 1e-3}, 1}).ok());
  EXPECT_FALSE(CheckSensedUp({{0, 0, 0}, 1}).ok());
  EXPECT_FALSE(CheckSensedUp({{0, kNan, 1}, 1}).ok());
  EXPECT_FALSE(CheckSensedUp({{0, kInfinite, 1}, 1}).ok());
  for (const double sigma : {0.0, -1.0, kNan, kInfinite})
    EXPECT_FALSE(CheckSensedUp({{0, 0, 1}, sigma}).ok()) << sigma;
}

TEST(LandmarksOf, AreAscendingAndOnceEach) {
  const PooledVector<Correspondence> matches = {
      {.landmark = 5}, {.landmark = 2}, {.landmark = 5}, {.landmark = 3}};
  EXPECT_EQ(LandmarksOf(matches), (PooledVector<LandmarkIdx>{2, 3, 5}));
}

// Landmarks 3 and 7, at (3, 0, 1) and (7, 0, 1).
LandmarkSet TwoLandmarks() {
  LandmarkSet landmarks;
  landmarks.idx = {3, 7};
  landmarks.landmarks.resize(2);
  for (int i = 0; i < 2; ++i) {
    landmarks.landmarks[i].position = {static_cast<double>(landmarks.idx[i]), 0, 1};
    landmarks.landmarks[i].covariance = landmarks.idx[i] * Eigen::Matrix3d::Identity();
  }
  return landmarks;
}

TEST(MakeMeasurements, KnowTheLandmarkTheRayAndTheCamera) {
  std::vector<Query> rig(
      2, MakeQuery(FeaturesAt({{.x = 320, .y = 240}, {.x = 370, .y = 240}}, 7), CameraOf(1, 500), {}));
  rig[1].cam_from_rig.translation = {0, 1, 0};
  const PooledVector<Correspondence> matches = {{.keypoint = 1, .landmark = 7},
                                                {.keypoint = 0, .landmark = 3, .image = 1}};
  const auto measurements = MakeMeasurements(Sighting(std::span<const Query>(rig)), TwoLandmarks(), matches);
  ASSERT_EQ(measurements.size(), size_t{2});
  EXPECT_EQ(measurements[0].point, Eigen::Vector3d(7, 0, 1));
  EXPECT_EQ(measurements[0].point_covariance, 7 * Eigen::Matrix3d::Identity());
  EXPECT_NEAR(measurements[0].ray.ray.x(), 0.1, 1e-6);
  EXPECT_EQ(measurements[0].image, 0);
  EXPECT_FALSE(measurements[0].cam_from_rig) << "the first camera is the rig";
  EXPECT_FALSE(measurements[0].row);
  EXPECT_EQ(measurements[1].image, 1);
  ASSERT_TRUE(measurements[1].cam_from_rig);
  EXPECT_EQ(measurements[1].cam_from_rig->translation, Eigen::Vector3d(0, 1, 0));
  // A camera that is only turned is not the rig either.
  rig[0].cam_from_rig.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()));
  EXPECT_TRUE(
      MakeMeasurements(Sighting(std::span<const Query>(rig)), TwoLandmarks(), matches)[0].cam_from_rig);
}

TEST(MakeMeasurements, ARowIsReadWhereTheCameraIsByThen) {
  // The top row is read half a readout before the middle one, and the row of 360 px a quarter after it.
  Query query = MakeQuery(FeaturesAt({{.x = 320, .y = 0}, {.x = 320, .y = 360}}, 7), CameraOf(1, 500), {});
  query.readout.motion << 0, 0, 0, 0.4, 0, 0;
  query.readout.sigmas.setConstant(0.01);
  const PooledVector<Correspondence> matches = {{.keypoint = 0, .landmark = 3},
                                                {.keypoint = 1, .landmark = 7}};
  const auto measurements = MakeMeasurements(query, TwoLandmarks(), matches);
  ASSERT_TRUE(measurements[0].cam_from_rig && measurements[1].cam_from_rig);
  EXPECT_NEAR(measurements[0].cam_from_rig->translation.x(), -0.2, 1e-12);
  EXPECT_NEAR(measurements[1].cam_from_rig->translation.x(), 0.1, 1e-12);
  ASSERT_TRUE(measurements[0].row && measurements[1].row);
  EXPECT_EQ(measurements[0].row->part, -0.5);
  EXPECT_EQ(measurements[1].row->part, 0.25);
  EXPECT_EQ(measurements[1].row->motion_sigmas, query.readout.sigmas);
}

}  // namespace
}  // namespace cairn
