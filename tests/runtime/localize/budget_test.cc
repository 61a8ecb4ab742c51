// Answers that may take so much work and no more.
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/work/work_budget.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/refine.h"
#include "runtime/track/region_tracker.h"
#include "tests/runtime/localize/poster_scene.h"
#include "tests/runtime/localize/room_drive.h"

namespace cairn {
namespace {

constexpr double kRounding = 1e-9;  // of ms

const std::vector<double>& Budgets() {  // ms, from nothing to more than all of it takes
  static const std::vector<double> budgets{0.01, 0.2, 0.5, 1, 1.5, 2, 3, 4, 6, 8, 12, 20, 40, 1000};
  return budgets;
}

LocalizerOptions WithBudget(double budget_ms, LocalizerOptions options = {}) {
  options.budget_ms = budget_ms;
  return options;
}

void ExpectSame(const Localization& a, const Localization& b) {
  EXPECT_EQ(a.reason, b.reason);
  EXPECT_EQ(a.message, b.message);
  EXPECT_EQ(a.cam_from_world.Matrix(), b.cam_from_world.Matrix());
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(a.probability, b.probability);
  EXPECT_EQ(a.work_ms, b.work_ms);
}

double SquaredError(const Localization& found, const Pose& truth) {
  const Vector6d error = PerturbationBetween(found.cam_from_world, truth);
  return error.dot(found.covariance.ldlt().solve(error));
}

TEST(Budget, OfFeaturesIsKeptWhateverItIs) {
  const Pose truth = PoseAt({1, 0.5, 1.2}, 20);
  const Features features = RenderFeatures(Room(), truth, {}, 3);
  const Localization any = *Localizer(RoomMap()).LocalizeFeatures(features, Room().camera);
  ASSERT_TRUE(any.has_fix());
  EXPECT_GT(any.work_ms, 0.5);
  int num_fixes = 0, num_over = 0;
  for (const double budget_ms : Budgets()) {
    SCOPED_TRACE(budget_ms);
    const auto localize = [&] {
      return *Localizer(RoomMap(), WithBudget(budget_ms)).LocalizeFeatures(features, Room().camera);
    };
    const Localization found = localize();
    ExpectSame(found, localize());
    EXPECT_LE(found.work_ms, budget_ms + kRounding);
    if (found.has_fix()) {
      ++num_fixes;
      EXPECT_LT(CenterErrorM(found.cam_from_world, truth), 0.05);
      EXPECT_LT(SquaredError(found, truth), 17);  // 99 % of 6 degrees of freedom
    } else {
      ++num_over;
      EXPECT_EQ(found.reason, NoFix::kOverBudget) << found.message;
      EXPECT_THAT(found.message, testing::HasSubstr("budget_ms"));
      EXPECT_THAT(found.message, testing::HasSubstr(found.num_features == 0  ? "features alone"
                                                    : found.num_matches == 0 ? "before landmarks were matched"
                                                                             : "before a fix was sure"));
      EXPECT_LT(budget_ms, any.work_ms);
    }
  }
  EXPECT_GE(num_fixes, 4);
  EXPECT_GE(num_over, 3);
  EXPECT_STREQ(NoFixName(NoFix::kOverBudget), "over_budget");
  Localization all = *Localizer(RoomMap(), WithBudget(1000)).LocalizeFeatures(features, Room().camera);
  ExpectSame(all, any);
}

TEST(Budget, IsOfACoreOfThisSpeed) {
  const Features features = RenderFeatures(Room(), PoseAt({1, 0.5, 1.2}, 20), {}, 3);
  LocalizerOptions fast = WithBudget(2), slow = WithBudget(8);
  fast.core_speed = 2;
  slow.core_speed = 0.5;
  ExpectSame(*Localizer(RoomMap(), fast).LocalizeFeatures(features, Room().camera),
             *Localizer(RoomMap(), slow).LocalizeFeatures(features, Room().camera));
}

// Of all scales where there is room for them; else of the image's own pixels, of coarser and coarser scales.
TEST(Budget, OfAnImageGoesToFewerFeatures) {
  const cv::Mat grey = RenderPoster(Poster(), PosterQueryPose());
  const Camera& camera = Poster().camera;
  const Localizer any(PosterMap(), PosterOptions());
  const Query all = *any.QueryFromImage(grey, camera);
  EXPECT_EQ(all.min_scale_px, 0);
  EXPECT_EQ(all.work->num(Work::kWholePixel), grey.cols * grey.rows);
  EXPECT_EQ(all.work->num(Work::kFeature), std::ssize(all.features.keypoints));
  const double all_ms = all.work->spent_ms();
  std::vector<double> least_scales;
  for (double part = 0.1; part < 4; part *= 1.2) {
    const Localizer localizer(PosterMap(), WithBudget(part * all_ms, PosterOptions()));
    const Query query = *localizer.QueryFromImage(grey, camera);
    EXPECT_LE(query.work->spent_ms(), 0.75 * part * all_ms);
    if (query.features.keypoints.empty()) {
      EXPECT_TRUE(query.had_no_room);
      EXPECT_TRUE(least_scales.empty());
      const Localization none = *Localizer(localizer).Localize(grey, camera);
      EXPECT_EQ(none.reason, NoFix::kOverBudget);
      EXPECT_THAT(none.message, testing::HasSubstr("features alone"));
      continue;
    }
    if (least_scales.empty() || least_scales.back() != query.min_scale_px)
      least_scales.push_back(query.min_scale_px);
  }
  const double coarse_px = CoarseSiftScalePx(grey.size(), PosterOptions().sift);
  EXPECT_THAT(least_scales, testing::ElementsAre(2 * coarse_px, coarse_px, 0.5 * coarse_px, 0));
}

TEST(Budget, OfAnImageIsKeptWhateverItIs) {
  const cv::Mat grey = RenderPoster(Poster(), PosterQueryPose());
  const double any_ms = Localizer(PosterMap(), PosterOptions()).Localize(grey, Poster().camera)->work_ms;
  int num_fixes = 0;
  for (double budget_ms = 0.1 * any_ms; budget_ms < 3 * any_ms; budget_ms *= 1.3) {
    SCOPED_TRACE(budget_ms);
    const Localization found =
        *Localizer(PosterMap(), WithBudget(budget_ms, PosterOptions())).Localize(grey, Poster().camera);
    EXPECT_LE(found.work_ms, budget_ms + kRounding);
    if (!found.has_fix()) continue;
    ++num_fixes;
    EXPECT_LT(CenterErrorM(found.cam_from_world, PosterQueryPose()), 0.05);
  }
  EXPECT_GE(num_fixes, 4);
}

TEST(Budget, LandmarksAreTakenFromTheMapOnce) {
  LocalizerOptions options;
  options.accept.min_num_matches = 100'000;  // no attempt goes further
  const Localizer localizer(RoomMap(), options);
  const Query query =
      *localizer.QueryFromFeatures(RenderFeatures(Room(), PoseAt({1, 0.5, 1.2}, 20), {}, 3), Room().camera);
  std::vector<LandmarkIdx> some(700);
  std::iota(some.begin(), some.end(), 0);
  const Localization none = *localizer.LocalizeAmong(query, Scope::kVotes, some, std::nullopt);
  EXPECT_EQ(none.reason, NoFix::kTooFewMatches);
  EXPECT_GT(none.num_matches, 10);
  EXPECT_EQ(query.work->num(Work::kLandmark), 700);
  EXPECT_EQ(query.work->num(Work::kDescriptorPair), 700 * std::ssize(query.features.keypoints));
}

// Two images that show the same are matched with the same landmarks.
TEST(Budget, LandmarksOfARigAreTakenFromTheMapOnce) {
  LocalizerOptions options;
  options.accept.min_num_matches = 100'000;
  options.fall_back_to_all = false;
  const Localizer localizer(RoomMap(), options);
  const auto num_taken = [&](size_t num_images) {
    const auto work = std::make_shared<WorkBudget>();
    const std::vector<Query> queries(
        num_images, *localizer.QueryFromFeatures(RenderFeatures(Room(), PoseAt({1, 0.5, 1.2}, 20), {}, 3),
                                                 Room().camera, work));
    const Localization none =
        *localizer.LocalizeQuery(Sighting(std::span<const Query>(queries)), std::nullopt);
    EXPECT_EQ(none.reason, NoFix::kTooFewMatches);
    return work->num(Work::kLandmark);
  };
  EXPECT_GT(num_taken(1), 100);
  EXPECT_EQ(num_taken(2), num_taken(1));
}

// Where not all landmarks can be matched, those that are lie evenly among them: the image shows the second
// half alone, and of it as large a part as of all.  They are taken from the map, each.
TEST(Budget, LandmarksAreThinnedEvenly) {
  SyntheticRoom second_half = Room();
  const auto num_all = static_cast<LandmarkIdx>(second_half.points.size());
  for (LandmarkIdx i = 0; i < num_all / 2; ++i) second_half.points[i] = {0, 0, -1000};
  const Features features = RenderFeatures(second_half, PoseAt({0, 0, 1.2}, 20), {.detection_ratio = 1}, 3);
  std::vector<LandmarkIdx> all(num_all);
  std::iota(all.begin(), all.end(), 0);
  const auto localize = [&](double budget_ms) {
    const Localizer localizer(RoomMap(), WithBudget(budget_ms));
    const Query query = *localizer.QueryFromFeatures(features, Room().camera);
    const int num_matches = localizer.LocalizeAmong(query, Scope::kVotes, all, std::nullopt)->num_matches;
    const int64_t num_taken = query.work->num(Work::kLandmark);
    return std::tuple(num_matches, query.work->num(Work::kDescriptorPair) / std::ssize(features.keypoints),
                      num_taken);
  };
  const int num_matches_of_all = std::get<0>(localize(1000));
  ASSERT_GT(num_matches_of_all, 80);
  int num_thinned = 0;
  for (double budget_ms = 0.3; budget_ms < 3; budget_ms *= 1.03) {
    const auto [num_matches, num_matched_with, num_taken] = localize(budget_ms);
    if (num_matches == 0 || num_matched_with == num_all) continue;
    ++num_thinned;
    const double part = static_cast<double>(num_matched_with) / num_all;
    EXPECT_GE(part, 0.5);
    EXPECT_NEAR(static_cast<double>(num_matches) / num_matches_of_all, part, 0.12);
    EXPECT_GE(num_taken, num_matched_with);
  }
  EXPECT_GE(num_thinned, 10);
}

// Matches that agree on nothing take half of what is left when they are there; the rest is for what makes a
// fix sure.
TEST(Budget, FirstPosesTakeHalfAtMost) {
  const Features features = RenderFeatures(Room(), PoseAt({1, 0.5, 1.2}, 20), {.num_swapped_ratio = 1}, 3);
  std::vector<LandmarkIdx> all(Room().points.size());
  std::iota(all.begin(), all.end(), 0);
  constexpr double kBudgetMs = 8;
  const Localizer localizer(RoomMap(), WithBudget(kBudgetMs));
  const Query query = *localizer.QueryFromFeatures(features, Room().camera);
  EXPECT_EQ(localizer.LocalizeAmong(query, Scope::kAll, all, std::nullopt)->reason, NoFix::kOverBudget);
  double of_poses_ms = 0;
  for (const Work work : {Work::kSample, Work::kScore, Work::kRefine})
    of_poses_ms += 1e-9 * static_cast<double>(query.work->num(work) * WorkBudget::PicosecondsOf(work));
  const double after_ms = 1e-9 * static_cast<double>(query.work->num(Work::kMatchPair) *
                                                     WorkBudget::PicosecondsOf(Work::kMatchPair));
  const double left_ms = kBudgetMs - (query.work->spent_ms() - of_poses_ms - after_ms);
  EXPECT_LE(of_poses_ms, 0.5 * left_ms + kRounding);
  EXPECT_GT(of_poses_ms, 0.48 * left_ms);
}

// A frame that finds nothing by what was expected has what is left for another try.
TEST(Budget, OfAFrameIsKeptThroughTheDark) {
  const double frame_ms = [] {
    RegionTracker tracker(RoomMap());
    double most_ms = 0;
    for (int i = 0; i < 6; ++i)
      most_ms = std::max(
          most_ms, tracker.TrackFeatures(RenderFeatures(Room(), OnDrive(i), {}, i), Room().camera)->work_ms);
    return most_ms;
  }();
  for (const double part : {0.3, 0.6, 1.0, 1.5, 3.0}) {
    SCOPED_TRACE(part);
    RegionTracker tracker(RoomMap(), WithBudget(part * frame_ms));
    int num_fixes = 0;
    for (int i = 0; i < 20; ++i) {
      const bool is_dark = i > 8 && i < 12;
      const Features features =
          RenderFeatures(Room(), OnDrive(i), {.detection_ratio = is_dark ? 0.0 : 0.7}, i);
      const Localization found = *tracker.TrackFeatures(features, Room().camera);
      EXPECT_LE(found.work_ms, part * frame_ms + kRounding);
      if (!found.has_fix()) continue;
      ++num_fixes;
      EXPECT_FALSE(is_dark);
      EXPECT_LT(CenterErrorM(found.cam_from_world, OnDrive(i)), 0.05);
    }
    if (part > 1) EXPECT_EQ(num_fixes, 17);
  }
}

TEST(Budget, OfARigIsOfAllItsImages) {
  const Pose truth = PoseAt({1, 0.5, 1.2}, 20);
  const Pose turned{Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(90), Eigen::Vector3d::UnitY())), {}};
  const auto rig = [&] {
    return std::vector<RigFeatures>{{RenderFeatures(Room(), truth, {}, 3), Room().camera, Pose()},
                                    {RenderFeatures(Room(), turned * truth, {}, 4), Room().camera, turned}};
  };
  const Localization any = *Localizer(RoomMap()).LocalizeRigFeatures(rig());
  ASSERT_TRUE(any.has_fix());
  int num_fixes = 0;
  for (const double part : {0.1, 0.4, 0.7, 1.0, 1.5, 2.0, 10.0}) {
    const double budget_ms = part * any.work_ms;
    const Localization found = *Localizer(RoomMap(), WithBudget(budget_ms)).LocalizeRigFeatures(rig());
    EXPECT_LE(found.work_ms, budget_ms + kRounding);
    if (part == 10.0) ExpectSame(found, any);
    if (!found.has_fix()) continue;
    ++num_fixes;
    EXPECT_LT(CenterErrorM(found.cam_from_world, truth), 0.05);
  }
  EXPECT_GE(num_fixes, 3);
}

