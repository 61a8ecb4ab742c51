#include "core/packing/map_codes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace cairn {
namespace {

constexpr double kSmallestSizeM = 1e-6;
constexpr double kSizesPerOctave = 8;
constexpr int kSizeBits = 8;
constexpr int kAngleBits = 13;
// Odd, so that 0 is one of them: codes 0 .. 8190 are -90 to 90 degrees, both excluded.
constexpr int kNumAngles = (1 << kAngleBits) - 1;
constexpr double kQuaternionUnit = 1.0 / 2147483648.0;
constexpr double kEqualUnits = 64;

uint64_t EncodeAngle(double angle) {
  const int64_t code = std::llround(angle / std::numbers::pi * kNumAngles) + (kNumAngles - 1) / 2;
  return static_cast<uint64_t>(std::clamp<int64_t>(code, 0, kNumAngles - 1));
}

double DecodeAngle(uint64_t code) {
  const auto clamped = static_cast<double>(std::min<uint64_t>(code, kNumAngles - 1));
  return (clamped - (kNumAngles - 1) / 2.0) * std::numbers::pi / kNumAngles;
}

}  // namespace

int32_t EncodeLength(double metres) { return static_cast<int32_t>(std::llround(metres / kMapLengthUnitM)); }

uint8_t EncodeSize(double metres) {
  if (!(metres > 0)) return 0;
  return static_cast<uint8_t>(
      std::clamp(std::round(kSizesPerOctave * std::log2(metres / kSmallestSizeM)), 0.0, 254.0) + 1);
}

double DecodeSize(uint8_t code) {
  return code == 0 ? 0 : kSmallestSizeM * std::exp2((code - 1) / kSizesPerOctave);
}

uint64_t EncodeCovariance(const Eigen::Matrix3d& covariance) {
  // Cholesky's factor row by row; a pivot that is not positive leaves the rest of its column 0.
  Eigen::Matrix3d factor = Eigen::Matrix3d::Zero();
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col <= row; ++col) {
      double rest = covariance(row, col);
      for (int k = 0; k < col; ++k) rest -= factor(row, k) * factor(col, k);
      if (row == col) {
        factor(row, col) = std::sqrt(std::max(0.0, rest));
      } else if (factor(col, col) > 0) {
        factor(row, col) = rest / factor(col, col);
      }
    }
  }
  uint64_t code = 0;
  for (int row = 0; row < 3; ++row) {
    code = code << kSizeBits | EncodeSize(std::sqrt(std::max(0.0, covariance(row, row))));
  }
  // row 1 = sigma (sin a, cos a); row 2 = sigma (sin b, cos b sin c, cos b cos c)
  const double a = std::atan2(factor(1, 0), factor(1, 1));
  const double b = std::atan2(factor(2, 0), std::hypot(factor(2, 1), factor(2, 2)));
  const double c = std::atan2(factor(2, 1), factor(2, 2));
  for (const double angle : {a, b, c}) code = code << kAngleBits | EncodeAngle(angle);
  return code;
}

Eigen::Matrix3d DecodeCovariance(uint64_t code) {
  const auto take = [&](int bits) {
    const uint64_t value = code & ((uint64_t{1} << bits) - 1);
    code >>= bits;
    return value;
  };
  const double c = DecodeAngle(take(kAngleBits));
  const double b = DecodeAngle(take(kAngleBits));
  const double a = DecodeAngle(take(kAngleBits));
  Eigen::Vector3d sigma;
  for (int row = 2; row >= 0; --row) sigma[row] = DecodeSize(static_cast<uint8_t>(take(kSizeBits)));
  Eigen::Matrix3d factor = Eigen::Matrix3d::Zero();
  factor(0, 0) = sigma[0];
  factor.row(1).head<2>() = sigma[1] * Eigen::RowVector2d(std::sin(a), std::cos(a));
  factor.row(2) =
      sigma[2] * Eigen::RowVector3d(std::sin(b), std::cos(b) * std::sin(c), std::cos(b) * std::cos(c));
  return factor * factor.transpose();
}

void WriteRotation(const Eigen::Quaterniond& rotation, BlobWriter* writer) {
  const double wxyz[4] = {rotation.w(), rotation.x(), rotation.y(), rotation.z()};
  // Of such as are equally large but for rounding, the first: what is read is written as the same again.
  int largest = 0;
  for (int i = 1; i < 4; ++i) {
    if (std::abs(wxyz[i]) > std::abs(wxyz[largest]) + kEqualUnits * kQuaternionUnit) largest = i;
  }
  const double sign = wxyz[largest] < 0 ? -1 : 1;
  writer->UInt8(static_cast<uint8_t>(largest));
  for (int i = 0; i < 4; ++i) {
    if (i == largest) continue;
    writer->UInt32(
        static_cast<uint32_t>(static_cast<int32_t>(std::llround(sign * wxyz[i] / kQuaternionUnit))));
  }
}

Eigen::Quaterniond ReadRotation(BlobReader* reader) {
  const int largest = reader->UInt8();
  double wxyz[4] = {};
  double squared_norm = 0;
  for (int i = 0; i < 4; ++i) {
    if (i == largest) continue;
    wxyz[i] = static_cast<int32_t>(reader->UInt32()) * kQuaternionUnit;
    squared_norm += wxyz[i] * wxyz[i];
  }
  // The largest of four is at least 1/2.
  if (largest > 3 || squared_norm > 0.75 + 1e-6) {
    reader->Fail();
    return Eigen::Quaterniond::Identity();
  }
  wxyz[largest] = std::sqrt(1 - squared_norm);
  return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
}

void WriteRuns(const std::vector<int32_t>& values, BlobWriter* writer) {
  BlobWriter runs;
  uint64_t num_runs = 0;
  int64_t next = 0;  // least start of the next run
  for (size_t begin = 0; begin < values.size(); ++num_runs) {
    size_t end = begin + 1;
    while (end < values.size() && values[end] == values[end - 1] + 1) ++end;
    const size_t length = end - begin;
    runs.Varint(2 * static_cast<uint64_t>(values[begin] - next) + (length > 1 ? 1 : 0));
    if (length > 1) runs.Varint(length - 2);
    next = int64_t{values[end - 1]} + 2;
    begin = end;
  }
  writer->Varint(num_runs);
  writer->Bytes(runs.Take());
}

bool ReadRuns(BlobReader* reader, int64_t limit, int64_t* max_num_values, std::vector<int32_t>* values) {
  const uint64_t num_runs = reader->Varint();
  if (num_runs > reader->num_left()) return false;
  int64_t next = 0;
  for (uint64_t run = 0; run < num_runs; ++run) {
    const uint64_t head = reader->Varint();
    const uint64_t longer = head % 2 == 1 ? reader->Varint() : 0;
    const uint64_t length = head % 2 == 1 ? longer + 2 : 1;
    if (!reader->ok() || longer >= static_cast<uint64_t>(limit)) return false;
    const int64_t begin = next + static_cast<int64_t>(head / 2);
    const int64_t end = begin + static_cast<int64_t>(length);
    *max_num_values -= static_cast<int64_t>(length);
    if (end > limit || *max_num_values < 0) return false;
    for (int64_t value = begin; value < end; ++value) values->push_back(static_cast<int32_t>(value));
    next = end + 1;
  }
  return reader->ok();
}

}  // namespace cairn
