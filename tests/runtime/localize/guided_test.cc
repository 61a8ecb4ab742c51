#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "core/work/work_budget.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/match.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/landmark_set.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

constexpr int kSide = 8;  // landmarks in a square of 8 x 8, 50 px apart, in the middle of the image

struct Wall {
  Query query;
  LandmarkSet landmarks;
};

// A camera before a wall 2 m away whose landmarks all look the same or each like itself; `extra_px`: where
// else each can be seen, relative to its place.
Wall MakeWall(bool alike, const std::vector<Eigen::Vector2d>& extra_px, double sigma_m = 0) {
  Random random(1);
  Wall wall;
  Features features;
  Camera camera;
  camera.width = camera.height = 600;
  camera.model = CameraModel::kSimplePinhole;
  camera.params = {400, 300, 300};
  const auto look = RandomDescriptor(random);
  std::vector<Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim>> looks;
  std::vector<Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim>> seen;
  for (int i = 0; i < kSide * kSide; ++i) {
    const Eigen::Vector2d pixel(125 + 50 * (i % kSide), 125 + 50 * (i / kSide));
    const Eigen::Vector2d ray = (pixel - Eigen::Vector2d(300, 300)) / 400;
    wall.landmarks.idx.push_back(i);
    wall.landmarks.landmarks.push_back({.position = {2 * ray.x(), 2 * ray.y(), 2},
                                        .covariance = sigma_m * sigma_m * Eigen::Matrix3d::Identity()});
    looks.push_back(alike ? look : RandomDescriptor(random));
    std::vector<Eigen::Vector2d> places = {{0, 0}};
    places.insert(places.end(), extra_px.begin(), extra_px.end());
    for (const Eigen::Vector2d& place : places) {
      features.keypoints.push_back(
          {static_cast<float>(pixel.x() + place.x()), static_cast<float>(pixel.y() + place.y()), 2, 0});
      seen.push_back(looks.back());
    }
  }
  wall.landmarks.descriptors.resize(kSide * kSide, kSiftDescriptorDim);
  for (int i = 0; i < kSide * kSide; ++i) wall.landmarks.descriptors.row(i) = looks[i];
  features.descriptors.resize(static_cast<Eigen::Index>(seen.size()), kSiftDescriptorDim);
  for (size_t i = 0; i < seen.size(); ++i) features.descriptors.row(static_cast<Eigen::Index>(i)) = seen[i];
  wall.query = MakeQuery(std::move(features), camera, {});
  return wall;
}

TEST(GuidedByChance, NothingWhereThingsLookLikeThemselves) {
  const Wall wall = MakeWall(false, {});
  EXPECT_EQ(MatchGuided(wall.query, wall.landmarks, {}, {}).size(), size_t{kSide * kSide});
  EXPECT_EQ(GuidedByChance(wall.query, wall.landmarks, {}, {}), 0);
}

TEST(GuidedByChance, IsTheMeanOfFourWays) {
  // Looked for within 10 px, and beside their places 40 px away: at two of the four ways the same can be
  // seen.
  const Wall two = MakeWall(false, {{40, 0}, {0, -45}});
  EXPECT_EQ(GuidedByChance(two.query, two.landmarks, {}, {}), kSide * kSide / 2.0);
  const Wall four = MakeWall(false, {{40, 0}, {-40, 5}, {0, 40}, {3, -40}});
  EXPECT_EQ(GuidedByChance(four.query, four.landmarks, {}, {}), kSide * kSide);
  const Wall out_of_reach = MakeWall(false, {{51, 0}, {-28, 0}, {0, 51}, {0, -28}});
  EXPECT_EQ(GuidedByChance(out_of_reach.query, out_of_reach.landmarks, {}, {}), 0);
}

TEST(GuidedByChance, WhereAllLooksAlikeAsManyAsThereAreBeside) {
  // 50 px to the next: 40 px aside it is within reach, except beyond the last row or column.
  const Wall wall = MakeWall(true, {});
  EXPECT_EQ(MatchGuided(wall.query, wall.landmarks, {}, {}).size(), size_t{kSide * kSide});
  EXPECT_EQ(GuidedByChance(wall.query, wall.landmarks, {}, {}), kSide * (kSide - 1));
}

// A landmark that is looked for far around is looked for beside that: what is its own is not chance.
TEST(GuidedByChance, UncertainLandmarksAreNotFoundBesideTheirPlaces) {
  const Wall wall = MakeWall(false, {}, 0.1);  // 20 px: looked for within 61
  EXPECT_EQ(MatchGuided(wall.query, wall.landmarks, {}, {}).size(), size_t{kSide * kSide});
  EXPECT_EQ(GuidedByChance(wall.query, wall.landmarks, {}, {}), 0);
}

