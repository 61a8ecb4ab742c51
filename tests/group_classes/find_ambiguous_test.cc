#include "stages/group_classes/find_ambiguous.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn::group_classes {
namespace {

using testing::ElementsAre;

// Norm 512 in the plane of the first axes, turned by `angle`: four entries share each axis so that they
// fit a byte.
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
  EXPECT_THAT(FindAmbiguous({Look(0.1, 0.15, 0, 5), Look(0.2, 0.15, 5, 5), Look(1.0, 0.15, 9, 5)}, {}, {}),
              ElementsAre(Ambiguity::kAmbiguous, Ambiguity::kAmbiguous, Ambiguity::kNone));
}

TEST(FindAmbiguous, LookAlikesAtOnePlaceAreDuplicatesAndTheLargerStays) {
  EXPECT_THAT(FindAmbiguous({Look(0.1, 0.15, 0, 3), Look(0.2, 0.15, 0.01, 8)}, {}, {}),
              ElementsAre(Ambiguity::kDuplicate, Ambiguity::kNone));
}

TEST(FindAmbiguous, RuleCanBeSwitchedOff) {
  FindAmbiguousOptions options;
  options.min_separation_ratio = 0;
  EXPECT_THAT(FindAmbiguous({Look(0.1, 0.15, 0, 5), Look(0.2, 0.15, 5, 5)}, {}, options),
              ElementsAre(Ambiguity::kNone, Ambiguity::kNone));
}

TEST(FindAmbiguous, FewClassesAreNeverAmbiguous) {
  EXPECT_TRUE(FindAmbiguous({}, {}, {}).empty());
  EXPECT_THAT(FindAmbiguous({Look(0.1, 0.5, 0, 5)}, {}, {}), ElementsAre(Ambiguity::kNone));
}

TEST(FindAmbiguous, NearestLookAlikeMayBeTheDuplicateOfAnAmbiguousClass) {
  //   angle   0.10    0.13     0.22      radius 0.15: all three look alike
  //   place   0 m     0.01 m   5 m       0 and 1 are nearest to each other, and one scene feature;
  //                                      2 is nearest to 1, but cannot be told from 0 either
  EXPECT_THAT(
      FindAmbiguous({Look(0.10, 0.15, 0, 8), Look(0.13, 0.15, 0.01, 5), Look(0.22, 0.15, 5, 5)}, {}, {}),
      ElementsAre(Ambiguity::kAmbiguous, Ambiguity::kAmbiguous, Ambiguity::kAmbiguous));
}

TEST(FindAmbiguous, AWideClassTakesAllWithinItsRadius) {
  //   angle    0.5    0.6    0.75   0.9      each at a place of its own
  //   radius   0.3    0.01   0.01   0.01     0.5 + 0.3 reaches the third, which is not its nearest,
  //            W......................|      nor W the third's
  const std::vector<ClassAppearance> classes = {Look(0.5, 0.3, 0, 5), Look(0.6, 0.01, 3, 5),
                                                Look(0.75, 0.01, 6, 5), Look(0.9, 0.01, 9, 5)};
  const std::vector<Ambiguity> expected = {Ambiguity::kAmbiguous, Ambiguity::kAmbiguous,
                                           Ambiguity::kAmbiguous, Ambiguity::kNone};
  EXPECT_EQ(FindAmbiguous(classes, {}, {}), expected);
  // The same from the other end: whose radius it is does not depend on the order.
  EXPECT_EQ(FindAmbiguous({classes.rbegin(), classes.rend()}, {}, {}),
            (std::vector<Ambiguity>{expected.rbegin(), expected.rend()}));
}

TEST(FindAmbiguous, OfManyDuplicatesTheOneOfMostKeypointsStays) {
  //   keypoints   4   9   9   2      of equals the first
  EXPECT_THAT(
      FindAmbiguous({Look(0.10, 0.2, 0, 4), Look(0.12, 0.2, 0.01, 9), Look(0.14, 0.2, 0.02, 9),
                     Look(0.16, 0.2, 0.03, 2)},
                    {}, {}),
      ElementsAre(Ambiguity::kDuplicate, Ambiguity::kNone, Ambiguity::kDuplicate, Ambiguity::kDuplicate));
}

// What the header says, pair by pair.
std::vector<Ambiguity> Judged(const std::vector<ClassAppearance>& classes,
                              const FindAmbiguousOptions& options) {
  std::vector<Ambiguity> judged(classes.size(), Ambiguity::kNone);
  for (size_t i = 0; i < classes.size(); ++i) {
    for (size_t j = 0; j < classes.size(); ++j) {
      if (i == j) continue;
      const double dot = classes[i].centre.cast<int>().dot(classes[j].centre.cast<int>()) / (512.0 * 512.0);
      const double radius = std::max(classes[i].radius_rad, classes[j].radius_rad);
      if (std::acos(std::min(1.0, dot)) > options.min_separation_ratio * radius) continue;
      if ((classes[i].position - classes[j].position).norm() > options.max_duplicate_distance_m) {
        judged[i] = Ambiguity::kAmbiguous;
      } else if (judged[i] == Ambiguity::kNone &&
                 (classes[i].num_observations < classes[j].num_observations ||
                  (classes[i].num_observations == classes[j].num_observations && j < i))) {
        judged[i] = Ambiguity::kDuplicate;
      }
    }
  }
  return judged;
}

