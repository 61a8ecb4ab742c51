#include "stages/group_classes/group_classes.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/files/database.h"
#include "core/world/dropped_items.h"
#include "tests/group_classes/survey.h"

namespace cairn::group_classes {
namespace {

using testing::HasSubstr;

GroupClassesResult Group(const Survey& survey, const GroupClassesOptions& options = {}, int num_threads = 2) {
  NoProgress progress;
  auto result = GroupClasses(survey.matched, survey.capture, options, num_threads, progress);
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().message);
  return std::move(*result);
}

double MedianPointError(const Survey& survey, const Classes& classes) {
  std::vector<double> errors;
  for (const FeatureClass& c : classes.classes) {
    double least = 1e9;
    for (const Eigen::Vector3d& point : survey.points) least = std::min(least, (point - c.position).norm());
    errors.push_back(least);
  }
  std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
  return errors[errors.size() / 2];
}

TEST(GroupClasses, ExactPosesAndCamerasStayWhatTheyAre) {
  Survey survey = MakeSurvey({});
  // Files have rotations that are one to some digits: normalised anew they would have other bits.
  for (CaptureImage& image : survey.capture.images) image.cam_from_world->rotation.coeffs() *= 1 + 1e-14;
  const GroupClassesResult result = Group(survey);
  EXPECT_EQ(result.findings.pose_gain, 0);
  EXPECT_FALSE(result.findings.has_offset);
  for (const SurveyImage& image : result.classes.images) {
    EXPECT_EQ(image.cam_from_world.translation, image.given_cam_from_world.translation);
    EXPECT_EQ(image.cam_from_world.rotation.coeffs(), image.given_cam_from_world.rotation.coeffs());
  }
  EXPECT_EQ(result.classes.cameras[0].params, survey.matched.cameras.at(1).params);
  EXPECT_TRUE(result.classes.stated_cameras.empty());
  EXPECT_EQ(result.classes.stated_pose_sigma_m, 0);
  EXPECT_GT(result.classes.classes.size(), 200u);
  EXPECT_LT(MedianPointError(survey, result.classes), 0.01);
  EXPECT_LT(result.final_rms_px, 0.6);
}

TEST(GroupClasses, NoisyPosesAreRefinedTowardsTheTruth) {
  const Survey survey = MakeSurvey({.pose_m = 0.01, .pose_deg = 0.25});
  const GroupClassesResult result = Group(survey);
  ASSERT_GT(result.findings.pose_gain, 0);
  EXPECT_LT(result.final_rms_px, 0.8);
  double stated = 0, refined = 0;
  for (size_t i = 0; i < survey.true_poses.size(); ++i) {
    stated += CenterErrorM(result.classes.images[i].given_cam_from_world, survey.true_poses[i]);
    // As the capture would state it: without the offset, which a survey that looks one way pins down badly.
    const Pose in_given_frame =
        result.classes.camera_from_given.Inverse() * result.classes.images[i].cam_from_world;
    refined += CenterErrorM(in_given_frame, survey.true_poses[i]);
  }
  EXPECT_LT(refined, 0.6 * stated);
}

TEST(GroupClasses, ConstantOffsetAndFocalLengthAreFound) {
  SurveyNoise noise{.pose_m = 0.002, .pose_deg = 0.05, .focal_ratio = 1.02};
  noise.offset.translation = Eigen::Vector3d(0.04, -0.01, 0.02);
  noise.offset.rotation = Eigen::AngleAxisd(RadFromDeg(1.5), Eigen::Vector3d(0.6, 0, 0.8));
  const Survey survey = MakeSurvey(noise);
  GroupClassesOptions options;
  options.initial_reprojection_error_px = 30;
  const GroupClassesResult result = Group(survey, options);
  ASSERT_TRUE(result.findings.has_offset);
  EXPECT_LT((result.classes.camera_from_given.translation - noise.offset.translation).norm(), 0.01);
  EXPECT_LT(RotationErrorDeg(result.classes.camera_from_given, noise.offset), 0.2);
  EXPECT_NEAR(result.classes.cameras[0].FocalX(), 510, 3);
  ASSERT_EQ(result.classes.stated_cameras.size(), 1u);
  EXPECT_EQ(result.classes.stated_cameras[0].FocalX(), 500);
}

// The mean of error(a, b, true a, true b) over all pairs of a survey's poses, as stated or as refined.
template <typename Error>
double MeanOverPairs(const Survey& survey, const Classes& classes, bool stated, const Error& error) {
  const auto pose = [&](size_t k) {
    return stated ? classes.images[k].given_cam_from_world : classes.images[k].cam_from_world;
  };
  double sum = 0;
  int count = 0;
  for (size_t i = 0; i < survey.true_poses.size(); ++i) {
    for (size_t j = 0; j < i; ++j, ++count)
      sum += error(pose(i), pose(j), survey.true_poses[i], survey.true_poses[j]);
  }
  return sum / count;
}

// Means of the errors of a survey's poses, without an offset and the world's frame.
double MeanErrorDeg(const Survey& survey, const Classes& classes, bool stated) {
  return MeanOverPairs(survey, classes, stated,
                       [](const Pose& a, const Pose& b, const Pose& true_a, const Pose& true_b) {
                         return RotationErrorDeg(a * b.Inverse(), true_a * true_b.Inverse());
                       });
}

// Of distances between cameras, root mean square.
double DistanceErrorM(const Survey& survey, const Classes& classes, bool stated) {
  return std::sqrt(MeanOverPairs(survey, classes, stated,
                                 [](const Pose& a, const Pose& b, const Pose& true_a, const Pose& true_b) {
                                   return std::pow(CenterErrorM(a, b) - CenterErrorM(true_a, true_b), 2);
                                 }));
}

TEST(GroupClasses, DriftIsFoundAndStraightened) {
  const Survey survey = MakeSurvey({.walk_m = 0.01, .walk_deg = 0.4});
  const GroupClassesResult result = Group(survey);
  ASSERT_GT(result.findings.pose_gain, 0);
  EXPECT_GT(result.findings.noise.walk_deg, 3 * result.findings.noise.own_deg);
  EXPECT_LT(MeanErrorDeg(survey, result.classes, false), 0.2 * MeanErrorDeg(survey, result.classes, true));
}

TEST(GroupClasses, DriftIsStraightenedInPartsToo) {
  const Survey survey = MakeSurvey({.walk_m = 0.01, .walk_deg = 0.4});
  GroupClassesOptions options;
  options.adjustment.num_images_at_once = 20;  // of 24
  const Classes in_parts = Group(survey, options).classes, at_once = Group(survey).classes;
  EXPECT_LT(MeanErrorDeg(survey, in_parts, false), 0.2 * MeanErrorDeg(survey, in_parts, true));
  // Both end at the same optimum, not at the same bits.
  double largest_m = 0;
  for (size_t i = 0; i < at_once.images.size(); ++i) {
    largest_m = std::max(largest_m,
                         CenterErrorM(in_parts.images[i].cam_from_world, at_once.images[i].cam_from_world));
  }
  EXPECT_LT(largest_m, 2e-3);
  EXPECT_GT(largest_m, 0);
  // One thread or three.
  const Classes again = Group(survey, options, 1).classes, thrice = Group(survey, options, 3).classes;
  for (size_t i = 0; i < again.images.size(); ++i) {
    EXPECT_EQ(again.images[i].cam_from_world.translation, in_parts.images[i].cam_from_world.translation);
    EXPECT_EQ(thrice.images[i].cam_from_world.translation, in_parts.images[i].cam_from_world.translation);
  }
}

// What was straightened in parts is nearly right, but joints and far points are not: two steps straighten
// the whole, as points follow them.  Where they do not, these steps leave 3.4 of 4 degrees.
TEST(GroupClasses, PointsFollowTheStepsOfAWholeThatWasInParts) {
  const Survey survey = MakeSurvey({.walk_m = 0.025, .walk_deg = 1});
  GroupClassesOptions options;
  options.adjustment.num_images_at_once = 10;
  options.adjustment.max_num_iterations = 2;
  const Classes classes = Group(survey, options).classes;
  EXPECT_LT(MeanErrorDeg(survey, classes, false), 0.1 * MeanErrorDeg(survey, classes, true));
}

// Two blocks of twelve images turn as right as all 24 together.  What their size is beside each other they
// know from five images only.
TEST(GroupClasses, DriftIsStraightenedBlockByBlock) {
  const Survey survey = MakeSurvey({.walk_m = 0.01, .walk_deg = 0.4});
  GroupClassesOptions options;
  options.adjustment.num_images_at_once = 20;
  const Classes together = Group(survey, options).classes;
  options.adjustment.num_images_together = 12;
  const Classes in_blocks = Group(survey, options).classes;
  EXPECT_LT(MeanErrorDeg(survey, in_blocks, false), 0.1 * MeanErrorDeg(survey, in_blocks, true));
  EXPECT_LT(MeanErrorDeg(survey, in_blocks, false), 1.3 * MeanErrorDeg(survey, together, false));
  EXPECT_NE(MeanErrorDeg(survey, in_blocks, false), MeanErrorDeg(survey, together, false));
  EXPECT_LT(DistanceErrorM(survey, in_blocks, false), 0.9 * DistanceErrorM(survey, in_blocks, true));
  // One thread or three.
  const Classes again = Group(survey, options, 1).classes, thrice = Group(survey, options, 3).classes;
  for (size_t i = 0; i < again.images.size(); ++i) {
    EXPECT_EQ(again.images[i].cam_from_world.translation, in_blocks.images[i].cam_from_world.translation);
    EXPECT_EQ(thrice.images[i].cam_from_world.translation, in_blocks.images[i].cam_from_world.translation);
  }
}

// Where nothing was straightened in parts before, the second run is right only as it moves along with the
// first one.
TEST(GroupClasses, WhatFollowsARunOfABlockMovesAlong) {
  const Survey survey = MakeSurvey({.walk_m = 0.025, .walk_deg = 1});
  GroupClassesOptions options;
  options.adjustment.num_images_together = 12;
  const Classes in_blocks = Group(survey, options).classes;
  EXPECT_LT(MeanErrorDeg(survey, in_blocks, false), 0.1 * MeanErrorDeg(survey, in_blocks, true));
}

TEST(GroupClasses, OffsetAndFocalLengthAreThoseOfAllBlocks) {
  SurveyNoise noise{.pose_m = 0.002, .pose_deg = 0.05, .focal_ratio = 1.02};
  noise.offset.translation = Eigen::Vector3d(0.04, -0.01, 0.02);
  noise.offset.rotation = Eigen::AngleAxisd(RadFromDeg(1.5), Eigen::Vector3d(0.6, 0, 0.8));
  const Survey survey = MakeSurvey(noise);
  GroupClassesOptions options;
  options.initial_reprojection_error_px = 30;
  options.adjustment.num_images_learnt = 10;  // of 24
  const GroupClassesResult together = Group(survey, options);
  options.adjustment.num_images_together = 10;
  const GroupClassesResult in_blocks = Group(survey, options);
  ASSERT_TRUE(in_blocks.findings.has_offset);
  ASSERT_GT(in_blocks.findings.pose_gain, 0);
  const Pose& offset = in_blocks.classes.camera_from_given;
  EXPECT_LT((offset.translation - noise.offset.translation).norm(), 0.01);
  EXPECT_LT(RotationErrorDeg(offset, noise.offset), 0.2);
  EXPECT_NE(offset.translation, in_blocks.findings.camera_from_given.translation);  // as learnt from a few
  const double focal_px = in_blocks.classes.cameras[0].FocalX();
  EXPECT_NEAR(focal_px, 510, 3);
  EXPECT_NEAR(focal_px, together.classes.cameras[0].FocalX(), 1.5);
  EXPECT_NE(focal_px, in_blocks.findings.cameras[0].camera.FocalX());
}

TEST(GroupClasses, LensThatNobodyStatedIsFound) {
  const Survey survey = MakeSurvey({.k1 = -0.12});
  GroupClassesOptions options;
  options.initial_reprojection_error_px = 30;
  const GroupClassesResult result = Group(survey, options);
  ASSERT_EQ(result.findings.cameras.size(), 1u);
  const Camera& camera = result.classes.cameras[0];
  ASSERT_EQ(camera.model, CameraModel::kSimpleRadial) << result.findings.cameras[0].variant;
  EXPECT_NEAR(camera.params[3], -0.12, 0.01);
  EXPECT_EQ(result.findings.pose_gain, 0);
  options.adjustment.refine_cameras = false;
  EXPECT_TRUE(Group(survey, options).classes.stated_cameras.empty());
}

TEST(GroupClasses, SameResultForAnyNumberOfThreads) {
  const Survey survey = MakeSurvey({.pose_m = 0.01, .pose_deg = 0.2});
  const std::string path1 = testing::TempDir() + "/classes1.db", path2 = testing::TempDir() + "/classes2.db";
  ASSERT_TRUE(WriteClasses(Group(survey, {}, 1).classes, path1).ok());
  ASSERT_TRUE(WriteClasses(Group(survey, {}, 3).classes, path2).ok());
  EXPECT_EQ(*HashFile(path1), *HashFile(path2));
}

TEST(GroupClasses, ClassesReadBackAsTheyWereWritten) {
  const Classes written = Group(MakeSurvey({})).classes;
  const std::string path = testing::TempDir() + "/classes_roundtrip.db",
                    again = testing::TempDir() + "/classes_again.db";
  ASSERT_TRUE(WriteClasses(written, path).ok());
  const auto read = ReadClasses(path);
  ASSERT_TRUE(read.ok()) << read.error().message;
  ASSERT_TRUE(WriteClasses(*read, again).ok());
  EXPECT_EQ(*HashFile(path), *HashFile(again));
  EXPECT_EQ(read->classes.size(), written.classes.size());
  EXPECT_EQ(read->dropped, written.dropped);
}

TEST(GroupClasses, WhatTheLastSessionMissesIsGoneAndSaidOfEachClass) {
  std::set<int> gone;
  const Survey survey = SurveyOfTwoSessions(&gone);
  NoProgress progress;
  GroupClassesOptions options;
  const auto grouped =
      GroupClasses(survey.matched, survey.capture, options, 2, progress, nullptr, {"a", "b"});
  ASSERT_TRUE(grouped.ok()) << grouped.error().message;
  const Classes& classes = grouped->classes;
  EXPECT_EQ(classes.sessions, (std::vector<std::string>{"a", "b"}));
  ASSERT_EQ(grouped->sessions.size(), 2u);
  const auto is_gone = [&](const FeatureClass& feature) {
    return std::any_of(gone.begin(), gone.end(),
                       [&](int p) { return (survey.points[p] - feature.position).norm() < 0.02; });
  };
  const auto num_gone = std::count_if(classes.vanished.begin(), classes.vanished.end(), is_gone);
  EXPECT_GT(num_gone, 0.8 * static_cast<double>(gone.size()));
  EXPECT_LE(static_cast<double>(classes.vanished.size()), 1.1 * static_cast<double>(num_gone));
  EXPECT_EQ(classes.dropped.at("vanished"), static_cast<int64_t>(classes.vanished.size()));
  for (const FeatureClass& feature : classes.vanished) {
    EXPECT_LT(feature.age.presence, 0.5);
    ASSERT_EQ(feature.age.sessions.size(), 2u);
    EXPECT_GT(feature.age.sessions[0].num_seen, 1);
    EXPECT_EQ(feature.age.sessions[1].num_seen, 0);
  }
  for (const FeatureClass& feature : classes.classes) {
    EXPECT_GE(feature.age.presence, 0.5);
    int num_seen[2] = {0, 0};
    for (const Observation& observation : feature.observations) ++num_seen[1 - observation.image_id % 2];
    EXPECT_EQ(feature.age.sessions[0].num_seen, num_seen[0]);
    EXPECT_EQ(feature.age.sessions[1].num_seen, num_seen[1]);
  }
  // All of it is in the file.
  const std::string path = testing::TempDir() + "/classes_sessions.db",
                    again = testing::TempDir() + "/classes_sessions_again.db";
  Classes with_changes = classes;
  with_changes.changes = {
      {.session = 1, .num_vanished = 20, .image_before = 1, .moved_to = 1, .num_moved = 11},
      {.session = 1, .num_appeared = 15, .image_after = 2}};
  ASSERT_TRUE(WriteClasses(with_changes, path).ok());
  const auto read = ReadClasses(path);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->vanished.size(), classes.vanished.size());
  ASSERT_EQ(read->changes.size(), 2U);
  EXPECT_EQ(read->changes[0].moved_to, 1);
  EXPECT_EQ(read->changes[0].num_moved, 11);
  EXPECT_EQ(read->changes[1].moved_to, -1);
  EXPECT_EQ(read->sessions, classes.sessions);
  ASSERT_TRUE(WriteClasses(*read, again).ok());
  EXPECT_EQ(*HashFile(path), *HashFile(again));
  // Nothing is forgotten on request.
  options.persistence.min_presence = 0;
  const auto all = GroupClasses(survey.matched, survey.capture, options, 2, progress, nullptr, {"a", "b"});
  ASSERT_TRUE(all.ok());
  EXPECT_TRUE(all->classes.vanished.empty());
  EXPECT_EQ(all->classes.classes.size(), classes.classes.size() + classes.vanished.size());
}

