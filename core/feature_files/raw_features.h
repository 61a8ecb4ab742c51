#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/features/features.h"

namespace cairn {

// Types of numbers in files, little-endian: NumPy's f2, f4, f8, u1.
enum class NumberType { kFloat16, kFloat32, kFloat64, kUInt8 };
int BytesOf(NumberType type);
// "float32", "f4", "<f4", "numpy.float32"; nothing for another.
std::optional<NumberType> NumberTypeOf(std::string_view name);

// Rows of numbers, one after the other.
struct NumberTable {
  NumberType type = NumberType::kFloat32;
  int64_t num_rows = 0;
  int64_t num_cols = 0;
  std::string bytes;
};
using FloatTable = FloatDescriptors;  // keypoints, too
FloatTable Floats(const NumberTable& table);
NumberTable Transposed(const NumberTable& table);

// Features of an image as a file has them.
struct RawFeatures {
  // x, y; x, y, scale; x, y, scale, orientation; or x, y and an affine shape a11 a12 a21 a22, as COLMAP's.
  FloatTable keypoints;
  NumberTable descriptors;
};

// What descriptors are.
struct DescriptorChoice {
  // "auto", "sift", "float", "dense" or "binary".  auto: floating-point numbers are "float"; of bytes 128 a
  // row are "sift", fewer "binary".
  std::string type = "auto";
  std::string extractor;  // DescriptorKind::extractor
};
// "auto", "float", "binary orb".  Errors: InvalidArgument.
Result<DescriptorChoice> ParseDescriptorChoice(std::string_view text);

// The kind of descriptors in a table.  Errors: Unsupported (says what was found, and what to do).
Result<DescriptorKind> KindOf(const NumberTable& descriptors, const DescriptorChoice& choice);

// In the form of their kind.  Errors: as FeaturesFromRaw.
Result<DescriptorMatrix> DescriptorsOf(const NumberTable& table, const DescriptorKind& kind);

// Keypoints moved by `shift_px` in x and y, descriptors in the form of their kind.  Errors: Corrupt (numbers
// that do not fit, or are not finite), Unsupported.
Result<Features> FeaturesFromRaw(const RawFeatures& raw, const DescriptorKind& kind, float shift_px);

}  // namespace cairn