ClassAppearance RandomLook(Random& random) {
  ClassAppearance look;
  Eigen::Matrix<double, 1, kSiftDescriptorDim> d;
  for (int k = 0; k < kSiftDescriptorDim; ++k) d[k] = std::pow(random.Uniform(), 3);
  look.centre = (d * 512 / d.norm()).array().round().cwiseMin(255.0).cast<uint8_t>();
  look.position = Eigen::Vector3d(random.Uniform(0, 1), 0, 0);
  look.num_observations = static_cast<int>(random.UniformInt(2, 5));
  return look;
}

TEST(FindAmbiguous, EveryPairIsJudgedWhateverTheRadii) {
  // From sets in which hardly any class has a look-alike to sets in which nearly all have many.
  for (const double widest : {0.75, 0.85, 0.95, 1.2}) {
    for (uint64_t seed = 0; seed < 4; ++seed) {
      Random random(MixSeed(18, seed));
      std::vector<ClassAppearance> classes(seed == 0 ? 130 : 700);
      for (ClassAppearance& c : classes) {
        c = RandomLook(random);
        c.radius_rad = random.Uniform(0.3, 1) * widest;
      }
      FindAmbiguousOptions options;
      options.max_duplicate_distance_m = 0.3;
      const std::vector<Ambiguity> found = FindAmbiguous(classes, {}, options);
      EXPECT_EQ(found, Judged(classes, options)) << widest << " " << seed;
      // By the ratio, too.
      options.min_separation_ratio = 0.9;
      EXPECT_EQ(FindAmbiguous(classes, {}, options), Judged(classes, options)) << widest << " " << seed;
    }
  }
}

TEST(FindAmbiguous, RepeatedTexturesAreJudgedPairByPair) {
  // 40 kinds of tiles, each found at 20 places or found twice at one: dense blocks of look-alikes.
  Random random(40);
  std::vector<ClassAppearance> classes;
  for (int kind = 0; kind < 40; ++kind) {
    const ClassAppearance look = RandomLook(random);
    for (int i = 0; i < 20; ++i) {
      classes.push_back(look);
      for (int k = 0; k < kSiftDescriptorDim; ++k)
        classes.back().centre[k] =
            static_cast<uint8_t>(std::clamp<int64_t>(look.centre[k] + random.UniformInt(-1, 1), 0, 255));
      classes.back().radius_rad = random.Uniform(0.005, 0.03);
      classes.back().position.x() = kind < 20 ? 0.0 : random.Uniform(0, 1);
      classes.back().num_observations = static_cast<int>(random.UniformInt(2, 5));
    }
  }
  const std::vector<Ambiguity> found = FindAmbiguous(classes, {}, {});
  EXPECT_EQ(found, Judged(classes, {}));
  for (const Ambiguity value : {Ambiguity::kNone, Ambiguity::kAmbiguous, Ambiguity::kDuplicate})
    EXPECT_GT(std::count(found.begin(), found.end(), value), 40);
}

TEST(FindAmbiguous, EqualLooksAreToldApartWhereTheRuleIsOff) {
  FindAmbiguousOptions options;
  options.min_separation_ratio = 0;
  EXPECT_THAT(FindAmbiguous({Look(0.1, 0.1, 0, 5), Look(0.1, 0.1, 5, 5)}, {}, options),
              ElementsAre(Ambiguity::kNone, Ambiguity::kNone));
  // Without a radius only equal looks are one.
  EXPECT_THAT(FindAmbiguous({Look(0.1, 0, 0, 5), Look(0.1, 0, 5, 5), Look(0.15, 0, 9, 5)}, {}, {}),
              ElementsAre(Ambiguity::kAmbiguous, Ambiguity::kAmbiguous, Ambiguity::kNone));
}

TEST(FindAmbiguous, WhatHasNothingInCommonIsWithinARadiusOfARightAngle) {
  FindAmbiguousOptions options;
  options.min_separation_ratio = 1;
  const std::vector<ClassAppearance> wide = {Look(0, 1.6, 0, 5), Look(M_PI / 2, 1.6, 5, 5)},
                                     narrower = {Look(0, 1.5, 0, 5), Look(M_PI / 2, 1.5, 5, 5)};
  EXPECT_THAT(FindAmbiguous(wide, {}, options), ElementsAre(Ambiguity::kAmbiguous, Ambiguity::kAmbiguous));
  EXPECT_THAT(FindAmbiguous(narrower, {}, options), ElementsAre(Ambiguity::kNone, Ambiguity::kNone));
}

TEST(DescribeClass, RadiusOfEqualDescriptorsIsZero) {
  const ClassAppearance look = Look(0.3, 0, 0, 1);
  ClassAppearance described;
  DescribeClass({look.centre.data(), look.centre.data()}, {}, &described);
  EXPECT_NEAR(described.radius_rad, 0, 0.08);  // quantisation: acos near 1 is steep
}

}  // namespace
}  // namespace cairn::group_classes
