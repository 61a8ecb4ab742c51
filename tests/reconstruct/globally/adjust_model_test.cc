#include "stages/reconstruct/globally/adjust_model.h"

#include <cmath>
#include <map>

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "core/base/pooled.h"
#include "core/base/quantiles.h"
#include "core/base/random.h"

namespace cairn::reconstruct {
namespace {

Camera TrueCamera() {
  Camera camera;
  camera.model = CameraModel::kSimpleRadial;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 320, 240, -0.05};
  return camera;
}

// Cameras on an arc that look at a cloud of points, and what they see of it.
struct Scene {
  ModelProblem problem;
  std::vector<Pose> truth;
};

Scene MakeScene(double noise_px) {
  Random random(9);
  Scene scene;
  ModelProblem& problem = scene.problem;
  problem.cameras.push_back({TrueCamera(), TrueCamera(), {}, {}});
  for (int k = 0; k < 120; ++k)
    problem.points.emplace_back(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1));
  for (int i = 0; i < 10; ++i) {
    Pose pose;
    pose.rotation = Eigen::AngleAxisd(-0.25 * i, Eigen::Vector3d::UnitY());
    pose.translation = {0, 0, 3 + 0.3 * (i % 3)};
    scene.truth.push_back(pose);
    problem.camera_idx.push_back(0);
    for (size_t k = 0; k < problem.points.size(); ++k) {
      const auto pixel = ImageFromCamera(TrueCamera(), pose * problem.points[k]);
      if (!pixel) continue;
      problem.observations.push_back(
          {i, static_cast<int>(k),
           *pixel + Eigen::Vector2d(random.Normal(0, noise_px), random.Normal(0, noise_px))});
    }
  }
  problem.cam_from_world = scene.truth;
  return scene;
}

// Largest error of a rotation relative to the first image's, degrees.
double LargestTurnDeg(const Scene& scene) {
  double largest = 0;
  for (size_t i = 1; i < scene.truth.size(); ++i) {
    const std::vector<Pose>& found = scene.problem.cam_from_world;
    largest = std::max(
        largest, RotationErrorDeg(found[i] * found[0].Inverse(), scene.truth[i] * scene.truth[0].Inverse()));
  }
  return largest;
}

// A level camera on a flat floor sees none of the ratio of its focal lengths: without what is likely of it,
// it would stay where it happened to get.
TEST(AdjustModel, OfALevelCameraPixelsStaySquare) {
  Scene scene = MakeScene(0);
  ModelProblem& problem = scene.problem;
  Camera stated = TrueCamera();
  stated.model = CameraModel::kPinhole;
  stated.params = {500, 500, 320, 240};
  for (ModelObservation& observation : problem.observations)
    observation.pixel =
        *ImageFromCamera(stated, scene.truth[observation.image] * problem.points[observation.point]);
  Camera off = stated;
  off.params[1] = 485;
  for (Pose& pose : problem.cam_from_world) pose.translation.y() *= 500.0 / 485;
  for (Eigen::Vector3d& point : problem.points) point.y() *= 500.0 / 485;
  problem.cameras = {{.camera = off, .stated = stated, .free = {0, 1}, .sigma = {15, 15}}};
  // A camera changes by so much at a time.
  for (int k = 0; k < 3; ++k) AdjustModel({.max_num_iterations = 50, .function_tolerance = 1e-10}, &problem);
  const PooledVector<double>& found = problem.cameras[0].camera.params;
  EXPECT_NEAR(found[0] / found[1], 1, 2e-3);
}

TEST(AdjustModel, MovedPosesAndPointsReturn) {
  Scene scene = MakeScene(0.3);
  Random random(1);
  for (Pose& pose : scene.problem.cam_from_world) {
    pose.rotation = Eigen::AngleAxisd(0.02, Eigen::Vector3d::Random().normalized()) * pose.rotation;
    pose.translation.x() += random.Normal(0, 0.05);
  }
  for (Eigen::Vector3d& point : scene.problem.points) point.x() += random.Normal(0, 0.05);
  EXPECT_GT(LargestTurnDeg(scene), 1);
  AdjustModel({.max_num_iterations = 50, .function_tolerance = 1e-8}, &scene.problem);
  EXPECT_LT(LargestTurnDeg(scene), 0.1);
  double sum = 0;
  for (const ModelObservation& observation : scene.problem.observations)
    sum += (*ImageFromCamera(TrueCamera(), scene.problem.cam_from_world[observation.image] *
                                               scene.problem.points[observation.point]) -
            observation.pixel)
               .squaredNorm();
  EXPECT_LT(std::sqrt(sum / scene.problem.observations.size()), 0.5);
}

