#include "runtime/localize/localizer.h"

#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "core/files/file.h"
#include "core/seal/map_seal.h"
#include "core/work/work_budget.h"
#include "runtime/localize/accept.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/refine.h"
#include "runtime/map/block_cache.h"
#include "tests/option_limits.h"
#include "tests/runtime/localize/room_drive.h"

namespace cairn {
namespace {

// The synthetic rooms' errors are independent of each other: no factor for those that are not.
LocalizerOptions IndependentErrors() {
  LocalizerOptions options;
  options.refine.keypoint_correlation = 1e-12;
  return options;
}

TEST(Localizer, FindsEveryFreePoseOfACleanRoom) {
  Localizer localizer(RoomMap());
  Random random(5);
  for (int i = 0; i < 30; ++i) {
    const Pose truth = RandomPose(random);
    const auto found = localizer.LocalizeFeatures(RenderFeatures(Room(), truth, {}, i), Room().camera);
    ASSERT_TRUE(found.ok()) << found.error().message;
    ASSERT_TRUE(found->has_fix()) << i << ": " << found->message;
    EXPECT_LT(CenterErrorM(found->cam_from_world, truth), 0.05) << i;
    EXPECT_LT(RotationErrorDeg(found->cam_from_world, truth), 0.5) << i;
    EXPECT_EQ(found->scope, Scope::kRegions);
    EXPECT_GE(found->region, 0);
    EXPECT_FALSE(found->candidates.empty());
    EXPECT_GE(found->num_inliers, found->num_unguided_inliers / 2);
  }
}

TEST(Localizer, StandsManyWrongMatches) {
  Localizer localizer(RoomMap());
  Random random(6);
  int num_fixes = 0;
  for (int i = 0; i < 20; ++i) {
    const Pose truth = RandomPose(random);
    const RenderOptions dirty{.detection_ratio = 0.6, .num_outliers = 800, .num_swapped_ratio = 0.6};
    const auto found = *localizer.LocalizeFeatures(RenderFeatures(Room(), truth, dirty, i), Room().camera);
    if (!found.has_fix()) continue;
    ++num_fixes;
    EXPECT_LT(CenterErrorM(found.cam_from_world, truth), 0.2) << i;
  }
  EXPECT_GE(num_fixes, 18);
}

TEST(Localizer, CovarianceIsRight) {
  // Normalised estimation error squared over independent maps and queries: mean of a chi-square of 6 degrees
  // of freedom, variance 12 / n.  Processors round differently, so every kind of machine draws its own
  // errors: the band is the one that a right covariance leaves once in 1000 such machines.
  constexpr int kNumTrials = 900;
  double sum = 0;
  int num_fixes = 0;
  Random random(7);
  for (int i = 0; i < kNumTrials; ++i) {
    Localizer localizer(*Map::FromRows(WithLandmarkNoise(Room(), 0.01, random)), IndependentErrors());
    const Pose truth = RandomPose(random);
    const auto found = *localizer.LocalizeFeatures(
        RenderFeatures(Room(), truth, {.num_swapped_ratio = 0.2}, 100 + i), Room().camera);
    if (!found.has_fix()) continue;
    ++num_fixes;
    const Vector6d error = PerturbationBetween(found.cam_from_world, truth);
    sum += error.dot(found.covariance.inverse() * error);
  }
  ASSERT_GT(num_fixes, 870);
  const double band = 3.29 * std::sqrt(12.0 / num_fixes);
  EXPECT_NEAR(sum / num_fixes, 6, band);
}

TEST(Localizer, CovarianceFollowsNoiseThatNobodyAnnounced) {
  // Keypoints three times as noisy as the options say.
  double sum = 0;
  int num_fixes = 0;
  Random random(8);
  Localizer localizer(RoomMap(), IndependentErrors());
  for (int i = 0; i < 200; ++i) {
    const Pose truth = RandomPose(random);
    const RenderOptions noisy{
        .keypoint_sigma_px = 1.5, .keypoint_sigma_per_scale = 0.6, .detection_ratio = 0.4};
    const auto found = *localizer.LocalizeFeatures(RenderFeatures(Room(), truth, noisy, i), Room().camera);
    if (!found.has_fix()) continue;
    ++num_fixes;
    const Vector6d error = PerturbationBetween(found.cam_from_world, truth);
    sum += error.dot(found.covariance.inverse() * error);
  }
  ASSERT_GT(num_fixes, 190);
  // The search radius cuts the largest of these errors off, so that a little is missing: within 20 %.
  EXPECT_NEAR(sum / num_fixes, 6, 1.2);
}

TEST(Localizer, KeypointsThatErrTogetherWidenTheCovariance) {
  MapRows rows = Room().rows;
  const Features features = RenderFeatures(Room(), PoseAt({0, 0, 1.2}, 30), {}, 3);
  LocalizerOptions plain;
  plain.refine.keypoint_correlation = 1e-12;
  const auto without = *Localizer(RoomMap(), plain).LocalizeFeatures(features, Room().camera);
  rows.keypoint_correlation = 0.05;
  const auto with = *Localizer(*Map::FromRows(rows)).LocalizeFeatures(features, Room().camera);
  ASSERT_TRUE(with.has_fix());
  ASSERT_EQ(with.num_inliers, without.num_inliers);
  EXPECT_NEAR(with.covariance(0, 0) / without.covariance(0, 0), 1 + 0.025 * with.num_inliers, 1e-3);
  // What left-out images of the survey show beside.
  rows.covariance_scale = 1.25;
  const auto scaled = *Localizer(*Map::FromRows(rows)).LocalizeFeatures(features, Room().camera);
  EXPECT_NEAR(scaled.covariance(0, 0) / with.covariance(0, 0), 1.25, 1e-3);
  rows.keypoint_correlation = 0;
  const auto alone = *Localizer(*Map::FromRows(rows)).LocalizeFeatures(features, Room().camera);
  EXPECT_NEAR(alone.covariance(0, 0) / without.covariance(0, 0), 1.25, 1e-3);
  // Where the options say, the map does not.
  const auto by_options = *Localizer(*Map::FromRows(rows), plain).LocalizeFeatures(features, Room().camera);
  EXPECT_NEAR(by_options.covariance(0, 0) / without.covariance(0, 0), 1, 1e-3);
  // A map that does not say: the factor that was measured on the demo.
  const auto unmeasured = *Localizer(RoomMap()).LocalizeFeatures(features, Room().camera);
  EXPECT_NEAR(unmeasured.covariance(0, 0) / without.covariance(0, 0), 1.8, 1e-3);
}

// The room is a little larger or smaller than its map says: the errors of fixes grow from scale_centre, and
// their normalised squares still are 6 in the mean, for each size and over all that are likely.
TEST(Localizer, TheErrorOfTheMapsScaleIsInTheCovariance) {
  constexpr double kScaleSigma = 0.02;
  MapRows rows = Room().rows;
  rows.frame.scale_sigma_ratio = kScaleSigma;
  rows.frame.scale_centre = {-1, 2, 0.5};
  rows.camera_from_given = {Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())),
                            {0.1, 0, 0.2}};
  Localizer with(*Map::FromRows(rows), IndependentErrors());
  rows.frame.scale_sigma_ratio = 0;
  Localizer without(*Map::FromRows(rows), IndependentErrors());
  const Pose given_from_camera = rows.camera_from_given.Inverse();
  Random random(9);
  int num_fixes = 0;
  double sum_one_sigma = 0, sum_likely = 0, sum_ignored = 0;
  for (int i = 0; i < 300; ++i) {
    const Pose cam_from_map = RandomPose(random);
    const Features features = RenderFeatures(Room(), cam_from_map, {.num_swapped_ratio = 0.2}, 100 + i);
    const auto found = *with.LocalizeFeatures(features, Room().camera);
    if (!found.has_fix()) continue;
    ++num_fixes;
    const auto plain = *without.LocalizeFeatures(features, Room().camera);
    EXPECT_EQ(plain.scale_sigma_m, Eigen::Vector3d::Zero());
    EXPECT_EQ(found.covariance.topRows(3), plain.covariance.topRows(3));
    EXPECT_NEAR(found.scale_sigma_m.norm(),
                kScaleSigma * (found.cam_from_world.Center() - rows.frame.scale_centre).norm(), 1e-9);
    const auto nees = [&](double scale_error, const Matrix6d& covariance) {
      Pose truth = given_from_camera * cam_from_map;
      const Eigen::Vector3d centre =
          rows.frame.scale_centre + (1 + scale_error) * (truth.Center() - rows.frame.scale_centre);
      truth.translation = -(truth.rotation * centre);
      const Vector6d error = PerturbationBetween(found.cam_from_world, truth);
      return error.dot(covariance.inverse() * error);
    };
    sum_one_sigma += nees(kScaleSigma, found.covariance);
    sum_likely += nees(random.Normal(0, kScaleSigma), found.covariance);
    sum_ignored += nees(kScaleSigma, plain.covariance);
  }
  ASSERT_GT(num_fixes, 290);
  EXPECT_NEAR(sum_one_sigma / num_fixes, 6, 0.8);
  EXPECT_NEAR(sum_likely / num_fixes, 6, 0.8);
  EXPECT_GT(sum_ignored / num_fixes, 60);
}

