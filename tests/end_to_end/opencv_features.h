#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/features2d.hpp>

#include "core/capture/capture.h"
#include "core/images/image_file.h"

namespace cairn {

// Features of OpenCV's own detectors, as a stranger would bring them.
inline cv::Ptr<cv::Feature2D> OpenCvDetector(const std::string& name, int most) {
  if (name == "akaze") return cv::AKAZE::create(cv::AKAZE::DESCRIPTOR_MLDB, 0, 3, 0.0003F);
  if (name == "brisk") return cv::BRISK::create(20);
  if (name == "kaze") return cv::KAZE::create(false, false, 0.0003F);
  if (name == "orb") return cv::ORB::create(most);
  if (name == "sift") return cv::SIFT::create(most, 3, 0.02);
  return {};
}

struct OpenCvCounts {
  int64_t num_images = 0, num_features = 0;
  double seconds = 0;  // of detecting and describing
};

// Writes those of a capture's images and queries as a kapture folder, at most `most` of an image, the
// strongest. REQUIRES: a name that OpenCvDetector knows
inline Result<OpenCvCounts> WriteOpenCvFeatures(const std::string& name, const Capture& capture,
                                                const std::string& folder, int most) {
  namespace fs = std::filesystem;
  const auto write = [](const fs::path& path, const void* bytes, size_t num_bytes) {
    fs::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary)
        .write(static_cast<const char*>(bytes), static_cast<std::streamsize>(num_bytes));
  };
  const auto write_text = [&](const fs::path& path, const std::string& text) {
    write(path, text.data(), text.size());
  };
  const cv::Ptr<cv::Feature2D> detector = OpenCvDetector(name, most);
  const fs::path reconstruction = fs::path(folder) / "reconstruction";
  const fs::path of_keypoints = reconstruction / "keypoints" / name,
                 of_descriptors = reconstruction / "descriptors" / name;
  std::vector<CaptureImage> images;
  for (const auto* list : {&capture.images, &capture.queries}) {
    for (const CaptureImage& image : *list) images.push_back(image);
  }
  OpenCvCounts counts;
  cv::Mat last;
  for (const CaptureImage& image : images) {
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(capture.ImagePath(image)));
    std::vector<cv::KeyPoint> found;
    cv::Mat descriptors;
    const int64_t begin = cv::getTickCount();
    detector->detect(grey, found);
    std::stable_sort(found.begin(), found.end(),
                     [](const cv::KeyPoint& a, const cv::KeyPoint& b) { return a.response > b.response; });
    if (std::ssize(found) > most) found.resize(most);
    detector->compute(grey, found, descriptors);
    counts.seconds += static_cast<double>(cv::getTickCount() - begin) / cv::getTickFrequency();
    std::vector<float> keypoints;  // kapture's pixels: (0, 0) is the corner of the first
    for (const cv::KeyPoint& keypoint : found) {
      const float angle = keypoint.angle < 0 ? 0 : keypoint.angle * static_cast<float>(CV_PI / 180);
      keypoints.insert(keypoints.end(),
                       {keypoint.pt.x + 0.5F, keypoint.pt.y + 0.5F, keypoint.size / 2, angle});
    }
    if (!descriptors.empty()) last = descriptors;
    ++counts.num_images;
    counts.num_features += std::ssize(found);
    write(of_keypoints / (image.name + ".kpt"), keypoints.data(), keypoints.size() * sizeof(float));
    write(of_descriptors / (image.name + ".desc"), descriptors.data,
          descriptors.total() * descriptors.elemSize());
  }
  const bool are_bits = last.type() == CV_8U;
  write_text(of_keypoints / "keypoints.txt", fmt::format("# kapture format: 1.1\n{}, float32, 4\n", name));
  write_text(of_descriptors / "descriptors.txt",
             fmt::format("# kapture format: 1.1\n{0}, {1}, {2}, {0}, {3}\n", name,
                         are_bits ? "uint8" : "float32", last.cols, are_bits ? "hamming" : "L2"));
  return counts;
}

}  // namespace cairn
