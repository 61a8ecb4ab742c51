// Features that are looked for where landmarks are expected, on pixels.
#include "runtime/track/expected_features.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/camera/pixel_ray.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/refine.h"
#include "runtime/map/landmark_set.h"
#include "tests/runtime/localize/poster_scene.h"

namespace cairn {
namespace {

std::vector<LandmarkIdx> AllOf(const Map& map) {
  std::vector<LandmarkIdx> all(map.num_landmarks());
  std::iota(all.begin(), all.end(), 0);
  return all;
}

// The prior is 5 cm and 1 degree off.
Result<Localization> FindExpected(const cv::Mat& grey, const Camera& camera,
                                  const ExpectedFeaturesOptions& options = {},
                                  const Pose& truth = PosterQueryPose()) {
  PosePrior prior;
  prior.cam_from_world =
      Pose(Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(1), Eigen::Vector3d::UnitX())), {0.05, 0, 0}) *
      truth;
  prior.sigma_m = 0.1;
  prior.sigma_deg = 2;
  const Localizer localizer(PosterMap(), PosterOptions());
  return LocalizeExpected(*PosterMap(), localizer, QueryFrame(localizer, grey, camera), AllOf(*PosterMap()),
                          prior, options);
}

TEST(LocalizeExpected, FindsAnImageByAPartOfItsFeatures) {
  const cv::Mat grey = RenderPoster(Poster(), PosterQueryPose());
  const auto found = FindExpected(grey, Poster().camera, {.max_num_fine_features = 100000});
  ASSERT_TRUE(found.ok()) << found.error().message;
  ASSERT_TRUE(found->has_fix()) << found->message;
  EXPECT_EQ(found->scope, Scope::kTrack);
  EXPECT_LT(CenterErrorM(found->cam_from_world, PosterQueryPose()), 0.02);
  EXPECT_LT(RotationErrorDeg(found->cam_from_world, PosterQueryPose()), 0.3);
  const size_t num_coarse = ExtractUndoubledSift(grey, {}, SiftScales::kCoarse)->keypoints.size();
  const size_t num_fine = ExtractUndoubledSift(grey, {}, SiftScales::kFine)->keypoints.size();
  EXPECT_GT(found->num_features, static_cast<int>(num_coarse) + 20);
  EXPECT_LT(found->num_features, static_cast<int>(num_coarse + num_fine));
  // As sure as by all features: what was not looked for is not missing.
  Localizer localizer(PosterMap(), PosterOptions());
  const auto by_all = *localizer.Localize(grey, Poster().camera);
  EXPECT_NEAR(found->probability, by_all.probability, 0.05);
}

TEST(LocalizeExpected, FineFeaturesMakeItMoreExact) {
  const cv::Mat grey = RenderPoster(Poster(), PosterQueryPose());
  const auto coarse = FindExpected(grey, Poster().camera, {.max_num_fine_features = 0}),
             fine = FindExpected(grey, Poster().camera, {.max_num_fine_features = 100000});
  ASSERT_TRUE(coarse->has_fix());
  EXPECT_EQ(coarse->num_features,
            static_cast<int>(ExtractUndoubledSift(grey, {}, SiftScales::kCoarse)->keypoints.size()));
  EXPECT_GT(fine->num_inliers, coarse->num_inliers + 10);
  // What it was accepted by stays.
  EXPECT_EQ(fine->num_matches, coarse->num_matches);
  EXPECT_EQ(fine->num_unguided_inliers, coarse->num_unguided_inliers);
  EXPECT_EQ(fine->probability, coarse->probability);
  // No more of them than may be.
  const auto some = FindExpected(grey, Poster().camera, {.max_num_fine_features = 20});
  EXPECT_EQ(some->num_features, coarse->num_features + 20);
  EXPECT_GT(some->num_inliers, coarse->num_inliers);
}

