#include "core/packing/map_codes.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "core/base/random.h"

namespace cairn {
namespace {

using testing::ElementsAre;

Eigen::Matrix3d RandomCovariance(Random& random) {
  // Standard deviations from 0.1 mm to 10 m along random axes.
  const Eigen::Quaterniond axes =
      Eigen::Quaterniond(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1))
          .normalized();
  Eigen::Vector3d variances;
  for (double& variance : variances) variance = std::pow(10, random.Uniform(-8, 2));
  return axes.toRotationMatrix() * variances.asDiagonal() * axes.toRotationMatrix().transpose();
}

TEST(MapCodes, LengthsAreTenthsOfAMillimetre) {
  EXPECT_EQ(EncodeLength(2.12344), 21234);
  EXPECT_EQ(EncodeLength(-0.00005001), -1);
  EXPECT_DOUBLE_EQ(DecodeLength(21234), 2.1234);
}

TEST(MapCodes, SizesAreWithinFourAndAHalfPercent) {
  EXPECT_EQ(EncodeSize(0), 0);
  EXPECT_EQ(DecodeSize(0), 0);
  EXPECT_EQ(EncodeSize(1e-6), 1);
  EXPECT_EQ(EncodeSize(2e-6), 9);  // an octave is 8 steps
  EXPECT_EQ(EncodeSize(1e-12), 1);
  EXPECT_EQ(EncodeSize(1e12), 255);
  for (double size = 1.1e-6; size < 3e3; size *= 1.07) {
    EXPECT_NEAR(DecodeSize(EncodeSize(size)) / size, 1, 0.045) << size;
  }
  for (int code = 0; code < 256; ++code) EXPECT_EQ(EncodeSize(DecodeSize(static_cast<uint8_t>(code))), code);
}

TEST(MapCodes, CovariancesKeepDeviationsAndCorrelations) {
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Matrix3d covariance = RandomCovariance(random);
    const Eigen::Matrix3d decoded = DecodeCovariance(EncodeCovariance(covariance));
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(std::sqrt(decoded(axis, axis) / covariance(axis, axis)), 1, 0.045);
      const int other = (axis + 1) % 3;
      const double scale = std::sqrt(covariance(axis, axis) * covariance(other, other));
      const double decoded_scale = std::sqrt(decoded(axis, axis) * decoded(other, other));
      EXPECT_NEAR(decoded(axis, other) / decoded_scale, covariance(axis, other) / scale, 1e-3);
    }
  }
}

TEST(MapCodes, AnyBitsAreACovarianceWithTheSameCode) {
  Random random(2);
  for (int i = 0; i < 10000; ++i) {
    const uint64_t bits = random.Bits();
    const Eigen::Matrix3d covariance = DecodeCovariance(bits);
    ASSERT_TRUE(covariance.allFinite());
    // Cholesky's pivots: not negative, up to rounding.
    const Eigen::Matrix3d scaled = covariance / std::max(1e-30, covariance.trace());
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scaled).eigenvalues().minCoeff(), -1e-12);
    const uint64_t code = EncodeCovariance(covariance);
    EXPECT_EQ(EncodeCovariance(DecodeCovariance(code)), code);
  }
}

TEST(MapCodes, ZeroAndFlatCovariancesAreKept) {
  EXPECT_EQ(DecodeCovariance(EncodeCovariance(Eigen::Matrix3d::Zero())), Eigen::Matrix3d::Zero());
  const Eigen::Vector3d direction(1, 2, -1);
  const Eigen::Matrix3d flat = direction * direction.transpose();
  const Eigen::Matrix3d decoded = DecodeCovariance(EncodeCovariance(flat));
  EXPECT_NEAR(decoded(0, 1) / std::sqrt(decoded(0, 0) * decoded(1, 1)), 1, 1e-6);
  EXPECT_NEAR(decoded(0, 2) / std::sqrt(decoded(0, 0) * decoded(2, 2)), -1, 1e-6);
}

TEST(MapCodes, RotationsKeepEightDigits) {
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Quaterniond rotation =
        Eigen::Quaterniond(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1))
            .normalized();
    BlobWriter writer;
    WriteRotation(rotation, &writer);
    const std::string bytes = writer.Take();
    ASSERT_EQ(bytes.size(), 13u);
    BlobReader reader(bytes);
    const Eigen::Quaterniond decoded = ReadRotation(&reader);
    ASSERT_TRUE(reader.Finished());
    EXPECT_LT(rotation.angularDistance(decoded), 3e-8);  // acos near 1 knows no better
    EXPECT_NEAR(std::abs(rotation.dot(decoded)), 1, 1e-15);
    BlobWriter again;
    WriteRotation(decoded, &again);
    EXPECT_EQ(again.Take(), bytes);
  }
}