// No camera takes what the others need.
TEST(Budget, OfARigIsSharedByItsCameras) {
  const cv::Mat grey = RenderPoster(Poster(), PosterQueryPose());
  const std::vector<RigImage> rig(4, {grey, Poster().camera, Pose()});
  const double one_ms = Localizer(PosterMap(), PosterOptions()).Localize(grey, Poster().camera)->work_ms;
  int num_fixes = 0;
  for (const double part : {0.02, 1.0, 2.0, 4.0, 8.0}) {
    const double budget_ms = part * one_ms;
    const Localization found =
        *Localizer(PosterMap(), WithBudget(budget_ms, PosterOptions())).LocalizeRig(rig);
    EXPECT_LE(found.work_ms, budget_ms + kRounding);
    num_fixes += found.has_fix() ? 1 : 0;
    if (part < 1) EXPECT_EQ(found.reason, NoFix::kOverBudget);
  }
  EXPECT_GE(num_fixes, 2);
}

// A log holds against the map what is not there.
TEST(Budget, OfAFrameIsNotThatOfItsLog) {
  const cv::Mat grey = RenderPoster(Poster(), PosterQueryPose());
  const Localizer any(PosterMap(), PosterOptions());
  const size_t num_all = any.QueryFromImage(grey, Poster().camera)->features.keypoints.size();
  const double all_ms = any.QueryFromImage(grey, Poster().camera)->work->spent_ms();
  const Localizer localizer(PosterMap(), WithBudget(0.7 * all_ms, PosterOptions()));
  QueryFrame frame(localizer, grey, Poster().camera);
  const Query* for_answer = *frame.WithAllFeatures();
  const double spent_ms = frame.work()->spent_ms();
  EXPECT_LT(for_answer->features.keypoints.size(), num_all);
  EXPECT_EQ((*frame.WithAllFeaturesForLog())->features.keypoints.size(), num_all);
  EXPECT_EQ(frame.work()->spent_ms(), spent_ms);
  QueryFrame free(any, grey, Poster().camera);
  EXPECT_EQ(*free.WithAllFeaturesForLog(), *free.WithAllFeatures());
}

