#include "stages/reconstruct/registration/register_sessions.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/similarity.h"
#include "tests/reconstruct/synthetic_survey.h"

namespace cairn::reconstruct {
namespace {

using testing::HasSubstr;

constexpr CameraId kTonightsCamera = 2;

// A survey of which some images are of a session without poses, by another camera that nobody knows.
struct TwoSessions {
  SyntheticSurvey survey;
  std::vector<int> tonight;  // indices of the session's images

  explicit TwoSessions(int num_images, const std::function<bool(int)>& is_tonight) {
    survey = MakeSyntheticSurvey(num_images, 3);
    survey.input.cameras[1] = survey.camera;
    survey.input.cameras[kTonightsCamera] = GuessCamera(kTonightsCamera, 640, 480);
    for (int i = 0; i < num_images; ++i) {
      DatabaseImage& image = survey.input.images[i];
      CaptureImage& listed = survey.capture.images[i];
      listed.name = (is_tonight(i) ? "tonight/" : "old/") + image.name;
      image.name = listed.name;
      if (is_tonight(i)) {
        tonight.push_back(i);
        image.camera_id = listed.camera_id = kTonightsCamera;
      } else {
        listed.cam_from_world = survey.cams_from_world[i];
      }
    }
    survey.capture.registered = {"tonight"};
  }

  bool IsTonight(int image) const {
    return std::find(tonight.begin(), tonight.end(), image) != tonight.end();
  }
  int IndexOfId(ImageId id) const { return static_cast<int>(id) - 1; }
  // Whether a pair is of images of both sessions.
  bool IsAcross(const TwoViewGeometry& pair) const {
    return IsTonight(IndexOfId(pair.image_id1)) != IsTonight(IndexOfId(pair.image_id2));
  }

  Registration Register(int num_threads = 2) const {
    NoProgress progress;
    auto found = RegisterSessions(survey.input, survey.capture, {}, {}, num_threads, progress);
    EXPECT_TRUE(found.ok());
    return found.ok() ? *found : Registration();
  }