TEST(MapCodes, EquallyLargePartsOfARotationAreWrittenAsTheSameAgain) {
  // Cameras that look along an axis have such: rounding then makes the one larger, or the other.
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    const double rest = random.Uniform(-0.3, 0.3);
    const double equal = std::sqrt((1 - rest * rest) / 2);
    Eigen::Vector4d parts(equal, equal + random.Uniform(-1e-10, 1e-10), rest, 0);
    if (i % 2 == 0) parts = Eigen::Vector4d(rest, parts[0], 0, -parts[1]);
    const Eigen::Quaterniond rotation(parts[0], parts[1], parts[2], parts[3]);
    BlobWriter writer, again;
    WriteRotation(rotation.normalized(), &writer);
    const std::string bytes = writer.Take();
    BlobReader reader(bytes);
    WriteRotation(ReadRotation(&reader), &again);
    EXPECT_EQ(again.Take(), bytes) << i;
  }
}

TEST(MapCodes, RotationThatIsNoneIsRefused) {
  for (const std::string& bytes : {std::string(13, '\x7f'), std::string("\4") + std::string(12, '\0')}) {
    BlobReader reader(bytes);
    ReadRotation(&reader);
    EXPECT_FALSE(reader.ok());
  }
}

std::string Runs(const std::vector<int32_t>& values) {
  BlobWriter writer;
  WriteRuns(values, &writer);
  return writer.Take();
}

TEST(MapCodes, RunsTakeAByteOrTwoEach) {
  // Runs 3; 7, 8, 9; 20: gaps 3, 7 - 5, 20 - 11.
  EXPECT_EQ(Runs({3, 7, 8, 9, 20}), std::string({3, 6, 5, 1, 18}));
  EXPECT_EQ(Runs({}), std::string({0}));
  EXPECT_EQ(Runs({0, 1}), std::string({1, 1, 0}));
}

TEST(MapCodes, RunsComeBack) {
  Random random(4);
  for (int i = 0; i < 200; ++i) {
    std::vector<int32_t> values;
    for (int32_t value = 0; value < 400; ++value) {
      if (random.Uniform() < (i % 10) / 10.0) values.push_back(value);
    }
    std::vector<int32_t> read;
    const std::string bytes = Runs(values);
    BlobReader reader(bytes);
    int64_t max_num_values = 400;
    ASSERT_TRUE(ReadRuns(&reader, 400, &max_num_values, &read));
    EXPECT_TRUE(reader.Finished());
    EXPECT_EQ(read, values);
    EXPECT_EQ(max_num_values, 400 - static_cast<int64_t>(values.size()));
  }
}

TEST(MapCodes, RunsBeyondTheLimitAreRefused) {
  const auto accepts = [](const std::string& bytes, int64_t limit, int64_t max_num_values) {
    std::vector<int32_t> values;
    BlobReader reader(bytes);
    return ReadRuns(&reader, limit, &max_num_values, &values);
  };
  EXPECT_TRUE(accepts(Runs({3, 7, 8, 9}), 10, 4));
  EXPECT_FALSE(accepts(Runs({3, 7, 8, 9}), 9, 4));
  EXPECT_FALSE(accepts(Runs({3, 7, 8, 9}), 10, 3));
  EXPECT_FALSE(accepts(Runs({3, 7, 8, 9}).substr(0, 3), 10, 4));
  EXPECT_FALSE(accepts(std::string("\xff\xff\xff\xff\xff\xff\xff\x7f"), 10, 4));
}

TEST(MapCodes, ZigZagKeepsSigns) {
  EXPECT_EQ(ZigZag(0), 0u);
  EXPECT_EQ(ZigZag(-1), 1u);
  EXPECT_EQ(ZigZag(1), 2u);
  for (const int64_t value : {int64_t{0}, int64_t{-5}, int64_t{1} << 40, -(int64_t{1} << 40)}) {
    EXPECT_EQ(UnZigZag(ZigZag(value)), value);
  }
}

}  // namespace
}  // namespace cairn
