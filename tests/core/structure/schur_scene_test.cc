#include "core/structure/schur_solver.h"

#include <memory>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/camera/pixel_ray.h"
#include "core/structure/bundle_blocks.h"
#include "core/structure/camera_sensitivity.h"

namespace cairn {
namespace {

constexpr int kNumImages = 12, kNumPoints = 80;

// Cameras on an arc that look at a cloud of points, all moved from where they belong; every fifth image by a
// second camera.  The last image sees nothing, the last point is not seen.
struct Scene {
  // How it is adjusted.
  bool is_robust = false;
  bool are_cameras_free = false;
  double largest_change = 0;  // of a camera; 0: no bound
  std::vector<int> held = {0};
  // What is adjusted.
  std::vector<double> poses = std::vector<double>(kPoseBlockSize * kNumImages);
  std::vector<Eigen::Vector3d> points;
  std::vector<double> changes = {0, 0, 0, 0};  // two of each camera
  // What was seen.
  struct Seen {
    int image = 0, point = 0;
    PixelRay ray;
    CameraSensitivity sensitivity;
  };
  std::vector<Seen> seen;
  std::vector<Pose> stated;
};

Scene MakeScene(const Scene& how, double noise_px = 0.5) {
  Scene scene = how;
  Random random(11);
  Camera camera;
  camera.model = CameraModel::kSimpleRadial;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 320, 240, -0.05};
  Camera believed = camera;
  believed.params[0] = 490;
  for (int k = 0; k < kNumPoints; ++k)
    scene.points.emplace_back(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1));
  for (int i = 0; i < kNumImages; ++i) {
    Pose pose;
    pose.rotation = Eigen::AngleAxisd(-0.2 * i, Eigen::Vector3d::UnitY());
    pose.translation = {0, 0, 3 + 0.3 * (i % 3)};
    scene.stated.push_back(pose);
    for (int k = 0; k + 1 < kNumPoints && i + 1 < kNumImages; ++k) {
      // The first points are seen by all, others by some.
      if (k > 20 && random.Uniform() < 0.6) continue;
      Eigen::Vector2d pixel = *ImageFromCamera(camera, pose * scene.points[k]);
      pixel += Eigen::Vector2d(random.Normal(0, noise_px), random.Normal(0, noise_px));
      if (how.is_robust && random.Uniform() < 0.1) pixel.x() += 40;
      scene.seen.push_back(
          {i, k, *MakePixelRay(believed, pixel),
           how.are_cameras_free ? SensitivityOf(believed, pixel, {0, 3}) : CameraSensitivity()});
    }
    pose.rotation = Eigen::AngleAxisd(0.02, Eigen::Vector3d(1, -0.5, 0.3).normalized()) * pose.rotation;
    if (i > 1) pose.translation += Eigen::Vector3d(random.Normal(0, 0.05), random.Normal(0, 0.05), 0);
    StorePose(pose, &scene.poses[kPoseBlockSize * i]);
  }
  for (Eigen::Vector3d& point : scene.points)
    point += Eigen::Vector3d(random.Normal(0, 0.05), random.Normal(0, 0.05), random.Normal(0, 0.05));
  return scene;
}

struct ChangePrior {
  template <typename T>
  bool operator()(const T* change, T* residual) const {
    residual[0] = change[0] / T(50);
    residual[1] = change[1] / T(0.1);
    return true;
  }
};