// A landmark 400 / 2 px per metre away, of uncertain place along one axis, is looked for within 10 px and
// three of its standard deviations: as far as its image moves, whichever way it does.
TEST(MatchGuided, LooksAsFarAsTheLandmarksPlaceIsUncertain) {
  const Eigen::Vector2d at(380, 340);  // of (0.4, 0.2, 2)
  const auto is_found = [&](const Eigen::Vector3d& sigmas_m, const Eigen::Vector2d& aside) {
    Random random(1);
    LandmarkSet landmarks;
    landmarks.idx = {0};
    landmarks.landmarks.push_back(
        {.position = {0.4, 0.2, 2}, .covariance = sigmas_m.cwiseAbs2().asDiagonal()});
    landmarks.descriptors = RandomDescriptor(random);
    Features features;
    const Eigen::Vector2d pixel = at + aside;
    features.keypoints = {{static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 2, 0}};
    features.descriptors = landmarks.descriptors;
    Camera camera;
    camera.width = camera.height = 600;
    camera.model = CameraModel::kSimplePinhole;
    camera.params = {400, 300, 300};
    return !MatchGuided(MakeQuery(std::move(features), camera, {}), landmarks, {}, {}).empty();
  };
  for (const auto& [sigmas_m, moved_px] : {std::pair(Eigen::Vector3d(0, 0, 0), 0.0),
                                           {Eigen::Vector3d(0.1, 0, 0), 20.0},
                                           {Eigen::Vector3d(0, 0.1, 0), 20.0},
                                           {Eigen::Vector3d(0, 0, 0.1), 20 * std::hypot(0.2, 0.1)},
                                           {Eigen::Vector3d(0.1, 0.05, 0), 20.0}}) {
    const double radius_px = std::hypot(10, 3 * moved_px);
    for (const Eigen::Vector2d& way : {Eigen::Vector2d(1, 0), {-1, 0}, {0, 1}, {0, -1}, {0.6, 0.8}}) {
      EXPECT_TRUE(is_found(sigmas_m, 0.99 * radius_px * way))
          << sigmas_m.transpose() << ": " << way.transpose();
      EXPECT_FALSE(is_found(sigmas_m, 1.01 * radius_px * way))
          << sigmas_m.transpose() << ": " << way.transpose();
    }
  }
}

// Each landmark is projected, and costs one more than the keypoints near it: here its own, and another 5 px
// beside it, out of two.
TEST(MatchGuided, CountsWhatItLooksAt) {
  Wall wall = MakeWall(false, {{5, 0}, {25, 0}});
  wall.query.work = std::make_shared<WorkBudget>();
  MatchGuided(wall.query, wall.landmarks, {}, {});
  EXPECT_EQ(wall.query.work->num(Work::kProject), kSide * kSide);
  EXPECT_EQ(wall.query.work->num(Work::kNear), 3 * kSide * kSide);
}

// A first pose that enough matches led to.
PoseEstimate FromMany(const Pose& cam_from_world) {
  return {cam_from_world, PooledVector<int>(MatchOptions().guided_sure_num_inliers)};
}

// One that few led to.
PoseEstimate FromFew(const Pose& cam_from_world) {
  return {cam_from_world, PooledVector<int>(MatchOptions().guided_sure_num_inliers - 1)};
}

TEST(MatchGuidedInRounds, WhatIsFoundRefinesThePoseAndLeadsToTheRest) {
  // A turn about the optical axis moves the corners by 15 px and the middle by 2: 10 px are looked at.
  const Wall wall = MakeWall(false, {});
  const Pose turned{Eigen::Quaterniond(Eigen::AngleAxisd(0.06, Eigen::Vector3d::UnitZ())), {0, 0, 0}};
  const size_t num_found = MatchGuided(wall.query, wall.landmarks, turned, {}).size();
  EXPECT_LT(num_found, size_t{kSide * kSide});
  EXPECT_EQ(num_found, size_t{32});  // those within 167 px of the axis
  const GuidedMatches once =
      MatchGuidedInRounds(wall.query, wall.landmarks, FromMany(turned), {.guided_max_num_rounds = 1}, {}, {});
  EXPECT_EQ(once.matches.size(), num_found);
  EXPECT_EQ(RotationErrorDeg(once.cam_from_world, turned), 0);
  const GuidedMatches more = MatchGuidedInRounds(wall.query, wall.landmarks, FromMany(turned), {}, {}, {});
  EXPECT_EQ(more.matches.size(), size_t{kSide * kSide});
  EXPECT_LT(RotationErrorDeg(more.cam_from_world, {}), 1e-3);
}

