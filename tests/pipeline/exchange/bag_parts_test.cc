// Cameras and pixels of ROS's messages.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/exchange/bags/camera_of_info.h"
#include "pipeline/exchange/bags/image_pixels.h"

namespace cairn::pipeline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(PictureOf, ReadsSixteenBitsOfBothByteOrdersAndRowsWithGaps) {
  const auto picture = [](bool is_big_endian) {
    ImageMessage image;
    image.width = 1;
    image.height = 2;
    image.encoding = "mono16";
    image.is_big_endian = is_big_endian;
    image.step = 4;
    image.bytes =
        is_big_endian ? std::string_view("\x12\xff..\x01\x00", 6) : std::string_view("\xff\x12..\x00\x01", 6);
    return PictureOf(image);
  };
  for (const bool is_big_endian : {false, true}) {
    const auto read = picture(is_big_endian);
    ASSERT_TRUE(read.ok()) << read.error().message;
    EXPECT_EQ(read->pixels.at<uint16_t>(0, 0), 0x12ff);
    EXPECT_EQ(read->grey.at<uint8_t>(0, 0), 0x12);  // the high byte, as image files are read
    EXPECT_EQ(read->grey.at<uint8_t>(1, 0), 0x01);
  }
}

TEST(CameraOfInfo, HasTheModelOfItsDistortion) {
  const auto camera_of = [](const std::string& model, std::vector<double> d) {
    CameraInfoMessage info;
    info.width = 8;
    info.height = 6;
    info.distortion_model = model;
    info.d = std::move(d);
    info.k = {10, 0, 4, 0, 11, 3, 0, 0, 1};
    return CameraOfInfo(info, false);
  };
  EXPECT_EQ(camera_of("plumb_bob", {0, 0, 0, 0, 0})->model, CameraModel::kPinhole);
  EXPECT_EQ(camera_of("", {})->model, CameraModel::kPinhole);
  EXPECT_EQ(camera_of("plumb_bob", {1, 2, 3, 4, 0})->model, CameraModel::kOpenCv);
  EXPECT_THAT(camera_of("plumb_bob", {1, 2, 3, 4})->params, ElementsAre(10, 11, 4.5, 3.5, 1, 2, 3, 4));
  EXPECT_EQ(camera_of("plumb_bob", {1, 2, 3, 4, 5})->model, CameraModel::kFullOpenCv);
  EXPECT_THAT(camera_of("rational_polynomial", {1, 2, 3, 4, 5, 6, 7, 8})->params,
              ElementsAre(10, 11, 4.5, 3.5, 1, 2, 3, 4, 5, 6, 7, 8));
  EXPECT_TRUE(camera_of("rational_polynomial", {1, 2, 3, 4, 5, 6, 7, 8, 0, 0, 0, 0, 0, 0}).ok());
  EXPECT_THAT(camera_of("rational_polynomial", {1, 2, 3, 4, 5, 6, 7, 8, 9}).error().message,
              HasSubstr("thin prisms"));
  EXPECT_EQ(camera_of("equidistant", {1, 2, 3, 4})->model, CameraModel::kOpenCvFisheye);
  EXPECT_EQ(camera_of("fisheye", {1, 2, 3, 4})->model, CameraModel::kOpenCvFisheye);
  EXPECT_FALSE(camera_of("equidistant", {1, 2, 3, 4, 5}).ok());
  EXPECT_FALSE(camera_of("plumb_bob", {std::nan(""), 0, 0, 0, 0}).ok());
}

TEST(CameraOfInfo, CountsPartsOfTheSensorAndBinningFromPixelCorners) {
  // The middle half of 16 x 12 pixels, two by two binned: 4 x 3.  The sensor's middle stays the middle.
  CameraInfoMessage info;
  info.width = 16;
  info.height = 12;
  info.k = {20, 0, 7.5, 0, 20, 5.5, 0, 0, 1};
  info.binning_x = info.binning_y = 2;
  info.roi_x = 4;
  info.roi_y = 3;
  info.roi_width = 8;
  info.roi_height = 6;
  const auto camera = CameraOfInfo(info, false);
  ASSERT_TRUE(camera.ok());
  EXPECT_EQ(camera->width, 4);
  EXPECT_EQ(camera->height, 3);
  EXPECT_THAT(camera->params, ElementsAre(10, 10, 2, 1.5));
}

}  // namespace
}  // namespace cairn::pipeline
