#include "core/learned/learned_model.h"

#include <algorithm>
#include <filesystem>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "core/files/file.h"
#include "tests/core/learned/tiny_onnx.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string WriteModel(const std::string& name, std::string_view bytes) {
  const std::string path = testing::TempDir() + "/" + name;
  EXPECT_TRUE(WriteFileAtomically(path, bytes).ok());
  return path;
}

LearnedModel OpenTiny(const std::vector<int>& input) {
  auto model = LearnedModel::Open(WriteModel("tiny.onnx", TinyOnnx(input, BrightPixelOutputs())));
  EXPECT_TRUE(model.ok()) << model.error().message;
  return std::move(model).value();
}

Error ErrorOf(const std::string& name, std::string_view bytes) {
  const auto model = LearnedModel::Open(WriteModel(name, bytes));
  EXPECT_FALSE(model.ok());
  return model.ok() ? Error() : model.error();
}

// A black image with bright pixels.
cv::Mat Night(cv::Size size, const std::vector<cv::Point>& stars, uchar brightness = 255) {
  cv::Mat image(size, CV_8UC1, cv::Scalar(0));
  for (const cv::Point star : stars) image.at<uchar>(star) = brightness;
  return image;
}

std::vector<cv::Point2f> PlacesOf(const Result<LearnedFeatures>& features) {
  std::vector<cv::Point2f> places;
  EXPECT_TRUE(features.ok());
  if (!features.ok()) return places;
  for (const Keypoint& keypoint : features->keypoints) places.emplace_back(keypoint.x, keypoint.y);
  return places;
}