// So far off that nothing is within 10 px: found within 40, and from there all.
TEST(MatchGuidedInRounds, AFirstPoseOfFewMatchesIsLookedAroundFirst) {
  const Wall wall = MakeWall(false, {});
  const Pose turned{Eigen::Quaterniond(Eigen::AngleAxisd(0.06, Eigen::Vector3d::UnitY())),
                    {0, 0, 0}};  // 24 px
  EXPECT_TRUE(MatchGuided(wall.query, wall.landmarks, turned, {}).empty());
  EXPECT_TRUE(MatchGuidedInRounds(wall.query, wall.landmarks, FromMany(turned), {}, {}, {}).matches.empty());
  const GuidedMatches found = MatchGuidedInRounds(wall.query, wall.landmarks, FromFew(turned), {}, {}, {});
  EXPECT_EQ(found.matches.size(), size_t{kSide * kSide});
  EXPECT_LT(RotationErrorDeg(found.cam_from_world, {}), 1e-3);
  // Within 20 px there is nothing yet, and 4 times as far is asked for by nobody.
  EXPECT_TRUE(MatchGuidedInRounds(wall.query, wall.landmarks, FromFew(turned), {.guided_widest = 2}, {}, {})
                  .matches.empty());
  // Twice as far it would be found at last, and is as far as the second look goes: 15 px off.
  const Pose less{Eigen::Quaterniond(Eigen::AngleAxisd(0.0375, Eigen::Vector3d::UnitY())), {0, 0, 0}};
  EXPECT_EQ(MatchGuidedInRounds(wall.query, wall.landmarks, FromFew(less), {.guided_widest = 2}, {}, {})
                .matches.size(),
            size_t{kSide * kSide});
  EXPECT_TRUE(MatchGuidedInRounds(wall.query, wall.landmarks, FromFew(less), {.guided_widest = 1}, {}, {})
                  .matches.empty());
}

// What looks alike lies 24 px beside each landmark: a pose there finds as many as the right one, and stays.
TEST(MatchGuidedInRounds, LookingAroundLeavesAPoseThatFindsAsMany) {
  const Wall wall = MakeWall(false, {{24, 0}});
  const GuidedMatches found = MatchGuidedInRounds(wall.query, wall.landmarks, FromFew({}), {}, {}, {});
  EXPECT_EQ(found.matches.size(), size_t{kSide * kSide});
  EXPECT_EQ(RotationErrorDeg(found.cam_from_world, {}), 0);
}

TEST(MatchGuidedInRounds, StopsWhereNoMoreIsFound) {
  const Wall wall = MakeWall(false, {});
  const GuidedMatches all = MatchGuidedInRounds(wall.query, wall.landmarks, FromMany({}), {}, {}, {});
  EXPECT_EQ(all.matches.size(), size_t{kSide * kSide});
  EXPECT_EQ(RotationErrorDeg(all.cam_from_world, {}), 0);            // as it was given
  const Pose elsewhere{Eigen::Quaterniond::Identity(), {0, 0, -3}};  // all behind the camera
  EXPECT_TRUE(
      MatchGuidedInRounds(wall.query, wall.landmarks, FromMany(elsewhere), {}, {}, {}).matches.empty());
}

// An image of the room in which most landmarks stand twice, and match nothing before there is a pose; but
// some match, at their places, and others as if seen from elsewhere.
struct TwoPlaces {
  static constexpr Eigen::Index kNumOfTruth = 10, kNumOfOther = 12;
  SyntheticRoom room = MakeSyntheticRoom(3);
  Pose truth = PoseAt({0.5, 0.3, 1.3}, 20);
  Features seen;
  Eigen::Index num = 0;  // of landmarks seen from the truth
  LocalizerOptions options;

  // `as_much`: from elsewhere all can be seen that is there, too.
  explicit TwoPlaces(bool as_much) {
    const RenderOptions all = {.detection_ratio = 1, .num_outliers = 0};
    num = Add(RenderFeatures(room, truth, all, 5), kNumOfTruth, true);
    Add(RenderFeatures(room, PoseAt({-0.5, 0.2, 1.2}, 200), all, 6), kNumOfOther, as_much);
  }

  Localization Localize() const {
    const auto map = Map::FromRows(room.rows);
    std::vector<LandmarkIdx> landmarks(room.points.size());
    std::iota(landmarks.begin(), landmarks.end(), 0);
    const Localizer localizer(*map, options);
    return *localizer.LocalizeAmong(*localizer.QueryFromFeatures(seen, room.camera), Scope::kAll, landmarks,
                                    {});
  }

