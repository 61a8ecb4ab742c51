#include "core/learned/onnx_outline.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <set>

namespace cairn {
namespace {

// A protobuf message: fields, each with a number and a value, which is an integer or bytes.
struct Field {
  uint64_t number = 0;
  uint64_t integer = 0;
  std::string_view bytes;  // of another message, a text or packed values
};

// https://protobuf.dev/programming-guides/encoding
enum WireType : uint64_t { kVarint = 0, kFixed64 = 1, kBytes = 2, kFixed32 = 5 };

class MessageReader {
 public:
  explicit MessageReader(std::string_view bytes) : rest_(bytes) {}

  // Nothing at the end, and where the bytes are no field: is_broken then.
  std::optional<Field> Next() {
    if (rest_.empty() || is_broken_) return std::nullopt;
    Field field;
    const uint64_t tag = Varint();
    field.number = tag >> 3;
    switch (tag & 7) {
      case kVarint:
        field.integer = Varint();
        break;
      case kFixed64:
        field.bytes = Take(8);
        break;
      case kBytes:
        field.bytes = Take(Varint());
        break;
      case kFixed32:
        field.bytes = Take(4);
        break;
      default:
        is_broken_ = true;
    }
    if (field.number == 0) is_broken_ = true;
    if (is_broken_) return std::nullopt;
    return field;
  }

  bool is_broken() const { return is_broken_; }

 private:
  uint64_t Varint() {
    uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      const std::string_view byte = Take(1);
      if (byte.empty()) return 0;
      value |= static_cast<uint64_t>(byte[0] & 0x7f) << shift;
      if ((byte[0] & 0x80) == 0) return value;
    }
    is_broken_ = true;
    return 0;
  }

  std::string_view Take(uint64_t num_bytes) {
    if (num_bytes > rest_.size()) {
      is_broken_ = true;
      return {};
    }
    const std::string_view taken = rest_.substr(0, num_bytes);
    rest_.remove_prefix(num_bytes);
    return taken;
  }

  std::string_view rest_;
  bool is_broken_ = false;
};

// The numbers below are those of onnx.proto (ModelProto, GraphProto, NodeProto, ValueInfoProto, TensorProto).
constexpr uint64_t kModelIrVersion = 1, kModelGraph = 7;
constexpr uint64_t kGraphNode = 1, kGraphWeights = 5, kGraphInput = 11, kGraphOutput = 12;
constexpr uint64_t kNodeAttribute = 5, kAttributeTensor = 5;
constexpr uint64_t kValueName = 1, kValueType = 2, kTypeTensor = 1, kTensorShape = 2, kShapeSize = 1,
                   kSizeValue = 1;
constexpr uint64_t kWeightsType = 2, kWeightsFloats = 4, kWeightsName = 8, kWeightsRaw = 9;
constexpr uint64_t kFloatType = 1;

class OutlineReader {
 public:
  explicit OutlineReader(const std::string& path) : path_(path) {}

  Result<OnnxOutline> Read(std::string_view bytes) {
    bool has_version = false, has_graph = false;
    CAIRN_RETURN_IF_ERROR(ForEachField(bytes, [&](const Field& field) {
      if (field.number == kModelIrVersion) has_version = true;
      if (field.number != kModelGraph) return Ok();
      has_graph = true;
      return ReadGraph(field.bytes);
    }));
    if (!has_version || !has_graph)
      return Corrupt(path_, "is no ONNX file: it has no {}", has_graph ? "version" : "net");
    std::erase_if(outline_.inputs, [this](const OnnxTensor& input) { return weights_.contains(input.name); });
    return std::move(outline_);
  }

 private:
  template <typename Visit>
  Status ForEachField(std::string_view message, const Visit& visit) {
    MessageReader reader(message);
    while (const std::optional<Field> field = reader.Next()) CAIRN_RETURN_IF_ERROR(visit(*field));
    if (!reader.is_broken()) return Ok();
    return Corrupt(path_, "is no ONNX file, or damaged, or cut short: a field is not whole");
  }

  Status ReadGraph(std::string_view graph) {
    return ForEachField(graph, [&](const Field& field) {
      if (field.number == kGraphNode) return ReadNode(field.bytes);
      if (field.number == kGraphWeights) return ReadWeights(field.bytes);
      if (field.number == kGraphInput) return ReadTensor(field.bytes, &outline_.inputs.emplace_back());
      if (field.number == kGraphOutput) return ReadTensor(field.bytes, &outline_.outputs.emplace_back());
      return Ok();
    });
  }

  // Constants are weights too.
  Status ReadNode(std::string_view node) {
    return ForEachField(node, [&](const Field& field) {
      if (field.number != kNodeAttribute) return Ok();
      return ForEachField(field.bytes, [&](const Field& part) {
        return part.number == kAttributeTensor ? ReadWeights(part.bytes) : Ok();
      });
    });
  }

  Status ReadWeights(std::string_view weights) {
    std::string name;
    uint64_t type = 0;
    std::vector<std::string_view> values;
    CAIRN_RETURN_IF_ERROR(ForEachField(weights, [&](const Field& field) {
      if (field.number == kWeightsType) type = field.integer;
      if (field.number == kWeightsName) name = field.bytes;
      if (field.number == kWeightsFloats || field.number == kWeightsRaw) values.push_back(field.bytes);
      return Ok();
    }));
    weights_.insert(name);
    if (type != kFloatType) return Ok();
    for (const std::string_view bytes : values) {
      for (size_t i = 0; i + sizeof(float) <= bytes.size(); i += sizeof(float)) {
        float value = 0;
        std::memcpy(&value, bytes.data() + i, sizeof(float));
        if (std::isnan(value))
          return Corrupt(path_, "weight {} of \"{}\" is no number", i / sizeof(float), name);
      }
    }
    return Ok();
  }

  Status ReadTensor(std::string_view value, OnnxTensor* tensor) {
    return ForEachField(value, [&](const Field& field) {
      if (field.number == kValueName) tensor->name = field.bytes;
      if (field.number != kValueType) return Ok();
      return ForEachField(field.bytes, [&](const Field& type) {
        if (type.number != kTypeTensor) return Ok();
        return ForEachField(type.bytes, [&](const Field& part) {
          return part.number == kTensorShape ? ReadSizes(part.bytes, tensor) : Ok();
        });
      });
    });
  }

  Status ReadSizes(std::string_view shape, OnnxTensor* tensor) {
    return ForEachField(shape, [&](const Field& field) {
      if (field.number != kShapeSize) return Ok();
      tensor->sizes.push_back(0);
      return ForEachField(field.bytes, [&](const Field& size) {
        if (size.number == kSizeValue)
          tensor->sizes.back() = std::max<int64_t>(0, static_cast<int64_t>(size.integer));
        return Ok();
      });
    });
  }

  std::string path_;
  OnnxOutline outline_;
  std::set<std::string> weights_;
};

}  // namespace

Result<OnnxOutline> ReadOnnxOutline(std::string_view bytes, const std::string& path) {
  if (bytes.empty()) return Corrupt(path, "is empty; expected an ONNX file");
  return OutlineReader(path).Read(bytes);
}

std::string SizesText(const std::vector<int64_t>& sizes) {
  std::string text;
  for (const int64_t size : sizes) {
    if (!text.empty()) text += " x ";
    text += size == 0 ? "?" : fmt::format("{}", size);
  }
  return text.empty() ? "no sizes" : text;
}

}  // namespace cairn
