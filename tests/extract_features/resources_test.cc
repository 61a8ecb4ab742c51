#include "stages/extract_features/resources.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::extract_features {
namespace {

using testing::HasSubstr;

// 100 images of 1000 x 1000 px: 76 + 8 bytes a pixel are 80.1 MiB a thread; batches of 64 images with 1000
// keypoints of 144 bytes are 8.8 MiB; the program takes 64 MiB.
Capture LargeImages() {
  Capture capture;
  Camera camera;
  camera.camera_id = 1;
  camera.width = camera.height = 1000;
  capture.cameras[1] = camera;
  capture.images.resize(100);
  for (CaptureImage& image : capture.images) image.camera_id = 1;
  return capture;
}

ExtractFeaturesOptions ThousandKeypoints() {
  ExtractFeaturesOptions options;
  options.sift.max_num_features = 1000;
  return options;
}

TEST(Resources, AsManyThreadsAsLargeImagesFit) {
  const auto threads = [](int num_threads, int64_t memory_mib) {
    return ThreadsThatFit(LargeImages(), ThousandKeypoints(), num_threads, memory_mib).value();
  };
  EXPECT_EQ(threads(8, 153), 1);
  EXPECT_EQ(threads(8, 233), 1);
  EXPECT_EQ(threads(8, 234), 2);
  EXPECT_EQ(threads(8, 100000), 8);
}

TEST(Resources, NotEvenOneImageIsRefusedWithTheEstimate) {
  const auto threads = ThreadsThatFit(LargeImages(), ThousandKeypoints(), 8, 152);
  ASSERT_FALSE(threads.ok());
  EXPECT_THAT(threads.error().message, HasSubstr("takes about 153 MiB of memory, but --memory allows 152"));
}

TEST(Resources, SmallerImagesForSiftTakeLess) {
  ExtractFeaturesOptions options = ThousandKeypoints();
  options.sift.max_image_side_px = 500;  // a quarter of the pixels
  EXPECT_EQ(ThreadsThatFit(LargeImages(), options, 8, 153).value(), 3);
}

TEST(Resources, FeaturesAreEstimatedAtThreeQuartersOfThoseAllowed) {
  EXPECT_EQ(EstimateFeaturesBytes(LargeImages(), ThousandKeypoints()), 100 * 750 * 144);
  ExtractFeaturesOptions many = ThousandKeypoints();
  many.sift.max_num_features = 1000000;  // more than 10,000 SIFT does not find on a million pixels
  EXPECT_EQ(EstimateFeaturesBytes(LargeImages(), many), 100 * 7500 * 144);
}

}  // namespace
}  // namespace cairn::extract_features