 private:
  // The first once, the rest twice or not at all.
  Eigen::Index Add(const Features& features, Eigen::Index num_matched, bool rest) {
    const auto num_rows = static_cast<Eigen::Index>(features.keypoints.size());
    for (Eigen::Index i = 0; i < (rest ? num_rows : num_matched); ++i) {
      for (int copy = 0; copy < (i < num_matched ? 1 : 2); ++copy) {
        Keypoint keypoint = features.keypoints[i];
        if (copy == 1) keypoint.x += keypoint.x < 320 ? 250 : -250;
        seen.keypoints.push_back(keypoint);
        seen.descriptors.conservativeResize(static_cast<Eigen::Index>(seen.keypoints.size()),
                                            kSiftDescriptorDim);
        seen.descriptors.bottomRows<1>() = features.descriptors.row(i);
      }
    }
    return num_rows;
  }
};

TEST(Localizer, OfSeveralFirstPosesThatCountsWhichFindsMost) {
  TwoPlaces places(false);
  ASSERT_GT(places.num, 100);
  places.options.estimate.max_num_first_poses = 1;
  places.options.accept.max_second_pose_ratio = 0;
  const Localization misled = places.Localize();
  EXPECT_EQ(misled.reason, NoFix::kImprobable) << misled.message;
  EXPECT_LT(misled.probability, 0.1);
  EXPECT_EQ(misled.num_unguided_inliers, TwoPlaces::kNumOfOther);
  places.options.estimate.max_num_first_poses = 3;
  const Localization found = places.Localize();
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_LT(CenterErrorM(found.cam_from_world, places.truth), 0.02);
  EXPECT_EQ(found.num_unguided_inliers, TwoPlaces::kNumOfTruth);
  EXPECT_GT(found.num_inliers, places.num / 2);
  // Where enough matches agree, others are not looked at.
  places.options.sure_num_unguided_inliers = TwoPlaces::kNumOfOther;
  EXPECT_EQ(places.Localize().num_unguided_inliers, TwoPlaces::kNumOfOther);
  // A second pose elsewhere always is, if it has half of this part of the inliers.
  places.options.accept.max_second_pose_ratio = 1;
  EXPECT_EQ(places.Localize().num_unguided_inliers, TwoPlaces::kNumOfTruth);
  EXPECT_TRUE(places.Localize().has_fix());
}

TEST(Localizer, PosesElsewhereThatFindAsMuchAreAmbiguous) {
  TwoPlaces places(true);
  const Localization found = places.Localize();
  EXPECT_EQ(found.reason, NoFix::kAmbiguous) << found.message;
  places.options.accept.max_second_pose_ratio = 0;
  EXPECT_EQ(places.Localize().reason, NoFix::kNone);
}

TEST(Localizer, FixOfWhatIsNoMoreThanByChanceIsRefused) {
  // In the image, every landmark of the room appears again 40 px to each side.
  const SyntheticRoom room = MakeSyntheticRoom(3);
  const auto map = Map::FromRows(room.rows);
  const Pose truth = PoseAt({0.5, 0.3, 1.3}, 20);
  const Features clean = RenderFeatures(room, truth, {}, 5);
  LocalizerOptions options;
  ASSERT_TRUE(Localizer(*map, options).LocalizeFeatures(clean, room.camera)->has_fix());
  Random random(7);
  Features repeated = clean;
  const auto num = static_cast<Eigen::Index>(clean.keypoints.size());
  repeated.descriptors.conservativeResize(5 * num, Eigen::NoChange);
  int copy = 1;
  for (const auto& [x, y] : std::vector<std::pair<float, float>>{{40, 0}, {-40, 0}, {0, 40}, {0, -40}}) {
    for (const Keypoint& keypoint : clean.keypoints)
      repeated.keypoints.push_back({keypoint.x + x, keypoint.y + y, keypoint.scale, keypoint.orientation});
    for (Eigen::Index i = 0; i < num; ++i) {
      // Alike, but less than the landmark itself.
      auto look = NoisyDescriptor(clean.descriptors.row(i), random);
      for (int more = 0; more < 3; ++more) look = NoisyDescriptor(look, random);
      repeated.descriptors.row(copy * num + i) = look;
    }
    ++copy;
  }
  options.match.max_ratio = 1;  // else what stands there five times matches nothing
  // Wherever it is put, some are beside their places, and 200 are where they should be.
  options.accept.min_guided_sigmas = 100;
  const auto refused = Localizer(*map, options).LocalizeFeatures(repeated, room.camera);
  ASSERT_TRUE(refused.ok()) << refused.error().message;
  EXPECT_FALSE(refused->has_fix());
  EXPECT_EQ(refused->reason, NoFix::kTooFewInliers) << refused->message;
  options.accept.min_guided_sigmas = 0;
  options.accept.min_probability = 0;  // of five alike hardly one is recognized
  EXPECT_TRUE(Localizer(*map, options).LocalizeFeatures(repeated, room.camera)->has_fix());
}

}  // namespace
}  // namespace cairn