TEST(LocalizeExpected, FineFeaturesMakeErrorsSmaller) {
  double coarse_error_m = 0, fine_error_m = 0;
  for (int i = 0; i < 12; ++i) {
    const Pose truth = PoseAt({0.06 * i, 0.05 * i - 0.3, 1.4 + 0.02 * i}, 2.0 * i - 10);
    const cv::Mat grey = RenderPoster(Poster(), truth);
    const auto coarse = FindExpected(grey, Poster().camera, {.max_num_fine_features = 0}, truth),
               fine = FindExpected(grey, Poster().camera, {}, truth);
    ASSERT_TRUE(coarse->has_fix() && fine->has_fix()) << i;
    coarse_error_m += CenterErrorM(coarse->cam_from_world, truth);
    fine_error_m += CenterErrorM(fine->cam_from_world, truth);
  }
  EXPECT_LT(fine_error_m, coarse_error_m);
}

// How many of the image's fine features are as near to a landmark, and of such a scale, as one is looked for
// at this pose.
int NumFineFeaturesNear(const Map& map, const cv::Mat& grey, const Localization& fix, double radius_px) {
  const Pose& cam_from_world = fix.cam_from_world;
  const double sigma_rad = LargestSigma(fix.covariance.topLeftCorner<3, 3>());
  const double sigma_m = LargestSigma(fix.covariance.bottomRightCorner<3, 3>());
  const Camera& camera = Poster().camera;
  const Features fine = *ExtractUndoubledSift(grey, {}, SiftScales::kFine);
  const auto landmarks = *map.AllLandmarks();
  return static_cast<int>(
      std::count_if(fine.keypoints.begin(), fine.keypoints.end(), [&](const Keypoint& keypoint) {
        return std::any_of(
            landmarks->landmarks.begin(), landmarks->landmarks.end(), [&](const MapLandmark& landmark) {
              const Eigen::Vector3d point = cam_from_world * landmark.position;
              const auto pixel = ImageFromCamera(camera, point);
              if (!pixel || !IsInImage(*pixel, camera)) return false;
              const double pixels_per_m = camera.MeanFocal() / DepthOfScale(camera, point);
              const double scale_px = landmark.scale_m * pixels_per_m;
              const double sigma_px = std::hypot(std::sqrt(landmark.covariance.trace() / 3) * pixels_per_m,
                                                 sigma_m * pixels_per_m, sigma_rad * camera.MeanFocal());
              const double reach_px = std::min(4 * radius_px, std::hypot(radius_px, 3 * sigma_px));
              return (*pixel - Eigen::Vector2d(keypoint.x, keypoint.y)).norm() <= reach_px &&
                     scale_px <= 1.6 * CoarseSiftScalePx(grey.size(), {}) &&
                     keypoint.scale <= 1.6 * scale_px && scale_px <= 1.6 * keypoint.scale;
            });
      }));
}

TEST(LocalizeExpected, LooksForFineFeaturesNearLandmarksOfTheirScaleAlone) {
  const cv::Mat grey = RenderPoster(Poster(), PosterQueryPose());
  const auto coarse = FindExpected(grey, Poster().camera, {.max_num_fine_features = 0});
  for (const double radius_px : {1.0, 3.0, 10.0}) {
    const auto found =
        FindExpected(grey, Poster().camera, {.max_num_fine_features = 100000, .fine_radius_px = radius_px});
    EXPECT_EQ(found->num_features - coarse->num_features,
              NumFineFeaturesNear(*PosterMap(), grey, *coarse, radius_px))
        << radius_px;
  }
}

