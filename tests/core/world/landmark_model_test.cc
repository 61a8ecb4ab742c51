#include "core/world/landmark_model.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn {
namespace {

// A point 3 m ahead of a lattice of 5 x 4 places, seen by a pinhole: 320 (y - b) / (3 - a), 320 / (3 - a).
Eigen::Vector3d Seen(const Eigen::Vector2d& place) {
  const double depth = 3 - place.x();
  return {320 * (0.4 - place.y()) / depth, 320 * 0.5 / depth, std::log2(20 / depth)};
}

std::vector<Sight> Lattice(double noise_px = 0) {
  Random random(1);
  std::vector<Sight> sights;
  for (int row = 0; row < 4; ++row) {
    for (int col = 0; col < 5; ++col) {
      Sight sight{.place = {0.25 * col, 0.25 * row}};
      sight.seen =
          Seen(sight.place) + Eigen::Vector3d(random.Normal(0, noise_px), random.Normal(0, noise_px), 0);
      sights.push_back(sight);
    }
  }
  return sights;
}

TEST(LandmarkModel, WithoutNoiseIsExactAtTheSights) {
  const auto model = LandmarkModel::Make(Lattice(), {0, 0});
  ASSERT_TRUE(model);
  for (const Sight& sight : Lattice())
    EXPECT_LT((model->Predict(sight.place).seen - sight.seen).norm(), 0.01);
}

TEST(LandmarkModel, InterpolatesBetweenThem) {
  const auto model = LandmarkModel::Make(Lattice(), {2, 1});
  ASSERT_TRUE(model);
  EXPECT_LT((model->Predict({0.4, 0.3}).seen - Seen({0.4, 0.3})).norm(), 0.3);
}

TEST(LandmarkModel, ContinuesALinearTrend) {
  std::vector<Sight> sights = Lattice();
  const auto linear = [](const Eigen::Vector2d& p) {
    return Eigen::Vector3d(10 + 20 * p.x() - 5 * p.y(), 3 * p.y(), 1 - p.x());
  };
  for (Sight& sight : sights) sight.seen = linear(sight.place);
  const auto model = LandmarkModel::Make(sights, {1, 3});
  ASSERT_TRUE(model);
  EXPECT_LT((model->Predict({4, -3}).seen - linear({4, -3})).norm(), 1e-6);
}

TEST(LandmarkModel, GradientIsThatOfThePrediction) {
  const auto model = LandmarkModel::Make(Lattice(), {1, 2});
  ASSERT_TRUE(model);
  const Eigen::Vector2d at(0.33, 0.21);
  constexpr double kStep = 1e-5;
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(axis);
    const Eigen::Vector3d slope =
        (model->Predict(at + step).seen - model->Predict(at - step).seen) / (2 * kStep);
    EXPECT_LT((model->Predict(at).gradient.col(axis) - slope).norm(), 1e-4 * slope.norm());
  }
}

TEST(LandmarkModel, LeaveOneOutErrorsEqualThoseOfModelsWithoutTheSight) {
  const std::vector<Sight> sights = Lattice(1.0);
  for (const KernelShape shape : {KernelShape{1, 2}, KernelShape{3, 4}, KernelShape{0, 5}}) {
    const auto errors = LandmarkModel::LeaveOneOutErrors(sights, shape);
    ASSERT_TRUE(errors);
    for (size_t left_out = 0; left_out < sights.size(); ++left_out) {
      std::vector<Sight> others = sights;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(left_out));
      const auto model = LandmarkModel::Make(others, shape);
      ASSERT_TRUE(model);
      const Eigen::Vector3d expected = model->Predict(sights[left_out].place).seen - sights[left_out].seen;
      EXPECT_LT((errors->col(static_cast<Eigen::Index>(left_out)) - expected).norm(), 1e-6) << left_out;
    }
  }
}

TEST(ChooseKernel, ErrorsAreAboutTheNoiseOfTheSights) {
  const auto choice = ChooseKernel(Lattice(2.0));
  ASSERT_TRUE(choice);
  EXPECT_GT(choice->sigma.x(), 1);
  EXPECT_LT(choice->sigma.x(), 4);
  const auto exact = ChooseKernel(Lattice());
  ASSERT_TRUE(exact);
  EXPECT_LT(exact->sigma.x(), 1);
  EXPECT_LT(exact->sigma.x(), 0.5 * choice->sigma.x());
}

TEST(ChooseKernel, PlacesOnALineOrAFewMakeAModelToo) {
  std::vector<Sight> line;
  for (int i = 0; i < 8; ++i) line.push_back({{0.25 * i, 0}, Seen({0.25 * i, 0})});
  EXPECT_TRUE(ChooseKernel(line));
  line.resize(kMinNumSights);
  EXPECT_TRUE(ChooseKernel(line));
}

TEST(ChooseKernel, WhatIsNoDataMakesNoModel) {
  EXPECT_FALSE(ChooseKernel({}));
  std::vector<Sight> sights = Lattice();
  sights.resize(kMinNumSights - 1);
  EXPECT_FALSE(ChooseKernel(sights));
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    sights = Lattice();
    sights[3].seen.y() = bad;
    EXPECT_FALSE(ChooseKernel(sights));
    EXPECT_FALSE(LandmarkModel::Make(sights, {1, 1}));
    sights = Lattice();
    sights[3].place.x() = bad;
    EXPECT_FALSE(ChooseKernel(sights));
  }
}

}  // namespace
}  // namespace cairn
