#include "core/learned/dense_heads.h"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

namespace cairn {
namespace {

using testing::ElementsAre;

// A net's output for a window of so many cells.
cv::Mat Output(int num_channels, cv::Size cells, float value = 0) {
  return cv::Mat({1, num_channels, cells.height, cells.width}, CV_32F, cv::Scalar(value));
}
float& At(cv::Mat& output, int channel, int y, int x) { return output.ptr<float>(0, channel, y)[x]; }

DenseHeads Take(const cv::Mat& keypoints, const cv::Mat& reliability, const cv::Mat& descriptors) {
  const cv::Size cells(keypoints.size[3], keypoints.size[2]);
  DenseHeads heads = EmptyHeads(cells, descriptors.size[1]);
  TakeOutputs(keypoints, reliability, descriptors, {{}, cells}, {}, &heads);
  return heads;
}

// Heads of 16 x 16 px with a heat of so many tenths, '.': none; reliability 1.
DenseHeads Hot(const std::vector<std::string>& rows) {
  DenseHeads heads = EmptyHeads({2, 2}, 1);
  heads.reliability = 1;
  for (size_t y = 0; y < rows.size(); ++y) {
    for (size_t x = 0; x < rows[y].size(); ++x) {
      if (rows[y][x] == '.') continue;
      heads.heat.at<float>(static_cast<int>(y), static_cast<int>(x)) =
          0.1f * static_cast<float>(rows[y][x] - '0');
    }
  }
  return heads;
}

std::vector<cv::Point> PixelsOf(const std::vector<Peak>& peaks) {
  std::vector<cv::Point> pixels;
  for (const Peak& peak : peaks) pixels.push_back(peak.pixel);
  return pixels;
}

TEST(TakeOutputs, HeatIsTheSoftmaxOf65AtThePixelOfItsChannel) {
  // Logit ln 36 among 64 zeros: 36 of 100.  Channel 19 is the cell's row 2, column 3; the last is no pixel.
  cv::Mat keypoints = Output(65, {2, 1});
  At(keypoints, 19, 0, 1) = std::log(36.0f);
  At(keypoints, 64, 0, 0) = std::log(36.0f);
  const DenseHeads heads = Take(keypoints, Output(1, {2, 1}), Output(4, {2, 1}));
  ASSERT_EQ(heads.heat.size(), cv::Size(16, 8));
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 16; ++x)
      EXPECT_NEAR(heads.heat.at<float>(y, x), x == 8 + 3 && y == 2 ? 0.36 : 0.01, 1e-6) << x << " " << y;
  }
}

TEST(TakeOutputs, LargeLogitsDoNotOverflow) {
  cv::Mat keypoints = Output(65, {1, 1}, -500);
  At(keypoints, 0, 0, 0) = 500;
  EXPECT_EQ(Take(keypoints, Output(1, {1, 1}), Output(4, {1, 1})).heat.at<float>(0, 0), 1);
}

TEST(TakeOutputs, DescriptorsAreOfNormOne) {
  cv::Mat descriptors = Output(2, {2, 1});
  At(descriptors, 0, 0, 1) = 3;
  At(descriptors, 1, 0, 1) = -4;
  const DenseHeads heads = Take(Output(65, {2, 1}), Output(1, {2, 1}), descriptors);
  EXPECT_FLOAT_EQ(heads.descriptors.at<float>(0, 2), 0.6f);
  EXPECT_FLOAT_EQ(heads.descriptors.at<float>(0, 3), -0.8f);
  EXPECT_EQ(heads.descriptors.at<float>(0, 0), 0);
}

TEST(TakeOutputs, APartOfAWindowGoesToItsPlaceInTheImage) {
  //   window, reliability:  1 2 3      image:  . . . .
  //                         4 5 6              . 5 6 .
  cv::Mat reliability = Output(1, {3, 2});
  for (int i = 0; i < 6; ++i) At(reliability, 0, i / 3, i % 3) = static_cast<float>(i + 1);
  DenseHeads heads = EmptyHeads({4, 2}, 1);
  TakeOutputs(Output(65, {3, 2}), reliability, Output(1, {3, 2}, 1), {1, 1, 2, 1}, {1, 1}, &heads);
  EXPECT_EQ(cv::countNonZero(heads.reliability != (cv::Mat_<float>(2, 4) << 0, 0, 0, 0, 0, 5, 6, 0)), 0);
  EXPECT_EQ(cv::countNonZero(heads.heat), 2 * 64);
  EXPECT_EQ(cv::countNonZero(heads.descriptors), 2);
}

