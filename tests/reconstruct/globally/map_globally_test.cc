#include "stages/reconstruct/globally/map_globally.h"

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "stages/reconstruct/globally/part_mapper.h"
#include "stages/reconstruct/view_graph/average_rotations.h"
#include "stages/reconstruct/view_graph/view_pairs.h"
#include "tests/reconstruct/synthetic_survey.h"

namespace cairn::reconstruct {
namespace {

Result<std::vector<ColmapModel>> Map(const SyntheticSurvey& survey, int num_threads = 2,
                                     const MapGloballyOptions& options = {},
                                     const std::vector<ImageMotion>& motions = {}) {
  NoProgress progress;
  const auto map = MapGlobally(survey.input, motions, options, num_threads, progress);
  if (!map.ok()) return map.error();
  return map->models;
}

TEST(MapGlobally, FindsAllPosesAndTheFocalLength) {
  const SyntheticSurvey survey = MakeSyntheticSurvey(20, 1);
  const auto models = Map(survey);
  ASSERT_TRUE(models.ok());
  ASSERT_EQ(models->size(), 1u);
  const ColmapModel& model = models->front();
  EXPECT_EQ(model.images.size(), 20u);
  EXPECT_LT(LargestErrorM(model, survey), 0.03);
  EXPECT_NEAR(model.cameras.at(1).FocalX(), 500, 15);
  EXPECT_EQ(model.cameras.at(1).model, CameraModel::kSimpleRadial);
  EXPECT_GT(model.points.size(), 300u);
  for (const ModelPoint& point : model.points) {
    EXPECT_GE(point.track.size(), 2u);
    EXPECT_LT(point.error_px, 2);
    for (const auto& [image_id, keypoint] : point.track)
      EXPECT_EQ(model.images[image_id - 1].keypoints[keypoint].point_id, point.point_id);
  }
}

TEST(MapGlobally, SaysWhetherItIsADrive) {
  SyntheticSurvey survey = MakeSyntheticSurvey(20, 1);
  NoProgress progress;
  EXPECT_TRUE(MapGlobally(survey.input, {}, {}, 1, progress)->is_drive);
  // The same images under names in another order.
  for (size_t i = 0; i < 20; ++i) survey.input.images[i].name = fmt::format("image{:02}.jpg", 9 * i % 20);
  const auto shuffled = MapGlobally(survey.input, {}, {}, 1, progress);
  EXPECT_FALSE(shuffled->is_drive);
  EXPECT_EQ(shuffled->models.front().images.size(), 20u);
}

TEST(MapGlobally, CamerasStayWhereTheyAreNotToBeRefined) {
  SyntheticSurvey survey = MakeSyntheticSurvey(15, 1);
  Camera camera = survey.camera;
  camera.camera_id = 1;
  survey.input.cameras[1] = camera;
  const auto models = Map(survey, 2, {.refine_focal_length = false, .refine_distortion = false});
  ASSERT_TRUE(models.ok());
  EXPECT_EQ(models->front().cameras.at(1).params, camera.params);
  EXPECT_EQ(models->front().cameras.at(1).model, CameraModel::kSimplePinhole);
  EXPECT_LT(LargestErrorM(models->front(), survey), 0.03);
}

// Nothing is made of relative poses by a focal length that is an eighth off, but a better one.
TEST(PartMapper, SaysByWhatCameraToBeginAnew) {
  const SyntheticSurvey survey = MakeSyntheticSurvey(20, 1);
  std::map<CameraId, Camera> cameras = {{1, survey.camera}};
  cameras[1].has_focal_prior = false;
  cameras[1].params[0] = 560;
  std::vector<int> images(20), backbone;
  std::vector<Eigen::Quaterniond> rotations;
  for (int i = 0; i < 20; ++i) {
    images[i] = i;
    rotations.push_back(survey.cams_from_world[i].rotation);
  }
  NoProgress progress;
  const std::vector<ViewPair> pairs = EstimateViewPairs(survey.input, cameras, {}, 2, progress);
  for (size_t p = 0; p < pairs.size(); ++p) backbone.push_back(static_cast<int>(p));
  const MapGloballyOptions options;
  PartMapper mapper(survey.input, cameras, options, 2, images, pairs, {}, backbone, true);
  EXPECT_FALSE(mapper.Map(rotations, 0.01, progress).has_value());
  EXPECT_LT(std::abs(mapper.Cameras().at(1).MeanFocal() - 500), 45);
  PartMapper patient(survey.input, cameras, options, 2, images, pairs, {}, backbone, true);
  const auto model = patient.Map(rotations, 0.2, progress);
  ASSERT_TRUE(model.has_value());
  EXPECT_EQ(model->images.size(), 20u);
}

// What a user sees meanwhile, and Ctrl-C.
class KeptProgress : public Progress {
 public:
  explicit KeptProgress(int64_t num_until_cancelled = -1) : num_left_(num_until_cancelled) {}
  void Begin(std::string_view task, int64_t total, std::string_view unit) override {
    tasks.push_back(fmt::format("{}: {}", task, unit));
    totals.push_back(total);
    done.push_back(0);
    num_calls.push_back(0);
  }
  void Advance(int64_t num_items) override {
    const std::lock_guard lock(mutex_);
    done.back() += num_items;
    ++num_calls.back();
    if (num_left_ > 0) --num_left_;
  }
  void End() override { ++num_ended; }
  bool Cancelled() const override {
    const std::lock_guard lock(mutex_);
    return num_left_ == 0;
  }

