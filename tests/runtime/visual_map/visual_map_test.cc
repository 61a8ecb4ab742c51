#include "runtime/visual_map/visual_map.h"

#include <gtest/gtest.h>

#include "core/base/quantiles.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/map.h"
#include "runtime/visual_map/visual_estimate.h"
#include "runtime/visual_map/visual_filter.h"
#include "runtime/visual_map/visual_search.h"
#include "stages/emit_map/learn_visual_errors.h"
#include "stages/emit_map/model_landmarks.h"
#include "tests/runtime/visual_map/surveyed_room.h"

namespace cairn {
namespace {

double ErrorM(const VisualPose& pose, const Eigen::Vector2d& truth) { return (pose.position - truth).norm(); }

void ExpectWide(const VisualPose& pose) {
  // As wide as the survey, which is 2 x 1.5 m.
  EXPECT_GT(std::sqrt(pose.covariance(0, 0)), 0.5);
  EXPECT_GT(std::sqrt(pose.covariance(1, 1)), 0.4);
  EXPECT_GT(std::sqrt(pose.covariance(2, 2)), 1);
  EXPECT_GT(pose.entropy, 1.5);
}

TEST(ModelLandmarks, LearnsHowFarATurnMovesTheImage) {
  EXPECT_NEAR(Clean().room.rows.visual_map.focal_px, VisualRoom::kFocalPx, 1);
  const Surveyed noisy(1.0);
  EXPECT_NEAR(noisy.room.rows.visual_map.focal_px, VisualRoom::kFocalPx, 5);
}

TEST(ModelLandmarks, KnowsTheSurveysHeadingsAndStoresFewSights) {
  const VisualMapData& data = Clean().room.rows.visual_map;
  EXPECT_EQ(data.headings_deg, (std::vector<double>{0, 90, 180, 270}));
  for (const std::vector<HeadingModel>& models : data.landmarks) {
    size_t num_sights = 0;
    for (const HeadingModel& model : models) num_sights += model.sights.size();
    EXPECT_LE(num_sights, 96u + 3u);
  }
}

TEST(ModelLandmarks, SameForAnyNumberOfThreads) {
  const VisualRoom room;
  const VisualMapData one = *emit_map::ModelLandmarks(room.classes, room.rows, {}, 1);
  const VisualMapData three = *emit_map::ModelLandmarks(room.classes, room.rows, {}, 3);
  ASSERT_EQ(one.landmarks.size(), three.landmarks.size());
  for (size_t i = 0; i < one.landmarks.size(); ++i) {
    ASSERT_EQ(one.landmarks[i].size(), three.landmarks[i].size());
    for (size_t k = 0; k < one.landmarks[i].size(); ++k) {
      EXPECT_EQ(one.landmarks[i][k].sights, three.landmarks[i][k].sights);
      EXPECT_EQ(one.landmarks[i][k].sigma, three.landmarks[i][k].sigma);
    }
  }
}

TEST(ModelLandmarks, LevelsWhatTiltedCamerasSaw) {
  // Pitched by 5 degrees, 28 px: without, no model would predict to less.
  const Surveyed tilted(0, {.tilt_rad = RadFromDeg(5)});
  const VisualMapData& data = tilted.room.rows.visual_map;
  EXPECT_NEAR(data.focal_px, VisualRoom::kFocalPx, 2);
  EXPECT_NEAR(DegFromRad(data.errors.tilt_rad), 5 / std::sqrt(2.0), 0.5);
  std::vector<double> errors_px;
  for (const std::vector<HeadingModel>& models : data.landmarks) {
    for (const HeadingModel& model : models) errors_px.push_back(model.sigma.head<2>().norm());
  }
  EXPECT_LT(UpperMedian(errors_px), 3);
  EXPECT_NEAR(Clean().room.rows.visual_map.errors.tilt_rad, 0, 1e-6);
}

TEST(ModelLandmarks, LevelsTheHeightsOfACarriedSurvey) {
  // 0.1 m at 2 m are 16 px: without, no model would predict to less.
  const Surveyed carried(0, {.height_m = 0.1});
  std::vector<double> errors_px;
  for (const std::vector<HeadingModel>& models : carried.room.rows.visual_map.landmarks) {
    for (const HeadingModel& model : models) errors_px.push_back(model.sigma.head<2>().norm());
  }
  EXPECT_LT(UpperMedian(errors_px), 3);
  EXPECT_NEAR(carried.visual->height_sigma_m(), 0.1, 0.02);
  EXPECT_NEAR(Clean().visual->height_sigma_m(), 0, 1e-9);
}

TEST(LearnVisualErrors, SmallOnALatticeAndTheSameForAnyNumberOfThreads) {
  const VisualRoom& room = Clean().room;
  const VisualErrors& errors = room.rows.visual_map.errors;
  EXPECT_LT(errors.shared_m, 0.05);
  EXPECT_LT(DegFromRad(errors.shared_rad), 2);
  EXPECT_GT(errors.growth_per_m, 0);
  EXPECT_EQ(*emit_map::LearnVisualErrors(room.classes, room.rows, room.rows.visual_map, 3), errors);
}

TEST(LearnVisualErrors, NothingIsKnownWithoutImagesToTry) {
  // Three landmarks: too few in any image.
  const VisualRoom room(3);
  const auto data = emit_map::ModelLandmarks(room.classes, room.rows, {}, 1);
  ASSERT_TRUE(data.ok());
  const auto errors = emit_map::LearnVisualErrors(room.classes, room.rows, *data, 1);
  ASSERT_TRUE(errors.ok());
  EXPECT_FLOAT_EQ(errors->shared_m, 0.5F * VisualRoom::kSpacingM);
  EXPECT_GT(DegFromRad(errors->shared_rad), 4);
}

TEST(EstimateVisualPose, FindsPlacesBetweenThoseOfTheSurvey) {
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d truth(random.Uniform(1.5, 3.5), random.Uniform(1.25, 2.75));
    const int heading = static_cast<int>(random.UniformInt(0, 3));
    const auto pose = EstimateVisualPose(*Clean().visual, Clean().room.SeenLandmarks(VisualRoom::PoseAt(
                                                              truth, heading * std::numbers::pi / 2)));
    ASSERT_TRUE(pose.ok());
    EXPECT_EQ(pose->flag, VisualFlag::kNone) << pose->message;
    EXPECT_LT(ErrorM(*pose, truth), 0.02);
    EXPECT_LT(AngleBetweenDeg(pose->heading_deg, 90.0 * heading), 0.5);
  }
}

TEST(EstimateVisualPose, FindsHeadingsBetweenAndACameraThatLooksUp) {
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d truth(random.Uniform(1.5, 3.5), random.Uniform(1.25, 2.75));
    const double heading = random.Uniform(0, 2 * std::numbers::pi), up = random.Normal(0, RadFromDeg(2));
    const auto pose = EstimateVisualPose(*Clean().visual,
                                         Clean().room.SeenLandmarks(VisualRoom::PoseAt(truth, heading, up)));
    ASSERT_TRUE(pose.ok());
    EXPECT_EQ(pose->flag, VisualFlag::kNone) << pose->message;
    EXPECT_LT(ErrorM(*pose, truth), 0.06) << DegFromRad(heading);
    EXPECT_LT(AngleBetweenDeg(pose->heading_deg, DegFromRad(heading)), 1.5);
  }
}