TEST(Localizer, AStatedCameraIsTheOneThatTheSurveyFound) {
  MapRows rows = Room().rows;
  Camera stated = Room().camera;
  stated.params[0] *= 1.05;
  Camera other = stated;
  other.params[0] += 1;
  rows.stated_cameras = {stated};
  const auto map = *Map::FromRows(rows);
  const Features features = RenderFeatures(Room(), PoseAt({0, 0, 1.2}, 30), {}, 3);
  const auto as_found = *Localizer(map).LocalizeFeatures(features, Room().camera);
  const auto as_stated = *Localizer(map).LocalizeFeatures(features, stated);
  const auto as_other = *Localizer(map).LocalizeFeatures(features, other);
  ASSERT_TRUE(as_found.has_fix());
  ASSERT_TRUE(as_stated.has_fix());
  EXPECT_EQ(as_stated.cam_from_world.translation, as_found.cam_from_world.translation);
  EXPECT_TRUE(!as_other.has_fix() || CenterErrorM(as_other.cam_from_world, as_found.cam_from_world) > 1e-3);
}

TEST(ChanceOfInlier, IsADiscsShareWhereLandmarksSpreadAndLargeWhereTheyCrowd) {
  Query query;
  query.camera.width = 640;
  query.camera.height = 480;
  Random random(4);
  PooledVector<PoseMeasurement> measurements(100);
  for (PoseMeasurement& measurement : measurements) {
    measurement.point = Eigen::Vector3d(random.Uniform(-2, 2), random.Uniform(-1.5, 1.5), 3);
    measurement.ray.ray = measurement.point.hnormalized();
    measurement.ray.pixel_from_ray = 480 * Eigen::Matrix2d::Identity();
  }
  const double disc = M_PI * 36 / (640 * 480);
  EXPECT_NEAR(ChanceOfInlier(measurements, Pose(), 6, query), disc, disc);
  Pose far;  // from 1000 m everything is one point, and so are the keypoints that show it
  far.translation.z() = 1000;
  for (PoseMeasurement& measurement : measurements)
    measurement.ray.ray = (far * measurement.point).hnormalized();
  EXPECT_GT(ChanceOfInlier(measurements, far, 6, query), 0.9);
  EXPECT_NEAR(ChanceOfInlier({}, Pose(), 6, query), disc, 1e-12);
}

