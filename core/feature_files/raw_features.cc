#include "core/feature_files/raw_features.h"

#include <cstring>

#include "core/base/printable.h"
#include "core/base/text.h"
#include "core/colmap/colmap_database.h"

namespace cairn {
namespace {

template <typename T>
float FloatAt(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(value));
  return static_cast<float>(value);
}

Keypoint KeypointOf(const FloatTable& table, Eigen::Index row, float shift_px) {
  Keypoint keypoint{.x = table(row, 0) + shift_px, .y = table(row, 1) + shift_px};
  const Eigen::Index columns = table.cols();
  if (columns == 3 || columns == 4) keypoint.scale = table(row, 2);
  if (columns == 4) keypoint.orientation = table(row, 3);
  if (columns == 6) return KeypointOfShape(keypoint.x, keypoint.y, &table(row, 2));
  return keypoint;
}

std::string Said(const NumberTable& table) {
  return fmt::format("{} {} a descriptor", table.num_cols,
                     table.type == NumberType::kUInt8 ? "bytes" : "floating-point numbers");
}

}  // namespace

int BytesOf(NumberType type) {
  switch (type) {
    case NumberType::kFloat16:
      return 2;
    case NumberType::kFloat32:
      return 4;
    case NumberType::kFloat64:
      return 8;
    case NumberType::kUInt8:
      return 1;
  }
  return 0;
}

std::optional<NumberType> NumberTypeOf(std::string_view name) {
  if (name.starts_with("numpy.") || name.starts_with("np.")) name.remove_prefix(name.find('.') + 1);
  if (name.starts_with('<') || name.starts_with('|') || name.starts_with('=')) name.remove_prefix(1);
  // "float": Python's, of 64 bits
  if (name == "float16" || name == "f2") return NumberType::kFloat16;
  if (name == "float32" || name == "f4") return NumberType::kFloat32;
  if (name == "float64" || name == "float" || name == "f8") return NumberType::kFloat64;
  if (name == "uint8" || name == "u1") return NumberType::kUInt8;
  return std::nullopt;
}

NumberTable Transposed(const NumberTable& table) {
  const int size = BytesOf(table.type);
  NumberTable turned{table.type, table.num_cols, table.num_rows, std::string(table.bytes.size(), '\0')};
  for (int64_t row = 0; row < table.num_rows; ++row) {
    for (int64_t col = 0; col < table.num_cols; ++col)
      std::memcpy(turned.bytes.data() + (col * table.num_rows + row) * size,
                  table.bytes.data() + (row * table.num_cols + col) * size, size);
  }
  return turned;
}

FloatTable Floats(const NumberTable& table) {
  FloatTable floats(table.num_rows, table.num_cols);
  const char* bytes = table.bytes.data();
  for (Eigen::Index i = 0; i < floats.size(); ++i, bytes += BytesOf(table.type)) {
    float& value = floats.data()[i];
    switch (table.type) {
      case NumberType::kFloat16:
        value = FloatAt<Eigen::half>(bytes);
        break;
      case NumberType::kFloat32:
        value = FloatAt<float>(bytes);
        break;
      case NumberType::kFloat64:
        value = FloatAt<double>(bytes);
        break;
      case NumberType::kUInt8:
        value = FloatAt<uint8_t>(bytes);
        break;
    }
  }
  return floats;
}

Result<DescriptorChoice> ParseDescriptorChoice(std::string_view text) {
  const std::vector<std::string> words = SplitWords(text);
  const bool is_type = !words.empty() && (words[0] == "auto" || words[0] == "sift" || words[0] == "float" ||
                                          words[0] == "dense" || words[0] == "binary");
  if (!is_type || words.size() > 2 || HasControlCharacter(std::string(text))) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "descriptors '{}'; expected auto, sift, float, dense or binary, and in a second word "
                     "what made them, as "
                     "in 'binary orb'",
                     text);
  }
  return DescriptorChoice{words[0], words.size() == 2 ? words[1] : ""};
}