  // Largest errors of those of tonight that are joined.
  void ExpectNear(const Registration& found, double max_m, double max_deg) const {
    for (const int i : tonight) {
      if (!found.cam_from_world[i]) continue;
      EXPECT_LT(CenterErrorM(*found.cam_from_world[i], survey.cams_from_world[i]), max_m) << i;
      EXPECT_LT(RotationErrorDeg(*found.cam_from_world[i], survey.cams_from_world[i]), max_deg) << i;
    }
  }
};

bool IsOdd(int i) { return i % 2 == 1; }

TEST(RegisterSessions, PosesOfASessionWithoutAnyAreFoundInTheFrameOfTheOthers) {
  const TwoSessions sessions(24, IsOdd);
  const Registration found = sessions.Register();
  ASSERT_EQ(found.sessions.size(), 1u);
  EXPECT_EQ(found.sessions[0].name, "tonight");
  EXPECT_EQ(found.sessions[0].num_images, 12);
  EXPECT_EQ(found.sessions[0].num_joined, 12);
  EXPECT_EQ(found.sessions[0].num_supported, 12);
  sessions.ExpectNear(found, 0.03, 0.15);
  EXPECT_NEAR(found.cameras.at(kTonightsCamera).FocalX(), 500, 3);
  // What is stated stays as it is.
  EXPECT_EQ(found.cameras.at(1).params, sessions.survey.camera.params);
  for (int i = 0; i < 24; i += 2)
    EXPECT_EQ(found.cam_from_world[i]->translation, sessions.survey.cams_from_world[i].translation);
}

TEST(RegisterSessions, PosesInAFrameOfTheirOwnAreBroughtOver) {
  TwoSessions sessions(24, IsOdd);
  const Similarity own_from_world{
      2.5, Eigen::Quaterniond(Eigen::AngleAxisd(1, Eigen::Vector3d(1, 2, 3).normalized())), {10, -20, 3}};
  for (const int i : sessions.tonight) {
    sessions.survey.capture.own_poses[sessions.survey.input.images[i].name] =
        TransformPose(own_from_world, sessions.survey.cams_from_world[i]);
  }
  sessions.survey.input.cameras[kTonightsCamera] = sessions.survey.camera;
  const Registration found = sessions.Register();
  EXPECT_EQ(found.sessions[0].num_joined, 12);
  sessions.ExpectNear(found, 0.03, 0.1);
}

// A session whose own frame is torn in two is not torn in the others' frame.
TEST(RegisterSessions, HalvesOfAPieceAreEachPutWhereTheyAre) {
  TwoSessions sessions(30, IsOdd);
  for (const int i : sessions.tonight) {
    Pose pose = sessions.survey.cams_from_world[i];
    if (i > 18) pose.translation -= pose.rotation * Eigen::Vector3d(3, 1, 0);
    sessions.survey.capture.own_poses[sessions.survey.input.images[i].name] = pose;
  }
  sessions.survey.input.cameras[kTonightsCamera] = sessions.survey.camera;
  const Registration found = sessions.Register();
  EXPECT_EQ(found.sessions[0].num_joined, 15);
  sessions.ExpectNear(found, 0.03, 0.1);
}

// Of twenty images that show what one shows, all keypoints 1 px to the right of it, none is joined, and none
// pulls at it.
TEST(RegisterSessions, ImagesOfACameraThatStandsAreLeftOut) {
  TwoSessions sessions(24, IsOdd);
  MapperInput& input = sessions.survey.input;
  const DatabaseImage standing = input.images[11];
  const std::vector<TwoViewGeometry> geometries = input.geometries;
  for (ImageId id = 101; id <= 120; ++id) {
    input.images.push_back({id, fmt::format("tonight/stands{}.jpg", id), standing.camera_id});
    sessions.survey.capture.images.push_back({input.images.back().name, standing.camera_id, std::nullopt});
    input.keypoints.push_back(input.keypoints[11]);
    for (Keypoint& keypoint : input.keypoints.back()) keypoint.x += 1;
    for (TwoViewGeometry pair : geometries) {
      const bool is_second = pair.image_id2 == standing.image_id;
      if (!is_second && pair.image_id1 != standing.image_id) continue;
      if (!is_second) {  // ids of a pair ascend
        std::swap(pair.image_id1, pair.image_id2);
        for (Match& match : pair.inliers) std::swap(match.idx1, match.idx2);
        pair.F.transposeInPlace();
        pair.E.transposeInPlace();
      }
      pair.image_id2 = id;
      input.geometries.push_back(pair);
    }
    TwoViewGeometry same{.image_id1 = standing.image_id, .image_id2 = id};
    for (KeypointIdx k = 0; k < input.keypoints[11].size(); ++k) same.inliers.push_back({k, k});
    input.geometries.push_back(same);
  }
  const Registration found = sessions.Register();
  EXPECT_EQ(found.sessions[0].num_images, 32);
  EXPECT_EQ(found.sessions[0].num_joined, 12);
  sessions.ExpectNear(found, 0.03, 0.15);
  for (int i = 24; i < 44; ++i) {
    EXPECT_FALSE(found.cam_from_world[i]);
    EXPECT_EQ(found.reasons[i],
              "shows what " + standing.name + " shows, from the same place: it says nothing more");
  }
}

// They are where those are that they are joined with.
TEST(RegisterSessions, ImagesThatSeeNothingOfTheOthersAreBridged) {
  TwoSessions sessions(24, [](int i) { return i >= 10; });
  const Registration found = sessions.Register();
  EXPECT_EQ(found.sessions[0].num_joined, 14);
  sessions.ExpectNear(found, 0.15, 0.5);
}

TEST(RegisterSessions, AnotherPlaceIsNotJoinedByMatchesThatAreNone) {
  TwoSessions sessions(24, IsOdd);
  Random random(5);
  for (TwoViewGeometry& pair : sessions.survey.input.geometries) {
    if (!sessions.IsAcross(pair)) continue;
    pair.inliers.resize(40);
    for (KeypointIdx k = 0; k < 40; ++k)
      pair.inliers[k] = {k, static_cast<KeypointIdx>(random.UniformInt(0, 200))};
  }
  const Registration found = sessions.Register();
  EXPECT_EQ(found.sessions[0].num_joined, 0);
  for (const int i : sessions.tonight) {
    EXPECT_FALSE(found.cam_from_world[i]);
    EXPECT_NE(found.reasons[i], "");
  }
}

// As of another floor: some doors and lamps.
TEST(RegisterSessions, AFewPointsAnImageAreNotEnough) {
  TwoSessions sessions(24, IsOdd);
  for (TwoViewGeometry& pair : sessions.survey.input.geometries) {
    // The first keypoints of all images show the same few points.
    if (sessions.IsAcross(pair))
      std::erase_if(pair.inliers, [](const Match& match) { return match.idx1 > 22 || match.idx2 > 22; });
  }
  const Registration found = sessions.Register();
  EXPECT_EQ(found.sessions[0].num_joined, 0);
  EXPECT_THAT(found.reasons[sessions.tonight[0]], HasSubstr("see little of the other captures"));
}

// The old survey has two places that look alike, and tonight's is one of them.
TwoSessions SessionOfOneOfTwoPlaces() {
  TwoSessions sessions(24, IsOdd);
  SyntheticSurvey& survey = sessions.survey;
  const TwoSessions twin(24, IsOdd);
  const auto id_there = [](ImageId id) { return id + 24; };
  for (int i = 0; i < 24; i += 2) {
    DatabaseImage image = twin.survey.input.images[i];
    image.image_id = id_there(image.image_id);
    image.name = "old/there/" + image.name;
    survey.input.images.push_back(image);
    survey.input.keypoints.push_back(twin.survey.input.keypoints[i]);
    Pose there = twin.survey.cams_from_world[i];
    there.translation -= there.rotation * Eigen::Vector3d(40, 0, 0);
    survey.cams_from_world.push_back(there);
    survey.capture.images.push_back({image.name, 1, there});
  }
  for (TwoViewGeometry pair : twin.survey.input.geometries) {
    const bool is1 = sessions.IsTonight(static_cast<int>(pair.image_id1) - 1);
    const bool is2 = sessions.IsTonight(static_cast<int>(pair.image_id2) - 1);
    if (is1 && is2) continue;
    if (!is1) pair.image_id1 = id_there(pair.image_id1);
    if (!is2) pair.image_id2 = id_there(pair.image_id2);
    if (pair.image_id1 > pair.image_id2) {
      std::swap(pair.image_id1, pair.image_id2);
      for (Match& match : pair.inliers) std::swap(match.idx1, match.idx2);
    }
    survey.input.geometries.push_back(pair);
  }
  return sessions;
}

TEST(RegisterSessions, WhatLooksLikeTwoPlacesIsNotJoined) {
  const TwoSessions sessions = SessionOfOneOfTwoPlaces();
  const Registration found = sessions.Register();
  EXPECT_EQ(found.sessions[0].num_joined, 0);
  EXPECT_THAT(found.reasons[sessions.tonight[0]], HasSubstr("looks like two places"));
}

TEST(RegisterSessions, AnImageThatIsAloneNeedsMore) {
  TwoSessions sessions(24, [](int i) { return i == 11; });
  sessions.survey.input.cameras[kTonightsCamera] = sessions.survey.camera;
  EXPECT_EQ(sessions.Register().sessions[0].num_joined, 1);
  sessions.ExpectNear(sessions.Register(), 0.05, 0.3);
  for (TwoViewGeometry& pair : sessions.survey.input.geometries) {
    if (sessions.IsAcross(pair)) pair.inliers.resize(std::min<size_t>(pair.inliers.size(), 15));
  }
  const Registration found = sessions.Register();
  EXPECT_EQ(found.sessions[0].num_joined, 0);
  EXPECT_THAT(found.reasons[11], HasSubstr("points of the other captures, of 40 needed"));
}

// Where the session as a whole may be in two places, an image of it that sees enough of one is no better.
TEST(RegisterSessions, AnImageAloneIsNotJoinedWhereItsSessionIsNot) {
  TwoSessions sessions = SessionOfOneOfTwoPlaces();
  const int alone = sessions.tonight[3];
  std::erase_if(sessions.survey.input.geometries, [&](const TwoViewGeometry& pair) {
    const auto is = [&](ImageId id) { return id == sessions.survey.input.images[alone].image_id; };
    const auto is_there = [](ImageId id) { return id > 24; };
    const auto is_tonight = [&](ImageId id) {
      return id <= 24 && sessions.IsTonight(sessions.IndexOfId(id));
    };
    const ImageId other = is(pair.image_id1) ? pair.image_id2 : pair.image_id1;
    return (is(pair.image_id1) || is(pair.image_id2)) && (is_there(other) || is_tonight(other));
  });
  sessions.survey.input.cameras[kTonightsCamera] = sessions.survey.camera;
  const Registration found = sessions.Register();
  EXPECT_EQ(found.sessions[0].num_joined, 0);
  EXPECT_THAT(found.reasons[alone], HasSubstr("that are joined with each other are not registered"));
}

TEST(RegisterSessions, TheSameForAnyNumberOfThreads) {
  const TwoSessions sessions(16, IsOdd);
  const Registration one = sessions.Register(1), seven = sessions.Register(7);
  for (const int i : sessions.tonight) {
    EXPECT_EQ(one.cam_from_world[i]->translation, seven.cam_from_world[i]->translation);
    EXPECT_EQ(one.cam_from_world[i]->rotation.coeffs(), seven.cam_from_world[i]->rotation.coeffs());
  }
}

TEST(RegisterSessions, PanoramasAreRefused) {
  TwoSessions sessions(12, IsOdd);
  sessions.survey.input.images[1].name = "tonight/p.jpg#0of6";
  NoProgress progress;
  const auto found = RegisterSessions(sessions.survey.input, sessions.survey.capture, {}, {}, 1, progress);
  ASSERT_FALSE(found.ok());
  EXPECT_EQ(found.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(found.error().message, HasSubstr("session 'tonight' has panoramas"));
}

TEST(RegisterSessions, ASessionWithoutImagesIsNone) {
  TwoSessions sessions(12, [](int) { return false; });
  const Registration found = sessions.Register();
  EXPECT_EQ(found.sessions[0].num_images, 0);
  EXPECT_EQ(found.sessions[0].num_joined, 0);
}

}  // namespace
}  // namespace cairn::reconstruct
