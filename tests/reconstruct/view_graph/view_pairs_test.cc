#include "stages/reconstruct/view_graph/view_pairs.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "core/geometry/relative_pose.h"
#include "tests/reconstruct/synthetic_survey.h"

namespace cairn::reconstruct {
namespace {

std::map<CameraId, Camera> TrueCameras(const SyntheticSurvey& survey) {
  Camera camera = survey.camera;
  camera.camera_id = 1;
  return {{1, camera}};
}

TEST(EstimateViewPairs, RelativePosesAreThoseOfTheCameras) {
  NoProgress progress;
  const SyntheticSurvey survey = MakeSyntheticSurvey(12, 4);
  const std::vector<ViewPair> pairs = EstimateViewPairs(survey.input, TrueCameras(survey), {}, 2, progress);
  ASSERT_EQ(pairs.size(), survey.input.geometries.size());
  for (const ViewPair& pair : pairs) {
    const Pose truth = survey.cams_from_world[pair.image2] * survey.cams_from_world[pair.image1].Inverse();
    EXPECT_LT(DegFromRad(pair.cam2_from_cam1.rotation.angularDistance(truth.rotation)), 0.5);
    EXPECT_GT(pair.cam2_from_cam1.translation.dot(truth.translation.normalized()), 0.99);
    EXPECT_NEAR(pair.cam2_from_cam1.translation.norm(), 1, 1e-9);
    EXPECT_GT(pair.strength, 0);
    EXPECT_LE(pair.strength, 1);
  }
  const std::vector<ViewPair> alone = EstimateViewPairs(survey.input, TrueCameras(survey), {}, 1, progress);
  for (size_t p = 0; p < pairs.size(); ++p)
    EXPECT_EQ(pairs[p].cam2_from_cam1.translation, alone[p].cam2_from_cam1.translation);
}

TEST(EstimateViewPairs, MatchesThatTheGeometryDoesNotExplainAreLeftOut) {
  NoProgress progress;
  SyntheticSurvey survey = MakeSyntheticSurvey(4, 4);
  TwoViewGeometry& geometry = survey.input.geometries[0];
  const size_t num_before = geometry.inliers.size();
  for (size_t m = 0; m + 1 < geometry.inliers.size(); m += 10)
    std::swap(geometry.inliers[m].idx2, geometry.inliers[m + 1].idx2);
  const std::vector<ViewPair> pairs = EstimateViewPairs(survey.input, TrueCameras(survey), {}, 2, progress);
  EXPECT_LT(pairs[0].matches.size(), num_before * 9 / 10);
  EXPECT_GT(pairs[0].matches.size(), num_before * 7 / 10);
  // A pair with too few is none.
  geometry.inliers.resize(14);
  EXPECT_EQ(EstimateViewPairs(survey.input, TrueCameras(survey), {}, 2, progress).size(), pairs.size() - 1);
}

// A fundamental matrix from points on a plane may be any: five points decide.
TEST(EstimateViewPairs, AWrongFundamentalMatrixDoesNoHarm) {
  NoProgress progress;
  SyntheticSurvey survey = MakeSyntheticSurvey(3, 4);
  for (TwoViewGeometry& geometry : survey.input.geometries)
    geometry.F << 0, -1e-6, 3e-4, 2e-6, 0, -1e-3, -4e-4, 8e-4, 0.1;
  for (const ViewPair& pair : EstimateViewPairs(survey.input, TrueCameras(survey), {}, 1, progress)) {
    const Pose truth = survey.cams_from_world[pair.image2] * survey.cams_from_world[pair.image1].Inverse();
    EXPECT_LT(DegFromRad(pair.cam2_from_cam1.rotation.angularDistance(truth.rotation)), 0.5);
  }
}

// A wall seen from two places: two relative poses explain it, and neighbours tell which is right.
TEST(EstimateViewPairs, OfAPlaneBothRelativePosesAreKept) {
  NoProgress progress;
  Random random(12);
  Camera camera;
  camera.camera_id = 1;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 320, 240};
  MapperInput input;
  input.cameras.emplace(1, camera);
  input.images = {{1, "a", 1}, {2, "b", 1}};
  input.keypoints.resize(2);
  Pose truth;
  truth.rotation = Eigen::AngleAxisd(RadFromDeg(12), Eigen::Vector3d(0.2, 1, 0).normalized());
  truth.translation = {-0.9, 0.1, 0.2};
  TwoViewGeometry geometry{.image_id1 = 1, .image_id2 = 2, .config = TwoViewConfig::kPlanarOrPanoramic};
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector3d point(random.Uniform(-1.2, 1.2), random.Uniform(-1, 1), 3);
    const auto a = ImageFromCamera(camera, point), b = ImageFromCamera(camera, truth * point);
    ASSERT_TRUE(a && b);
    for (const auto& [image, pixel] : {std::pair(0, *a), std::pair(1, *b)}) {
      input.keypoints[image].push_back({.x = static_cast<float>(pixel.x() + random.Normal(0, 0.2)),
                                        .y = static_cast<float>(pixel.y() + random.Normal(0, 0.2)),
                                        .scale = 2,
                                        .orientation = 0});
    }
    geometry.inliers.push_back({static_cast<KeypointIdx>(k), static_cast<KeypointIdx>(k)});
  }
  // In the frame of the second camera x = (R + t n' / d) x1, with the wall's normal n and distance d.
  Eigen::Matrix3d K;
  K << 500, 0, 320, 0, 500, 240, 0, 0, 1;
  geometry.H = K * (truth.rotation.toRotationMatrix() + truth.translation * Eigen::RowVector3d(0, 0, 1) / 3) *
               K.inverse();
  input.geometries.push_back(geometry);
  std::vector<ViewPair> pairs = EstimateViewPairs(input, input.cameras, {}, 1, progress);
  ASSERT_EQ(pairs.size(), 1u);
  ViewPair& pair = pairs[0];
  ASSERT_EQ(pair.alternatives.size(), 1u);
  const auto turn = [](const Pose& pose) { return RotationErrorDeg(pose, Pose()); };
  EXPECT_LE(turn(pair.cam2_from_cam1), turn(pair.alternatives[0]));
  EXPECT_GT(RotationErrorDeg(pair.cam2_from_cam1, pair.alternatives[0]), 5);
  ChooseRotation(truth.rotation, &pair);
  EXPECT_LT(RotationErrorDeg(pair.cam2_from_cam1, truth), 1);
  const Pose other = pair.alternatives[0];
  ChooseRotation(other.rotation, &pair);
  EXPECT_EQ(pair.cam2_from_cam1.translation, other.translation);
}

}  // namespace
}  // namespace cairn::reconstruct
