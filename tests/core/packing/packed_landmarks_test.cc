#include "core/packing/packed_landmarks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include "core/base/blob.h"
#include "core/base/random.h"
#include "core/packing/map_codes.h"
#include "core/packing/range_coder.h"
#include "tests/core/packing/page_decoder.h"

namespace cairn {
namespace {

using testing::ElementsAre;

constexpr double kMicrometre = 1e-6;

// A landmark as its bytes have it.
struct StoredLandmark {
  int64_t class_id = 0, num_observations = 0, scale = 0;
  std::array<int64_t, 3> sizes = {}, ratios = {};
  std::array<int64_t, 3> position = {};  // 0.1 mm
  bool is_whole = false;
  TransformLevels levels = {};
  std::array<uint8_t, kSiftDescriptorDim> descriptor = {};
};

// log2 of the unit of positions, in 0.1 mm.
int PageShift(const std::array<int64_t, 3>& sizes) {
  const int64_t least = std::min({sizes[0], sizes[1], sizes[2]});
  return static_cast<int>(std::min<int64_t>(20, std::max<int64_t>(0, (least - 1) / 4 - 8)));
}

// Reads packed landmarks as schemas/FORMAT.md says it, written from that page alone.
class PageLandmarks {
 public:
  explicit PageLandmarks(std::string_view bytes) : decoder_(bytes.substr(1 + 128 + 12)) {
    BlobReader reader(bytes);
    step_ = reader.UInt8();
    mean_ = reader.Bytes(128);
    for (int64_t& coordinate : middle_) coordinate = static_cast<int32_t>(reader.UInt32());
    // Coefficient 8 (4 v + u) + f has the frequencies v, u and f's: 0, 1, 1, 2, 2, 3, 3, 4.
    for (int frequency = 0; frequency <= 10; ++frequency) {
      for (int i = 0; i < 128; ++i) {
        if (i / 32 + i / 8 % 4 + (i % 8 + 1) / 2 == frequency) order_.push_back(i);
      }
    }
  }

  StoredLandmark Next() {
    StoredLandmark read;
    class_id_ += UnZigZag(static_cast<uint64_t>(decoder_.Number("class step")));
    read.class_id = class_id_;
    read.num_observations = decoder_.Number("observations");
    read.scale = decoder_.Symbol("scale", 7);
    for (int i = 0; i < 3; ++i) read.sizes[i] = decoder_.Symbol("size" + std::to_string(i), 7);
    for (int i = 0; i < 3; ++i) read.ratios[i] = decoder_.Signed("ratio" + std::to_string(i));
    const auto unit = static_cast<double>(1 << PageShift(read.sizes));
    for (int i = 0; i < 3; ++i) {
      const double from = std::floor(static_cast<double>(middle_[i]) / unit + 0.5);
      read.position[i] = static_cast<int64_t>(
          unit * (from + static_cast<double>(decoder_.Signed("axis" + std::to_string(i)))));
    }
    read.is_whole = decoder_.Bit("whole", {});
    if (read.is_whole) {
      for (uint8_t& value : read.descriptor) value = static_cast<uint8_t>(decoder_.Bits(8));
      return read;
    }
    for (const int i : order_) read.levels[i] = static_cast<int16_t>(Level(i, read.levels));
    TransformCode code{.step = step_};
    std::copy(mean_.begin(), mean_.end(), code.mean.begin());
    DescriptorOf(read.levels, code, read.descriptor.data());
    return read;
  }

  int step() const { return step_; }
  std::array<int64_t, 3> middle() const { return middle_; }
  PageDecoder& decoder() { return decoder_; }

