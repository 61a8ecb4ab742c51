#include "core/world/landmark_model.h"

#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include <gtest/gtest.h>
#include <Eigen/LU>

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

// The prediction with trend and process solved for at once, as geostatisticians do:
//   [K H; H' 0] (w; b) = (seen; 0),   prediction = k(place)' w + h(place)' b
Eigen::Vector3d Predicted(const std::vector<Sight>& sights, const KernelShape& shape,
                          const Eigen::Vector2d& place) {
  const auto n = static_cast<Eigen::Index>(sights.size());
  const double length = kKernelLengthsM[shape.length];
  const auto kernel = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return std::exp(-(a - b).squaredNorm() / (2 * length * length));
  };
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(n + 3, n + 3), seen = Eigen::MatrixXd::Zero(n + 3, 3);
  Eigen::RowVectorXd at(n + 3);
  at.tail<3>() << 1, place.x(), place.y();
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) system(i, j) = kernel(sights[i].place, sights[j].place);
    system(i, i) += kKernelNoises[shape.noise];
    system.row(i).tail<3>() << 1, sights[i].place.x(), sights[i].place.y();
    seen.row(i) = sights[i].seen.transpose();
    at[i] = kernel(sights[i].place, place);
  }
  system.bottomLeftCorner(3, n) = system.topRightCorner(n, 3).transpose();
  return (at * system.fullPivLu().solve(seen)).transpose();
}

TEST(LandmarkModel, PredictsWhatTrendAndProcessSolvedTogetherPredict) {
  const std::vector<Sight> sights = Lattice(1.0);
  for (const KernelShape shape :
       {KernelShape{1, 2}, KernelShape{3, 4}, KernelShape{0, 5}, KernelShape{2, 3}}) {
    const auto model = LandmarkModel::Make(sights, shape);
    ASSERT_TRUE(model);
    for (const Eigen::Vector2d& place :
         {Eigen::Vector2d(0.4, 0.3), Eigen::Vector2d(2, -1), Eigen::Vector2d(0, 0.75)})
      EXPECT_LT((model->Predict(place).seen - Predicted(sights, shape, place)).norm(), 1e-5);
  }
}

// What a model of sights at these places, which see a plane, predicts at a place far away, where only its
// trend counts.
double FarAway(const std::vector<Eigen::Vector2d>& places) {
  std::vector<Sight> sights;
  for (const Eigen::Vector2d& place : places) sights.push_back({place, {10 * place.x(), 0, 0}});
  const auto model = LandmarkModel::Make(sights, {0, 5});
  EXPECT_TRUE(model);
  return model ? model->Predict({100, 0}).seen.x() : 0;
}

TEST(LandmarkModel, TrendHasASlopeWhereSixPlacesSpread) {
  std::vector<Eigen::Vector2d> places = {{0, 0}, {1, 0}, {2, 0}, {0, 1}, {1, 1}, {2, 1}};
  EXPECT_NEAR(FarAway(places), 1000, 1e-6);
  places.pop_back();
  EXPECT_NEAR(FarAway(places), 10, 10);  // a constant near the mean of what was seen
  // Across the line they stand on places spread by 5 cm or more.
  const auto wide = [](double spread_m) {
    std::vector<Eigen::Vector2d> row;
    for (int i = 0; i < 8; ++i)
      row.emplace_back(i, i == 0 || i == 3 || i == 5 || i == 6 ? spread_m : -spread_m);
    return row;
  };
  EXPECT_NEAR(FarAway(wide(0.0501)), 1000, 1e-6);
  EXPECT_NEAR(FarAway(wide(0.0499)), 35, 10);
}

TEST(ChooseKernel, TakesTheShapeWithTheLeastErrorsOfSightsLeftOut) {
  // An octave counts as 20 px; of equal shapes the first.
  std::set<int> lengths, noises;
  for (uint64_t seed = 0; seed < 300; ++seed) {
    Random random(seed);
    std::vector<Sight> sights;
    const double wave = random.Uniform(0.5, 3), noise_px = random.Uniform(0, 3);
    for (int i = 0; i < 7; ++i) {
      const Eigen::Vector2d place(random.Uniform(0, 2), random.Uniform(0, 2));
      sights.push_back({place,
                        {10 * std::sin(wave * place.x()) + random.Normal(0, noise_px), 5 * place.y(),
                         0.5 * std::cos(wave * place.y()) + random.Normal(0, 0.05 * noise_px)}});
    }
    std::optional<KernelShape> best;
    double least = 0;
    Eigen::Vector3d sigma = Eigen::Vector3d::Zero();
    for (int length = 0; length < kNumKernelLengths; ++length) {
      for (int noise = 0; noise < kNumKernelNoises; ++noise) {
        const auto errors = LandmarkModel::LeaveOneOutErrors(sights, {length, noise});
        if (!errors) continue;
        const Eigen::Vector3d squares = errors->rowwise().squaredNorm() / 7;
        const double cost = squares.x() + squares.y() + 20 * 20 * squares.z();
        if (best && cost >= least) continue;
        best = {length, noise};
        least = cost;
        sigma = squares.cwiseSqrt();
      }
    }
    const auto choice = ChooseKernel(sights);
    ASSERT_TRUE(choice && best);
    EXPECT_EQ(choice->shape, *best) << seed;
    EXPECT_LT((choice->sigma - sigma).norm(), 1e-9 * (1 + sigma.norm())) << seed;
    lengths.insert(best->length);
    noises.insert(best->noise);
  }
  EXPECT_EQ(lengths.size(), kNumKernelLengths);  // every shape is the best of some
  EXPECT_EQ(noises.size(), kNumKernelNoises);
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