TEST(EstimateVisualPose, FindsACameraThatIsHeldHigherOrLower) {
  Random random(6);
  for (const double higher_m : {-0.12, -0.05, 0.05, 0.12}) {
    const Eigen::Vector2d truth(random.Uniform(1.5, 3.5), random.Uniform(1.25, 2.75));
    const auto pose = EstimateVisualPose(
        *Clean().visual, Clean().room.SeenLandmarks(VisualRoom::PoseAt(truth, 0, 0, 1 + higher_m)));
    ASSERT_TRUE(pose.ok());
    EXPECT_EQ(pose->flag, VisualFlag::kNone) << pose->message;
    EXPECT_LT(ErrorM(*pose, truth), 0.02) << higher_m;
    EXPECT_NEAR(pose->higher_m, higher_m, 0.02);
  }
}

TEST(VisualSearch, AMaximumSharperThanThePointsKeepsItsMass) {
  const VisualEstimateOptions options;
  const size_t num_places = Clean().visual->places().size();
  std::vector<double> log_prior(num_places, -std::log(static_cast<double>(num_places)));
  const auto seen = Clean().room.SeenLandmarks(VisualRoom::PoseAt({2.3, 2.1}, 0));
  VisualSearch search(*Clean().visual, seen, options, log_prior);
  search.Run();
  const auto log_mass = [&](int32_t heading) {
    double largest = -std::numeric_limits<double>::infinity(), sum = 0;
    for (const VisualHypothesis& each : search.hypotheses())
      if (each.heading == heading) largest = std::max(largest, each.log_mass);
    for (const VisualHypothesis& each : search.hypotheses())
      if (each.heading == heading) sum += std::exp(each.log_mass - largest);
    return largest + std::log(sum);
  };
  const double before = log_mass(0);
  const size_t num_points = search.hypotheses().size();
  VisualHypothesis point{.place = 0, .heading = 0, .log_mass = before - 1};
  search.AddMissingMass(point, 100);
  EXPECT_EQ(search.hypotheses().size(), num_points);  // the points have more
  point.log_mass = before + 3;
  search.AddMissingMass(point, 100);
  EXPECT_NEAR(log_mass(0), before + 3, 1e-9);
  search.AddMissingMass(point, 100);  // found again
  EXPECT_NEAR(log_mass(0), before + 3, 1e-9);
  log_prior[0] = -std::numeric_limits<double>::infinity();
  point.log_mass = before + 9;
  search.AddMissingMass(point, 100);
  EXPECT_NEAR(log_mass(0), before + 3, 1e-9);  // the prior excludes its place
}

