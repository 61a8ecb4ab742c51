#include "core/features/features.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/base/printable.h"
#include "core/base/text.h"

namespace cairn {
namespace {

constexpr int kFloatOffset = 128;
constexpr double kFloatUnit = 32;  // of the root mean square of a vector's values
constexpr double kMostFloat = 127;
// Cut off and made longer so many times: what is left to cut off then is less than is rounded.
constexpr int kNumCuts = 4;
constexpr double kBinaryNorm = 512;

constexpr std::array<std::pair<DescriptorType, std::string_view>, 4> kTypeNames = {
    {{DescriptorType::kSift, "sift"},
     {DescriptorType::kFloat, "float"},
     {DescriptorType::kDense, "dense"},
     {DescriptorType::kBinary, "binary"}}};

}  // namespace

DescriptorSpace DescriptorKind::space() const {
  switch (type) {
    case DescriptorType::kSift:
      return {};
    case DescriptorType::kFloat:
      return {num_values, kFloatOffset, DescriptorMeasure::kAngle, kFloatUnit * kFloatUnit * num_values};
    case DescriptorType::kDense:
      return {num_values, kFloatOffset, DescriptorMeasure::kDense, kFloatUnit * kFloatUnit * num_values};
    case DescriptorType::kBinary: {
      const int offset = static_cast<int>(std::lround(kBinaryNorm / std::sqrt(num_values)));
      return {num_values, offset, DescriptorMeasure::kHamming,
              static_cast<double>(offset) * offset * num_values};
    }
  }
  return {};
}

Result<DescriptorMatrix> DescriptorsFromFloats(const FloatDescriptors& values, const DescriptorKind& kind) {
  if (kind.is_sift() || kind.type == DescriptorType::kBinary) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "descriptors of floating-point values, expected bytes of the kind '{}'", ToString(kind));
  }
  if (values.cols() != kind.num_values) {
    return MakeError(ErrorCode::kInvalidArgument, "descriptors of {} values, expected {}", values.cols(),
                     kind.num_values);
  }
  const double norm = std::sqrt(kind.space().squared_norm);
  DescriptorMatrix descriptors(values.rows(), values.cols());
  for (Eigen::Index row = 0; row < values.rows(); ++row) {
    if (!values.row(row).allFinite())
      return MakeError(ErrorCode::kInvalidArgument, "descriptor {} has a value that is not finite", row);
    Eigen::RowVectorXd scaled = values.row(row).cast<double>();
    const double largest = scaled.cwiseAbs().maxCoeff();
    if (largest > 0) scaled /= largest;  // no square overflows
    for (int cut = 0; cut < kNumCuts && largest > 0; ++cut)
      scaled = (scaled * (norm / scaled.norm())).cwiseMax(-kMostFloat).cwiseMin(kMostFloat);
    descriptors.row(row) = (scaled.array().round() + kFloatOffset).cast<uint8_t>();
  }
  return descriptors;
}

DescriptorMatrix DescriptorsFromBits(const uint8_t* bytes, int64_t num_rows, int64_t num_bytes,
                                     const DescriptorKind& kind) {
  const auto one = static_cast<uint8_t>(2 * kind.space().offset);
  DescriptorMatrix descriptors(num_rows, 8 * num_bytes);
  for (Eigen::Index i = 0; i < descriptors.size(); ++i)
    descriptors.data()[i] = ((bytes[i / 8] >> (i % 8)) & 1) != 0 ? one : 0;
  return descriptors;
}

Result<DescriptorMatrix> DescriptorsFromBytes(const uint8_t* bytes, int64_t num_rows, int64_t num_bytes,
                                              const DescriptorKind& kind) {
  const bool is_binary = kind.type == DescriptorType::kBinary;
  if (!kind.is_sift() && !is_binary) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "descriptors of bytes, expected floating-point values: {} of the kind '{}'",
                     kind.num_values, ToString(kind));
  }
  const int expected = is_binary ? kind.num_values / 8 : kind.num_values;
  if (num_bytes != expected) {
    return MakeError(ErrorCode::kInvalidArgument, "descriptors of {} bytes, expected {} of the kind '{}'",
                     num_bytes, expected, ToString(kind));
  }
  if (is_binary) return DescriptorsFromBits(bytes, num_rows, num_bytes, kind);
  return DescriptorMatrix(Eigen::Map<const DescriptorMatrix::Matrix>(bytes, num_rows, num_bytes));
}

void RoundToBits(const DescriptorKind& kind, DescriptorMatrix* descriptors) {
  const int offset = kind.space().offset;
  for (Eigen::Index i = 0; i < descriptors->size(); ++i) {
    uint8_t& value = descriptors->data()[i];
    value = static_cast<uint8_t>(value > offset ? 2 * offset : 0);
  }
}

std::string BitsOfDescriptors(const DescriptorMatrix& descriptors) {
  std::string bytes(static_cast<size_t>(descriptors.size() / 8), '\0');
  for (Eigen::Index i = 0; i < descriptors.size(); ++i) {
    if (descriptors.data()[i] != 0)
      bytes[i / 8] = static_cast<char>(static_cast<uint8_t>(bytes[i / 8]) | 1u << (i % 8));
  }
  return bytes;
}

std::string ToString(const DescriptorKind& kind) {
  for (const auto& [type, name] : kTypeNames) {
    if (type != kind.type) continue;
    if (kind.is_sift()) return std::string(name);
    return fmt::format("{} {}{}{}", name, kind.num_values, kind.extractor.empty() ? "" : " ", kind.extractor);
  }
  return "";
}

Result<DescriptorKind> ParseDescriptorKind(std::string_view text) {
  const Error unknown = MakeError(
      ErrorCode::kCorrupt,
      "descriptors of the kind '{}'; expected 'sift', or 'float', 'dense' or 'binary', their {} to {} values "
      "(of bits a multiple of 8) and what made them",
      Printable(text), kMinDescriptorDim, kMaxDescriptorDim);
  const std::vector<std::string> words = SplitWords(text);
  const auto* const named = std::find_if(kTypeNames.begin(), kTypeNames.end(), [&](const auto& name) {
    return !words.empty() && name.second == words[0];
  });
  if (named == kTypeNames.end() || HasControlCharacter(std::string(text))) return unknown;
  DescriptorKind kind{.type = named->first};
  if (kind.is_sift()) return words.size() == 1 ? Result<DescriptorKind>(kind) : unknown;
  if (words.size() < 2 || words.size() > 3 || !ParseNumber(words[1], &kind.num_values) ||
      kind.num_values < kMinDescriptorDim || kind.num_values > kMaxDescriptorDim ||
      (kind.type == DescriptorType::kBinary && kind.num_values % 8 != 0)) {
    return unknown;
  }
  if (words.size() == 3) kind.extractor = words[2];
  return kind;
}

Status CheckSameKind(const DescriptorKind& found, const DescriptorKind& expected, std::string_view what) {
  const bool is_same_extractor =
      found.extractor == expected.extractor || found.extractor.empty() || expected.extractor.empty();
  if (found.type == expected.type && found.num_values == expected.num_values && is_same_extractor)
    return Ok();
  return MakeError(
      ErrorCode::kInvalidArgument,
      "{}: descriptors of the kind '{}', expected '{}': those of different kinds cannot be compared", what,
      ToString(found), ToString(expected));
}

}  // namespace cairn