TEST(AdjustModel, WrongMatchesHaveLittleSay) {
  Scene scene = MakeScene(0.3);
  for (size_t k = 0; k < scene.problem.observations.size(); k += 10)
    scene.problem.observations[k].pixel += Eigen::Vector2d(30, -20);
  AdjustModel({}, &scene.problem);
  EXPECT_LT(LargestTurnDeg(scene), 0.15);
}

TEST(AdjustModel, AGuessedCameraIsFoundStepByStep) {
  Scene scene = MakeScene(0.2);
  FreeCamera& camera = scene.problem.cameras[0];
  camera.camera.params[0] = camera.stated.params[0] = 560;
  camera.camera.params[3] = camera.stated.params[3] = 0;
  camera.free = {0, 3};
  camera.sigma = {0.3 * 560, 0.1};
  AdjustModel({.adjust_cameras = false}, &scene.problem);
  EXPECT_EQ(camera.camera.params[0], 560);
  for (int round = 0; round < 3; ++round) AdjustModel({.max_num_iterations = 50}, &scene.problem);
  EXPECT_NEAR(camera.camera.params[0], 500, 3);
  EXPECT_NEAR(camera.camera.params[3], -0.05, 0.005);
  EXPECT_EQ(camera.stated.params[0], 560);
  // No step is longer than sensitivities hold.
  camera.camera.params[0] = camera.stated.params[0] = 900;
  camera.sigma[0] = 100;
  AdjustModel({.max_num_iterations = 50}, &scene.problem);
  EXPECT_NEAR(camera.camera.params[0], 850, 1);
}

// The last image sees nothing that others see: only what its pair says of its rotation holds it.
TEST(AdjustModel, ARelativeRotationHoldsAnImageWithoutPoints) {
  Scene scene = MakeScene(0.3);
  const size_t last = scene.truth.size() - 1;
  const auto with_points_of_its_own = [&] {
    std::map<int, int> renamed;
    for (ModelObservation& observation : scene.problem.observations) {
      if (observation.image != static_cast<int>(last)) continue;
      const auto [it, is_new] =
          renamed.emplace(observation.point, static_cast<int>(scene.problem.points.size()));
      if (is_new) scene.problem.points.push_back(scene.problem.points[observation.point]);
      observation.point = it->second;
    }
  };
  with_points_of_its_own();
  Pose& pose = scene.problem.cam_from_world[last];
  pose.rotation = Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()) * pose.rotation;
  ModelProblem without = scene.problem;
  AdjustModel({}, &without);
  scene.problem.rotations.push_back({static_cast<int>(last) - 1, static_cast<int>(last),
                                     scene.truth[last].rotation * scene.truth[last - 1].rotation.conjugate(),
                                     true});
  AdjustModel({.max_num_iterations = 50}, &scene.problem);
  EXPECT_LT(LargestTurnDeg(scene), 0.2);
  scene.problem = without;
  EXPECT_GT(LargestTurnDeg(scene), 2);
}

// The same for where it is, of a drive with steps of about one length.
TEST(AdjustModel, AStepHoldsAnImageWithoutPoints) {
  Scene scene = MakeScene(0.3);
  const int last = static_cast<int>(scene.truth.size()) - 1;
  std::erase_if(scene.problem.observations, [&](const ModelObservation& observation) {
    return observation.image == last && observation.point >= 1;
  });
  for (int i = 1; i <= last; ++i) scene.problem.steps.push_back({i - 1, i});
  double step = 0;
  for (int i = 1; i < last; ++i) step = std::max(step, CenterErrorM(scene.truth[i], scene.truth[i - 1]));
  scene.problem.cam_from_world[last].translation *= 6;
  AdjustModel({.max_num_iterations = 200, .function_tolerance = 1e-10}, &scene.problem);
  EXPECT_LT(CenterErrorM(scene.problem.cam_from_world[last], scene.problem.cam_from_world[last - 1]),
            3 * step);
}

