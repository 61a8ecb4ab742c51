#include "stages/reconstruct/inertial/inertial_alignment.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/geometry/rotations.h"
#include "tests/reconstruct/inertial/simulated_imu.h"

namespace cairn::reconstruct {
namespace {

using testing::HasSubstr;

class AlignedWalk : public testing::Test {
 protected:
  Result<InertialAlignment> Align() {
    ImuRecording recording = RecordImu(motion_, imu_, 60, 3);
    if (!is_stated_) recording.cam_from_imu.reset();
    if (change_recording_) change_recording_(&recording);
    images_ = ModelOfMotion(motion_, model_, 60, imu_.time_offset_s, 3);
    if (change_images_) change_images_(&images_);
    return AlignToImu(images_, recording, {});
  }
  std::string ErrorOf() {
    const auto found = Align();
    if (found.ok()) return "aligned";
    EXPECT_EQ(found.error().code, ErrorCode::kNoData);
    return found.error().message;
  }
  Motion motion_ = Handheld(3);
  SimulatedImu imu_;
  SimulatedModel model_;
  bool is_stated_ = false;
  std::function<void(ImuRecording*)> change_recording_;
  std::function<void(std::vector<TimedImage>*)> change_images_;
  std::vector<TimedImage> images_;
};

TEST_F(AlignedWalk, FindsTurnBiasesPlaceAndNoise) {
  const auto found = Align();
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_LT(DegFromRad(found->cam_from_imu.angularDistance(imu_.cam_from_imu.rotation)), 0.3);
  EXPECT_LT((found->gyro_bias - imu_.gyro_bias).norm(), 0.001);
  EXPECT_LT((found->accel_bias - imu_.accel_bias).norm(), 0.03);
  EXPECT_LT((found->imu_in_cam_m - imu_.cam_from_imu.translation).norm(), 0.03);
  EXPECT_NEAR(found->place_sigma_m, 0.003, 0.001);
  EXPECT_NEAR(DegFromRad(found->turn_sigma_rad), 0.05, 0.01);
  EXPECT_LT(found->imu_noise_ratio, 1.2);
  EXPECT_NEAR(found->time_offset_s, 0, 0.002);
}

TEST_F(AlignedWalk, OfFewerThanSixtyImagesIsBelievedHalfAsMuch) {
  const auto many = Align();
  ASSERT_TRUE(many.ok()) << many.error().message;
  EXPECT_EQ(many->sigma_ratio, std::max(many->noise_sigma_ratio, many->parts_sigma_ratio));
  model_.step_s = 1.5;
  const auto few = Align();
  ASSERT_TRUE(few.ok()) << few.error().message;
  EXPECT_LT(few->image_idx.size(), 60u);
  EXPECT_LT(few->sigma_ratio, 0.2);
  EXPECT_DOUBLE_EQ(few->sigma_ratio, 2 * few->noise_sigma_ratio);
}

TEST_F(AlignedWalk, FindsTheClocksDifference) {
  for (const double offset_s : {0.02, -0.12}) {
    imu_.time_offset_s = offset_s;
    const auto found = Align();
    ASSERT_TRUE(found.ok()) << found.error().message;
    EXPECT_NEAR(found->time_offset_s, offset_s, 0.003);
    EXPECT_NEAR(found->scale * model_.model_per_metre, 1, 0.03);
  }
}

TEST_F(AlignedWalk, FindsNoiseBeyondTheDataSheet) {
  imu_.noise = {0.006, 0.06};
  const auto found = Align();
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_NEAR(found->imu_noise_ratio, 3, 0.6);
  EXPECT_LT(std::abs(std::log(found->scale * model_.model_per_metre)), 3 * found->sigma_ratio);
}

TEST_F(AlignedWalk, AnImageInAWrongPlaceIsOffAndChangesLittle) {
  const double without = Align()->scale;
  change_images_ = [](std::vector<TimedImage>* images) {
    (*images)[60].cam_from_model.translation += Eigen::Vector3d(0.4, 0.1, 0);
  };
  const auto found = Align();
  ASSERT_TRUE(found.ok());
  EXPECT_NEAR(found->scale / without, 1, 0.01);
  EXPECT_TRUE(found->is_off[60]);
  EXPECT_GT(found->residuals_m[60], 0.5);
  EXPECT_LE(std::count(found->is_off.begin(), found->is_off.end(), true), 3);
}

TEST_F(AlignedWalk, AGapOfTheImuIsPassedOver) {
  change_recording_ = [](ImuRecording* imu) {
    imu->samples.erase(imu->samples.begin() + 4000, imu->samples.begin() + 6000);
  };
  const auto found = Align();
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_NEAR(found->scale * model_.model_per_metre, 1, 0.03);
  EXPECT_LT(found->image_idx.size(), images_.size() - 15);
}

TEST_F(AlignedWalk, SaysWhatIsWrongWithTheFile) {
  change_recording_ = [](ImuRecording* imu) {
    for (ImuSample& sample : imu->samples) sample.time_ns += 1'700'000'000'000'000'000;
  };
  EXPECT_THAT(ErrorOf(), HasSubstr("are of two clocks"));
  change_recording_ = [](ImuRecording* imu) {
    for (ImuSample& sample : imu->samples) sample.gyro *= 180 / M_PI;
  };
  EXPECT_THAT(ErrorOf(), HasSubstr("times as far as the images: its columns 2 to 4 are rad/s"));
  // Of another walk.
  change_recording_ = [&](ImuRecording* imu) { *imu = RecordImu(Handheld(8), imu_, 60, 3); };
  EXPECT_THAT(ErrorOf(), HasSubstr("the gyro's turns are not those of the images"));
  change_recording_ = [](ImuRecording* imu) { imu->samples.resize(300); };
  EXPECT_THAT(ErrorOf(), HasSubstr("pairs at most 5 s apart have samples all the time"));
}

TEST_F(AlignedWalk, AWrongStatementOfTheTurnIsNamed) {
  is_stated_ = true;
  imu_.cam_from_imu.rotation = Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5);
  change_recording_ = [](ImuRecording* imu) { imu->cam_from_imu->rotation.setIdentity(); };
  EXPECT_THAT(ErrorOf(), HasSubstr("or the IMU is not on it as imu_on_camera states"));
}

TEST_F(AlignedWalk, TurnsAboutOneAxisDoNotSayHowTheImuIsTurned) {
  motion_ = [](double t) -> Pose {
    return {YawPitchRoll(std::sin(0.7 * t), 0, 0) * LooksAhead(), {std::sin(t), std::cos(1.3 * t), 0.5}};
  };
  model_.turn_sigma_deg = 0.01;
  model_.bend_sigma_deg = 0;
  imu_.noise.gyro_rad_s_rthz = 1e-4;
  EXPECT_THAT(ErrorOf(), HasSubstr("imu_on_camera,X,Y,Z,QX,QY,QZ,QW"));
  is_stated_ = true;
  const auto found = Align();
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_NEAR(found->scale * model_.model_per_metre, 1, 0.03);
}

TEST(Preintegrate, DerivativesByTheBiasesAreThoseOfDifferences) {
  const ImuRecording recording = RecordImu(Handheld(4), {}, 3, 4);
  const auto at = [&](const Eigen::Vector3d& gyro, const Eigen::Vector3d& accel) {
    return *Preintegrate(recording.samples, 1'001'234'567, 1'903'000'000, gyro, accel, {});
  };
  const Preintegrated middle = at({0.01, 0, 0}, {0, 0.02, 0});
  EXPECT_NEAR(middle.dt_s, 0.901765433, 1e-9);
  for (int i = 0; i < 6; ++i) {
    constexpr double h = 1e-4;
    const Eigen::Vector3d gyro =
        i < 3 ? Eigen::Vector3d(h * Eigen::Vector3d::Unit(i)) : Eigen::Vector3d::Zero();
    const Eigen::Vector3d accel =
        i < 3 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(h * Eigen::Vector3d::Unit(i - 3));
    const Preintegrated more = at(Eigen::Vector3d(0.01, 0, 0) + gyro, Eigen::Vector3d(0, 0.02, 0) + accel);
    const Eigen::Vector3d turn =
        VectorFromQuaternion(Eigen::Quaterniond(middle.dR.conjugate() * more.dR)) / h;
    EXPECT_LT((turn - middle.by_bias.block<3, 1>(0, i)).norm(), 2e-3) << i;
    EXPECT_LT(((more.dv - middle.dv) / h - middle.by_bias.block<3, 1>(3, i)).norm(), 1e-2) << i;
    EXPECT_LT(((more.dp - middle.dp) / h - middle.by_bias.block<3, 1>(6, i)).norm(), 1e-2) << i;
  }
}

TEST(Preintegrate, CovarianceIsThatOfTheNoise) {
  const Motion motion = Handheld(4);
  SimulatedImu exact, noisy;
  exact.noise = {1e-12, 1e-12};
  exact.gyro_bias.setZero();
  exact.accel_bias.setZero();
  noisy.gyro_bias.setZero();
  noisy.accel_bias.setZero();
  const Eigen::Vector3d none = Eigen::Vector3d::Zero();
  const Preintegrated truth = *Preintegrate(RecordImu(motion, exact, 1.5, 1).samples, 500'000'000,
                                            1'200'000'000, none, none, noisy.noise);
  Matrix9d sum = Matrix9d::Zero();
  constexpr int kNum = 400;
  for (int seed = 0; seed < kNum; ++seed) {
    const Preintegrated said = *Preintegrate(RecordImu(motion, noisy, 1.5, seed).samples, 500'000'000,
                                             1'200'000'000, none, none, noisy.noise);
    Eigen::Matrix<double, 9, 1> error;
    error << VectorFromQuaternion(Eigen::Quaterniond(truth.dR.conjugate() * said.dR)), said.dv - truth.dv,
        said.dp - truth.dp;
    sum += error * error.transpose() / kNum;
  }
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(sum(i, i) / truth.covariance(i, i), 1, 0.25) << i;
}

}  // namespace
}  // namespace cairn::reconstruct
