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

// schemas/FORMAT.md draws the bits: three sizes of 8, three angles of 13, code 4095 for 0 degrees.
TEST(MapCodes, CovarianceBitsAreThoseThatThePageDraws) {
  const auto bits = [](uint64_t s1, uint64_t s2, uint64_t s3, uint64_t a, uint64_t b, uint64_t c) {
    return s1 << 55 | s2 << 47 | s3 << 39 | a << 26 | b << 13 | c;
  };
  // 2, 4 and 8 um: an octave is 8 steps, and 1 um is 1.
  const Eigen::Matrix3d straight = Eigen::Vector3d(4e-12, 16e-12, 64e-12).asDiagonal();
  EXPECT_EQ(EncodeCovariance(straight), bits(9, 17, 25, 4095, 4095, 4095));
  EXPECT_LT((DecodeCovariance(bits(9, 17, 25, 4095, 4095, 4095)) - straight).norm(), 1e-20);
  // Angles of 30, -45 and 60 degrees: 180 degrees are 8191 codes.
  const double degree = std::acos(-1) / 180;
  const double a = 30 * degree, b = -45 * degree, c = 60 * degree;
  Eigen::Matrix3d factor;
  factor << 2e-6, 0, 0,                           //
      4e-6 * std::sin(a), 4e-6 * std::cos(a), 0,  //
      8e-6 * std::sin(b), 8e-6 * std::cos(b) * std::sin(c), 8e-6 * std::cos(b) * std::cos(c);
  const Eigen::Matrix3d covariance = factor * factor.transpose();
  const uint64_t code = bits(9, 17, 25, 4095 + 1365, 4095 - 2048, 4095 + 2730);
  EXPECT_EQ(EncodeCovariance(covariance), code);
  EXPECT_LT((DecodeCovariance(code) - covariance).norm(), 1e-3 * covariance.norm());
  // +-90 degrees, where coordinates are exactly dependent, are taken for the outermost codes; one beyond is
  // the last.
  Eigen::Matrix3d flat;
  flat << 4, -4, 4, -4, 4, -4, 4, -4, 4;
  const uint64_t size = EncodeSize(2);
  EXPECT_EQ(EncodeCovariance(flat), bits(size, size, size, 0, 8190, 4095));
  EXPECT_EQ(DecodeCovariance(bits(9, 9, 9, 8191, 0, 4095)), DecodeCovariance(bits(9, 9, 9, 8190, 0, 4095)));
  const double outermost = 4095 * std::acos(-1) / 8191;
  EXPECT_NEAR(DecodeCovariance(bits(9, 9, 9, 8190, 4095, 4095))(0, 1), 4e-12 * std::sin(outermost), 1e-24);
}

// What a pivot of 0 is stated to have in common with others is left out, not divided by.
TEST(MapCodes, ExactlyKnownCoordinatesHaveNothingInCommonWithOthers) {
  Eigen::Matrix3d covariance;
  covariance << 0, 1, 1, 1, 4, 2, 1, 2, 9;
  const Eigen::Matrix3d decoded = DecodeCovariance(EncodeCovariance(covariance));
  EXPECT_EQ(decoded(0, 0), 0);
  EXPECT_EQ(decoded(0, 1), 0);
  EXPECT_EQ(decoded(0, 2), 0);
  EXPECT_NEAR(decoded(1, 2) / std::sqrt(decoded(1, 1) * decoded(2, 2)), 1 / std::sqrt(9), 1e-3);
}

TEST(MapCodes, SizesAreTheNearestStep) {
  // 1 um 2^(k / 8): code k + 1 from half a step below to half a step above.
  for (int k = 0; k <= 254; ++k) {
    const double size = 1e-6 * std::pow(2, k / 8.0);
    EXPECT_EQ(EncodeSize(size * std::pow(2, -0.49 / 8)), k + 1);
    EXPECT_EQ(EncodeSize(size * std::pow(2, 0.49 / 8)), k + 1);
    EXPECT_DOUBLE_EQ(DecodeSize(static_cast<uint8_t>(k + 1)), size);
  }
  EXPECT_EQ(EncodeSize(-1), 0);
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

// The number of the largest, then the others in 2^-31, little-endian, with the sign that makes the largest
// positive.
TEST(MapCodes, RotationBytesAreThoseThatThePageDraws) {
  const auto written = [](double w, double x, double y, double z) {
    BlobWriter writer;
    WriteRotation(Eigen::Quaterniond(w, x, y, z), &writer);
    return writer.Take();
  };
  const std::string zero(4, '\0'), half("\0\0\0\x40", 4), less_half("\0\0\0\xc0", 4);
  const double most = std::sqrt(0.75);
  EXPECT_EQ(written(most, 0.5, 0, 0), '\0' + half + zero + zero);
  EXPECT_EQ(written(-most, 0.5, 0, 0), '\0' + less_half + zero + zero);
  EXPECT_EQ(written(0.5, -most, 0, 0), '\1' + less_half + zero + zero);
  EXPECT_EQ(written(0, 0.5, most, 0), '\2' + zero + half + zero);
  EXPECT_EQ(written(0, 0, -0.5, most), '\3' + zero + zero + less_half);
  // Larger by up to 64 units is equally large, and the first is taken.
  const double unit = std::pow(2, -31);
  EXPECT_EQ(written(0.5, 0.5 + 64 * unit, 0, 0)[0], 0);
  EXPECT_EQ(written(0.5, 0.5 + 65 * unit, 0, 0)[0], 1);
  EXPECT_EQ(written(0.5, -0.5 - 64 * unit, 0, 0)[0], 0);
  EXPECT_EQ(written(0.5, -0.5 - 65 * unit, 0, 0)[0], 1);
}

// The three that are not the largest: 1/2 each, and a little more as rounding may have it.
TEST(MapCodes, RotationsOfFourEqualPartsMayBeALittleTooLong) {
  const auto accepts = [](uint32_t more) {
    BlobWriter writer;
    writer.UInt8(2);
    for (int i = 0; i < 3; ++i) writer.UInt32((1u << 30) + more);
    const std::string bytes = writer.Take();
    BlobReader reader(bytes);
    ReadRotation(&reader);
    return reader.ok();
  };
  EXPECT_TRUE(accepts(0));
  EXPECT_TRUE(accepts(700));   // squares: 0.75 + 3 * 700 / 2^31, which is 0.98e-6
  EXPECT_FALSE(accepts(730));  // 1.02e-6
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
  EXPECT_TRUE(accepts(Runs({9}), 10, 1));
  EXPECT_FALSE(accepts(Runs({10}), 10, 1));
  EXPECT_TRUE(accepts(Runs({}), 0, 0));
  EXPECT_FALSE(accepts(Runs({0}), 10, 0));
  EXPECT_FALSE(accepts({2, 0}, 10, 9));  // more runs than bytes
  // A gap and a length that are negative as signed numbers.
  const std::string huge = std::string(9, '\xfe') + '\1';
  EXPECT_FALSE(accepts('\1' + huge, 10, 9));
  EXPECT_FALSE(accepts("\1\1" + huge, 10, 9));
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