  std::vector<std::string> tasks;
  std::vector<int64_t> totals, done, num_calls;
  int num_ended = 0;

 private:
  mutable std::mutex mutex_;
  int64_t num_left_;  // -1: never
};

TEST(MapGlobally, TellsHowManyImagesAreJoinedAndEveryStepOfTheSolvers) {
  const SyntheticSurvey survey = MakeSyntheticSurvey(20, 1);
  KeptProgress progress;
  ASSERT_TRUE(MapGlobally(survey.input, {}, {}, 2, progress).ok());
  ASSERT_GE(progress.tasks.size(), 2u);
  EXPECT_EQ(progress.tasks[0], "relative poses: pairs");
  EXPECT_EQ(progress.totals[0], static_cast<int64_t>(survey.input.geometries.size()));
  EXPECT_EQ(progress.tasks.back(), "20 of 20 images joined, finding their places: steps");
  EXPECT_EQ(progress.done.back(), progress.totals.back());
  EXPECT_EQ(progress.done[0], progress.totals[0]);
  EXPECT_GT(progress.num_calls.back(), 10);  // more than one a round
}

TEST(MapGlobally, StopsWithinAStep) {
  const SyntheticSurvey survey = MakeSyntheticSurvey(20, 1);
  const auto num_pairs = static_cast<int64_t>(survey.input.geometries.size());
  for (const int64_t num_until_cancelled : {int64_t{1}, num_pairs, num_pairs + 1, num_pairs + 5}) {
    KeptProgress progress(num_until_cancelled);
    const auto map = MapGlobally(survey.input, {}, {}, 1, progress);
    ASSERT_FALSE(map.ok());
    EXPECT_EQ(map.error().code, ErrorCode::kCancelled);
    // No iteration more: what is left of the solver's is a call of its own.
    int64_t num_calls = 0;
    for (const int64_t num : progress.num_calls) num_calls += num;
    EXPECT_LE(num_calls, num_until_cancelled + 1);
  }
}

// One that is stated as such, and wrong, is begun anew with until it is found.
TEST(MapGlobally, FindsAFocalLengthThatIsStatedWrongly) {
  SyntheticSurvey survey = MakeSyntheticSurvey(20, 1);
  survey.input.cameras[1] = survey.camera;
  survey.input.cameras[1].camera_id = 1;
  survey.input.cameras[1].has_focal_prior = true;
  survey.input.cameras[1].params[0] = 550;
  const auto models = Map(survey);
  ASSERT_TRUE(models.ok());
  EXPECT_EQ(models->front().images.size(), 20u);
  EXPECT_NEAR(models->front().cameras.at(1).FocalX(), 500, 10);
  EXPECT_LT(LargestErrorM(models->front(), survey), 0.05);
}

TEST(MapGlobally, PartsThatNothingJoinsAreModelsOfTheirOwn) {
  SyntheticSurvey survey = MakeSyntheticSurvey(8, 1, "a");
  AppendSurvey(MakeSyntheticSurvey(12, 2, "b", 100), &survey);
  const auto models = Map(survey);
  ASSERT_TRUE(models.ok());
  ASSERT_EQ(models->size(), 2u);
  EXPECT_EQ(models->at(0).images.size(), 12u);
  EXPECT_EQ(models->at(1).images.size(), 8u);
  EXPECT_EQ(models->at(0).images[0].name, "b00.jpg");
}

std::vector<ImageMotion> TrueMotions(const SyntheticSurvey& survey) {
  std::vector<ImageMotion> motions;
  for (int i = 1; i < static_cast<int>(survey.cams_from_world.size()); ++i)
    motions.push_back({i - 1, i, survey.cams_from_world[i] * survey.cams_from_world[i - 1].Inverse()});
  return motions;
}

double WayOf(const ColmapModel& model, size_t from, size_t to) {
  return CenterErrorM(model.images[from].cam_from_world, model.images[to].cam_from_world);
}

TEST(MapGlobally, MotionsJoinWhatNothingElseDoesAndGiveTheScale) {
  SyntheticSurvey survey = MakeSyntheticSurvey(8, 1, "a");
  AppendSurvey(MakeSyntheticSurvey(12, 2, "b", 100), &survey);
  std::vector<ImageMotion> motions = TrueMotions(survey);
  for (ImageMotion& motion : motions) motion.cam2_from_cam1.translation *= 1.5;  // wheels that are too small
  const auto models = Map(survey, 2, {}, motions);
  ASSERT_TRUE(models.ok());
  ASSERT_EQ(models->size(), 1u);
  const ColmapModel& model = models->front();
  EXPECT_EQ(model.images.size(), 20u);
  EXPECT_LT(LargestErrorM(model, survey), 0.25);  // 13 m are from the one to the other
  EXPECT_NEAR(WayOf(model, 0, 7) / CenterErrorM(survey.cams_from_world[0], survey.cams_from_world[7]), 1.5,
              0.03);
}

TEST(MapGlobally, MotionsOfAnotherFrameHaveNoSay) {
  const SyntheticSurvey survey = MakeSyntheticSurvey(15, 1);
  std::vector<ImageMotion> motions = TrueMotions(survey);
  for (ImageMotion& motion : motions)
    motion.cam2_from_cam1 = {Eigen::Quaterniond::Identity(), {0, 0, -motion.Way().norm()}};
  NoProgress progress;
  const auto map = MapGlobally(survey.input, motions, {}, 2, progress);
  ASSERT_TRUE(map.ok());
  EXPECT_NE(map->why_no_odometry, "");
  EXPECT_LT(LargestErrorM(map->models.front(), survey), 0.03);
  EXPECT_EQ(MapGlobally(survey.input, TrueMotions(survey), {}, 2, progress)->why_no_odometry, "");
}

TEST(MapGlobally, SameModelForAnyNumberOfThreads) {
  const SyntheticSurvey survey = MakeSyntheticSurvey(12, 3);
  const auto one = Map(survey, 1), seven = Map(survey, 7);
  ASSERT_TRUE(one.ok() && seven.ok());
  ASSERT_EQ(one->front().images.size(), seven->front().images.size());
  for (size_t i = 0; i < one->front().images.size(); ++i) {
    const Pose &a = one->front().images[i].cam_from_world, &b = seven->front().images[i].cam_from_world;
    EXPECT_EQ(a.translation, b.translation);
    EXPECT_EQ(a.rotation.coeffs(), b.rotation.coeffs());
  }
  EXPECT_EQ(one->front().cameras.at(1).params, seven->front().cameras.at(1).params);
}

// Four images of one place match four of another, as they would where both bear the same poster.
SyntheticSurvey MakeLookAlikes() {
  SyntheticSurvey survey = MakeSyntheticSurvey(30, 6);
  for (int i = 0; i < 4; ++i) {
    for (int j = 25; j < 29; ++j) {
      // A third of what neighbours share, exact for the pose that the two would have if the places were one.
      const TwoViewGeometry& near =
          survey.input.geometries[5 * i + j - 25 == i ? 5 * i : 5 * i + std::abs(j - 25 - i) - 1];
      TwoViewGeometry geometry = near;
      geometry.image_id1 = static_cast<ImageId>(i + 1);
      geometry.image_id2 = static_cast<ImageId>(j + 1);
      geometry.inliers.clear();
      for (const Match& match : near.inliers) {
        if (match.idx1 % 3 == 0 && match.idx2 < survey.input.keypoints[j].size())
          geometry.inliers.push_back(match);
      }
      // The second image shows there what a neighbour of the first shows.
      for (const Match& match : geometry.inliers)
        survey.input.keypoints[j][match.idx2] = survey.input.keypoints[near.image_id2 - 1][match.idx2];
      survey.input.geometries.push_back(geometry);
    }
  }
  return survey;
}

TEST(MapGlobally, LookAlikesDoNotBendTheMap) {
  const SyntheticSurvey survey = MakeLookAlikes();
  const auto models = Map(survey);
  ASSERT_TRUE(models.ok());
  EXPECT_GE(models->front().images.size(), 26u);
  EXPECT_LT(LargestErrorM(models->front(), survey), 0.1);
}

// Pairs that nothing bears out, each of another relative pose, as strong as the right ones.
TEST(MapGlobally, InNoOrderPairsThatNoTriangleBearsOutDoNotBendTheMap) {
  SyntheticSurvey survey = MakeSyntheticSurvey(30, 6);
  const size_t num_right = survey.input.geometries.size();
  for (int i = 0; i < 30; ++i) {
    for (int j = i + 6 + i % 3; j < 30; j += 4) {
      TwoViewGeometry geometry = survey.input.geometries[(17 * i + 5 * j) % num_right];
      const ImageId from = geometry.image_id1, to = geometry.image_id2;
      geometry.image_id1 = static_cast<ImageId>(i + 1);
      geometry.image_id2 = static_cast<ImageId>(j + 1);
      const size_t first1 = survey.input.keypoints[i].size(), first2 = survey.input.keypoints[j].size();
      std::vector<Match> matches;
      for (const Match& match : geometry.inliers) {
        matches.push_back({static_cast<KeypointIdx>(first1 + matches.size()),
                           static_cast<KeypointIdx>(first2 + matches.size())});
        survey.input.keypoints[i].push_back(survey.input.keypoints[from - 1][match.idx1]);
        survey.input.keypoints[j].push_back(survey.input.keypoints[to - 1][match.idx2]);
      }
      geometry.inliers = matches;
      survey.input.geometries.push_back(geometry);
    }
  }
  for (size_t i = 0; i < 30; ++i) survey.input.images[i].name = fmt::format("image{:02}.jpg", 7 * i % 30);
  const auto models = Map(survey);
  ASSERT_TRUE(models.ok());
  EXPECT_EQ(models->front().images.size(), 30u);
  EXPECT_LT(LargestErrorM(models->front(), survey), 0.1);
}

// Images 20 to 29 hang on a poster near images 0 to 5 that hangs before them, too: at first they are mapped
// before that one, and what images 15 to 24 share says otherwise.
class MisplacedPartOfAMap : public testing::Test {
 protected:
  static constexpr int kNumImages = 30, kFirstMisplaced = 20;