// A map whose own images, left out, were off by this much.
std::shared_ptr<const VisualMap> WithSharedErrors(float shared_m, float shared_rad) {
  VisualMapData data = Clean().room.rows.visual_map;
  data.errors.shared_m = shared_m;
  data.errors.shared_rad = shared_rad;
  VisualSurvey survey{.places = Clean().visual->places(),
                      .width_px = VisualRoom::kWidthPx,
                      .height_px = VisualRoom::kHeightPx};
  for (const MapImage& image : Clean().room.rows.images)
    survey.images.push_back(image.cam_from_world.Center().head<2>());
  return *VisualMap::Make(data, survey);
}

TEST(EstimateVisualPose, SharedErrorsGrowWithTheSquareOfHowCloseLandmarksLie) {
  EXPECT_DOUBLE_EQ(SharedGrowth(0.3), 1);
  EXPECT_DOUBLE_EQ(SharedGrowth(kFullSpreadRatio), 1);
  EXPECT_DOUBLE_EQ(SharedGrowth(kFullSpreadRatio / 2), 4);
  EXPECT_TRUE(std::isfinite(SharedGrowth(0)));
  const auto visual = WithSharedErrors(0.02F, 0.01F);
  auto seen = Clean().room.SeenLandmarks(VisualRoom::PoseAt({2.3, 2.1}, 0));
  const auto all = EstimateVisualPose(*visual, seen);
  ASSERT_TRUE(all.ok());
  ASSERT_GT(all->spread_ratio, kFullSpreadRatio);
  // Those of the image's middle: a seventh of its diagonal apart.
  std::erase_if(seen, [](const SeenLandmark& match) {
    return (match.seen.head<2>() - Eigen::Vector2d(320, 240)).norm() > 150;
  });
  const auto spot = EstimateVisualPose(*visual, seen);
  ASSERT_TRUE(spot.ok());
  ASSERT_EQ(spot->flag, VisualFlag::kNone) << spot->message;
  ASSERT_LT(spot->spread_ratio, 0.15);
  const double growth = SharedGrowth(spot->spread_ratio);
  EXPECT_GE(std::sqrt(spot->covariance(0, 0)), growth * 0.02);
  EXPECT_GE(std::sqrt(spot->covariance(2, 2)), growth * 0.01);
  EXPECT_LT(std::sqrt(all->covariance(0, 0)), 0.03);
}

