// One fix of what several cameras see.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "runtime/localize/estimate.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/refine.h"
#include "tests/runtime/localize/room_drive.h"

namespace cairn {
namespace {

// Cameras around a mast, 0.2 m from its axis, looking outwards, evenly turned.
std::vector<Pose> Mast(int num_cameras) {
  std::vector<Pose> cams_from_rig;
  for (int i = 0; i < num_cameras; ++i) {
    Pose turned;
    turned.rotation = Eigen::AngleAxisd(2 * M_PI * i / num_cameras, Eigen::Vector3d::UnitY());
    turned.translation = {0, 0, -0.2};
    cams_from_rig.push_back(turned);
  }
  return cams_from_rig;
}

std::vector<RigFeatures> See(const Pose& rig_from_world, const std::vector<Pose>& cams_from_rig,
                             const RenderOptions& options, uint64_t seed) {
  std::vector<RigFeatures> images;
  for (const Pose& cam_from_rig : cams_from_rig) {
    images.push_back({RenderFeatures(Room(), cam_from_rig * rig_from_world, options, seed++), Room().camera,
                      cam_from_rig});
  }
  return images;
}

double NormalisedErrorSquared(const Localization& found, const Pose& truth) {
  const Vector6d error = PerturbationBetween(found.cam_from_world, truth);
  return error.dot(found.covariance.inverse() * error);
}

TEST(Rig, PosesOfPointsThatNoCameraSeesThreeOf) {
  Random random(1);
  const std::vector<Pose> cams_from_rig = Mast(8);
  const Pose truth = PoseAt({3, -2, 1}, 50);
  PooledVector<PoseMeasurement> measurements;
  for (int i = 0; i < 8; ++i) {
    for (int k = 0; k < 8; ++k) {
      const Eigen::Vector3d in_cam(random.Uniform(-2, 2), random.Uniform(-1.5, 1.5), random.Uniform(2, 6));
      PoseMeasurement measurement;
      measurement.point = truth.Inverse() * (cams_from_rig[i].Inverse() * in_cam);
      measurement.ray.pixel_from_ray = 500 * Eigen::Matrix2d::Identity();
      measurement.ray.ray = in_cam.hnormalized();
      if (k >= 2) measurement.ray.ray = {random.Uniform(-0.6, 0.6), random.Uniform(-0.5, 0.5)};
      measurement.image = i;
      measurement.cam_from_rig = cams_from_rig[i];
      measurements.push_back(measurement);
    }
  }
  const auto estimate = EstimatePose(measurements, {}, {}, 0);
  ASSERT_TRUE(estimate);
  EXPECT_GE(estimate->inliers.size(), 16U);
  EXPECT_LT(CenterErrorM(estimate->cam_from_world, truth), 1e-3);
  EXPECT_LT(RotationErrorDeg(estimate->cam_from_world, truth), 0.02);
  const auto with_up =
      EstimatePose(measurements, {}, {}, 0,
                   UpMeasurement{truth.rotation * Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitZ(), 0.001});
  ASSERT_TRUE(with_up);
  EXPECT_LT(CenterErrorM(with_up->cam_from_world, truth), 1e-3);
}

TEST(Rig, OneCameraAtTheRigsOriginIsThatCamera) {
  const Pose truth = PoseAt({0.4, 0.3, 1.2}, 20);
  Localizer localizer(RoomMap());
  const Localization alone = *localizer.LocalizeFeatures(RenderFeatures(Room(), truth, {}, 9), Room().camera);
  const Localization rig = *localizer.LocalizeRigFeatures(See(truth, {Pose()}, {}, 9));
  ASSERT_TRUE(alone.has_fix());
  EXPECT_EQ(rig.cam_from_world.translation, alone.cam_from_world.translation);
  EXPECT_EQ(rig.covariance, alone.covariance);
  EXPECT_EQ(rig.num_inliers, alone.num_inliers);
  EXPECT_EQ(rig.candidates, alone.candidates);
  EXPECT_EQ(rig.probability, alone.probability);
}

TEST(Rig, ItsPoseIsThatOfTheRigHoweverItsCamerasStandOnIt) {
  const Pose truth = PoseAt({0.4, 0.3, 1.2}, 20);
  std::vector<Pose> odd = Mast(2);
  odd[0] = Perturb(Pose(), (Vector6d() << 0.3, 0.2, -0.4, 0.3, -0.1, 0.2).finished());
  const Localization found = *Localizer(RoomMap()).LocalizeRigFeatures(See(truth, odd, {}, 9));
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_LT(CenterErrorM(found.cam_from_world, truth), 0.03);
  EXPECT_LT(RotationErrorDeg(found.cam_from_world, truth), 0.3);
}

TEST(Rig, MoreCamerasErrLessAndSayHowMuch) {
  Localizer localizer(RoomMap());
  constexpr int kNumTrials = 100;
  std::vector<double> mean_error_m;
  for (const int num_cameras : {1, 2, 4}) {
    Random random(2);
    double sum = 0, error_m = 0;
    int num_fixes = 0;
    for (int trial = 0; trial < kNumTrials; ++trial) {
      const Pose truth = RandomPose(random);
      const Localization found = *localizer.LocalizeRigFeatures(
          See(truth, Mast(num_cameras), {.detection_ratio = 0.3}, 1000 * trial));
      if (!found.has_fix()) continue;
      ++num_fixes;
      sum += NormalisedErrorSquared(found, truth);
      error_m += CenterErrorM(found.cam_from_world, truth);
    }
    EXPECT_GE(num_fixes, 0.97 * kNumTrials) << num_cameras;
    mean_error_m.push_back(error_m / num_fixes);
    // Maps that do not say how errors go together have wider covariances: 6 / 1.8.
    EXPECT_NEAR(sum / num_fixes, 6 / 1.8, 4 * std::sqrt(12.0 / kNumTrials) / 1.8) << num_cameras;
  }
  EXPECT_LT(mean_error_m[1], 0.8 * mean_error_m[0]);
  EXPECT_LT(mean_error_m[2], 0.8 * mean_error_m[1]);
}

TEST(Rig, FindsWithAllWhatNoneFindsAlone) {
  LocalizerOptions options;
  options.accept.min_probability = 0;  // most of what should be seen is missing
  Localizer localizer(RoomMap(), options);
  Random random(3);
  int num_alone = 0, num_rig = 0, num_images = 0;
  constexpr int kNumTrials = 40;
  for (int trial = 0; trial < kNumTrials; ++trial) {
    const Pose truth = RandomPose(random);
    const std::vector<RigFeatures> images =
        See(truth, Mast(4), {.detection_ratio = 0.015, .num_outliers = 200}, 1000 * trial);
    const Localization found = *localizer.LocalizeRigFeatures(images);
    num_rig += found.has_fix() ? 1 : 0;
    EXPECT_TRUE(!found.has_fix() || CenterErrorM(found.cam_from_world, truth) < 0.2) << trial;
    for (const RigFeatures& image : images) {
      ++num_images;
      num_alone += localizer.LocalizeFeatures(image.features, image.camera)->has_fix() ? 1 : 0;
    }
  }
  EXPECT_GE(num_rig, 0.8 * kNumTrials);
  EXPECT_LE(num_alone, 0.4 * num_images);
}

TEST(Rig, ACameraThatRecognizesNothingIsSearchedForWhatTheOthersPutThere) {
  const Pose truth = PoseAt({0.4, 0.3, 1.2}, 20);
  const std::vector<RigFeatures> one = See(truth, Mast(1), {}, 9);
  std::vector<RigFeatures> two = See(truth, Mast(2), {}, 9);
  Localizer localizer(RoomMap());
  const int num_of_one = localizer.LocalizeRigFeatures(one)->num_inliers;
  const int num_of_two = localizer.LocalizeRigFeatures(two)->num_inliers;
  EXPECT_GT(num_of_two, 1.5 * num_of_one);
  // Its words are those of nothing: what it shows are thousands of other things.
  Random random(4);
  const Eigen::Index num = two[1].features.descriptors.rows();
  two[1].features.descriptors.conservativeResize(num + 3000, Eigen::NoChange);
  for (Eigen::Index i = num; i < num + 3000; ++i) {
    two[1].features.descriptors.row(i) = RandomDescriptor(random);
    two[1].features.keypoints.push_back(
        {static_cast<float>(random.Uniform(0, 640)), static_cast<float>(random.Uniform(0, 480)), 2, 0});
  }
  const Localization found = *localizer.LocalizeRigFeatures(two);
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_LT(CenterErrorM(found.cam_from_world, truth), 0.03);
  EXPECT_GT(found.num_inliers, 1.3 * num_of_one);
  EXPECT_EQ(found.num_features,
            static_cast<int>(two[0].features.keypoints.size() + two[1].features.keypoints.size()));
}

// One looks ahead and the other behind: what each recognizes is of its own regions.
TEST(Rig, EachCameraIsMatchedWithWhatItShows) {
  const Pose truth = PoseAt({0.4, 0.3, 1.2}, 20);
  LocalizerOptions options;
  options.retrieve.max_num_regions = 1;
  options.fall_back_to_all = false;
  Localizer localizer(RoomMap(), options);
  const std::vector<RigFeatures> images = See(truth, Mast(2), {}, 9);
  int num_alone = 0;
  for (const RigFeatures& image : images)
    num_alone += localizer.LocalizeFeatures(image.features, image.camera)->num_unguided_inliers;
  const Localization found = *localizer.LocalizeRigFeatures(images);
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_EQ(found.scope, Scope::kRegions);
  EXPECT_GT(found.num_unguided_inliers, 0.9 * num_alone);
  EXPECT_LT(CenterErrorM(found.cam_from_world, truth), 0.03);
}

TEST(Rig, ABlindCameraDoesNoHarm) {
  const Pose truth = PoseAt({0.4, 0.3, 1.2}, 20);
  std::vector<RigFeatures> images = See(truth, Mast(3), {}, 9);
  images[1].features = Features();
  images[1].features.descriptors.resize(0, kSiftDescriptorDim);
  const Localization found = *Localizer(RoomMap()).LocalizeRigFeatures(images);
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_LT(CenterErrorM(found.cam_from_world, truth), 0.03);
}

TEST(Rig, PriorAndUpAreTheRigs) {
  const Pose truth = PoseAt({0.4, 0.3, 1.2}, 20);
  std::vector<Pose> backwards = {Mast(2)[1]};  // its only camera looks behind
  Localizer localizer(RoomMap());
  const std::vector<RigFeatures> images = See(truth, backwards, {}, 9);
  const SensedUp up{truth.rotation * Eigen::Vector3d::UnitZ(), 1};
  const Localization found = *localizer.LocalizeRigFeatures(images, PosePrior{truth, 0.2, 5}, up);
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_EQ(found.scope, Scope::kPrior);
  EXPECT_LT(CenterErrorM(found.cam_from_world, truth), 0.05);
  // In the camera's frame this would be up; the rig's is turned by half.
  std::vector<Pose> rolled = {Pose{Eigen::Quaterniond(Eigen::AngleAxisd(1, Eigen::Vector3d::UnitZ())), {}}};
  const Eigen::Vector3d in_camera = rolled[0].rotation * up.direction;
  const std::vector<RigFeatures> rolled_images = See(truth, rolled, {}, 9);
  EXPECT_TRUE(localizer.LocalizeRigFeatures(rolled_images, std::nullopt, up)->has_fix());
  EXPECT_FALSE(localizer.LocalizeRigFeatures(rolled_images, std::nullopt, SensedUp{in_camera, 1})->has_fix());
}

TEST(Rig, FramesAreThoseOfTheStatedPoses) {
  MapRows rows = Room().rows;
  rows.camera_from_given = Perturb(Pose(), (Vector6d() << 0.3, -1.2, 0.4, 0.1, 0.2, 0.3).finished());
  const Pose given_from_camera = rows.camera_from_given.Inverse();
  const Pose truth = PoseAt({0.4, 0.3, 1.2}, 20);  // of camera 0, at the rig's origin
  std::vector<RigFeatures> images = See(truth, {Pose(), Mast(2)[1]}, {}, 9);
  // The stated pose of a camera is given_from_camera * its pose, and so is what is stated between two.
  images[1].cam_from_rig = given_from_camera * images[1].cam_from_rig * rows.camera_from_given;
  const Localization found = *Localizer(*Map::FromRows(rows)).LocalizeRigFeatures(images);
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_LT(CenterErrorM(found.cam_from_world, given_from_camera * truth), 0.03);
  EXPECT_LT(RotationErrorDeg(found.cam_from_world, given_from_camera * truth), 0.3);
}

TEST(Rig, WhatIsNoRigIsRefused) {
  Localizer localizer(RoomMap());
  const Pose truth = PoseAt({0.4, 0.3, 1.2}, 20);
  const auto expect = [](const Result<Localization>& found, const std::string& message) {
    ASSERT_FALSE(found.ok());
    EXPECT_EQ(found.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(found.error().message, testing::HasSubstr(message));
  };
  expect(localizer.LocalizeRigFeatures({}), "a rig without images");
  expect(localizer.LocalizeRig({}), "a rig without images");
  std::vector<RigFeatures> images = See(truth, Mast(2), {}, 9);
  images[1].cam_from_rig.rotation.coeffs() *= 2;
  expect(localizer.LocalizeRigFeatures(images), "is no pose");
  images[1].cam_from_rig.rotation.coeffs() *= 0.5 * 1.0011;
  expect(localizer.LocalizeRigFeatures(images), "is no pose");
  images[1].cam_from_rig.rotation.coeffs() *= 1.0009 / 1.0011;  // as a file may state it
  EXPECT_TRUE(localizer.LocalizeRigFeatures(images).ok());
  images[1].cam_from_rig = Pose();
  images[1].cam_from_rig.translation.x() = std::nan("");
  expect(localizer.LocalizeRigFeatures(images), "is no pose");
  images[1].cam_from_rig = Pose();
  images[1].camera.params.clear();
  EXPECT_FALSE(localizer.LocalizeRigFeatures(images).ok());
  images[1] = images[0];
  images[1].features.keypoints.pop_back();
  expect(localizer.LocalizeRigFeatures(images), "keypoints with");
  const RigImage wide{cv::Mat::zeros(480, 600, CV_8U), Room().camera, Pose()};
  expect(localizer.LocalizeRig({wide}), "600 x 480 px");
}

}  // namespace
}  // namespace cairn