TEST(LocalizeExpected, LandmarksOfUncertainPlaceAreLookedForFartherAway) {
  MapRows rows = MakePosterMap(Poster());
  for (size_t i = 0; i < rows.landmarks.size(); ++i) {
    const double sigma_m = i % 3 == 0 ? 0.001 : i % 3 == 1 ? 0.02 : 2;  // 0.1, 2 and 190 px
    rows.landmarks[i].covariance = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
  }
  const auto map = *Map::FromRows(rows);
  const Localizer localizer(map, PosterOptions());
  const cv::Mat grey = RenderPoster(Poster(), PosterQueryPose());
  PosePrior prior;
  prior.cam_from_world = PosterQueryPose();
  const auto coarse = *LocalizeExpected(*map, localizer, QueryFrame(localizer, grey, Poster().camera),
                                        AllOf(*map), prior, {.max_num_fine_features = 0}),
             fine = *LocalizeExpected(*map, localizer, QueryFrame(localizer, grey, Poster().camera),
                                      AllOf(*map), prior, {.max_num_fine_features = 100000});
  ASSERT_TRUE(coarse.has_fix()) << coarse.message;
  const int num_near = NumFineFeaturesNear(*map, grey, coarse, 3);
  EXPECT_EQ(fine.num_features - coarse.num_features, num_near);
  EXPECT_GT(num_near, NumFineFeaturesNear(*PosterMap(), grey, coarse, 3) + 10);
}

TEST(LocalizeExpected, WhatIsNotThereIsNotFound) {
  const auto blank = FindExpected(cv::Mat(240, 320, CV_8UC1, cv::Scalar(90)), Poster().camera);
  ASSERT_TRUE(blank.ok());
  EXPECT_EQ(blank->reason, NoFix::kTooFewFeatures);
  EXPECT_THAT(blank->message, testing::HasSubstr("0 coarse features"));
  const auto other = FindExpected(RenderPoster(MakePosterScene(2), PosterQueryPose()), Poster().camera);
  ASSERT_TRUE(other.ok());
  EXPECT_FALSE(other->has_fix());
}

TEST(LocalizeExpected, LandmarksOfUnknownSizeAreNotExpected) {
  MapRows rows = MakePosterMap(Poster());
  for (MapLandmark& landmark : rows.landmarks) landmark.scale_m = 0;
  const auto map = *Map::FromRows(rows);
  const cv::Mat grey = RenderPoster(Poster(), PosterQueryPose());
  PosePrior prior;
  prior.cam_from_world = PosterQueryPose();
  const Localizer localizer(map, PosterOptions());
  const auto found =
      LocalizeExpected(*map, localizer, QueryFrame(localizer, grey, Poster().camera), AllOf(*map), prior, {});
  ASSERT_TRUE(found.ok());
  EXPECT_EQ(found->reason, NoFix::kTooFewMatches);
  EXPECT_THAT(found->message, testing::HasSubstr("size is not known"));
  // A tracker looks at all of the image then.
  RegionTracker tracker(map, PosterOptions());
  for (int frame = 0; frame < 2; ++frame) {
    const auto tracked = *tracker.Track(grey, Poster().camera);
    ASSERT_TRUE(tracked.has_fix()) << tracked.message;
    EXPECT_EQ(tracked.scope == Scope::kTrack, frame > 0);
    EXPECT_EQ(tracked.num_features, static_cast<int>(ExtractSift(grey, {})->keypoints.size()));
  }
}