TEST(FindPeaks, KeepsTheLargestOfFiveByFive) {
  const DenseHeads heads = Hot({"........",  //
                                ".5.43..2",  //
                                "........"});
  // 4 is two pixels from 5, 3 one from 4, and 2 three from 3.
  EXPECT_THAT(PixelsOf(FindPeaks(heads, {16, 16}, 0.05)), ElementsAre(cv::Point(1, 1), cv::Point(7, 1)));
  EXPECT_THAT(PixelsOf(FindPeaks(heads, {16, 16}, 0.25)), ElementsAre(cv::Point(1, 1)));
}

TEST(FindPeaks, OfEqualNeighboursTheFirstIsOne) {
  const DenseHeads heads = Hot({".55...5.",  //
                                "55......"});
  EXPECT_THAT(PixelsOf(FindPeaks(heads, {16, 16}, 0.05)), ElementsAre(cv::Point(1, 0), cv::Point(6, 0)));
}

TEST(FindPeaks, PixelsBeyondTheImageNeitherAreNorHidePeaks) {
  EXPECT_THAT(PixelsOf(FindPeaks(Hot({"...4.9.."}), {5, 16}, 0.05)), ElementsAre(cv::Point(3, 0)));
}

TEST(FindPeaks, ScoreIsHeatTimesTheReliabilityBetweenCells) {
  // Pixel (9, 4): its centre, 9.5 px, is 5.5 px beyond the first cell's centre of 4 px, of 8; the second
  // row's cells count 0.5 px of 8.
  DenseHeads heads = EmptyHeads({2, 2}, 1);
  heads.reliability = (cv::Mat_<float>(2, 2) << 0.2, 1, 0.2, 0.2);
  heads.heat.at<float>(4, 9) = 0.5f;
  heads.heat.at<float>(0, 0) = 0.5f;
  const std::vector<Peak> peaks = FindPeaks(heads, {16, 16}, 0.05);
  ASSERT_EQ(peaks.size(), 2u);
  EXPECT_NEAR(peaks[0].score, 0.5 * 0.2, 1e-6);  // beyond the outermost centres: the nearest cell
  EXPECT_NEAR(peaks[1].score, 0.5 * (0.2 + 0.8 * (5.5 / 8) * (7.5 / 8)), 1e-6);
}

TEST(DescriptorAt, IsTheCellsOwnAtItsCentre) {
  DenseHeads heads = EmptyHeads({3, 3}, 2);
  heads.descriptors = (cv::Mat_<float>(3, 6) << 1, 0, 1, 0, 1, 0, 1, 0, .6, -.8, 1, 0, 1, 0, 1, 0, 1, 0);
  const Eigen::VectorXf descriptor = DescriptorAt(heads, 12, 12);
  EXPECT_NEAR(descriptor[0], 0.6, 1e-6);
  EXPECT_NEAR(descriptor[1], -0.8, 1e-6);
}

TEST(DescriptorAt, IsCubicBetweenCentresAndOfNormOne) {
  // One row of four cells; half-way between the middle ones the weights are -3/32, 19/32, 19/32, -3/32.
  DenseHeads heads = EmptyHeads({4, 1}, 2);
  heads.descriptors = (cv::Mat_<float>(1, 8) << 0, 1, 1, 0, 0, 1, 1, 0);
  const Eigen::VectorXf half_way = DescriptorAt(heads, 16, 4);
  EXPECT_NEAR(half_way[0], std::sqrt(0.5), 1e-6);
  EXPECT_NEAR(half_way[1], std::sqrt(0.5), 1e-6);
  heads.descriptors = (cv::Mat_<float>(1, 8) << 0, 1, 1, 0, 1, 0, 1, 0);
  EXPECT_NEAR(DescriptorAt(heads, 16, 4)[1] / DescriptorAt(heads, 16, 4)[0], -3.0 / 35, 1e-6);
}

TEST(DescriptorAt, ContinuesTheOutermostCells) {
  DenseHeads heads = EmptyHeads({2, 1}, 2);
  heads.descriptors = (cv::Mat_<float>(1, 4) << .6, .8, .6, .8);
  for (const float x : {0.0f, 0.5f, 8.0f, 15.5f, 16.0f}) {
    EXPECT_NEAR(DescriptorAt(heads, x, 0.5f)[0], 0.6, 1e-6);
    EXPECT_NEAR(DescriptorAt(heads, x, 7.5f)[1], 0.8, 1e-6);
  }
}

}  // namespace
}  // namespace cairn