  // `elsewhere`: poses of images as far as they are told from the poster.
  void SetUp() override {
    const Pose move = survey.cams_from_world[26].Inverse() * survey.cams_from_world[4];
    elsewhere = survey.cams_from_world;
    for (int i = kFirstMisplaced; i < kNumImages; ++i) elsewhere[i] = elsewhere[i] * move;
    std::vector<Eigen::Vector3d> poster;
    for (const Eigen::Vector3d& point : survey.points) {
      if (std::abs(point.x()) < 1 && std::abs(point.y()) < 1) poster.push_back(point);
    }
    std::vector<size_t> num_before;
    for (int i = 0; i < kNumImages; ++i) {
      num_before.push_back(survey.input.keypoints[i].size());
      for (const Eigen::Vector3d& point : poster) {
        const auto pixel = ImageFromCamera(survey.camera, elsewhere[i] * point);
        survey.input.keypoints[i].push_back({.x = static_cast<float>(pixel->x()),
                                             .y = static_cast<float>(pixel->y()),
                                             .scale = 2,
                                             .orientation = 0});
      }
    }
    for (int i = 0; i < 6; ++i) {
      for (int j = 26; j < kNumImages; ++j) {
        TwoViewGeometry geometry{.image_id1 = static_cast<ImageId>(i + 1),
                                 .image_id2 = static_cast<ImageId>(j + 1),
                                 .config = TwoViewConfig::kUncalibrated};
        for (size_t k = 0; k < poster.size(); ++k)
          geometry.inliers.push_back(
              {static_cast<KeypointIdx>(num_before[i] + k), static_cast<KeypointIdx>(num_before[j] + k)});
        survey.input.geometries.push_back(geometry);
      }
    }
  }

