#include "stages/group_classes/find_ambiguous.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/random.h"

namespace cairn {
namespace {

using testing::ElementsAre;

// Norm 512 in the plane of the first axes, turned by `angle`: four entries share each axis so that they fit a
// byte.
ClassAppearance Look(double angle, double radius, double x, int num_observations) {
  ClassAppearance look;
  look.centre.setZero();
  for (int i = 0; i < 4; ++i) {
    look.centre[i] = static_cast<uint8_t>(std::min(255.0, std::round(256 * std::cos(angle))));
    look.centre[4 + i] = static_cast<uint8_t>(std::min(255.0, std::round(256 * std::sin(angle))));
  }
  look.radius_rad = radius;
  look.position.x() = x;
  look.num_observations = num_observations;
  return look;
}

TEST(FindAmbiguous, LookAlikesApartAreBothDropped) {
  //   angle   0.1   0.2         1.0
  //   place   0 m   5 m         9 m      radius 0.15: the first two cannot be told apart
  EXPECT_THAT(FindAmbiguous({Look(0.1, 0.15, 0, 5), Look(0.2, 0.15, 5, 5), Look(1.0, 0.15, 9, 5)}, {}),
              ElementsAre(Ambiguity::kAmbiguous, Ambiguity::kAmbiguous, Ambiguity::kNone));
}

TEST(FindAmbiguous, LookAlikesAtOnePlaceAreDuplicatesAndTheLargerStays) {
  EXPECT_THAT(FindAmbiguous({Look(0.1, 0.15, 0, 3), Look(0.2, 0.15, 0.01, 8)}, {}),
              ElementsAre(Ambiguity::kDuplicate, Ambiguity::kNone));
}

TEST(FindAmbiguous, RuleCanBeSwitchedOff) {
  FindAmbiguousOptions options;
  options.min_separation_ratio = 0;
  EXPECT_THAT(FindAmbiguous({Look(0.1, 0.15, 0, 5), Look(0.2, 0.15, 5, 5)}, options),
              ElementsAre(Ambiguity::kNone, Ambiguity::kNone));
}

TEST(FindAmbiguous, FewClassesAreNeverAmbiguous) {
  EXPECT_TRUE(FindAmbiguous({}, {}).empty());
  EXPECT_THAT(FindAmbiguous({Look(0.1, 0.5, 0, 5)}, {}), ElementsAre(Ambiguity::kNone));
}

TEST(FindAmbiguous, NearestClassIsFoundExactlyAmongMany) {
  constexpr double kRadius = 0.95;
  Random random(5);
  std::vector<ClassAppearance> classes(500);
  for (ClassAppearance& c : classes) {
    Eigen::Matrix<double, 1, kDescriptorDim> d;
    for (int k = 0; k < kDescriptorDim; ++k) d[k] = std::pow(random.Uniform(), 3);
    c.centre = (d * 512 / d.norm()).array().round().cwiseMin(255.0).cast<uint8_t>();
    c.radius_rad = kRadius;
    c.position = Eigen::Vector3d(random.Uniform(0, 100), 0, 0);
  }
  std::vector<Ambiguity> expected(classes.size(), Ambiguity::kNone);
  for (size_t i = 0; i < classes.size(); ++i) {
    for (size_t j = 0; j < classes.size(); ++j) {
      const double dot = classes[i].centre.cast<int>().dot(classes[j].centre.cast<int>()) / (512.0 * 512.0);
      if (i != j && std::acos(std::min(1.0, dot)) <= kRadius) expected[i] = Ambiguity::kAmbiguous;
    }
  }
  EXPECT_GT(std::count(expected.begin(), expected.end(), Ambiguity::kAmbiguous), 0);
  EXPECT_LT(std::count(expected.begin(), expected.end(), Ambiguity::kAmbiguous), 500);
  EXPECT_EQ(FindAmbiguous(classes, {}), expected);
}

TEST(DescribeClass, RadiusOfEqualDescriptorsIsZero) {
  const ClassAppearance look = Look(0.3, 0, 0, 1);
  ClassAppearance described;
  DescribeClass({look.centre.data(), look.centre.data()}, &described);
  EXPECT_NEAR(described.radius_rad, 0, 0.08);  // quantisation: acos near 1 is steep
}

}  // namespace
}  // namespace cairn
