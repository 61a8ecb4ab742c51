#include "core/learned/onnx_outline.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/learned/tiny_onnx.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(OnnxOutline, NamesInputsAndOutputsWithTheirSizes) {
  const auto outline = ReadOnnxOutline(TinyOnnx({1, 1, 64, 0}, BrightPixelOutputs()), "net.onnx");
  ASSERT_TRUE(outline.ok()) << outline.error().message;
  EXPECT_THAT(outline->inputs, ElementsAre(OnnxTensor{"image", {1, 1, 64, 0}}));
  EXPECT_THAT(outline->outputs,
              ElementsAre(OnnxTensor{"descriptors", {1, 3, 0, 0}}, OnnxTensor{"keypoints", {1, 65, 0, 0}},
                          OnnxTensor{"reliability", {1, 1, 0, 0}}));
  EXPECT_EQ(SizesText(outline->inputs.front().sizes), "1 x 1 x 64 x ?");
}

TEST(OnnxOutline, LeavesWeightsOutOfTheInputs) {
  // A file of the format's first years has the weights among the inputs.
  const std::string graph = BytesField(5, TinyTensor("weights", {1}, {2})) +
                            BytesField(11, TinyValue("weights", {1})) +
                            BytesField(11, TinyValue("image", {1, 1, 8, 8}));
  const auto outline = ReadOnnxOutline(IntegerField(1, 3) + BytesField(7, graph), "net.onnx");
  ASSERT_TRUE(outline.ok()) << outline.error().message;
  EXPECT_THAT(outline->inputs, ElementsAre(OnnxTensor{"image", {1, 1, 8, 8}}));
}

TEST(OnnxOutline, EveryShorterFileIsCorrupt) {
  const std::string whole = TinyOnnx({1, 1, 64, 64}, {{"mean", 1, std::vector<float>(64, 1), {0}}});
  // What follows the net is the version of its operators: without it the file is whole for this reader.
  const size_t graph_end = whole.size() - BytesField(8, IntegerField(2, 12)).size();
  for (size_t length = 0; length < graph_end; ++length) {
    const auto outline = ReadOnnxOutline(std::string_view(whole).substr(0, length), "net.onnx");
    ASSERT_FALSE(outline.ok()) << length;
    EXPECT_EQ(outline.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(outline.error().message, HasSubstr("net.onnx"));
  }
}

TEST(OnnxOutline, WeightsThatAreNoNumbersAreNamed) {
  std::vector<TinyOutput> outputs = BrightPixelOutputs();
  outputs[1].weights[7] = std::numeric_limits<float>::quiet_NaN();
  const auto outline = ReadOnnxOutline(TinyOnnx({1, 1, 64, 64}, outputs), "net.onnx");
  ASSERT_FALSE(outline.ok());
  EXPECT_EQ(outline.error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(outline.error().message, "net.onnx: weight 7 of \"keypoints_weights\" is no number");
}

TEST(OnnxOutline, NeverEndingNumbersAreCorrupt) {
  EXPECT_EQ(ReadOnnxOutline(std::string(100, '\xff'), "net.onnx").error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(ReadOnnxOutline(std::string(100, '\0'), "net.onnx").error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace cairn