TEST(EstimateVisualPose, TheErrorOfTheMapsScaleIsInTheCovariance) {
  MapRows rows = Clean().room.rows;
  // The floor frame is the world's, turned by a quarter and 5 m away.
  rows.floor_from_world = {
      Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ())), {5, 0, 0}};
  const auto estimate = [&](double scale_sigma_ratio) {
    rows.frame.scale_sigma_ratio = scale_sigma_ratio;
    rows.frame.scale_centre = {0, 3, 9};
    const auto visual = VisualMap::Open(*Map::FromRows(rows));
    EXPECT_TRUE(visual.ok()) << visual.error().message;
    return *EstimateVisualPose(**visual, Clean().room.SeenLandmarks(VisualRoom::PoseAt({2.3, 2.1}, 0)));
  };
  const VisualPose without = estimate(0), with = estimate(0.1);
  EXPECT_EQ(without.scale_sigma_m, Eigen::Vector2d::Zero());
  const Eigen::Vector2d moved =
      0.1 * (with.position - Eigen::Vector2d(2, 0));  // (0, 3) on the floor: 5 - 3, 0
  EXPECT_TRUE(with.scale_sigma_m.isApprox(moved)) << with.scale_sigma_m;
  const Eigen::Matrix2d added = (with.covariance - without.covariance).topLeftCorner(2, 2);
  EXPECT_TRUE(added.isApprox(moved * moved.transpose(), 1e-6));
  // A filter's belief, where an image shows nothing.
  VisualFilter filter(*VisualMap::Open(*Map::FromRows(rows)));
  const VisualPose blind = *filter.See({});
  ASSERT_NE(blind.flag, VisualFlag::kNone);
  EXPECT_TRUE(blind.scale_sigma_m.isApprox(0.1 * (blind.position - Eigen::Vector2d(2, 0))));
}

TEST(EstimateVisualPose, SurveysUnsureOfTheirOwnImagesNeedMoreAgreeingLandmarks) {
  auto seen = Clean().room.SeenLandmarks(VisualRoom::PoseAt({2.3, 2.1}, 0));
  ASSERT_GT(seen.size(), 20u);
  std::vector<SeenLandmark> few;
  for (size_t i = 0; i < seen.size(); i += seen.size() / 6) few.push_back(seen[i]);
  const auto flag = [&](float shared_m, const std::vector<SeenLandmark>& matches) {
    return EstimateVisualPose(*WithSharedErrors(shared_m, 0), matches)->flag;
  };
  ASSERT_LT(few.size(), 8u);
  EXPECT_EQ(flag(0.2F * VisualRoom::kSpacingM, few), VisualFlag::kNone);
  EXPECT_EQ(flag(0.3F * VisualRoom::kSpacingM, few), VisualFlag::kDisagree);
  EXPECT_EQ(flag(0.3F * VisualRoom::kSpacingM, seen), VisualFlag::kNone);
}