TEST(Budget, WhatAnAnswerTookIsSaidWithoutAFix) {
  const cv::Mat blank(240, 320, CV_8UC1, cv::Scalar(90));
  for (const double budget_ms : {0.0, 50.0}) {
    const Localization none =
        *Localizer(PosterMap(), WithBudget(budget_ms, PosterOptions())).Localize(blank, Poster().camera);
    EXPECT_EQ(none.reason, NoFix::kTooFewFeatures);
    EXPECT_GT(none.work_ms, 1);
  }
}

TEST(Budget, ThatIsNoneIsNone) {
  const Features features = RenderFeatures(Room(), PoseAt({1, 0.5, 1.2}, 20), {}, 3);
  LocalizerOptions still = WithBudget(100);
  still.core_speed = 0;
  for (const LocalizerOptions& options :
       {WithBudget(-1), WithBudget(std::numeric_limits<double>::quiet_NaN()), still}) {
    const Localization none = *Localizer(RoomMap(), options).LocalizeFeatures(features, Room().camera);
    EXPECT_EQ(none.reason, NoFix::kOverBudget);
    EXPECT_EQ(none.work_ms, 0);
  }
}

TEST(Budget, OptionsAreChecked) {
  LocalizerOptions options = WithBudget(-1);
  EXPECT_FALSE(CheckOptions(DescribeOptions(&options)).ok());
  options = WithBudget(5);
  options.core_speed = 0;
  EXPECT_FALSE(CheckOptions(DescribeOptions(&options)).ok());
}

}  // namespace
}  // namespace cairn