  std::optional<ColmapModel> Map(const std::vector<ImageMotion>& motions, bool is_drive) const {
    const std::map<CameraId, Camera> cameras = {{1, survey.camera}};
    std::vector<int> images(kNumImages), backbone;
    std::vector<Eigen::Quaterniond> rotations;
    for (int i = 0; i < kNumImages; ++i) {
      images[i] = i;
      rotations.push_back(elsewhere[i].rotation);
    }
    NoProgress progress;
    const std::vector<ViewPair> pairs = EstimateViewPairs(survey.input, cameras, {}, 2, progress);
    for (size_t p = 0; p < pairs.size(); ++p) {
      if (RotationErrorDeg(pairs[p], rotations) < 3) backbone.push_back(static_cast<int>(p));
    }
    EXPECT_LT(backbone.size(), pairs.size() - 10);
    const MapGloballyOptions options;
    PartMapper mapper(survey.input, cameras, options, 2, images, pairs, motions, backbone, is_drive);
    return mapper.Map(rotations, 1, progress);
  }

  SyntheticSurvey survey = MakeSyntheticSurvey(kNumImages, 6);
  std::vector<Pose> elsewhere;
};

class MisplacedPartInOrderOrNot : public MisplacedPartOfAMap, public testing::WithParamInterface<bool> {};

INSTANTIATE_TEST_SUITE_P(InOrderOrNot, MisplacedPartInOrderOrNot, testing::Bool());

TEST_P(MisplacedPartInOrderOrNot, IsMovedToWhereMostOfSpaceIsShared) {
  const auto model = Map({}, GetParam());
  ASSERT_TRUE(model.has_value());
  EXPECT_EQ(model->images.size(), 30u);
  EXPECT_LT(LargestErrorM(*model, survey), 0.05);
}

// Wheels that say as the poster does are believed.
TEST_F(MisplacedPartOfAMap, OfADriveStaysWhereOdometryHasIt) {
  std::vector<ImageMotion> motions;
  for (int i = 1; i < kNumImages; ++i)
    motions.push_back({i - 1, i, elsewhere[i] * elsewhere[i - 1].Inverse()});
  const auto model = Map(motions, true);
  ASSERT_TRUE(model.has_value());
  EXPECT_GT(LargestErrorM(*model, survey), 5);
}

// Two surveys, joined by one pair of hardly a match: two models, not one with half of it anywhere.
TEST(MapGlobally, PartsThatNextToNothingJoinsAreModelsOfTheirOwn) {
  SyntheticSurvey survey = MakeSyntheticSurvey(12, 1, "a");
  AppendSurvey(MakeSyntheticSurvey(14, 2, "b", 100), &survey);
  TwoViewGeometry weak{.image_id1 = 5, .image_id2 = 102, .config = TwoViewConfig::kUncalibrated};
  // What image 4 of the one sees is what image 2 of the other does, of sixteen of its keypoints.
  for (const Match& match : survey.input.geometries[4].inliers) {
    const auto first = static_cast<KeypointIdx>(survey.input.keypoints[4].size()),
               second = static_cast<KeypointIdx>(survey.input.keypoints[14].size());
    if (weak.inliers.size() == 16) break;
    survey.input.keypoints[4].push_back(survey.input.keypoints[0][match.idx1]);
    survey.input.keypoints[14].push_back(survey.input.keypoints[5][match.idx2]);
    weak.inliers.push_back({first, second});
  }
  survey.input.geometries.push_back(weak);
  for (size_t i = 0; i < 26; ++i) survey.input.images[i].name = fmt::format("image{:02}.jpg", 7 * i % 26);
  const auto models = Map(survey);
  ASSERT_TRUE(models.ok());
  ASSERT_EQ(models->size(), 2u);
  EXPECT_EQ(models->at(0).images.size(), 14u);
  EXPECT_EQ(models->at(1).images.size(), 12u);
}

TEST(MapGlobally, NothingToJoinIsAnError) {
  SyntheticSurvey survey = MakeSyntheticSurvey(5, 1);
  survey.input.geometries.clear();
  const auto models = Map(survey);
  ASSERT_FALSE(models.ok());
  EXPECT_EQ(models.error().code, ErrorCode::kNoData);
  EXPECT_NE(models.error().message.find("5 images"), std::string::npos) << models.error().message;
}

}  // namespace
}  // namespace cairn::reconstruct