Result<DescriptorKind> KindOf(const NumberTable& descriptors, const DescriptorChoice& choice) {
  const bool are_bytes = descriptors.type == NumberType::kUInt8;
  std::string type = choice.type;
  if (type == "auto") {
    type = !are_bytes                                   ? "float"
           : descriptors.num_cols == kSiftDescriptorDim ? "sift"
           : descriptors.num_cols < kSiftDescriptorDim  ? "binary"
                                                        : "";
    if (type.empty()) {
      return MakeError(ErrorCode::kUnsupported,
                       "{} may be numbers or bits; say which: float, dense or binary", Said(descriptors));
    }
  }
  DescriptorKind kind{.extractor = choice.extractor};
  if (type == "sift") {
    if (are_bytes && descriptors.num_cols == kSiftDescriptorDim) return kind;
    return MakeError(ErrorCode::kUnsupported, "{}; SIFT's are 128 bytes", Said(descriptors));
  }
  kind.type = type == "float"   ? DescriptorType::kFloat
              : type == "dense" ? DescriptorType::kDense
                                : DescriptorType::kBinary;
  if (kind.type == DescriptorType::kBinary && !are_bytes)
    return MakeError(ErrorCode::kUnsupported, "{}; bits come in bytes, eight in each", Said(descriptors));
  const int64_t num_values = descriptors.num_cols * (kind.type == DescriptorType::kBinary ? 8 : 1);
  if (num_values < kMinDescriptorDim || num_values > kMaxDescriptorDim) {
    return MakeError(ErrorCode::kUnsupported, "{}; descriptors of {} to {} values or bits are taken",
                     Said(descriptors), kMinDescriptorDim, kMaxDescriptorDim);
  }
  kind.num_values = static_cast<int>(num_values);
  return kind;
}

Result<DescriptorMatrix> DescriptorsOf(const NumberTable& table, const DescriptorKind& kind) {
  const bool are_numbers = kind.type == DescriptorType::kFloat || kind.type == DescriptorType::kDense;
  if (!are_numbers && table.type != NumberType::kUInt8)
    return MakeError(ErrorCode::kCorrupt, "{}; expected bytes", Said(table));
  Result<DescriptorMatrix> descriptors =
      are_numbers ? DescriptorsFromFloats(Floats(table), kind)
                  : DescriptorsFromBytes(reinterpret_cast<const uint8_t*>(table.bytes.data()), table.num_rows,
                                         table.num_cols, kind);
  if (!descriptors.ok()) return MakeError(ErrorCode::kCorrupt, "{}", descriptors.error().message);
  return descriptors;
}

Result<Features> FeaturesFromRaw(const RawFeatures& raw, const DescriptorKind& kind, float shift_px) {
  const FloatTable& table = raw.keypoints;
  const int64_t columns = table.cols();
  if (columns != 2 && columns != 3 && columns != 4 && columns != 6)
    return MakeError(ErrorCode::kUnsupported, "keypoints of {} numbers; 2, 3, 4 or 6 are known", columns);
  if (table.rows() != raw.descriptors.num_rows)
    return MakeError(ErrorCode::kCorrupt, "{} keypoints and {} descriptors", table.rows(),
                     raw.descriptors.num_rows);
  Features features{.keypoints = {}, .descriptors = DescriptorMatrix(0, kind.num_values), .kind = kind};
  for (Eigen::Index i = 0; i < table.rows(); ++i) {
    if (!table.row(i).allFinite())
      return MakeError(ErrorCode::kCorrupt, "keypoint {} has a number that is not finite", i);
    features.keypoints.push_back(KeypointOf(table, i, shift_px));
  }
  if (table.rows() == 0) return features;
  CAIRN_ASSIGN_OR_RETURN(features.descriptors, DescriptorsOf(raw.descriptors, kind));
  return features;
}

}  // namespace cairn