TEST(GroupClasses, SightingsOfAnotherNumberOfSessionsAreCorrupt) {
  std::set<int> gone;
  const Survey survey = SurveyOfTwoSessions(&gone);
  NoProgress progress;
  const auto grouped = GroupClasses(survey.matched, survey.capture, {}, 2, progress, nullptr, {"a", "b"});
  ASSERT_TRUE(grouped.ok());
  const std::string path = testing::TempDir() + "/classes_sessions_damaged.db";
  for (const auto& [damage, message] :
       {std::pair("DELETE FROM sessions WHERE session_idx = 1", "sightings of 2 sessions, expected 1"),
        std::pair("UPDATE classes SET sightings = x'00'", "blob"),
        std::pair("INSERT INTO changes SELECT 2, position, 1, 1, 1, 0, 0, -1, 0 FROM classes LIMIT 1",
                  "session 2 of 2"),
        std::pair("INSERT INTO changes SELECT -1, position, 1, 1, 1, 0, 0, -1, 0 FROM classes LIMIT 1",
                  "session -1"),
        std::pair("INSERT INTO changes SELECT 1, position, 1, 1, 1, 999, 0, -1, 0 FROM classes LIMIT 1",
                  "images 999"),
        std::pair("INSERT INTO changes SELECT 1, position, 1, 1, 1, 0, 999, -1, 0 FROM classes LIMIT 1",
                  "999"),
        std::pair("INSERT INTO changes SELECT 1, position, 1, 1, 1, 0, 0, 1, 5 FROM classes LIMIT 1",
                  "moved to change 1 of"),
        std::pair("INSERT INTO changes SELECT 1, position, 1, 1, 1, 0, 0, -2, 5 FROM classes LIMIT 1",
                  "moved to change -2")}) {
    ASSERT_TRUE(WriteClasses(grouped->classes, path).ok());
    {
      SQLite::Database database(path, SQLite::OPEN_READWRITE);
      database.exec(damage);
    }
    const auto read = ReadClasses(path);
    ASSERT_FALSE(read.ok()) << damage;
    EXPECT_EQ(read.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(read.error().message, HasSubstr(message)) << damage;
  }
}

TEST(GroupClasses, CaptureWithoutPosesIsAnErrorWithTheRemedy) {
  Survey survey = MakeSurvey({});
  for (CaptureImage& image : survey.capture.images) image.cam_from_world.reset();
  NoProgress progress;
  const auto result = GroupClasses(survey.matched, survey.capture, {}, 1, progress);
  EXPECT_EQ(result.error().code, ErrorCode::kNoData);
  EXPECT_THAT(result.error().message, HasSubstr("images.txt"));
}

TEST(GroupClasses, PosesThatDoNotFitAreAnErrorThatSaysWhatTookTheMost) {
  Survey survey = MakeSurvey({});
  Random random(3);
  for (CaptureImage& image : survey.capture.images) {
    image.cam_from_world->rotation = Eigen::AngleAxisd(random.Uniform(0, 3), Eigen::Vector3d::UnitY());
    image.cam_from_world->translation = Eigen::Vector3d(random.Uniform(-50, 50), random.Uniform(-50, 50), 0);
  }
  NoProgress progress;
  const auto result = GroupClasses(survey.matched, survey.capture, {}, 1, progress);
  ASSERT_FALSE(result.ok());
  EXPECT_THAT(result.error().message, HasSubstr("by reprojection_error"));
}

using ImageKeypoint = std::pair<ImageId, uint32_t>;

// Dropped items by the name of their reason.
std::map<std::string, std::vector<DroppedItem>> ByReason(const std::vector<DroppedItem>& items) {
  std::map<std::string, std::vector<DroppedItem>> by_reason;
  for (const DroppedItem& item : items) by_reason[DescribeDropReason(item.reason).name].push_back(item);
  return by_reason;
}

std::vector<ImageKeypoint> KeypointsOf(const DroppedItem& item) {
  std::vector<ImageKeypoint> keypoints;
  for (size_t i = 0; i + 1 < item.seen_at.size(); i += 2)
    keypoints.emplace_back(item.seen_at[i], item.seen_at[i + 1]);
  return keypoints;
}

// The keypoints of a scene point, in all images.
std::vector<ImageKeypoint> KeypointsOfPoint(const Survey& survey, int point) {
  std::vector<ImageKeypoint> keypoints;
  for (size_t image = 0; image < survey.keypoint_of_point.size(); ++image) {
    const auto keypoint = survey.keypoint_of_point[image].find(point);
    if (keypoint != survey.keypoint_of_point[image].end())
      keypoints.emplace_back(static_cast<ImageId>(image + 1), keypoint->second);
  }
  return keypoints;
}

TEST(GroupClassesDrops, EveryTrackAndEveryMatchedKeypointIsKeptOrDroppedOnce) {
  for (const SurveyNoise& noise :
       {SurveyNoise{}, SurveyNoise{.pixel = 3}, SurveyNoise{.pose_m = 0.02, .pose_deg = 0.5}}) {
    const Survey survey = MakeSurvey(noise);
    const GroupClassesResult result = Group(survey);
    ASSERT_EQ(result.num_conflicts, 0);
    int64_t num_dropped_tracks = 0;
    std::set<int64_t> tracks;
    std::vector<ImageKeypoint> accounted;
    for (const DroppedItem& item : result.dropped_items) {
      const std::vector<ImageKeypoint> keypoints = KeypointsOf(item);
      accounted.insert(accounted.end(), keypoints.begin(), keypoints.end());
      if (DescribeDropReason(item.reason).kind != DropKind::kFeature) continue;
      ++num_dropped_tracks;
      tracks.insert(item.item_id);
    }
    for (const FeatureClass& feature_class : result.classes.classes) {
      for (const Observation& observation : feature_class.observations)
        accounted.emplace_back(observation.image_id, observation.keypoint_idx);
    }
    EXPECT_EQ(static_cast<int64_t>(tracks.size()), num_dropped_tracks);
    EXPECT_EQ(num_dropped_tracks + static_cast<int64_t>(result.classes.classes.size()), result.num_tracks);
    int64_t num_counted = 0;
    for (const auto& [reason, count] : result.classes.dropped) num_counted += count;
    EXPECT_EQ(num_counted, num_dropped_tracks);

    std::set<ImageKeypoint> matched;
    for (const TwoViewGeometry& geometry : survey.matched.geometries) {
      for (const Match& match : geometry.inliers) {
        matched.emplace(geometry.image_id1, match.idx1);
        matched.emplace(geometry.image_id2, match.idx2);
      }
    }
    std::sort(accounted.begin(), accounted.end());
    EXPECT_EQ(accounted, std::vector<ImageKeypoint>(matched.begin(), matched.end()));
  }
}

TEST(GroupClassesDrops, ShortTracksAndNarrowOnesAreNamed) {
  const Survey survey = MakeSurvey({});
  GroupClassesOptions options;
  options.triangulation.min_num_observations = 12;
  auto dropped = ByReason(Group(survey, options).dropped_items);
  ASSERT_FALSE(dropped["few_observations"].empty());
  for (const DroppedItem& item : dropped["few_observations"]) EXPECT_LT(KeypointsOf(item).size(), 12u);

  options = {};
  options.triangulation.min_triangulation_angle_deg = 40;
  dropped = ByReason(Group(survey, options).dropped_items);
  EXPECT_GT(dropped["small_angle"].size(), 20u);
}

TEST(GroupClassesDrops, TracksWhoseRaysDisagreeAreNamed) {
  GroupClassesOptions options;
  options.refine_poses = "never";
  options.triangulation.max_reprojection_error_px = 0.3;  // as large as the noise
  options.triangulation.min_num_observations = 8;
  auto dropped = ByReason(Group(MakeSurvey({}), options).dropped_items);
  ASSERT_FALSE(dropped["reprojection_error"].empty());
  for (const DroppedItem& item : dropped["reprojection_error"]) EXPECT_GE(KeypointsOf(item).size(), 8u);
}

TEST(GroupClassesDrops, DisplacedKeypointOfAClassThatStaysIsAnOutlier) {
  Survey survey = MakeSurvey({});
  const int point = survey.keypoint_of_point[12].begin()->first;
  const uint32_t keypoint = survey.keypoint_of_point[12].begin()->second;
  survey.matched.features[12].keypoints[keypoint].x += 60;
  const GroupClassesResult result = Group(survey);
  auto dropped = ByReason(result.dropped_items);
  ASSERT_EQ(dropped["outlier"].size(), 1u);
  EXPECT_THAT(KeypointsOf(dropped["outlier"][0]), testing::ElementsAre(ImageKeypoint(13, keypoint)));
  const FeatureClass& stays = result.classes.classes.at(dropped["outlier"][0].item_id - 1);
  EXPECT_EQ(stays.observations.size() + 1, KeypointsOfPoint(survey, point).size());
}

TEST(GroupClassesDrops, LookAlikesAreAmbiguousOrDuplicatesByTheirDistance) {
  Survey survey = MakeSurvey({});
  // Two points that at least ten images see and that are classes get one look.
  std::vector<std::vector<ImageKeypoint>> points;
  for (const FeatureClass& feature_class : Group(survey).classes.classes) {
    if (feature_class.observations.size() < 10 || points.size() == 2) continue;
    std::vector<ImageKeypoint>& keypoints = points.emplace_back();
    for (const Observation& observation : feature_class.observations)
      keypoints.emplace_back(observation.image_id, observation.keypoint_idx);
  }
  ASSERT_EQ(points.size(), 2u);
  const auto [image_id, keypoint] = points[0].front();
  const auto look = survey.matched.features[image_id - 1].descriptors.row(keypoint).eval();
  for (const auto& [id, k] : points[1]) survey.matched.features[id - 1].descriptors.row(k) = look;

  const auto num_of_both = [&](const std::vector<DroppedItem>& items) {
    return std::count_if(items.begin(), items.end(), [&](const DroppedItem& item) {
      return KeypointsOf(item) == points[0] || KeypointsOf(item) == points[1];
    });
  };
  auto dropped = ByReason(Group(survey).dropped_items);
  EXPECT_EQ(num_of_both(dropped["ambiguous"]), 2);
  EXPECT_EQ(num_of_both(dropped["duplicate"]), 0);

  GroupClassesOptions options;
  options.ambiguity.max_duplicate_distance_m = 100;
  dropped = ByReason(Group(survey, options).dropped_items);
  EXPECT_EQ(num_of_both(dropped["ambiguous"]), 0);
  EXPECT_EQ(num_of_both(dropped["duplicate"]), 1);
}

TEST(GroupClassesDrops, ImagesWithoutAPoseAndTheirPairsAreNamed) {
  Survey survey = MakeSurvey({});
  survey.capture.images[7].cam_from_world.reset();
  const auto is_pair = [](const TwoViewGeometry& g) { return g.image_id1 == 8 || g.image_id2 == 8; };
  const auto num_pairs =
      std::count_if(survey.matched.geometries.begin(), survey.matched.geometries.end(), is_pair);
  auto dropped = ByReason(Group(survey).dropped_items);
  ASSERT_EQ(dropped["no_pose"].size(), 1u);
  EXPECT_EQ(dropped["no_pose"][0].item_id, 8);
  EXPECT_EQ(static_cast<int64_t>(dropped["pair_without_pose"].size()), num_pairs);
}

TEST(GroupClassesDrops, AreReadBackFromTheFileAsTheyWere) {
  const GroupClassesResult result = Group(MakeSurvey({.pixel = 2}));
  const std::string path = testing::TempDir() + "/classes_dropped.db";
  ASSERT_TRUE(WriteClasses(result.classes, path, result.dropped_items).ok());
  const auto read = ReadDroppedItems(path, kDroppedItemsTable);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(*read, result.dropped_items);
  for (const char* sql :
       {"UPDATE dropped_items SET reason_id = 9999", "UPDATE dropped_items SET reason_id = -1",
        "UPDATE dropped_items SET item_id = -5", "UPDATE dropped_items SET seen_at = x'00000000'",
        "UPDATE dropped_items SET seen_at = x'000000'"}) {
    ASSERT_TRUE(WriteClasses(result.classes, path, result.dropped_items).ok());
    SQLite::Database(path, SQLite::OPEN_READWRITE).exec(sql);
    const auto damaged = ReadDroppedItems(path, kDroppedItemsTable);
    ASSERT_FALSE(damaged.ok()) << sql;
    EXPECT_EQ(damaged.error().code, ErrorCode::kCorrupt) << sql;
  }
  SQLite::Database(path, SQLite::OPEN_READWRITE).exec("DROP TABLE dropped_items");
  EXPECT_TRUE(ReadDroppedItems(path, kDroppedItemsTable)->empty());  // a file of an earlier program
}

}  // namespace
}  // namespace cairn::group_classes