TEST(EstimateVisualPose, HalfOfTheMatchesMayBeWrong) {
  Random random(3);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d truth(random.Uniform(1.5, 3.5), random.Uniform(1.25, 2.75));
    auto seen = Clean().room.SeenLandmarks(VisualRoom::PoseAt(truth, random.Uniform(0, 6)));
    for (size_t k = 0; k < seen.size(); k += 2)
      seen[k].seen = {random.Uniform(0, 640), random.Uniform(0, 480), random.Uniform(0, 4)};
    const auto pose = EstimateVisualPose(*Clean().visual, seen);
    ASSERT_TRUE(pose.ok());
    EXPECT_EQ(pose->flag, VisualFlag::kNone) << pose->message;
    EXPECT_LT(ErrorM(*pose, truth), 0.1);
  }
}

TEST(EstimateVisualPose, PosteriorSumsToOneAndIsSureOfAClearView) {
  const Eigen::Vector2d truth(2.5, 2);
  const auto pose =
      EstimateVisualPose(*Clean().visual, Clean().room.SeenLandmarks(VisualRoom::PoseAt(truth, 0)));
  ASSERT_TRUE(pose.ok());
  double sum = pose->elsewhere;
  for (const double share : pose->at_place) sum += share;
  EXPECT_NEAR(sum, 1, 1e-9);
  EXPECT_LT(pose->entropy, 0.7);
  EXPECT_LT((pose->mean - truth).norm(), 0.1);
  EXPECT_NEAR(PosteriorDivergence(*pose, *pose, 0.1), 0, 1e-12);
  VisualPose other = *pose;
  std::reverse(other.at_place.begin(), other.at_place.end() - 5);
  EXPECT_GT(PosteriorDivergence(other, *pose, 0.1), 0.1);
}

TEST(EstimateVisualPose, WhatThePriorExcludesHasNoProbability) {
  const size_t num_places = Clean().visual->places().size();
  std::vector<double> prior(num_places, 0);
  prior[0] = 0.5;
  prior[1] = 0.5;
  const auto seen = Clean().room.SeenLandmarks(VisualRoom::PoseAt({1.55, 1.25}, 0));
  const auto pose = EstimateVisualPose(*Clean().visual, seen, {}, prior);
  ASSERT_TRUE(pose.ok());
  EXPECT_EQ(pose->at_place[2], 0);
  EXPECT_GT(pose->at_place[0], 0.9);
}

TEST(EstimateVisualPose, FewerThanTwoLandmarksAreFlagged) {
  for (const std::vector<SeenLandmark>& seen :
       {std::vector<SeenLandmark>{}, {{3, {100, 100, 1}}}, {{3, {100, 100, 1}}, {3, {400, 100, 1}}}}) {
    const auto pose = EstimateVisualPose(*Clean().visual, seen);
    ASSERT_TRUE(pose.ok());
    EXPECT_EQ(pose->flag, VisualFlag::kTooFewMatches);
    ExpectWide(*pose);
  }
}

TEST(EstimateVisualPose, LandmarksInOneSpotAreFlagged) {
  std::vector<Eigen::Vector3d> spot;
  for (int i = 0; i < 12; ++i) spot.emplace_back(5, 2 + 0.004 * i, 1 + 0.003 * (i % 4));
  VisualRoom survey(160, 0, spot);
  survey.rows.visual_map = *emit_map::ModelLandmarks(survey.classes, survey.rows, {}, 1);
  const auto map = *Map::FromRows(survey.rows);
  const auto visual = *VisualMap::Load(*map);
  auto seen = survey.SeenLandmarks(VisualRoom::PoseAt({2.3, 2.1}, 0));
  std::erase_if(seen, [](const SeenLandmark& match) { return match.landmark < 160; });
  ASSERT_EQ(seen.size(), 12u);
  const auto pose = EstimateVisualPose(*visual, seen);
  ASSERT_TRUE(pose.ok());
  EXPECT_EQ(pose->flag, VisualFlag::kOneSpot) << pose->message;
  ExpectWide(*pose);
}