// The problem for either solver: Ceres' where `ceres_problem` is not null.
class Build {
 public:
  Build(Scene* scene, ceres::Problem* ceres_problem, SchurProblem* schur) {
    std::vector<double*> values;
    for (int i = 0; i < kNumImages; ++i) {
      values.push_back(&scene->poses[kPoseBlockSize * i]);
      if (schur != nullptr) schur->AddBlock(values.back(), kPoseBlockSize, &manifold_);
    }
    for (Eigen::Vector3d& point : scene->points) {
      values.push_back(point.data());
      if (schur != nullptr) schur->AddPoint(values.back());
    }
    for (int c = 0; c < 2; ++c) {
      values.push_back(&scene->changes[2 * c]);
      if (schur != nullptr) schur->AddBlock(values.back(), 2);
    }
    const auto add = [&](const ceres::CostFunction* cost, ceres::LossFunction* loss,
                         std::initializer_list<int> blocks) {
      if (schur != nullptr) return schur->AddResidual(cost, loss, blocks);
      std::vector<double*> pointers;
      for (const int b : blocks) pointers.push_back(values[b]);
      ceres_problem->AddResidualBlock(const_cast<ceres::CostFunction*>(cost), loss, pointers);
    };
    ceres::LossFunction* loss = scene->is_robust ? &loss_ : nullptr;
    for (const Scene::Seen& seen : scene->seen) {
      const ceres::CostFunction* cost = costs_.AddReprojection(seen.ray, seen.sensitivity, 1);
      const int point = kNumImages + seen.point;
      if (seen.sensitivity.empty()) {
        add(cost, loss, {seen.image, point});
      } else {
        add(cost, loss, {seen.image, point, kNumImages + kNumPoints + (seen.image % 5 == 0 ? 1 : 0)});
      }
    }
    // The image that sees nothing hangs on another.
    const Pose motion = scene->stated[kNumImages - 1] * scene->stated[2].Inverse();
    add(costs_.Add(new ceres::AutoDiffCostFunction<MotionCost, 6, kPoseBlockSize, kPoseBlockSize>(
            new MotionCost{motion, 0.01, 0.02})),
        nullptr, {kNumImages - 1, 2});
    for (const int c : {kNumImages + kNumPoints, kNumImages + kNumPoints + 1}) {
      if (scene->are_cameras_free) {
        add(costs_.Add(new ceres::AutoDiffCostFunction<ChangePrior, 2, 2>(new ChangePrior)), nullptr, {c});
      } else if (schur != nullptr) {
        schur->SetConstant(c);
      }
      if (!scene->are_cameras_free || scene->largest_change == 0) continue;
      const double most = scene->largest_change;
      if (schur != nullptr) {
        schur->SetBounds(c, 0, -most, most);
      } else {
        ceres_problem->SetParameterLowerBound(values[c], 0, -most);
        ceres_problem->SetParameterUpperBound(values[c], 0, most);
      }
    }
    for (const int i : scene->held) {
      if (schur != nullptr) {
        schur->SetConstant(i);
      } else {
        ceres_problem->SetParameterBlockConstant(values[i]);
      }
    }
    if (schur != nullptr) return;
    for (int i = 0; i < kNumImages; ++i) ceres_problem->SetManifold(values[i], &manifold_);
    for (const double* point : std::vector<double*>(values.begin() + kNumImages, values.end() - 2)) {
      if (ceres_problem->HasParameterBlock(point)) ordering->AddElementToGroup(const_cast<double*>(point), 0);
    }
    for (size_t b = 0; b < values.size(); ++b) {
      const bool is_point = b >= kNumImages && b + 2 < values.size();
      if (!is_point && ceres_problem->HasParameterBlock(values[b])) ordering->AddElementToGroup(values[b], 1);
    }
  }

  std::shared_ptr<ceres::ParameterBlockOrdering> ordering = std::make_shared<ceres::ParameterBlockOrdering>();

 private:
  PoseManifold manifold_;
  ceres::CauchyLoss loss_{1};
  BundleCosts costs_;
};

SchurSummary SolveOurs(const SchurSolverOptions& options, Scene* scene) {
  SchurProblem problem;
  const Build build(scene, nullptr, &problem);
  return SolveSchur(problem, options);
}

// Of costs, losses and manifolds that are the caller's.
ceres::Problem::Options UncheckedProblem() {
  ceres::Problem::Options options;
  options.disable_all_safety_checks = true;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  return options;
}

ceres::Solver::Summary SolveCeres(const SchurSolverOptions& options, Scene* scene) {
  ceres::Problem problem(UncheckedProblem());
  const Build build(scene, &problem, nullptr);
  ceres::Solver::Options ceres_options;
  ceres_options.linear_solver_type = ceres::SPARSE_SCHUR;
  ceres_options.linear_solver_ordering = build.ordering;
  ceres_options.num_threads = 1;
  ceres_options.logging_type = ceres::SILENT;
  ceres_options.max_num_iterations = options.max_num_iterations;
  ceres_options.function_tolerance = options.function_tolerance;
  ceres_options.initial_trust_region_radius = options.initial_trust_region_radius;
  if (options.points_follow) {
    ceres_options.use_inner_iterations = true;
    ceres_options.inner_iteration_tolerance = 1e-6;
    ceres_options.inner_iteration_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (Eigen::Vector3d& point : scene->points) {
      if (problem.HasParameterBlock(point.data()))
        ceres_options.inner_iteration_ordering->AddElementToGroup(point.data(), 0);
    }
  }
  ceres::Solver::Summary summary;
  ceres::Solve(ceres_options, &problem, &summary);
  return summary;
}

// Step by step: costs, trust, values.
void ExpectCeresSteps(const Scene& how, double initial_trust_region_radius = 1e4,
                      bool points_follow = false) {
  const Scene start = MakeScene(how);
  for (int num_steps = 0; num_steps < 9; ++num_steps) {
    Scene ours = start, theirs = start;
    const SchurSolverOptions options{.max_num_iterations = num_steps,
                                     .function_tolerance = 1e-9,
                                     .initial_trust_region_radius = initial_trust_region_radius,
                                     .points_follow = points_follow,
                                     .num_threads = 2};
    const SchurSummary summary = SolveOurs(options, &ours);
    const ceres::Solver::Summary expected = SolveCeres(options, &theirs);
    EXPECT_NEAR(summary.initial_cost, expected.initial_cost, 1e-9 * expected.initial_cost);
    EXPECT_NEAR(summary.final_cost, expected.final_cost, 1e-6 * expected.final_cost) << num_steps;
    EXPECT_EQ(summary.num_steps, static_cast<int>(expected.iterations.size()) - 1);
    EXPECT_EQ(summary.has_converged, expected.termination_type == ceres::CONVERGENCE);
    const double radius = expected.iterations.back().trust_region_radius;
    EXPECT_NEAR(summary.trust_region_radius, radius, 1e-4 * radius) << num_steps;
    for (size_t k = 0; k < ours.poses.size(); ++k) EXPECT_NEAR(ours.poses[k], theirs.poses[k], 1e-5);
    for (int k = 0; k < kNumPoints; ++k) EXPECT_LT((ours.points[k] - theirs.points[k]).norm(), 1e-5);
    for (size_t k = 0; k < ours.changes.size(); ++k) EXPECT_NEAR(ours.changes[k], theirs.changes[k], 1e-3);
  }
}