TEST(Log10ChancePoses, FollowsTheDefinition) {
  // C(10, 3) = 120, C(7, 3) = 35
  EXPECT_NEAR(Log10ChancePoses(10, 6, 1e-3), std::log10(120 * 35 * 1e-9), 1e-9);
  EXPECT_GT(Log10ChancePoses(10, 3, 1e-3), 1e9);  // three matches always agree
  EXPECT_LT(Log10ChancePoses(20, 8, 1e-3), Log10ChancePoses(40, 8, 1e-3));
}

TEST(Localizer, AnotherPlaceIsRefused) {
  const SyntheticRoom other = MakeSyntheticRoom(99);
  Localizer localizer(RoomMap());
  Random random(9);
  for (int i = 0; i < 20; ++i) {
    const auto found =
        *localizer.LocalizeFeatures(RenderFeatures(other, RandomPose(random), {}, i), Room().camera);
    EXPECT_FALSE(found.has_fix()) << i;
    EXPECT_FALSE(found.message.empty());
    EXPECT_NE(found.reason, NoFix::kNone);
  }
}

TEST(Localizer, MatchesThatAgreeOnNoPoseAreRefused) {
  // Every descriptor is one of the map, every place in the image is random.
  Localizer localizer(RoomMap());
  Random random(10);
  for (int i = 0; i < 10; ++i) {
    const RenderOptions swapped{.num_swapped_ratio = 1};
    const auto found =
        *localizer.LocalizeFeatures(RenderFeatures(Room(), RandomPose(random), swapped, i), Room().camera);
    EXPECT_FALSE(found.has_fix());
    EXPECT_EQ(found.reason, NoFix::kTooFewInliers) << found.message;
  }
}

