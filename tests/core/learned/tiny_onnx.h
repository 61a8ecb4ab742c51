#pragma once

// ONNX files with a convolution for each output, written byte by byte.

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "core/learned/dense_heads.h"

namespace cairn {

// Protobuf: https://protobuf.dev/programming-guides/encoding
inline std::string Varint(uint64_t value) {
  std::string bytes;
  for (; value >= 0x80; value >>= 7) bytes += static_cast<char>(value | 0x80);
  return bytes + static_cast<char>(value);
}
inline std::string IntegerField(int number, uint64_t value) { return Varint(number << 3) + Varint(value); }
inline std::string BytesField(int number, std::string_view bytes) {
  return Varint(number << 3 | 2) + Varint(bytes.size()) + std::string(bytes);
}

// An output: `weights` and `bias` of a convolution with a kernel and a stride of 8 px.
struct TinyOutput {
  std::string name;
  int num_channels = 0;
  std::vector<float> weights;  // [channel][input channel][y][x]
  std::vector<float> bias;
};

inline std::string TinyTensor(const std::string& name, const std::vector<int>& sizes,
                              const std::vector<float>& values) {
  std::string tensor;
  for (const int size : sizes) tensor += IntegerField(1, size);
  std::string raw(values.size() * sizeof(float), '\0');
  std::memcpy(raw.data(), values.data(), raw.size());
  return tensor + IntegerField(2, 1) + BytesField(8, name) + BytesField(9, raw);
}

// A size of 0 is not fixed.
inline std::string TinyValue(const std::string& name, const std::vector<int>& sizes) {
  std::string shape;
  for (const int size : sizes) {
    shape += BytesField(1, size == 0 ? BytesField(2, "any") : IntegerField(1, size));
  }
  const std::string tensor = IntegerField(1, 1) + BytesField(2, shape);
  return BytesField(1, name) + BytesField(2, BytesField(1, tensor));
}

inline std::string TinyAttribute(const std::string& name, const std::vector<int>& values) {
  std::string attribute = BytesField(1, name);
  for (const int value : values) attribute += IntegerField(8, value);
  return BytesField(5, attribute + IntegerField(20, 7));
}

inline std::string TinyOnnx(const std::vector<int>& input, const std::vector<TinyOutput>& outputs) {
  std::string graph;
  for (const TinyOutput& output : outputs) {
    const std::string weights = output.name + "_weights", bias = output.name + "_bias";
    graph +=
        BytesField(1, BytesField(1, "image") + BytesField(1, weights) + BytesField(1, bias) +
                          BytesField(2, output.name) + BytesField(4, "Conv") +
                          TinyAttribute("kernel_shape", {kCellPx, kCellPx}) +
                          TinyAttribute("strides", {kCellPx, kCellPx}) + TinyAttribute("pads", {0, 0, 0, 0}));
    const int num_inputs =
        static_cast<int>(output.weights.size()) / output.num_channels / (kCellPx * kCellPx);
    graph += BytesField(
        5, TinyTensor(weights, {output.num_channels, num_inputs, kCellPx, kCellPx}, output.weights));
    graph += BytesField(5, TinyTensor(bias, {output.num_channels}, output.bias));
  }
  graph += BytesField(2, "tiny") + BytesField(11, TinyValue("image", input));
  for (const TinyOutput& output : outputs)
    graph += BytesField(12, TinyValue(output.name, {1, output.num_channels, 0, 0}));
  return IntegerField(1, 7) + BytesField(7, graph) + BytesField(8, IntegerField(2, 12));
}

// A net whose keypoints are bright pixels in the dark: logit 20 times the pixel's brightness, of "none" 10;
// the reliability is the cell's sum of brightness; descriptors of 3 values are (1, how far right, how far
// down the cell's light is).
inline std::vector<TinyOutput> BrightPixelOutputs() {
  constexpr int kPixels = kCellPx * kCellPx;
  TinyOutput keypoints{"keypoints", kNumKeypointLogits, std::vector<float>(kNumKeypointLogits * kPixels),
                       std::vector<float>(kNumKeypointLogits)};
  for (int k = 0; k < kPixels; ++k) keypoints.weights[k * kPixels + k] = 20;
  keypoints.bias.back() = 10;
  TinyOutput descriptors{"descriptors", 3, std::vector<float>(3 * kPixels), {1, 0, 0}};
  for (int k = 0; k < kPixels; ++k) {
    descriptors.weights[kPixels + k] = static_cast<float>(k % kCellPx) / kCellPx;
    descriptors.weights[2 * kPixels + k] = static_cast<float>(k / kCellPx) / kCellPx;
  }
  return {descriptors, keypoints, {"reliability", 1, std::vector<float>(kPixels, 1), {0}}};
}

}  // namespace cairn