TEST(LocalizeExpected, BadImagesAndCamerasAreErrors) {
  const cv::Mat grey = RenderPoster(Poster(), PosterQueryPose());
  EXPECT_EQ(FindExpected(grey.rowRange(0, 100), Poster().camera).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(FindExpected(cv::Mat(240, 320, CV_8UC3), Poster().camera).error().code,
            ErrorCode::kInvalidArgument);
  Camera panorama;
  panorama.model = CameraModel::kEquirectangular;
  panorama.width = 320;
  panorama.height = 160;
  EXPECT_EQ(FindExpected(grey, panorama).error().code, ErrorCode::kUnsupported);
}

Pose OnWay(int frame) { return PoseAt({0.03 * frame, 0.02 * frame, 1.5}, 0.5 * frame); }

TEST(RegionTracker, LooksInAnImageForWhatItExpectsAndInAllOfItWhenLost) {
  RegionTracker tracker(PosterMap(), PosterOptions());
  std::vector<int> num_features;
  for (int frame = 0; frame < 6; ++frame) {
    const auto found = tracker.Track(RenderPoster(Poster(), OnWay(frame)), Poster().camera);
    ASSERT_TRUE(found.ok()) << found.error().message;
    ASSERT_TRUE(found->has_fix()) << frame << ": " << found->message;
    EXPECT_LT(CenterErrorM(found->cam_from_world, OnWay(frame)), 0.03);
    EXPECT_EQ(found->scope == Scope::kTrack, frame > 0) << frame;
    num_features.push_back(found->num_features);
  }
  for (int frame = 1; frame < 6; ++frame) EXPECT_LT(num_features[frame], 0.8 * num_features[0]);
  // Carried to the side, farther than it may move in a frame.
  const Pose elsewhere = PoseAt({0, -1, 1.5}, 0);
  const auto carried = tracker.Track(RenderPoster(Poster(), elsewhere), Poster().camera);
  ASSERT_TRUE(carried->has_fix()) << carried->message;
  EXPECT_LT(CenterErrorM(carried->cam_from_world, elsewhere), 0.03);
  EXPECT_NE(carried->scope, Scope::kTrack);
}

TEST(RegionTracker, LooksForAllFeaturesWhereItIsTold) {
  RegionTrackerOptions options;
  options.features.map_guided = false;
  RegionTracker tracker(PosterMap(), PosterOptions(), options), by_features(PosterMap(), PosterOptions());
  for (int frame = 0; frame < 3; ++frame) {
    const cv::Mat grey = RenderPoster(Poster(), OnWay(frame));
    const auto found = *tracker.Track(grey, Poster().camera);
    const auto expected = *by_features.TrackFeatures(*ExtractSift(grey, {}), Poster().camera);
    EXPECT_EQ(found.num_features, expected.num_features);
    EXPECT_EQ(found.cam_from_world.translation, expected.cam_from_world.translation);
  }
}

TEST(RegionTracker, UsesTheFeaturesThatAFrameHasAlready) {
  const Localizer localizer(PosterMap(), PosterOptions());
  for (const bool is_known : {false, true}) {
    RegionTracker tracker(PosterMap(), PosterOptions());
    ASSERT_TRUE(tracker.Track(RenderPoster(Poster(), OnWay(0)), Poster().camera)->has_fix());
    const cv::Mat grey = RenderPoster(Poster(), OnWay(1));
    QueryFrame frame(localizer, grey, Poster().camera);
    const size_t num_all = ExtractSift(grey, {})->keypoints.size();
    if (is_known) EXPECT_EQ((*frame.WithAllFeatures())->features.keypoints.size(), num_all);
    const auto found = *tracker.TrackFrame(&frame);
    ASSERT_TRUE(found.has_fix());
    EXPECT_EQ(found.scope, Scope::kTrack);
    EXPECT_EQ(found.num_features == static_cast<int>(num_all), is_known);
    EXPECT_EQ(frame.image() == nullptr, is_known);
  }
}

TEST(RegionTracker, BadImagesAreErrorsAndChangeNothing) {
  RegionTracker tracker(PosterMap(), PosterOptions());
  ASSERT_TRUE(tracker.Track(RenderPoster(Poster(), OnWay(0)), Poster().camera)->has_fix());
  const cv::Mat grey = RenderPoster(Poster(), OnWay(1));
  const Pose expected = tracker.Prediction()->cam_from_world;
  EXPECT_EQ(tracker.Track(grey.rowRange(0, 100), Poster().camera).error().code, ErrorCode::kInvalidArgument);
  Camera unknown = Poster().camera;
  unknown.params.clear();
  EXPECT_EQ(tracker.Track(grey, unknown).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(tracker.Prediction()->cam_from_world.translation, expected.translation);
  EXPECT_EQ(tracker.Track(grey, Poster().camera)->scope, Scope::kTrack);
}

}  // namespace
}  // namespace cairn