TEST(Localizer, TwoPosesOfEqualSupportAreAmbiguous) {
  // Half of the keypoints show the room from one place, half from another.
  Localizer localizer(RoomMap());
  const Features left = RenderFeatures(Room(), PoseAt({-2, 0, 1.2}, 90), {.num_outliers = 0}, 1);
  const Features right = RenderFeatures(Room(), PoseAt({2, 0, 1.2}, -90), {.num_outliers = 0}, 2);
  Features both = left;
  both.keypoints.insert(both.keypoints.end(), right.keypoints.begin(), right.keypoints.end());
  both.descriptors.conservativeResize(left.descriptors.rows() + right.descriptors.rows(), kSiftDescriptorDim);
  both.descriptors.bottomRows(right.descriptors.rows()) = right.descriptors;
  LocalizerOptions options;
  options.retrieve.max_num_regions = 8;
  const auto found = *Localizer(RoomMap(), options).LocalizeFeatures(both, Room().camera);
  EXPECT_EQ(found.reason, NoFix::kAmbiguous) << found.message;
}

TEST(Localizer, FewFeaturesAreNamedAsTheReason) {
  Localizer localizer(RoomMap());
  const auto found = *localizer.LocalizeFeatures(Features(), Room().camera);
  EXPECT_EQ(found.reason, NoFix::kTooFewFeatures);
  EXPECT_THAT(found.message, testing::HasSubstr("0 features"));
  EXPECT_STREQ(NoFixName(found.reason), "too_few_features");
}

TEST(Localizer, BlankImageHasNoFix) {
  Localizer localizer(RoomMap());
  const auto found = *localizer.Localize(cv::Mat(480, 640, CV_8UC1, cv::Scalar(128)), Room().camera);
  EXPECT_EQ(found.reason, NoFix::kTooFewFeatures);
}