 private:
  int64_t Level(int coefficient, const TransformLevels& levels) {
    const int v = coefficient / 32, u = coefficient / 8 % 4, f = coefficient % 8;
    const auto known = [&](int dv, int du, int df) {
      return std::abs(levels[32 * (v - dv) + 8 * (u - du) + f - df]);
    };
    int around = 0;
    if (v >= 1) around += known(1, 0, 0);
    if (u >= 1) around += known(0, 1, 0);
    if (v >= 1 && u >= 1) around += known(1, 1, 0);
    if (f >= 3) around += known(0, 0, 2);
    const bool is_sine = f == 2 || f == 4 || f == 6;
    if (is_sine) around += known(0, 0, 1) + known(0, 0, 1);
    const std::vector<int64_t> model = {coefficient, around == 0 ? 0 : around <= 2 ? 1 : 2};
    if (!decoder_.Bit("not 0", model)) return 0;
    const bool is_negative = decoder_.Bit("negative", model);
    int64_t size = 1;
    while (size <= 14 && decoder_.Bit("more than " + std::to_string(size), model)) ++size;
    if (size == 15) size += decoder_.Number("large level");
    return is_negative ? -size : size;
  }

  PageDecoder decoder_;
  int step_ = 0;
  std::string_view mean_;
  std::array<int64_t, 3> middle_ = {};
  int64_t class_id_ = 0;
  std::vector<int> order_;
};

Eigen::Matrix3d RotatedCovariance(Random& random, double least_log10, double most_log10) {
  const Eigen::Quaterniond axes =
      Eigen::Quaterniond(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1))
          .normalized();
  Eigen::Vector3d variances;
  for (double& variance : variances) variance = std::pow(10, random.Uniform(least_log10, most_log10));
  return axes.toRotationMatrix() * variances.asDiagonal() * axes.toRotationMatrix().transpose();
}

// Classes ahead and back, places on both sides of the middle, covariances of 1 um to 3 m, and descriptors
// whose levels are of all sizes; some that no levels stand for.
PackedLandmarks VariedLandmarks(size_t num, int step, uint64_t seed) {
  PackedLandmarks packed;
  Random random(seed);
  packed.descriptors.resize(static_cast<Eigen::Index>(num), kSiftDescriptorDim);
  for (size_t i = 0; i < num; ++i) {
    MapLandmark landmark;
    landmark.class_id = static_cast<ClassId>(random.UniformInt(0, i % 3 == 0 ? 4'000'000'000 : 50));
    landmark.num_observations = static_cast<int>(random.UniformInt(0, i % 4 == 0 ? 2'000'000'000 : 30));
    landmark.position = {random.Normal(3, 5), random.Normal(-40, 3),
                         random.Normal(100, i % 5 == 0 ? 3000 : 1)};
    landmark.covariance = RotatedCovariance(random, i % 3 == 0 ? -12 : -6, i % 3 == 0 ? 1 : -3);
    landmark.scale_m = i % 7 == 0 ? 0 : std::pow(10, random.Uniform(-6, 2));
    packed.landmarks.push_back(landmark);
    // Peaks of the same place in several descriptors, so that neighbouring coefficients are of like size.
    const double size = i % 4 == 0 ? 200 : 40;
    for (int k = 0; k < kSiftDescriptorDim; ++k) {
      packed.descriptors(static_cast<Eigen::Index>(i), k) = static_cast<uint8_t>(std::min(
          255.0, size * std::abs(std::sin(0.1 * static_cast<double>(i) + 0.7 * k)) + 10 * random.Uniform()));
    }
  }
  packed.code = QuantizeByTransform(step, &packed.descriptors);
  for (size_t i = 5; i < num; i += 11)
    packed.descriptors.row(static_cast<Eigen::Index>(i)).setConstant(i % 2 == 0 ? 255 : 0);
  for (size_t i = 5; i < num; i += 11) packed.descriptors(static_cast<Eigen::Index>(i), 3) = 100;
  return packed;
}

double SizeOf(int64_t code) {
  return code == 0 ? 0 : kMicrometre * std::pow(2, static_cast<double>(code - 1) / 4);
}

int64_t CodeOf(double size) {
  if (size <= 0) return 0;
  return 1 +
         static_cast<int64_t>(std::min(126.0, std::max(0.0, std::round(4 * std::log2(size / kMicrometre)))));
}

// What a landmark's bytes say is what was packed.  Rows of the stored factor say of a coordinate, given those
// before, what the covariance says: expected as `slopes` of these, and off by the square root of the Schur
// complement.
void ExpectStands(const StoredLandmark& stored, const MapLandmark& landmark, const std::string& where) {
  SCOPED_TRACE(where);
  EXPECT_EQ(stored.class_id, landmark.class_id);
  EXPECT_EQ(stored.num_observations, landmark.num_observations);
  EXPECT_EQ(stored.scale, CodeOf(landmark.scale_m));
  Eigen::Matrix3d factor = Eigen::Matrix3d::Zero();
  int next = 0;
  for (int row = 0; row < 3; ++row) {
    const auto before = landmark.covariance.topLeftCorner(row, row);
    const Eigen::VectorXd with = landmark.covariance.col(row).head(row);
    Eigen::RowVectorXd wanted(row);
    double variance = landmark.covariance(row, row);
    if (row > 0) {
      const Eigen::VectorXd slopes = before.fullPivLu().solve(with);
      wanted = slopes.transpose() * factor.topLeftCorner(row, row);
      variance -= slopes.dot(with);
    }
    const double least = row == 0 ? 0 : wanted.cwiseAbs().maxCoeff() / 16384;
    EXPECT_EQ(stored.sizes[row], CodeOf(std::max(least, std::sqrt(std::max(0.0, variance)))));
    factor(row, row) = SizeOf(stored.sizes[row]);
    for (int col = 0; col < row; ++col, ++next) {
      EXPECT_EQ(stored.ratios[next], std::llround(wanted[col] / (factor(row, row) / 2)));
      factor(row, col) = static_cast<double>(stored.ratios[next]) * factor(row, row) / 2;
    }
  }
  // The unit of positions: half a unit beside half of 0.1 mm.
  const double unit_m = 1e-4 * (1 << PageShift(stored.sizes));
  for (int axis = 0; axis < 3; ++axis)
    EXPECT_NEAR(1e-4 * static_cast<double>(stored.position[axis]), landmark.position[axis],
                PageShift(stored.sizes) == 0 ? 0.5001e-4 : 0.5001 * unit_m + 0.5e-4);
}

void ExpectUnpacked(const MapLandmark& read, const StoredLandmark& stored) {
  EXPECT_EQ(read.class_id, stored.class_id);
  EXPECT_EQ(read.num_observations, stored.num_observations);
  EXPECT_DOUBLE_EQ(read.scale_m, SizeOf(stored.scale));
  Eigen::Matrix3d factor = Eigen::Matrix3d::Zero();
  factor.diagonal() =
      Eigen::Vector3d(SizeOf(stored.sizes[0]), SizeOf(stored.sizes[1]), SizeOf(stored.sizes[2]));
  factor(1, 0) = factor(1, 1) / 2 * static_cast<double>(stored.ratios[0]);
  factor(2, 0) = factor(2, 2) / 2 * static_cast<double>(stored.ratios[1]);
  factor(2, 1) = factor(2, 2) / 2 * static_cast<double>(stored.ratios[2]);
  const Eigen::Matrix3d covariance = factor * factor.transpose();
  EXPECT_LE((read.covariance - covariance).norm(), 1e-12 * covariance.norm());
  for (int axis = 0; axis < 3; ++axis)
    EXPECT_NEAR(read.position[axis], 1e-4 * static_cast<double>(stored.position[axis]), 1e-9);
}

TEST(PackedLandmarks, BytesAreThoseThatThePageDraws) {
  for (const int step : {2, 16, 60}) {
    const PackedLandmarks packed = VariedLandmarks(60, step, 11);
    const std::string bytes = PackLandmarks(packed);
    PackedLandmarks read;
    ASSERT_TRUE(UnpackLandmarks(bytes, packed.landmarks.size(), &read));
    EXPECT_EQ(read.code, packed.code);
    EXPECT_EQ(read.descriptors, packed.descriptors);
    PageLandmarks page(bytes);
    EXPECT_EQ(page.step(), step);
    for (size_t i = 0; i < packed.landmarks.size(); ++i) {
      const StoredLandmark stored = page.Next();
      ExpectStands(stored, packed.landmarks[i], std::to_string(step) + ": " + std::to_string(i));
      ExpectUnpacked(read.landmarks[i], stored);
      EXPECT_EQ(stored.is_whole, i % 11 == 5);
      EXPECT_TRUE(std::equal(stored.descriptor.begin(), stored.descriptor.end(),
                             packed.descriptors.data() + i * kSiftDescriptorDim));
    }
    EXPECT_TRUE(page.decoder().IsAtEnd());
  }
}

// What a map has and what an update brings: the models go on, the class id too, and places count from the
// middle of what is known.
TEST(PackedLandmarks, MoreGoOnWhereTheKnownOnesEnd) {
  const PackedLandmarks known = VariedLandmarks(40, 16, 12);
  PackedLandmarks more = VariedLandmarks(25, 16, 13);
  more.code = known.code;
  QuantizeByCode(known.code, &more.descriptors);
  const std::string bytes = PackMoreLandmarks(known, more);
  const std::string known_bytes = PackLandmarks(known);
  PageLandmarks page(known_bytes);
  for (size_t i = 0; i < known.landmarks.size(); ++i) page.Next();
  page.decoder().Start(bytes);
  PackedLandmarks read;
  ASSERT_TRUE(UnpackMoreLandmarks(known, bytes, more.landmarks.size(), &read));
  EXPECT_EQ(read.code, known.code);
  EXPECT_EQ(read.descriptors, more.descriptors);
  for (size_t i = 0; i < more.landmarks.size(); ++i) {
    const StoredLandmark stored = page.Next();
    ExpectStands(stored, more.landmarks[i], std::to_string(i));
    ExpectUnpacked(read.landmarks[i], stored);
    EXPECT_TRUE(std::equal(stored.descriptor.begin(), stored.descriptor.end(),
                           more.descriptors.data() + i * kSiftDescriptorDim));
  }
  EXPECT_TRUE(page.decoder().IsAtEnd());
}

// Of more than 4096 the first that many count.
TEST(PackedLandmarks, OfManyKnownOnesTheFirstCount) {
  const auto num = static_cast<Eigen::Index>(kMaxNumKnownLandmarks);
  PackedLandmarks first;
  first.descriptors = DescriptorMatrix::Zero(num, kSiftDescriptorDim);
  for (Eigen::Index i = 0; i < num; ++i) {
    first.landmarks.push_back({.class_id = static_cast<ClassId>(3 * i)});
    first.landmarks.back().position.x() = static_cast<double>(i);
  }
  PackedLandmarks all = first;
  for (int i = 0; i < 3; ++i) all.landmarks.push_back({.class_id = 5});
  all.descriptors = DescriptorMatrix::Zero(num + 3, kSiftDescriptorDim);
  const PackedLandmarks more = VariedLandmarks(3, 24, 14);
  EXPECT_EQ(PackMoreLandmarks(all, more), PackMoreLandmarks(first, more));
  first.landmarks.pop_back();
  EXPECT_NE(PackMoreLandmarks(all, more), PackMoreLandmarks(first, more));
}

PackedLandmarks AtPlaces(const std::vector<Eigen::Vector3d>& places) {
  PackedLandmarks packed;
  for (const Eigen::Vector3d& place : places) packed.landmarks.push_back({.position = place});
  packed.descriptors = DescriptorMatrix::Zero(static_cast<Eigen::Index>(places.size()), kSiftDescriptorDim);
  return packed;
}

// The greater of the two in the middle of an even number; by coordinate; of none 0.
TEST(PackedLandmarks, PlacesCountFromTheMedian) {
  const auto middle = [](const std::vector<Eigen::Vector3d>& places) {
    const std::string bytes = PackLandmarks(AtPlaces(places));
    return PageLandmarks(bytes).middle();
  };
  EXPECT_THAT(middle({}), ElementsAre(0, 0, 0));
  EXPECT_THAT(middle({{1, -2, 3}}), ElementsAre(10000, -20000, 30000));
  EXPECT_THAT(middle({{1, -2, 3}, {0, -1, 2}}), ElementsAre(10000, -10000, 30000));
  EXPECT_THAT(middle({{1, -2, 3}, {0, 5, 9}, {7, 1, 2}}), ElementsAre(10000, 10000, 30000));
  EXPECT_THAT(middle({{1, -2, 3}, {0, 5, 9}, {7, 1, 2}, {9, 9, -9}}), ElementsAre(70000, 50000, 30000));
}

// Standard deviations of 1 um 2^(k / 4) in all directions: codes 1 + k.  From 2^9 um on a unit is 2^(k / 4 -
// 8) of 0.1 mm, up to 2^20.
TEST(PackedLandmarks, UnitsGrowWithTheLeastDeviation) {
  std::vector<Eigen::Vector3d> places(127, Eigen::Vector3d(12.3456, -7.0001, 0.00026));
  PackedLandmarks packed = AtPlaces(places);
  for (size_t k = 0; k < places.size(); ++k) {
    const double sigma = kMicrometre * std::pow(2, 0.25 * static_cast<double>(k));
    // The least of the three, in turn.
    Eigen::Vector3d sigmas(4 * sigma, 4 * sigma, 4 * sigma);
    sigmas[static_cast<Eigen::Index>(k % 3)] = sigma;
    packed.landmarks[k].covariance = sigmas.cwiseAbs2().asDiagonal();
  }
  const std::string bytes = PackLandmarks(packed);
  PageLandmarks page(bytes);
  PackedLandmarks read;
  ASSERT_TRUE(UnpackLandmarks(bytes, places.size(), &read));
  for (size_t k = 0; k < places.size(); ++k) {
    const StoredLandmark stored = page.Next();
    EXPECT_EQ(stored.sizes[k % 3], static_cast<int64_t>(k) + 1);
    EXPECT_EQ(stored.sizes[(k + 1) % 3], std::min<int64_t>(static_cast<int64_t>(k) + 9, 127));
    ExpectStands(stored, packed.landmarks[k], std::to_string(k));
    ExpectUnpacked(read.landmarks[k], stored);
  }
}

TEST(PackedLandmarks, SizesBeyondTheScaleAreItsEnds) {
  PackedLandmarks packed = AtPlaces(std::vector<Eigen::Vector3d>(4, Eigen::Vector3d::Zero()));
  const double scales[] = {0, 1e-9, 1e9, 1.05 * kMicrometre * 16};
  for (int i = 0; i < 4; ++i) packed.landmarks[i].scale_m = scales[i];
  const std::string bytes = PackLandmarks(packed);
  PageLandmarks page(bytes);
  for (const int64_t code : {0, 1, 127, 17}) EXPECT_EQ(page.Next().scale, code);
}

// All three coordinates err as one, so the second is exactly known given the first: it gets a deviation of 1
// m / 16384 = 61.04 um, rounded to 64 um, of which 1 m is 31,250 halves; the third, expected as the second,
// whose row is (1 m, 64 um).
TEST(PackedLandmarks, ExactlyDependentCoordinatesGetADeviationThatTheRatiosReach) {
  PackedLandmarks packed = AtPlaces({Eigen::Vector3d::Zero()});
  packed.landmarks[0].covariance.setOnes();
  const std::string bytes = PackLandmarks(packed);
  const StoredLandmark stored = PageLandmarks(bytes).Next();
  EXPECT_THAT(stored.sizes, ElementsAre(81, 25, 25));  // 2^20 um = 1.05 m
  EXPECT_EQ(stored.ratios[0], std::llround(1.048576 / 32e-6));
  EXPECT_EQ(stored.ratios[1], std::llround(1.048576 / 32e-6));
  EXPECT_EQ(stored.ratios[2], 0);
}

// Nothing follows from a coordinate that is exactly known, whatever is stated beside its variance of 0.
TEST(PackedLandmarks, ExactlyKnownCoordinatesSayNothingOfOthers) {
  PackedLandmarks packed = AtPlaces(std::vector<Eigen::Vector3d>(2, Eigen::Vector3d::Zero()));
  packed.landmarks[0].covariance << 0, 1, 1, 1, 4, 2, 1, 2, 9;
  packed.landmarks[1].covariance << 4, 0, 2, 0, 0, 1, 2, 1, 9;
  const std::string bytes = PackLandmarks(packed);
  PageLandmarks page(bytes);
  const StoredLandmark first = page.Next();
  // L = (0; 0, 2; 0, 1, sqrt(8)): sizes 2 m, 2.83 m; of the third 1 m is expected of 2 m.
  EXPECT_THAT(first.sizes, ElementsAre(0, CodeOf(2), CodeOf(std::sqrt(8))));
  EXPECT_THAT(first.ratios,
              ElementsAre(0, 0, std::llround(SizeOf(CodeOf(2)) / SizeOf(CodeOf(std::sqrt(8))))));
  const StoredLandmark second = page.Next();
  EXPECT_THAT(second.sizes, ElementsAre(CodeOf(2), 0, CodeOf(std::sqrt(8))));
  EXPECT_THAT(second.ratios,
              ElementsAre(0, std::llround(SizeOf(CodeOf(2)) / SizeOf(CodeOf(std::sqrt(8)))), 0));
  EXPECT_EQ(first.position, second.position);
}

// One landmark that is written by hand, its descriptor as it is unless there are levels.
struct HandWritten {
  int64_t class_id = 7;
  uint64_t num_observations = 3;
  std::array<uint32_t, 3> sizes = {1, 1, 1};
  int64_t ratio = 0;
  std::array<int64_t, 3> position = {};  // in units
  int step = 24;
  std::optional<uint64_t> first_level;
};

std::string Bytes(const HandWritten& landmark) {
  BlobWriter writer;
  writer.UInt8(static_cast<uint8_t>(landmark.step));
  writer.Bytes(std::string(kSiftDescriptorDim + 12, '\0'));
  RangeEncoder encoder;
  AdaptiveBit bits[3];
  const auto put_signed = [&](int64_t value, AdaptiveBit* sign) {
    AdaptiveNumber number;
    number.Code(encoder, static_cast<uint64_t>(std::abs(value)));
    if (value != 0) encoder.Bit(sign, value < 0);
  };
  AdaptiveNumber step, observations;
  step.Code(encoder, ZigZag(landmark.class_id));
  observations.Code(encoder, landmark.num_observations);
  AdaptiveSymbol<7> scale, sizes[3];
  scale.Code(encoder, 0);
  for (int i = 0; i < 3; ++i) sizes[i].Code(encoder, landmark.sizes[i]);
  for (int i = 0; i < 3; ++i) {
    AdaptiveBit sign;
    put_signed(i == 0 ? landmark.ratio : 0, &sign);
  }
  for (int i = 0; i < 3; ++i) put_signed(landmark.position[i], &bits[i]);
  AdaptiveBit whole;
  encoder.Bit(&whole, !landmark.first_level);
  if (!landmark.first_level) {
    for (int i = 0; i < kSiftDescriptorDim; ++i) encoder.Bits(8, 9);
  } else {
    AdaptiveBit level[16], others[kSiftDescriptorDim];
    encoder.Bit(&level[0], true);
    encoder.Bit(&level[1], false);
    for (int i = 0; i < 14; ++i) encoder.Bit(&level[2 + i], true);
    AdaptiveNumber large;
    large.Code(encoder, *landmark.first_level - 15);
    for (int i = 1; i < kSiftDescriptorDim; ++i) encoder.Bit(&others[i], false);
  }
  writer.Bytes(encoder.Take());
  return writer.Take();
}

std::optional<MapLandmark> Read(const HandWritten& landmark) {
  PackedLandmarks read;
  if (!UnpackLandmarks(Bytes(landmark), 1, &read)) return std::nullopt;
  return read.landmarks[0];
}

TEST(PackedLandmarks, NumbersOutOfRangeAreRefused) {
  EXPECT_EQ(Read({})->class_id, 7u);
  EXPECT_EQ(Read({.class_id = 0})->class_id, 0u);
  EXPECT_FALSE(Read({.class_id = -1}));
  EXPECT_EQ(Read({.class_id = kInvalidClassId})->class_id, kInvalidClassId);
  EXPECT_FALSE(Read({.class_id = int64_t{kInvalidClassId} + 1}));
  EXPECT_EQ(Read({.num_observations = 2147483647})->num_observations, 2147483647);
  EXPECT_FALSE(Read({.num_observations = 2147483648}));
  EXPECT_TRUE(Read({.step = 1}));
  EXPECT_FALSE(Read({.step = 0}));
}

TEST(PackedLandmarks, PlacesBeyondTwoHundredKilometresAreRefused) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const int64_t sign : {1, -1}) {
      HandWritten landmark;
      landmark.position[axis] = sign * 2'000'000'000;
      EXPECT_DOUBLE_EQ(Read(landmark)->position[axis], static_cast<double>(sign) * 2e5);
      landmark.position[axis] += sign;
      EXPECT_FALSE(Read(landmark));
      // In units of 2^11 of 0.1 mm: 2e9 are 976,562.5 of them.
      landmark.sizes = {77, 77, 77};
      landmark.position[axis] = sign * 976'562;
      EXPECT_DOUBLE_EQ(Read(landmark)->position[axis], static_cast<double>(sign) * 976'562 * 0.2048);
      landmark.position[axis] += sign;
      EXPECT_FALSE(Read(landmark));
    }
  }
}

TEST(PackedLandmarks, PlacesAtTheLimitAreNotRoundedBeyondIt) {
  PackedLandmarks packed = AtPlaces({{2e5, -2e5, 2e5}});
  const double sigma = kMicrometre * (1 << 19);
  packed.landmarks[0].covariance = Eigen::Vector3d(sigma, sigma, sigma).cwiseAbs2().asDiagonal();
  PackedLandmarks read;
  ASSERT_TRUE(UnpackLandmarks(PackLandmarks(packed), 1, &read));
  EXPECT_DOUBLE_EQ(read.landmarks[0].position.x(), 976'562 * 0.2048);
  EXPECT_DOUBLE_EQ(read.landmarks[0].position.y(), -976'562 * 0.2048);
}

// Ratios end at 65,536, which are 32,768 of the deviation of their row.
TEST(PackedLandmarks, LargerRatiosAreTakenForTheLargest) {
  for (const int64_t sign : {1, -1}) {
    const double largest = static_cast<double>(sign) * 32768e-12;
    EXPECT_DOUBLE_EQ(Read({.ratio = sign * 65536})->covariance(0, 1), largest);
    EXPECT_DOUBLE_EQ(Read({.ratio = sign * 65537})->covariance(0, 1), largest);
    EXPECT_DOUBLE_EQ(Read({.ratio = sign * 65535})->covariance(0, 1),
                     largest - static_cast<double>(sign) * 0.5e-12);
  }
}

TEST(PackedLandmarks, LevelsOfMoreThanADescriptorAreRefused) {
  EXPECT_TRUE(Read({.step = 1, .first_level = 4096}));
  EXPECT_FALSE(Read({.step = 1, .first_level = 4097}));
  EXPECT_TRUE(Read({.step = 64, .first_level = 64}));
  EXPECT_FALSE(Read({.step = 64, .first_level = 65}));
}

TEST(PackedLandmarks, BytesCutOffOrAddedAreRefused) {
  const PackedLandmarks packed = VariedLandmarks(3, 24, 15);
  const std::string bytes = PackLandmarks(packed);
  PackedLandmarks read;
  for (size_t size = 0; size < bytes.size(); ++size)
    EXPECT_FALSE(UnpackLandmarks(std::string_view(bytes).substr(0, size), 3, &read)) << size;
  EXPECT_FALSE(UnpackLandmarks(bytes + '\0', 3, &read));
  EXPECT_TRUE(UnpackLandmarks(bytes, 3, &read));
}

}  // namespace
}  // namespace cairn
