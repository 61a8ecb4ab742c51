#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "tests/reconstruct/inertial/simulated_imu.h"

namespace cairn::reconstruct {
namespace {

// Errors of the scale over trajectories of many seeds.
struct ScaleErrors {
  int num = 0, num_refused = 0;
  double root_mean_square = 0, largest = 0;
  double largest_sigmas = 0;  // in the standard deviations that are said
  double nees = 0;            // normalised error squared, mean
};
ScaleErrors Measure(Motion (*motion_of)(uint64_t), bool is_stated, double duration_s, int num_seeds,
                    const SimulatedModel& model = {}) {
  ScaleErrors errors;
  double sum_squares = 0, sum_normalised = 0;
  for (int seed = 1; seed <= num_seeds; ++seed) {
    const Motion motion = motion_of(seed);
    const SimulatedImu imu = ImuOfSeed(seed);
    ImuRecording recording = RecordImu(motion, imu, duration_s, seed);
    if (!is_stated) recording.cam_from_imu.reset();
    const auto found = AlignToImu(ModelOfMotion(motion, model, duration_s, 0, seed), recording, {});
    EXPECT_TRUE(found.ok()) << found.error().message;
    if (!found.ok() || !(found->sigma_ratio < 0.2)) {
      ++errors.num_refused;
      continue;
    }
    ++errors.num;
    const double error = std::log(found->scale * model.model_per_metre);
    errors.largest = std::max(errors.largest, std::abs(error));
    errors.largest_sigmas = std::max(errors.largest_sigmas, std::abs(error) / found->sigma_ratio);
    sum_squares += error * error;
    sum_normalised += error * error / (found->sigma_ratio * found->sigma_ratio);
    EXPECT_LT(UpErrorDeg(*found), 1) << seed;
  }
  errors.root_mean_square = std::sqrt(sum_squares / errors.num);
  errors.nees = sum_normalised / errors.num;
  testing::Test::RecordProperty("root_mean_square", std::to_string(errors.root_mean_square));
  testing::Test::RecordProperty("largest_sigmas", std::to_string(errors.largest_sigmas));
  testing::Test::RecordProperty("nees", std::to_string(errors.nees));
  testing::Test::RecordProperty("num_refused", errors.num_refused);
  return errors;
}

// Two minutes of each; how the IMU is turned is found.
TEST(InertialAccuracy, FindsTheScaleOfAWalkToAPerCentAndSaysHowWell) {
  const ScaleErrors errors = Measure(Handheld, false, 120, 20);
  EXPECT_EQ(errors.num_refused, 0);
  EXPECT_LT(errors.root_mean_square, 0.01);
  EXPECT_LT(errors.largest, 0.02);
  EXPECT_GT(errors.nees, 0.4);
  EXPECT_LT(errors.nees, 1.7);
}

TEST(InertialAccuracy, KnowsTheScaleOfARobotOnWheelsLessWellAndSaysSo) {
  const ScaleErrors errors = Measure(Wheeled, true, 180, 20);
  EXPECT_LE(errors.num_refused, 2);
  EXPECT_LT(errors.root_mean_square, 0.04);
  EXPECT_GT(errors.nees, 0.4);
  EXPECT_LT(errors.nees, 2);
}

TEST(InertialAccuracy, SaysThatAStraightWayAtOneSpeedShowsNoScale) {
  for (const uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    const SimulatedImu imu = ImuOfSeed(seed);
    const auto found =
        AlignToImu(ModelOfMotion(Steady(), {}, 60, 0, seed), RecordImu(Steady(), imu, 60, seed), {});
    ASSERT_TRUE(found.ok()) << found.error().message;
    EXPECT_FALSE(found->sigma_ratio < 0.2) << seed << ": " << found->sigma_ratio;
    EXPECT_LT(UpErrorDeg(*found), 1) << seed;
  }
}

// Images so wrong that they hide what wheels do: what is said is right, or nothing is.
TEST(InertialAccuracy, OfARobotOnWheelsWhoseImagesErrByACentimetreIsRefusedOrRight) {
  const ScaleErrors errors =
      Measure(Wheeled, true, 180, 12, {.place_sigma_m = 0.01, .bend_sigma_m = 0.003, .bend_sigma_deg = 0.03});
  EXPECT_LT(errors.largest_sigmas, 3.5);
  EXPECT_LT(errors.largest, 0.4);
}

}  // namespace
}  // namespace cairn::reconstruct