TEST(Localizer, ImageOfAnotherSizeOrTypeIsAnError) {
  Localizer localizer(RoomMap());
  EXPECT_EQ(localizer.Localize(cv::Mat(100, 640, CV_8UC1), Room().camera).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(localizer.Localize(cv::Mat(480, 100, CV_8UC1), Room().camera).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(localizer.Localize(cv::Mat(100, 100, CV_8UC1), Room().camera).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(localizer.Localize(cv::Mat(480, 640, CV_8UC3), Room().camera).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(localizer.Localize(cv::Mat(), Room().camera).error().code, ErrorCode::kInvalidArgument);
  Camera broken = Room().camera;
  broken.params.pop_back();
  EXPECT_EQ(localizer.LocalizeFeatures(Features(), broken).error().code, ErrorCode::kInvalidArgument);
}

TEST(Localizer, FallsBackToAllLandmarksWhenRegionsAndWordsFail) {
  MapRows rows = Room().rows;
  rows.regions.clear();
  for (auto& postings : rows.vocabulary.inverted_files) postings.clear();
  WeightVocabulary(&rows.vocabulary);
  const auto map = *Map::FromRows(rows);
  const Pose truth = PoseAt({0, 0, 1.2}, 30);
  const Features features = RenderFeatures(Room(), truth, {}, 3);
  const auto found = *Localizer(map).LocalizeFeatures(features, Room().camera);
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_EQ(found.scope, Scope::kAll);
  EXPECT_EQ(found.region, -1);
  EXPECT_LT(CenterErrorM(found.cam_from_world, truth), 0.05);
  LocalizerOptions options;
  options.fall_back_to_all = false;
  EXPECT_EQ(Localizer(map, options).LocalizeFeatures(features, Room().camera)->reason, NoFix::kNoCandidates);
}

TEST(Localizer, PriorLeadsToItsNeighbourhood) {
  Localizer localizer(RoomMap());
  const Pose truth = PoseAt({1, 1, 1.2}, 200);
  const PosePrior prior{PoseAt({1.3, 0.8, 1.2}, 190), 0.3, 5};
  const auto found = *localizer.LocalizeFeatures(RenderFeatures(Room(), truth, {}, 4), Room().camera, prior);
  ASSERT_TRUE(found.has_fix());
  EXPECT_EQ(found.scope, Scope::kPrior);
  const PosePrior wrong{PoseAt({-3, -2, 1.2}, 20), 0.1, 1};
  const auto rescued =
      *localizer.LocalizeFeatures(RenderFeatures(Room(), truth, {}, 4), Room().camera, wrong);
  ASSERT_TRUE(rescued.has_fix()) << rescued.message;
  EXPECT_LT(CenterErrorM(rescued.cam_from_world, truth), 0.05);
}

TEST(Localizer, ReportsPosesInTheFrameOfTheCapture) {
  MapRows rows = Room().rows;
  rows.camera_from_given = {Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized())),
                            {0.2, -0.1, 0.4}};
  const auto map = *Map::FromRows(rows);
  const Pose truth = PoseAt({0, 0, 1.2}, 30);
  const Features features = RenderFeatures(Room(), truth, {}, 3);
  const auto plain = *Localizer(RoomMap()).LocalizeFeatures(features, Room().camera);
  const auto found = *Localizer(map).LocalizeFeatures(features, Room().camera);
  ASSERT_TRUE(found.has_fix() && plain.has_fix());
  const Pose given = rows.camera_from_given.Inverse() * truth;
  EXPECT_LT(CenterErrorM(found.cam_from_world, given), 0.05);
  // The same error, seen in another frame, is as likely.
  const Vector6d error = PerturbationBetween(found.cam_from_world, given);
  const Vector6d plain_error = PerturbationBetween(plain.cam_from_world, truth);
  EXPECT_NEAR(error.dot(found.covariance.inverse() * error),
              plain_error.dot(plain.covariance.inverse() * plain_error), 0.05);
}

TEST(Localizer, SameImageSameAnswerFromAnyThread) {
  const Features features = RenderFeatures(Room(), PoseAt({0, 1, 1.2}, 120), {.num_swapped_ratio = 0.5}, 3);
  std::vector<Localization> found(4);
  std::vector<std::thread> threads;
  for (Localization& one : found) {
    threads.emplace_back([&] {
      Localizer localizer(RoomMap());
      for (int i = 0; i < 3; ++i) one = *localizer.LocalizeFeatures(features, Room().camera);
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const Localization& one : found) {
    ASSERT_TRUE(one.has_fix());
    EXPECT_EQ(one.cam_from_world.translation, found[0].cam_from_world.translation);
    EXPECT_EQ(one.covariance, found[0].covariance);
  }
}

TEST(Localizer, WorksWithAFisheyeCamera) {
  SyntheticRoom room = Room();
  room.camera.model = CameraModel::kOpenCvFisheye;
  room.camera.params = {300, 300, 320, 240, 0.02, -0.01, 0.003, -0.001};
  const Pose truth = PoseAt({0, 0, 1.2}, 30);
  const auto found = *Localizer(RoomMap()).LocalizeFeatures(RenderFeatures(room, truth, {}, 3), room.camera);
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_LT(CenterErrorM(found.cam_from_world, truth), 0.05);
}

TEST(Localizer, OptionsAreDescribedOnceEach) {
  LocalizerOptions options;
  std::vector<std::string> names;
  for (const Option& option : DescribeOptions(&options)) names.push_back(option.name);
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::adjacent_find(names.begin(), names.end()), names.end());
  EXPECT_TRUE(CheckOptions(DescribeOptions(&options)).ok());
}

TEST(Localizer, OptionsHaveTheirRanges) {
  ExpectLimits<LocalizerOptions>({{"keypoint_sigma_px", "0.001", "0.0009"},
                                  {"keypoint_sigma_per_scale", "0", "-0.001"},
                                  {"max_num_candidates", "1", "0"},
                                  {"min_score_ratio", "0", "-0.001", "1", "1.001"},
                                  {"max_word_angle_rad", "0.001", "0.0009"},
                                  {"max_word_ratio", "0.001", "0.0009", "1", "1.001"},
                                  {"max_num_regions", "1", "0"},
                                  {"prior_distance_m", "0", "-0.001"},
                                  {"prior_angle_deg", "0", "-0.001", "180", "180.001"},
                                  {"max_ratio", "0.001", "0.0009", "1", "1.001"},
                                  {"max_angle_rad", "0.001", "0.0009"},
                                  {"guided_radius_px", "0.1", "0.09"},
                                  {"guided_radius_sigmas", "0", "-0.001"},
                                  {"guided_max_angle_rad", "0.001", "0.0009"},
                                  {"guided_max_scale_ratio", "1", "0.999"},
                                  {"guided_num_images", "0", "-1"},
                                  {"guided_widest", "1", "0.999", "64", "64.001"},
                                  {"guided_sure_num_inliers", "0", "-1"},
                                  {"guided_max_num_rounds", "1", "0"},
                                  {"max_error_px", "0.001", "0.0009"},
                                  {"confidence", "0.01", "0.009", "0.999999", "0.9999999"},
                                  {"min_num_ransac_iterations", "1", "0"},
                                  {"max_num_ransac_iterations", "1", "0"},
                                  {"max_num_first_poses", "1", "0", "100", "101"},
                                  {"robust_scale", "0.001", "0.0009"},
                                  {"max_num_refine_iterations", "1", "0"},
                                  {"inlier_chi_square", "0.001", "0.0009"},
                                  {"covariance_scale", "1e-9", "9e-10"},
                                  {"keypoint_correlation", "0", "-0.001", "1", "1.001"},
                                  {"systematic_sigma_m", "0", "-0.001"},
                                  {"systematic_sigma_deg", "0", "-0.001"},
                                  {"min_num_features", "4", "3"},
                                  {"min_num_matches", "4", "3"},
                                  {"min_num_unguided_inliers", "4", "3"},
                                  {"min_num_inliers", "5", "4"},
                                  {"min_kept_ratio", "0", "-0.001", "1", "1.001"},
                                  {"min_guided_sigmas", "0", "-0.001"},
                                  {"min_probability", "0", "-0.001", "1", "1.001"},
                                  {"spread_grid", "1", "0", "1000", "1001"},
                                  {"min_num_cells", "1", "0"},
                                  {"max_sigma_m", "1e-6", "9e-7"},
                                  {"max_sigma_deg", "1e-6", "9e-7"},
                                  {"max_up_sigmas", "0.1", "0.09"},
                                  {"max_distance_from_survey_m", "0", "-0.001"},
                                  {"max_second_pose_ratio", "0", "-0.001", "1", "1.001"},
                                  {"num_second_pose_iterations", "1", "0"},
                                  {"second_pose_distance_m", "1e-6", "9e-7"},
                                  {"second_pose_angle_deg", "1e-6", "9e-7"},
                                  {"min_look_alike_odds", "1", "0.999"},
                                  {"floor_up_sigma_deg", "0.01", "0.009", "90", "90.001"},
                                  {"budget_ms", "0", "-0.001"},
                                  {"core_speed", "0.001", "0.0009", "1000", "1000.1"},
                                  {"sure_num_unguided_inliers", "0", "-1"},
                                  {"fall_back_max_num_landmarks", "0", "-1"}});
}

// As many unguided inliers as are asked for are enough, and one less is not.
TEST(Localizer, AFixThatIsNotSureIsHeldAgainstOtherLandmarks) {
  const Features features = RenderFeatures(Room(), PoseAt({0, 0, 1.2}, 30), {}, 3);
  const auto localize = [&](int sure_num) {
    LocalizerOptions options;
    options.sure_num_unguided_inliers = sure_num;
    const Localizer localizer(RoomMap(), options);
    const Query query = *localizer.QueryFromFeatures(features, Room().camera);
    const Localization found = *localizer.LocalizeQuery(query, std::nullopt);
    return std::pair(found, query.work->num(Work::kAttempt));
  };
  const auto [sure, num_attempts] = localize(20);
  ASSERT_TRUE(sure.has_fix());
  EXPECT_EQ(num_attempts, 1);
  EXPECT_EQ(localize(sure.num_unguided_inliers).second, 1);
  EXPECT_GT(localize(sure.num_unguided_inliers + 1).second, 1);
}

// Of the matches that agree on the first pose some are beyond what the noise explains.
TEST(Localizer, AFixThatRefinementLeavesLittleOfIsRefused) {
  const Features features = RenderFeatures(Room(), PoseAt({0, 0, 1.2}, 30), {}, 3);
  const auto localize = [&](double min_kept_ratio) {
    LocalizerOptions options;
    options.match.guided_num_images = 0;
    options.accept.min_kept_ratio = min_kept_ratio;
    options.fall_back_to_all = false;
    options.first_landmarks = "images";
    return *Localizer(RoomMap(), options).LocalizeFeatures(features, Room().camera);
  };
  const Localization found = localize(0.5);
  ASSERT_TRUE(found.has_fix()) << found.message;
  ASSERT_LT(found.num_inliers, found.num_unguided_inliers);
  const double kept = static_cast<double>(found.num_inliers) / found.num_unguided_inliers;
  EXPECT_TRUE(localize(kept - 0.001).has_fix());
  EXPECT_EQ(localize(kept + 0.001).reason, NoFix::kTooFewInliers);
  const Localization refused = localize(1);
  EXPECT_EQ(refused.reason, NoFix::kTooFewInliers);
  EXPECT_THAT(refused.message, testing::HasSubstr("are left after refinement; at least 100 % are needed"));
  EXPECT_EQ(refused.probability, 0);
}

TEST(Localizer, AVotedFixThatIsNotSureIsHeldAgainstOtherLandmarks) {
  const Pose truth = PoseAt({0, 0, 1.2}, 30);
  const Features features = RenderFeatures(Room(), truth, {.detection_ratio = 1}, 3);
  std::vector<LandmarkIdx> voted;  // a third of all
  for (LandmarkIdx i = 0; i < static_cast<LandmarkIdx>(Room().points.size()); i += 3) voted.push_back(i);
  const auto localize = [&](int sure_num) {
    LocalizerOptions options;
    options.sure_num_unguided_inliers = sure_num;
    const Localizer localizer(RoomMap(), options);
    return *localizer.LocalizeVoted(*localizer.QueryFromFeatures(features, Room().camera), voted);
  };
  const Localization sure = localize(20);
  ASSERT_TRUE(sure.has_fix()) << sure.message;
  EXPECT_EQ(sure.scope, Scope::kVotes);
  EXPECT_EQ(localize(sure.num_unguided_inliers).scope, Scope::kVotes);
  const Localization better = localize(sure.num_unguided_inliers + 1);
  EXPECT_EQ(better.scope, Scope::kRegions);
  EXPECT_GT(better.num_unguided_inliers, 2 * sure.num_unguided_inliers);
}

TEST(Map, CameraIsChosenBySizeOnlyIfOneFits) {
  EXPECT_EQ(RoomMap()->CameraForSize(640, 480)->camera_id, 1u);
  const Error error = RoomMap()->CameraForSize(1280, 720).error();
  EXPECT_EQ(error.code, ErrorCode::kNotFound);
  EXPECT_THAT(error.message, testing::HasSubstr("640 x 480"));
  MapRows rows = Room().rows;
  rows.cameras.push_back(rows.cameras[0]);
  rows.cameras.back().camera_id = 2;
  EXPECT_FALSE((*Map::FromRows(rows))->CameraForSize(640, 480).ok());
}

TEST(Localizer, WorksWithoutAVocabulary) {
  MapRows rows = Room().rows;
  rows.vocabulary = {};
  Localizer localizer(*Map::FromRows(rows));
  const Pose truth = PoseAt({0, 0, 1.2}, 30);
  const auto found = *localizer.LocalizeFeatures(RenderFeatures(Room(), truth, {}, 3), Room().camera);
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_EQ(found.scope, Scope::kRegions);
  EXPECT_LT(CenterErrorM(found.cam_from_world, truth), 0.05);
}

TEST(Map, OpensTheFileThatWasWritten) {
  const std::string path = testing::TempDir() + "/room.cairn";
  ASSERT_TRUE(WriteMapRows(Room().rows, path).ok());
  const auto map = Map::Open(path);
  ASSERT_TRUE(map.ok()) << map.error().message;
  const Pose truth = PoseAt({0, 0, 1.2}, 30);
  EXPECT_TRUE(
      Localizer(*map).LocalizeFeatures(RenderFeatures(Room(), truth, {}, 3), Room().camera)->has_fix());
  EXPECT_EQ(Map::Open(path + ".none").error().code, ErrorCode::kNotFound);
}

TEST(Map, FileAnswersAsTheRowsDo) {
  const std::string path = testing::TempDir() + "/same.cairn";
  ASSERT_TRUE(WriteMapRows(Room().rows, path).ok());
  // As the file has them: rounded.
  Localizer of_rows(*Map::FromRows(*ReadMapRows(path))), of_file(*Map::Open(path));
  Random random(9);
  for (int i = 0; i < 10; ++i) {
    const Features features = RenderFeatures(Room(), RandomPose(random), {.num_swapped_ratio = 0.4}, i);
    const Localization a = *of_rows.LocalizeFeatures(features, Room().camera);
    const Localization b = *of_file.LocalizeFeatures(features, Room().camera);
    EXPECT_EQ(a.has_fix(), b.has_fix());
    EXPECT_EQ(a.cam_from_world.translation, b.cam_from_world.translation);
    EXPECT_EQ(a.candidates, b.candidates);
    EXPECT_EQ(a.region, b.region);
  }
}

TEST(Map, KeepsWithinItsBudgetAndAnswersTheSame) {
  const std::string path = testing::TempDir() + "/budget.cairn";
  ASSERT_TRUE(WriteMapRows(Room().rows, path).ok());
  const auto roomy = *Map::Open(path), tight = *Map::Open(path, {.memory_budget_bytes = 200'000});
  Random random(10);
  for (int i = 0; i < 8; ++i) {
    const Features features = RenderFeatures(Room(), RandomPose(random), {}, i);
    const Localization a = *Localizer(roomy).LocalizeFeatures(features, Room().camera);
    const Localization b = *Localizer(tight).LocalizeFeatures(features, Room().camera);
    EXPECT_EQ(a.cam_from_world.translation, b.cam_from_world.translation);
    EXPECT_LE(tight->cache().num_bytes(), 200'000);
  }
  EXPECT_GT(roomy->cache().num_bytes(), 200'000);
  EXPECT_GT(tight->cache().num_loads(), roomy->cache().num_loads());
}

TEST(Map, DamagedBlockIsAnErrorOfTheQueryThatNeedsIt) {
  const std::string path = testing::TempDir() + "/hurt.cairn";
  ASSERT_TRUE(WriteMapRows(Room().rows, path).ok());
  std::string bytes = *ReadFile(path);
  bytes[bytes.size() - 100'000] ^= 1;  // among the landmarks, which come last
  ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
  const auto map = Map::Open(path);
  ASSERT_TRUE(map.ok()) << map.error().message;
  const auto found =
      Localizer(*map).LocalizeFeatures(RenderFeatures(Room(), PoseAt({0, 0, 1.2}, 30), {}, 3), Room().camera);
  ASSERT_FALSE(found.ok());
  EXPECT_EQ(found.error().code, ErrorCode::kCorrupt);
}

TEST(Map, RequiredKeyIsRequired) {
  const std::string path = testing::TempDir() + "/keyed.cairn";
  ASSERT_TRUE(WriteMapRows(Room().rows, path).ok());
  const KeyPair keys = MakeKeyPair();
  EXPECT_EQ(Map::Open(path, {.public_key = keys.public_key}).error().code, ErrorCode::kNotSigned);
  ASSERT_TRUE(SignMap(path, keys.secret_key, path).ok());
  EXPECT_TRUE(Map::Open(path, {.public_key = keys.public_key}).ok());
  EXPECT_EQ(Map::Open(path, {.public_key = MakeKeyPair().public_key}).error().code, ErrorCode::kWrongKey);
}

TEST(BlockCache, EvictsWhatWasUsedLongestAgo) {
  BlockCache cache(100);
  const auto block = [](int value) { return std::make_shared<const int>(value); };
  cache.Insert(1, block(1), 40);
  cache.Insert(2, block(2), 40);
  EXPECT_NE(cache.Find(1), nullptr);  // now 2 is the oldest
  cache.Insert(3, block(3), 40);
  EXPECT_EQ(cache.Find(2), nullptr);
  EXPECT_NE(cache.Find(1), nullptr);
  EXPECT_NE(cache.Find(3), nullptr);
  EXPECT_EQ(cache.num_bytes(), 80);
}

TEST(BlockCache, WhatIsLargerThanTheBudgetIsNotKept) {
  BlockCache cache(100);
  EXPECT_NE(cache.Insert(1, std::make_shared<const int>(1), 200), nullptr);
  EXPECT_EQ(cache.Find(1), nullptr);
  EXPECT_EQ(cache.num_bytes(), 0);
}

}  // namespace
}  // namespace cairn
