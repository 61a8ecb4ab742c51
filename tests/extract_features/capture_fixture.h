#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/random.h"
#include "core/capture/capture.h"
#include "core/colmap/cameras_text.h"
#include "stages/extract_features/extract_features.h"

namespace cairn::extract_features {

// Random blobs of several sizes on grey: plenty of SIFT features.
inline cv::Mat BlobImage(uint64_t seed, int width = 320, int height = 240) {
  Random random(seed);
  cv::Mat image(height, width, CV_8UC1, cv::Scalar(128));
  for (int i = 0; i < 150; ++i) {
    const cv::Point center(static_cast<int>(random.UniformInt(0, width)),
                           static_cast<int>(random.UniformInt(0, height)));
    cv::circle(image, center, static_cast<int>(random.UniformInt(2, 9)), cv::Scalar(random.Uniform(0, 255)),
               cv::FILLED, cv::LINE_AA);
  }
  return image;
}

// A capture of blob images, empty at first.
class ExtractFeaturesTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = testing::TempDir() + "/capture_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(root_);
    std::filesystem::create_directories(root_ + "/images");
    Camera camera;
    camera.model = CameraModel::kPinhole;
    camera.width = 320;
    camera.height = 240;
    camera.params = {300, 300, 160, 120};
    ASSERT_TRUE(WriteCamerasText(root_ + "/cameras.txt", {{1, camera}}).ok());
  }

  void AddImage(const std::string& name, const cv::Mat& image) {
    ASSERT_TRUE(cv::imwrite(root_ + "/images/" + name, image));
    List(name);
  }
  void List(const std::string& name) {
    images_.push_back({name, 1, Pose()});
    ASSERT_TRUE(WriteImagesText(root_ + "/images.txt", images_).ok());
  }

  Result<ExtractFeaturesSummary> Extract(int num_threads = 2, const ExtractFeaturesOptions& options = {}) {
    return ExtractTo("features.db", {}, num_threads, options);
  }
  Result<ExtractFeaturesSummary> ExtractTo(const std::string& name, const ReuseOptions& reuse,
                                           int num_threads = 2, const ExtractFeaturesOptions& options = {}) {
    const Result<Capture> capture = ReadCapture(root_);
    if (!capture.ok()) return capture.error();
    NoProgress progress;
    return ExtractFeatures(*capture, options, root_ + "/" + name, num_threads, progress, reuse);
  }

  std::string root_;
  std::vector<CaptureImage> images_;
};

}  // namespace cairn::extract_features
