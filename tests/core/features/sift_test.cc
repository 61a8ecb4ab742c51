#include "core/features/sift.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/pooled.h"
#include "core/sift/find_sift.h"
#include "tests/core/sift/sift_pictures.h"

namespace cairn {
namespace {

// A Gaussian blob whose centre is known in COLMAP's pixels.
cv::Mat Blob(double x, double y, double sigma) {
  cv::Mat image(96, 128, CV_8UC1);
  for (int row = 0; row < image.rows; ++row) {
    for (int column = 0; column < image.cols; ++column) {
      const double dx = column + 0.5 - x, dy = row + 0.5 - y;
      image.at<uint8_t>(row, column) = static_cast<uint8_t>(
          std::lround(60 + 180 * std::exp(-0.5 * (dx * dx + dy * dy) / (sigma * sigma))));
    }
  }
  return image;
}

TEST(ExtractSift, FindsTheCentreOfABlobInColmapsPixels) {
  for (const auto& [x, y] : {std::pair(60.5, 40.5), std::pair(61.0, 40.0), std::pair(60.25, 44.75)}) {
    const auto features = ExtractSift(Blob(x, y, 4.0), {});
    ASSERT_TRUE(features.ok());
    double least = 1e9;
    Keypoint nearest;
    for (const Keypoint& keypoint : features->keypoints) {
      if (const double distance = std::hypot(keypoint.x - x, keypoint.y - y); distance < least) {
        least = distance;
        nearest = keypoint;
      }
    }
    EXPECT_NEAR(nearest.x, x, 0.06);
    EXPECT_NEAR(nearest.y, y, 0.06);
    EXPECT_NEAR(nearest.scale, 4.0, 0.8);  // the blob's own sigma
  }
}

TEST(ExtractSift, BlankImageHasNoFeatures) {
  const auto features = ExtractSift(cv::Mat(50, 50, CV_8UC1, cv::Scalar(7)), {});
  ASSERT_TRUE(features.ok());
  EXPECT_TRUE(features->keypoints.empty());
  EXPECT_EQ(features->descriptors.rows(), 0);
}

TEST(ExtractSift, LargeImagesAreMadeSmallerAndTheirKeypointsLargerAgain) {
  SiftOptions options;
  options.max_image_side_px = 80;  // of 128 x 96: a factor of 1.6
  const auto features = ExtractSift(Blob(61.0, 40.0, 6.0), options);
  ASSERT_TRUE(features.ok());
  double least = 1e9;
  Keypoint nearest;
  for (const Keypoint& keypoint : features->keypoints) {
    if (const double distance = std::hypot(keypoint.x - 61.0, keypoint.y - 40.0); distance < least) {
      least = distance;
      nearest = keypoint;
    }
  }
  EXPECT_LT(least, 0.15);
  EXPECT_NEAR(nearest.scale, 6.0, 1.2);
}

TEST(ExtractSift, CappedFeaturesAreTheStrongestOfAllWithTies) {
  // Equal tiles: features of equal strength, of which the cap may take some and leave others.
  cv::Mat image;
  cv::repeat(Blob(50, 40, 5), 3, 3, image);
  const auto all = ExtractSift(image, {});
  // A mask that hides nothing: OpenCV's own cap is not used.
  const cv::Mat mask(image.size(), CV_8UC1, cv::Scalar(255));
  const size_t count = all->keypoints.size();
  ASSERT_GT(count, 9u);
  for (const size_t cap : {size_t{1}, size_t{4}, size_t{9}, count / 2, count - 1, count}) {
    const SiftOptions options{.max_num_features = static_cast<int>(cap)};
    const auto capped = ExtractSift(image, options), expected = ExtractSift(image, options, mask);
    ASSERT_EQ(capped->keypoints.size(), cap);
    EXPECT_EQ(capped->descriptors, expected->descriptors);
    for (size_t i = 0; i < cap; ++i) {
      EXPECT_EQ(capped->keypoints[i].x, expected->keypoints[i].x);
      EXPECT_EQ(capped->keypoints[i].y, expected->keypoints[i].y);
    }
  }
}

// Of a picture whose brightest tenth begins at a grey level.
cv::Mat PictureOfLevel(int level, double contrast = 0.3) {
  cv::Mat picture;
  RandomBlobs({200, 160}, 150, 1).convertTo(picture, CV_8U, contrast);
  std::vector<uint8_t> levels;
  for (int y = 0; y < picture.rows; y += 4)
    levels.insert(levels.end(), picture.ptr<uint8_t>(y), picture.ptr<uint8_t>(y) + picture.cols);
  // The 800th of 8,000 from the top.
  std::nth_element(levels.begin(), levels.begin() + 799, levels.end(), std::greater<>());
  return picture + cv::Scalar(level - levels[799]);
}

PooledVector<SiftFeature> FoundWithContrast(const cv::Mat& picture, double contrast_threshold) {
  return FindSift(picture, {}, {.max_num_features = 2000, .contrast_threshold = contrast_threshold});
}

TEST(ExtractSift, LessContrastIsEnoughInADarkImageByTheSquareOfItsBrightestTenth) {
  for (const auto& [level, contrast_threshold] :
       {std::pair(200, 0.02), std::pair(81, 0.02), std::pair(80, 0.02), std::pair(72, 0.0162),
        std::pair(60, 0.01125)}) {
    const cv::Mat picture = PictureOfLevel(level);
    const auto expected = FoundWithContrast(picture, contrast_threshold);
    const auto features = ExtractSift(picture, {});
    ASSERT_EQ(features->keypoints.size(), expected.size()) << level;
    for (size_t i = 0; i < expected.size(); ++i)
      EXPECT_EQ(features->keypoints[i].x, KeypointFromOpenCv(expected[i].x, 0, 0, 0).x) << level;
    EXPECT_EQ(expected.size() > FoundWithContrast(picture, 0.02).size(), level < 80) << level;
  }
}

TEST(ExtractSift, NoLessThanATenthOfTheContrastIsEnough) {
  for (const auto& [level, ratio] : {std::pair(5, 0.1), std::pair(25, 0.1), std::pair(26, 0.105625)}) {
    const cv::Mat picture = PictureOfLevel(level, 0.05);
    const size_t num = ExtractSift(picture, {})->keypoints.size();
    EXPECT_GT(num, 20u) << level;
    EXPECT_EQ(num, FoundWithContrast(picture, 0.02 * ratio).size()) << level;
  }
}

TEST(ExtractSift, BlackImagesHaveNoFeaturesOfNoise) {
  cv::Mat noise;
  Noise({200, 160}, 3).convertTo(noise, CV_8U, 5 / 256.0, -0.5);  // 0 to 4
  EXPECT_TRUE(ExtractSift(noise, {})->keypoints.empty());
  EXPECT_GT(FoundWithContrast(noise, 0.002).size(), 100u);
}

TEST(ExtractSift, WhatAMaskHidesMakesNoImageBright) {
  const cv::Mat dark = PictureOfLevel(60);
  cv::Mat picture = dark.clone(), mask(dark.size(), CV_8UC1, cv::Scalar(255));
  picture.colRange(150, 200).setTo(255);
  mask.colRange(140, 200).setTo(0);
  const auto found = ExtractSift(picture, {}, mask);
  const auto less = FindSift(picture, mask, {.contrast_threshold = 0.02});
  EXPECT_GT(found->keypoints.size(), less.size());
}

TEST(ExtractSift, ATenthOfTheLightLeavesMostFeatures) {
  const cv::Mat picture = RandomBlobs({400, 300}, 300, 2);
  cv::Mat dark;
  picture.convertTo(dark, CV_8U, 0.1);
  const auto bright = ExtractSift(picture, {}), found = ExtractSift(dark, {});
  EXPECT_LT(FoundWithContrast(dark, 0.02).size(), bright->keypoints.size() / 10);
  size_t num_again = 0;
  for (const Keypoint& keypoint : bright->keypoints) {
    num_again += std::any_of(found->keypoints.begin(), found->keypoints.end(), [&](const Keypoint& other) {
      return std::hypot(other.x - keypoint.x, other.y - keypoint.y) < 0.2 * keypoint.scale + 0.5;
    });
  }
  EXPECT_GT(num_again, bright->keypoints.size() / 2);
}

TEST(ExtractSift, TinyImagesHaveNoFeatures) {
  for (const cv::Size size :
       {cv::Size(1, 1), cv::Size(1, 500), cv::Size(5, 5), cv::Size(6, 6), cv::Size(9, 300)}) {
    const auto features = ExtractSift(cv::Mat(size, CV_8UC1, cv::Scalar(7)), {});
    ASSERT_TRUE(features.ok()) << size.width << " x " << size.height;
    EXPECT_TRUE(features->keypoints.empty());
  }
}

TEST(ExtractSift, ColourImageIsAnError) {
  EXPECT_EQ(ExtractSift(cv::Mat(50, 50, CV_8UC3), {}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(ExtractSift(cv::Mat(), {}).error().code, ErrorCode::kInvalidArgument);
}

TEST(KeypointFromOpenCv, IsInColmapsPixelsSigmaAndRadians) {
  const Keypoint keypoint = KeypointFromOpenCv(10, 20, 6, 90);
  EXPECT_FLOAT_EQ(keypoint.x, 10.25f);
  EXPECT_FLOAT_EQ(keypoint.y, 20.25f);
  EXPECT_FLOAT_EQ(keypoint.scale, 3);
  EXPECT_FLOAT_EQ(keypoint.orientation, static_cast<float>(M_PI / 2));
}

// The keypoint nearest to a place.
Keypoint NearestTo(double x, double y, const Features& features) {
  EXPECT_FALSE(features.keypoints.empty());
  Keypoint nearest;
  for (const Keypoint& keypoint : features.keypoints) {
    if (std::hypot(keypoint.x - x, keypoint.y - y) < std::hypot(nearest.x - x, nearest.y - y))
      nearest = keypoint;
  }
  return nearest;
}

TEST(ExtractUndoubledSift, FindsBlobsInColmapsPixelsByTheirScales) {
  for (const double sigma : {1.2, 4.0}) {
    const SiftScales scales = sigma < 1.8 ? SiftScales::kFine : SiftScales::kCoarse;
    const auto features = ExtractUndoubledSift(Blob(60.25, 44.75, sigma), {}, scales);
    ASSERT_TRUE(features.ok());
    const Keypoint nearest = NearestTo(60.25, 44.75, *features);
    EXPECT_NEAR(nearest.x, 60.25, 0.06) << sigma;
    EXPECT_NEAR(nearest.y, 44.75, 0.06) << sigma;
    EXPECT_NEAR(nearest.scale, sigma, 0.2 * sigma);
  }
}

// A picture with features of all scales.
cv::Mat Blobs() {
  cv::Mat image(300, 400, CV_8UC1, cv::Scalar(60));
  for (int i = 0; i < 150; ++i) {
    cv::circle(image, {(37 * i) % 400, (101 * i) % 300}, 1 + i % 12, cv::Scalar(60 + (83 * i) % 180),
               cv::FILLED);
  }
  return image;
}

TEST(ExtractUndoubledSift, CoarseFeaturesAreAboveAScaleAndFineOnesBelow) {
  const cv::Mat image = Blobs();
  for (const int max_side : {3200, 200}) {
    const SiftOptions options{.max_image_side_px = max_side};
    const double limit = CoarseSiftScalePx(image.size(), options);
    EXPECT_NEAR(limit, max_side == 200 ? 3.592 : 1.796, 1e-3);
    const auto coarse = ExtractUndoubledSift(image, options, SiftScales::kCoarse),
               fine = ExtractUndoubledSift(image, options, SiftScales::kFine);
    ASSERT_GT(coarse->keypoints.size(), 50u);
    ASSERT_GT(fine->keypoints.size(), 50u);
    // Half a layer of rounding to either side.
    for (const Keypoint& keypoint : coarse->keypoints) EXPECT_GE(keypoint.scale, 0.999 * limit);
    for (const Keypoint& keypoint : fine->keypoints) EXPECT_LE(keypoint.scale, 1.13 * limit);
    EXPECT_EQ(coarse->descriptors.rows(), static_cast<Eigen::Index>(coarse->keypoints.size()));
  }
}

TEST(ExtractUndoubledSift, WantedFeaturesAreAskedForInPixelsOfTheWholeImage) {
  const cv::Mat image = Blobs();
  const auto is_wanted = [](const Keypoint& keypoint) { return keypoint.x < 150 && keypoint.scale > 3; };
  for (const int max_side : {3200, 200}) {
    const SiftOptions options{.max_image_side_px = max_side};
    const auto all = ExtractUndoubledSift(image, options, SiftScales::kCoarse),
               wanted = ExtractUndoubledSift(image, options, SiftScales::kCoarse, is_wanted);
    std::vector<float> expected, found;
    for (const Keypoint& keypoint : all->keypoints) {
      if (is_wanted(keypoint)) expected.push_back(keypoint.x);
    }
    for (const Keypoint& keypoint : wanted->keypoints) found.push_back(keypoint.x);
    EXPECT_EQ(found, expected);
    EXPECT_GT(found.size(), 10u);
    EXPECT_LT(found.size(), all->keypoints.size() / 2);
  }
}

TEST(ExtractUndoubledSift, RefusesWhatIsNotGreyAndFindsNothingInTinyImages) {
  EXPECT_EQ(ExtractUndoubledSift(cv::Mat(50, 50, CV_8UC3), {}, SiftScales::kFine).error().code,
            ErrorCode::kInvalidArgument);
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(5, 500), cv::Size(10, 10)}) {
    for (const SiftScales scales : {SiftScales::kCoarse, SiftScales::kFine})
      EXPECT_TRUE(ExtractUndoubledSift(cv::Mat(size, CV_8UC1, cv::Scalar(7)), {}, scales)->keypoints.empty());
  }
}

}  // namespace
}  // namespace cairn