TEST(SchurScene, GoesCeresWay) {
  ExpectCeresSteps({.held = {0, 1}});
  ExpectCeresSteps({.held = {0, 1}}, 1e-2);
}

TEST(SchurScene, GoesCeresWayWhereTheScaleIsFree) { ExpectCeresSteps({}); }

TEST(SchurScene, GoesCeresWayWithRobustLosses) { ExpectCeresSteps({.is_robust = true, .held = {0, 1}}); }

TEST(SchurScene, GoesCeresWayWithFreeCameras) {
  ExpectCeresSteps({.are_cameras_free = true, .held = {0, 1}});
  ExpectCeresSteps({.is_robust = true, .are_cameras_free = true, .held = {0, 1}});
}

TEST(SchurScene, PointsFollowAsCeresInnerIterations) {
  ExpectCeresSteps({.held = {0, 1}}, 1e4, true);
  ExpectCeresSteps({.is_robust = true, .are_cameras_free = true, .held = {0, 1}}, 1e-1, true);
}

TEST(SchurScene, FindsCeresOptimumWithinBounds) {
  for (const double largest_change : {1.0, 100.0}) {
    const Scene start = MakeScene(
        {.is_robust = true, .are_cameras_free = true, .largest_change = largest_change, .held = {0, 1}});
    Scene ours = start, theirs = start;
    const SchurSolverOptions options{.max_num_iterations = 200, .function_tolerance = 1e-12};
    const SchurSummary summary = SolveOurs(options, &ours);
    const ceres::Solver::Summary expected = SolveCeres(options, &theirs);
    EXPECT_TRUE(summary.has_converged);
    EXPECT_NEAR(summary.final_cost, expected.final_cost, 1e-6 * expected.final_cost);
    if (largest_change == 1) {
      EXPECT_EQ(ours.changes[0], 1);
    } else {
      EXPECT_NEAR(ours.changes[0], theirs.changes[0], 0.01);
      EXPECT_GT(ours.changes[0], 5);
    }
  }
}

TEST(SchurScene, TheNumberOfThreadsChangesNoBit) {
  for (const double largest_change : {0.0, 3.0}) {
    const Scene start =
        MakeScene({.is_robust = true, .are_cameras_free = true, .largest_change = largest_change});
    std::vector<Scene> found;
    for (const int num_threads : {1, 2, 3, 7}) {
      found.push_back(start);
      SolveOurs({.max_num_iterations = 6, .num_threads = num_threads}, &found.back());
      EXPECT_EQ(found.back().poses, found.front().poses);
      EXPECT_EQ(found.back().points, found.front().points);
      EXPECT_EQ(found.back().changes, found.front().changes);
    }
    EXPECT_NE(found.front().poses, start.poses);
  }
}

class Counter : public Progress {
 public:
  explicit Counter(int64_t cancel_at = 1000) : cancel_at_(cancel_at) {}
  void Begin(std::string_view, int64_t, std::string_view) override {}
  void Advance(int64_t num_items) override { num_items_ += num_items; }
  void End() override {}
  bool Cancelled() const override { return num_items_ >= cancel_at_; }
  int64_t num_items() const { return num_items_; }

 private:
  int64_t cancel_at_, num_items_ = 0;
};

TEST(SchurScene, ProgressIsAsLongAsWasSaid) {
  Scene scene = MakeScene({});
  Counter counter;
  const SchurSummary summary = SolveOurs({.max_num_iterations = 30, .progress = &counter}, &scene);
  EXPECT_LT(summary.num_steps, 30);
  EXPECT_EQ(counter.num_items(), 30);
}

TEST(SchurScene, WhatIsStoppedChangesNothing) {
  const Scene start = MakeScene({});
  Scene scene = start;
  Counter counter(2);
  const SchurSummary summary = SolveOurs({.max_num_iterations = 30, .progress = &counter}, &scene);
  EXPECT_TRUE(summary.was_stopped);
  EXPECT_FALSE(summary.has_converged);
  EXPECT_EQ(summary.num_steps, 2);
  EXPECT_EQ(scene.poses, start.poses);
  EXPECT_EQ(scene.points, start.points);
}

}  // namespace
}  // namespace cairn