// An image that sees nothing and is said to be where the one before it is, and one a step and a half away.
TEST(AdjustModel, AnImageWithoutPointsIsAsFarAwayAsItsStepSays) {
  for (const double length : {0.0, 1.5}) {
    Scene scene = MakeScene(0);
    const int last = static_cast<int>(scene.truth.size()) - 1;
    std::erase_if(scene.problem.observations, [&](const ModelObservation& observation) {
      return observation.image == last && observation.point >= 1;
    });
    std::vector<double> steps;
    for (int i = 1; i < last; ++i) {
      scene.problem.steps.push_back({i - 1, i, 1});
      steps.push_back(CenterErrorM(scene.truth[i], scene.truth[i - 1]));
    }
    // Shorter ones than half a step say nothing of a typical one's length.
    scene.problem.steps[2].length = 0.4;
    scene.problem.steps.push_back({last - 1, last, length});
    AdjustModel({.max_num_iterations = 200, .function_tolerance = 1e-12}, &scene.problem);
    const std::vector<Pose>& found = scene.problem.cam_from_world;
    EXPECT_NEAR(CenterErrorM(found[last], found[last - 1]) / Median(steps), length, 0.3) << length;
  }
}

std::vector<ImageMotion> MotionsOf(const std::vector<Pose>& poses) {
  std::vector<ImageMotion> motions;
  for (int i = 1; i < static_cast<int>(poses.size()); ++i)
    motions.push_back({i - 1, i, poses[i] * poses[i - 1].Inverse()});
  return motions;
}

TEST(AdjustModel, MotionsGiveTheScale) {
  Scene scene = MakeScene(0.2);
  scene.problem.motions = MotionsOf(scene.truth);
  for (Pose& pose : scene.problem.cam_from_world) pose.translation *= 0.8;
  for (Eigen::Vector3d& point : scene.problem.points) point *= 0.8;
  AdjustModel({.adjust_cameras = false}, &scene.problem);
  const std::vector<Pose>& found = scene.problem.cam_from_world;
  EXPECT_NEAR(CenterErrorM(found[0], found[9]) / CenterErrorM(scene.truth[0], scene.truth[9]), 1, 0.02);
}

// No point joins the first five images with the last five.
TEST(AdjustModel, MotionsPlaceWhatNoPointDoes) {
  Scene scene = MakeScene(0.2);
  std::erase_if(scene.problem.observations, [](const ModelObservation& observation) {
    return (observation.image < 5) != (observation.point < 60);
  });
  scene.problem.motions = MotionsOf(scene.truth);
  const Pose bend{Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitZ())), {0.1, 0, 0.1}};
  for (int i = 5; i < 10; ++i) scene.problem.cam_from_world[i] = scene.truth[i] * bend;
  for (int k = 60; k < 120; ++k) scene.problem.points[k] = bend.Inverse() * scene.problem.points[k];
  EXPECT_GT(LargestTurnDeg(scene), 2.5);
  AdjustModel({.adjust_cameras = false}, &scene.problem);
  EXPECT_LT(LargestTurnDeg(scene), 0.3);
}

TEST(AdjustModel, AMotionThatPointsContradictHasLittleSay) {
  Scene scene = MakeScene(0.2);
  scene.problem.motions = MotionsOf(scene.truth);
  scene.problem.motions[4].cam2_from_cam1.translation += Eigen::Vector3d(2, 0, 0);
  AdjustModel({.adjust_cameras = false}, &scene.problem);
  EXPECT_LT(LargestTurnDeg(scene), 0.2);
  EXPECT_LT(CenterErrorM(scene.problem.cam_from_world[9], scene.truth[9]), 0.05);
}

TEST(AdjustModel, NothingSeenMovesNothing) {
  Scene scene = MakeScene(0.2);
  scene.problem.observations.clear();
  scene.problem.points.clear();
  AdjustModel({}, &scene.problem);
  for (size_t i = 0; i < scene.truth.size(); ++i)
    EXPECT_EQ(scene.problem.cam_from_world[i].translation, scene.truth[i].translation);
}

}  // namespace
}  // namespace cairn::reconstruct