TEST(EstimateVisualPose, PosesOutsideOfTheSurveyAreFlagged) {
  for (const Eigen::Vector2d& truth :
       {Eigen::Vector2d(0.6, 2), Eigen::Vector2d(4.3, 2), Eigen::Vector2d(2.5, 3.5)}) {
    for (int heading = 0; heading < 4; ++heading) {
      const auto pose = EstimateVisualPose(*Clean().visual, Clean().room.SeenLandmarks(VisualRoom::PoseAt(
                                                                truth, heading * std::numbers::pi / 2)));
      ASSERT_TRUE(pose.ok());
      EXPECT_NE(pose->flag, VisualFlag::kNone)
          << truth.transpose() << " " << heading << ": " << pose->position.transpose() << ", "
          << pose->num_agreeing << " of " << pose->num_matches;
      ExpectWide(*pose);
    }
  }
}

TEST(EstimateVisualPose, MatchesThatAgreeOnNothingAreFlagged) {
  Random random(4);
  for (int i = 0; i < 20; ++i) {
    std::vector<SeenLandmark> seen;
    for (LandmarkIdx landmark = 0; landmark < 12; ++landmark) {
      seen.push_back({static_cast<LandmarkIdx>(random.UniformInt(0, 159)),
                      {random.Uniform(0, 640), random.Uniform(0, 480), random.Uniform(0, 4)}});
    }
    const auto pose = EstimateVisualPose(*Clean().visual, seen);
    ASSERT_TRUE(pose.ok());
    EXPECT_NE(pose->flag, VisualFlag::kNone);
    ExpectWide(*pose);
  }
}

TEST(EstimateVisualPose, BadInputIsAnError) {
  const VisualMap& visual = *Clean().visual;
  const auto code = [&](const std::vector<SeenLandmark>& seen, const std::vector<double>& prior = {}) {
    const auto pose = EstimateVisualPose(visual, seen, {}, prior);
    return pose.ok() ? static_cast<ErrorCode>(0) : pose.error().code;
  };
  EXPECT_EQ(code({{-1, {1, 1, 1}}}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code({{160, {1, 1, 1}}}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code({{0, {std::nan(""), 1, 1}}}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code({}, {1}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code({}, std::vector<double>(63, 1)), ErrorCode::kInvalidArgument);
  VisualEstimateOptions options;
  options.outlier_ratio = 0;
  EXPECT_FALSE(EstimateVisualPose(visual, {}, options).ok());
}

TEST(VisualMap, MapsWithoutOneSayHowToGetIt) {
  VisualRoom room;
  const auto map = *Map::FromRows(room.rows);
  const auto visual = VisualMap::Load(*map);
  ASSERT_FALSE(visual.ok());
  EXPECT_EQ(visual.error().code, ErrorCode::kNotFound);
  EXPECT_NE(visual.error().message.find("visual_map = true"), std::string::npos);
}

TEST(VisualMap, MatchesByDescriptorsInImagesOfTheSurveysSizeOnly) {
  Features features;
  features.keypoints = {{10, 20, 4, 0}, {30, 40, 2, 0}};
  features.descriptors = Clean().room.rows.descriptors.middleRows(7, 2);
  Camera camera = Clean().room.rows.cameras[0];
  const auto seen = Clean().visual->Match(MakeQuery(features, camera, {}));
  ASSERT_TRUE(seen.ok());
  ASSERT_EQ(seen->size(), 2u);
  EXPECT_EQ((*seen)[0].landmark, 7);
  EXPECT_EQ((*seen)[1].landmark, 8);
  EXPECT_EQ((*seen)[0].seen, Eigen::Vector3d(10, 20, 2));
  camera.width = 320;
  EXPECT_EQ(Clean().visual->Match(MakeQuery(features, camera, {})).error().code, ErrorCode::kUnsupported);
}

}  // namespace
}  // namespace cairn