TEST(OpenLearnedModel, SaysWhatIsWrongWithTheFile) {
  EXPECT_EQ(LearnedModel::Open(testing::TempDir() + "/none.onnx").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(LearnedModel::Open(testing::TempDir()).error().code, ErrorCode::kNotFound);
  const Error empty = ErrorOf("empty.onnx", "");
  EXPECT_EQ(empty.code, ErrorCode::kCorrupt);
  EXPECT_THAT(empty.message, HasSubstr("empty.onnx: is empty; expected an ONNX file"));
  std::string garbage(10000, '\0');
  uint32_t state = 1;
  for (char& byte : garbage) byte = static_cast<char>((state = state * 1664525 + 1013904223) >> 24);
  EXPECT_EQ(ErrorOf("garbage.onnx", garbage).code, ErrorCode::kCorrupt);
  EXPECT_EQ(ErrorOf("picture.onnx", "\x89PNG\r\n\x1a\n").code, ErrorCode::kCorrupt);
  const std::string whole = TinyOnnx({1, 1, 64, 64}, BrightPixelOutputs());
  const Error truncated = ErrorOf("truncated.onnx", whole.substr(0, whole.size() / 2));
  EXPECT_EQ(truncated.code, ErrorCode::kCorrupt);
  EXPECT_THAT(truncated.message, HasSubstr("cut short"));
}

TEST(OpenLearnedModel, HugeFilesAreNotRead) {
  const std::string path = WriteModel("huge.onnx", "");
  std::filesystem::resize_file(path, uint64_t{1} << 34);
  const auto model = LearnedModel::Open(path);
  std::filesystem::remove(path);
  ASSERT_FALSE(model.ok());
  EXPECT_EQ(model.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(model.error().message,
              HasSubstr("has 17179869184 bytes; a learned model has at most 536870912"));
}

TEST(OpenLearnedModel, NetsWithOtherOutputsAreNamedWithThem) {
  std::vector<TinyOutput> outputs = BrightPixelOutputs();
  outputs.pop_back();
  const Error two = ErrorOf("two.onnx", TinyOnnx({1, 1, 64, 64}, outputs));
  EXPECT_EQ(two.code, ErrorCode::kUnsupported);
  EXPECT_THAT(two.message, HasSubstr("two.onnx: the net has 2 outputs, expected three"));

  // 66 logits: no more the heads that are known.
  outputs = BrightPixelOutputs();
  outputs[1] = {"keypoints", 66, std::vector<float>(66 * 64), std::vector<float>(66)};
  const Error other = ErrorOf("other.onnx", TinyOnnx({1, 1, 64, 64}, outputs));
  EXPECT_EQ(other.code, ErrorCode::kUnsupported);
  EXPECT_THAT(other.message, HasSubstr("for 64 x 64 px are of 1 x 3 x 8 x 8, 1 x 66 x 8 x 8, 1 x 1 x 8 x 8"));
}

TEST(OpenLearnedModel, NetsWithOtherInputsAreNamedWithThem) {
  for (const auto& [input, text] :
       std::vector<std::pair<std::vector<int>, std::string>>{{{1, 2, 64, 64}, "1 x 2 x 64 x 64"},
                                                             {{1, 1, 64, 60}, "1 x 1 x 64 x 60"},
                                                             {{4, 1, 64, 64}, "4 x 1 x 64 x 64"},
                                                             {{1, 64, 64}, "1 x 64 x 64"},
                                                             {{1, 1, 64, 0}, "1 x 1 x 64 x ?"}}) {
    const Error error = ErrorOf("input.onnx", TinyOnnx(input, BrightPixelOutputs()));
    EXPECT_EQ(error.code, ErrorCode::kUnsupported);
    EXPECT_THAT(error.message, HasSubstr("input is of " + text + ", expected")) << error.message;
  }
}

TEST(OpenLearnedModel, WhatOpenCvDoesNotBuildIsUnsupported) {
  std::string bytes = TinyOnnx({1, 1, 64, 64}, BrightPixelOutputs());
  bytes.replace(bytes.find("Conv"), 4, "Cnov");
  const Error unknown = ErrorOf("unknown.onnx", bytes);
  EXPECT_EQ(unknown.code, ErrorCode::kUnsupported);
  EXPECT_THAT(unknown.message, HasSubstr("unknown.onnx: OpenCV"));
  // Weights for an input of three channels, which the net has not.
  EXPECT_EQ(ErrorOf("three.onnx", TinyOnnx({1, 3, 64, 64}, BrightPixelOutputs())).code,
            ErrorCode::kUnsupported);
}

TEST(OpenLearnedModel, WeightsThatAreNoNumbersAreCorrupt) {
  std::vector<TinyOutput> outputs = BrightPixelOutputs();
  outputs[0].bias[1] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(ErrorOf("nan.onnx", TinyOnnx({1, 1, 64, 64}, outputs)).code, ErrorCode::kCorrupt);
  outputs[0].bias[1] = std::numeric_limits<float>::infinity();
  const Error infinite = ErrorOf("infinite.onnx", TinyOnnx({1, 1, 64, 64}, outputs));
  EXPECT_EQ(infinite.code, ErrorCode::kCorrupt);
  EXPECT_THAT(infinite.message, HasSubstr("outputs for 64 x 64 px are no numbers"));
}

TEST(OpenLearnedModel, KnowsItsNameAndTheFilesHash) {
  const std::string bytes = TinyOnnx({1, 1, 64, 64}, BrightPixelOutputs());
  const auto model = LearnedModel::Open(WriteModel("night.v2.onnx", bytes));
  ASSERT_TRUE(model.ok()) << model.error().message;
  EXPECT_EQ(model->name(), "night.v2");
  EXPECT_EQ(model->hash(), HashContents(bytes));
  EXPECT_EQ(model->num_values(), 3);
}

TEST(LearnedModel, KeypointsAreCentresOfPixels) {
  for (const int side : {0, 64}) {
    LearnedModel model = OpenTiny({1, 1, side, side});
    const auto features = model.Extract(Night({64, 64}, {{20, 10}, {0, 0}, {63, 63}}), {});
    EXPECT_THAT(PlacesOf(features),
                ElementsAre(cv::Point2f(0.5, 0.5), cv::Point2f(20.5, 10.5), cv::Point2f(63.5, 63.5)));
    ASSERT_EQ(features->descriptors.rows(), 3);
    ASSERT_EQ(features->descriptors.cols(), 3);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(features->descriptors.row(i).norm(), 1, 1e-6);
    EXPECT_EQ(features->keypoints[0].scale, 0);
    EXPECT_EQ(features->keypoints[0].orientation, 0);
  }
}

TEST(LearnedModel, ChannelsOfAColourInputAreTheGreyImage) {
  std::vector<TinyOutput> outputs = BrightPixelOutputs();
  for (TinyOutput& output : outputs) {
    // The mean of three: a third of each weight.
    std::vector<float> weights;
    for (int channel = 0; channel < output.num_channels; ++channel) {
      for (int i = 0; i < 3 * 64; ++i) weights.push_back(output.weights[channel * 64 + i % 64] / 3);
    }
    output.weights = weights;
  }
  auto model = LearnedModel::Open(WriteModel("colour.onnx", TinyOnnx({1, 3, 64, 64}, outputs)));
  ASSERT_TRUE(model.ok()) << model.error().message;
  EXPECT_THAT(PlacesOf(model->Extract(Night({64, 64}, {{20, 10}}), {})),
              ElementsAre(cv::Point2f(20.5, 10.5)));
}

TEST(LearnedModel, ANetOfOneSizeSeesALargeImageAsOneOfAnySizeDoes) {
  // No sizes of cells or windows; stars at the seams, and pairs of which the fainter hides.
  std::vector<cv::Point> stars;
  for (int y = 1; y < 101; y += 7) {
    for (int x = y % 5; x < 203; x += 5) stars.emplace_back(x, y);
  }
  cv::Mat image = Night({203, 101}, stars, 240);
  for (int x = 3; x < 203; x += 11) image.at<uchar>(50, x) = 250;
  LearnedModel any = OpenTiny({1, 1, 0, 0}), one = OpenTiny({1, 1, 64, 64});
  const auto expected = any.Extract(image, {}), found = one.Extract(image, {});
  ASSERT_TRUE(expected.ok() && found.ok());
  EXPECT_GT(expected->keypoints.size(), 200u);
  EXPECT_EQ(PlacesOf(found), PlacesOf(expected));
  // Cells at the borders of windows look the same to this net.
  EXPECT_TRUE(found->descriptors.isApprox(expected->descriptors, 1e-5f));
}

TEST(LearnedModel, FeaturesAreOrderedByRowsAndTheBrightestAreKept) {
  LearnedModel model = OpenTiny({1, 1, 0, 0});
  cv::Mat image = Night({96, 96}, {{80, 4}, {4, 4}, {40, 80}}, 200);
  image.at<uchar>(60, 60) = 255;
  image.at<uchar>(52, 20) = 250;
  EXPECT_THAT(PlacesOf(model.Extract(image, {.max_num_features = 2})),
              ElementsAre(cv::Point2f(20.5, 52.5), cv::Point2f(60.5, 60.5)));
  // Of the three that are equal, the first.
  EXPECT_THAT(PlacesOf(model.Extract(image, {.max_num_features = 3})),
              ElementsAre(cv::Point2f(4.5, 4.5), cv::Point2f(20.5, 52.5), cv::Point2f(60.5, 60.5)));
  EXPECT_THAT(PlacesOf(model.Extract(image, {})),
              ElementsAre(cv::Point2f(4.5, 4.5), cv::Point2f(80.5, 4.5), cv::Point2f(20.5, 52.5),
                          cv::Point2f(60.5, 60.5), cv::Point2f(40.5, 80.5)));
}

TEST(LearnedModel, FaintKeypointsAreLeftOut) {
  // Logit 10 against "none" of 10, and 63 of 0: heat 0.499; 15.7 gives 0.997.
  LearnedModel model = OpenTiny({1, 1, 0, 0});
  cv::Mat image = Night({64, 64}, {{10, 10}}, 127);
  image.at<uchar>(50, 50) = 200;
  EXPECT_EQ(PlacesOf(model.Extract(image, {.min_score = 0.4})).size(), 2u);
  EXPECT_THAT(PlacesOf(model.Extract(image, {.min_score = 0.6})), ElementsAre(cv::Point2f(50.5, 50.5)));
}

TEST(LearnedModel, MaskedFeaturesLeaveRoomForOthers) {
  LearnedModel model = OpenTiny({1, 1, 0, 0});
  cv::Mat image = Night({70, 70}, {{10, 10}}, 200);
  image.at<uchar>(50, 50) = 255;
  cv::Mat mask(image.size(), CV_8UC1, cv::Scalar(255));
  mask.at<uchar>(50, 50) = 0;
  EXPECT_THAT(PlacesOf(model.Extract(image, {.max_num_features = 1}, mask)),
              ElementsAre(cv::Point2f(10.5, 10.5)));
}

TEST(LearnedModel, ImagesAreMadeSmallerAndKeypointsLarger) {
  // Twice as large as allowed: a pixel of the smaller image is 2 x 2 of the image's.
  LearnedModel model = OpenTiny({1, 1, 0, 0});
  for (const cv::Size size : {cv::Size(64, 128), cv::Size(128, 64)}) {
    const cv::Mat image = Night(size, {{40, 20}, {41, 20}, {40, 21}, {41, 21}});
    EXPECT_THAT(PlacesOf(model.Extract(image, {.max_image_side_px = 64})), ElementsAre(cv::Point2f(41, 21)));
    cv::Mat mask(size, CV_8UC1, cv::Scalar(255));
    EXPECT_EQ(PlacesOf(model.Extract(image, {.max_image_side_px = 64}, mask)).size(), 1u);
    mask(cv::Rect(40, 20, 2, 2)) = 0;
    EXPECT_EQ(PlacesOf(model.Extract(image, {.max_image_side_px = 64}, mask)).size(), 0u);
  }
}

TEST(LearnedModel, TinyAndBlankImagesHaveNoFeatures) {
  for (const int side : {0, 64}) {
    LearnedModel model = OpenTiny({1, 1, side, side});
    for (const cv::Size size : {cv::Size(1, 1), cv::Size(31, 200), cv::Size(64, 64), cv::Size(100, 33)}) {
      const auto features = model.Extract(cv::Mat(size, CV_8UC1, cv::Scalar(0)), {});
      ASSERT_TRUE(features.ok());
      EXPECT_TRUE(features->keypoints.empty());
      EXPECT_EQ(features->descriptors.rows(), 0);
      EXPECT_EQ(features->descriptors.cols(), 3);
    }
  }
}

TEST(LearnedModel, RefusesOtherImagesAndMasks) {
  LearnedModel model = OpenTiny({1, 1, 0, 0});
  EXPECT_EQ(model.Extract({}, {}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(model.Extract(cv::Mat(64, 64, CV_8UC3), {}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(model.Extract(cv::Mat(64, 64, CV_8UC1), {}, cv::Mat(32, 64, CV_8UC1)).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(model.Extract(cv::Mat(64, 64, CV_8UC1), {}, cv::Mat(64, 64, CV_32F)).error().code,
            ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace cairn
