#include "core/features/features.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/features/descriptor_distance.h"
#include "core/features/descriptor_kind_table.h"

namespace cairn {
namespace {

using testing::HasSubstr;

FloatDescriptors RandomFloats(int num, int num_values, uint64_t seed) {
  Random random(seed);
  FloatDescriptors floats(num, num_values);
  for (Eigen::Index i = 0; i < floats.size(); ++i) floats.data()[i] = static_cast<float>(random.Normal(0, 1));
  return floats;
}

double AngleOf(const FloatDescriptors& floats, int i, int j) {
  const Eigen::VectorXd a = floats.row(i).cast<double>().normalized(),
                        b = floats.row(j).cast<double>().normalized();
  return std::acos(std::clamp(a.dot(b), -1.0, 1.0));
}

TEST(DescriptorKind, TextStandsForTheKindAndNothingElseDoes) {
  for (const DescriptorKind& kind : {DescriptorKind(), DescriptorKind{DescriptorType::kFloat, 64, "kaze"},
                                     DescriptorKind{DescriptorType::kDense, 64, "xfeat-0a1b2c3d"},
                                     DescriptorKind{DescriptorType::kBinary, 488, ""}}) {
    EXPECT_EQ(*ParseDescriptorKind(ToString(kind)), kind) << ToString(kind);
  }
  EXPECT_EQ(ToString({DescriptorType::kBinary, 256, "orb"}), "binary 256 orb");
  for (const char* text : {"", "sift 128", "sifts", "float", "float 31", "float 1025", "float x",
                           "binary 260", "float 64 a b", "float 64.5", "binary -8", "float 64 a\x01"}) {
    EXPECT_EQ(ParseDescriptorKind(text).error().code, ErrorCode::kCorrupt) << text;
  }
  EXPECT_TRUE(ParseDescriptorKind("float 32").ok());
  EXPECT_TRUE(ParseDescriptorKind("float 1024").ok());
}

TEST(DescriptorKind, OthersAreRefusedAndAnExtractorThatIsNotKnownMayBeAny) {
  const DescriptorKind orb{DescriptorType::kBinary, 256, "orb"};
  EXPECT_TRUE(CheckSameKind(orb, orb, "q").ok());
  EXPECT_TRUE(CheckSameKind({DescriptorType::kBinary, 256, ""}, orb, "q").ok());
  EXPECT_TRUE(CheckSameKind(orb, {DescriptorType::kBinary, 256, ""}, "q").ok());
  EXPECT_FALSE(CheckSameKind({DescriptorType::kBinary, 256, "brief"}, orb, "q").ok());
  EXPECT_FALSE(CheckSameKind({DescriptorType::kBinary, 512, "orb"}, orb, "q").ok());
  EXPECT_FALSE(CheckSameKind({DescriptorType::kFloat, 256, "orb"}, orb, "q").ok());
  EXPECT_THAT(CheckSameKind({}, orb, "query.jpg").error().message,
              HasSubstr("query.jpg: descriptors of the kind 'sift', expected 'binary 256 orb'"));
}

TEST(DescriptorsFromFloats, KeepTheAnglesAndTheNorm) {
  for (const int num_values : {32, 64, 100, 128, 256, 512}) {
    const DescriptorKind kind{DescriptorType::kFloat, num_values, ""};
    FloatDescriptors floats = RandomFloats(40, num_values, 1);
    for (int i = 1; i < 20; ++i) floats.row(2 * i) += static_cast<float>(i) * floats.row(2 * i - 1);  // alike
    const DescriptorMatrix descriptors = *DescriptorsFromFloats(floats, kind);
    const DescriptorSpace space = kind.space();
    for (int i = 1; i < 40; ++i) {
      const double cosine =
          DescriptorDot(descriptors.row(i - 1).data(), descriptors.row(i).data(), space) / space.squared_norm;
      EXPECT_NEAR(cosine, std::max(std::cos(AngleOf(floats, i - 1, i)), 0.0), 0.01) << num_values << " " << i;
      const double squared_norm = (descriptors.row(i).cast<double>().array() - space.offset).square().sum();
      EXPECT_NEAR(squared_norm / space.squared_norm, 1, 0.02) << num_values << " " << i;
    }
  }
}

// SIFT as floating-point numbers, unnormalised, with values that are cut off.
TEST(DescriptorsFromFloats, AnyLengthIsTheSameAndLargeValuesAreCutOff) {
  const DescriptorKind kind{DescriptorType::kFloat, 64, ""};
  FloatDescriptors floats = RandomFloats(3, 64, 2);
  floats.row(1) = 1e-30F * floats.row(0);
  floats.row(2) = 1e30F * floats.row(0);
  const DescriptorMatrix descriptors = *DescriptorsFromFloats(floats, kind);
  EXPECT_EQ(descriptors.row(1), descriptors.row(0));
  EXPECT_EQ(descriptors.row(2), descriptors.row(0));
  FloatDescriptors peak = FloatDescriptors::Zero(2, 64);
  peak(0, 7) = -1;
  const DescriptorMatrix extreme = *DescriptorsFromFloats(peak, kind);
  EXPECT_EQ(extreme(0, 7), 1) << "128 - 127";
  EXPECT_EQ(extreme(0, 8), 128);
  EXPECT_TRUE((extreme.row(1).array() == 128).all()) << "no direction";
  EXPECT_EQ(DescriptorDot(extreme.row(1).data(), descriptors.row(0).data(), kind.space()), 0);
}

TEST(DescriptorsFromFloats, WhatIsNoVectorIsRefused) {
  const DescriptorKind kind{DescriptorType::kFloat, 64, ""};
  EXPECT_FALSE(DescriptorsFromFloats(RandomFloats(2, 63, 1), kind).ok());
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    FloatDescriptors floats = RandomFloats(3, 64, 1);
    floats(2, 63) = bad;
    EXPECT_THAT(DescriptorsFromFloats(floats, kind).error().message, HasSubstr("descriptor 2 "));
  }
  EXPECT_EQ(DescriptorsFromFloats(FloatDescriptors(0, 64), kind)->rows(), 0);
}

TEST(DescriptorsFromBits, AreAsFarApartAsTheirBitsDiffer) {
  const DescriptorKind kind{DescriptorType::kBinary, 488, "akaze"};
  std::string bytes(2 * 61, '\0');
  bytes[0] = '\x05';                         // bits 0 and 2
  bytes[61 + 60] = static_cast<char>(0x80);  // bit 487
  const DescriptorMatrix descriptors =
      DescriptorsFromBits(reinterpret_cast<const uint8_t*>(bytes.data()), 2, 61, kind);
  ASSERT_EQ(descriptors.cols(), 488);
  EXPECT_EQ(descriptors(0, 0), 2 * kind.space().offset);
  EXPECT_EQ(descriptors(0, 1), 0);
  EXPECT_EQ(descriptors(1, 487), 2 * kind.space().offset);
  EXPECT_EQ(BitsOfDescriptors(descriptors), bytes);
  const DescriptorSpace space = kind.space();
  const int32_t dot = DescriptorDot(descriptors.row(0).data(), descriptors.row(1).data(), space);
  EXPECT_NEAR(DescriptorAngleRad(dot, space), std::numbers::pi * 3 / 488, 1e-12);
}

TEST(DescriptorDistance, AnglesAndDotProductsAreEachOthersInverse) {
  for (const DescriptorKind& kind :
       {DescriptorKind(), DescriptorKind{DescriptorType::kFloat, 256, ""},
        DescriptorKind{DescriptorType::kDense, 64, ""}, DescriptorKind{DescriptorType::kBinary, 256, ""}}) {
    const DescriptorSpace space = kind.space();
    for (const double angle : {0.05, 0.3, 0.7, 1.5}) {
      EXPECT_NEAR(DescriptorAngleRad(static_cast<int32_t>(DotAtAngle(angle, space)), space), angle, 0.01)
          << ToString(kind) << angle;
    }
    EXPECT_EQ(DescriptorAngleRad(static_cast<int32_t>(space.squared_norm) + 1, space), 0);
    EXPECT_NEAR(DescriptorAngleRad(0, space), std::numbers::pi / 2, 1e-12);
  }
  // dense: pi / 2 (angle / 0.75)^4
  const DescriptorSpace dense = DescriptorKind{DescriptorType::kDense, 1024, ""}.space();
  const auto at = [&](double angle) { return static_cast<int32_t>(dense.squared_norm * std::cos(angle)); };
  EXPECT_NEAR(DescriptorAngleRad(at(0.375), dense), std::numbers::pi / 32, 1e-4);
  EXPECT_NEAR(DescriptorAngleRad(at(0.76), dense), std::numbers::pi / 2, 1e-12);
}

TEST(MeanDescriptor, IsTheDirectionOfTheSumAboutTheOffset) {
  const DescriptorKind kind{DescriptorType::kFloat, 64, ""};
  const DescriptorMatrix descriptors = *DescriptorsFromFloats(RandomFloats(3, 64, 5), kind);
  Eigen::Matrix<double, 1, Eigen::Dynamic> sum = Eigen::Matrix<double, 1, Eigen::Dynamic>::Zero(64);
  Eigen::RowVectorXd direction = Eigen::RowVectorXd::Zero(64);
  for (int i = 0; i < 3; ++i) {
    sum += descriptors.row(i).cast<double>();
    direction += (descriptors.row(i).cast<double>().array() - 128).matrix();
  }
  direction *= 32 * 8 / direction.norm();
  const DescriptorRow mean = MeanDescriptor(sum, 3, kind.space());
  for (int d = 0; d < 64; ++d) EXPECT_EQ(mean[d], std::lround(direction[d]) + 128) << d;
  const DescriptorRow none = MeanDescriptor(Eigen::RowVectorXd::Constant(64, 2 * 128.0), 2, kind.space());
  EXPECT_TRUE((none.array() == 128).all());
}

TEST(DescriptorKindTable, WithoutOneDescriptorsAreSifts) {
  SQLite::Database database(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  WriteDescriptorKind(database, {});
  EXPECT_FALSE(HasDescriptorKind(database));
  EXPECT_TRUE(ReadDescriptorKind(database, "a.db")->is_sift());
  const DescriptorKind kind{DescriptorType::kBinary, 512, "brisk"};
  WriteDescriptorKind(database, kind);
  EXPECT_EQ(*ReadDescriptorKind(database, "a.db"), kind);
  database.exec("UPDATE descriptor_kind SET kind = 'bits 512'");
  EXPECT_THAT(ReadDescriptorKind(database, "a.db").error().message,
              HasSubstr("a.db: table descriptor_kind: "));
  database.exec("DELETE FROM descriptor_kind");
  EXPECT_EQ(ReadDescriptorKind(database, "a.db").error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace cairn
