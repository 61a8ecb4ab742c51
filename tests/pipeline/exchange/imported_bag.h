#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/text.h"
#include "core/files/file.h"
#include "pipeline/exchange/bags/import_bag.h"
#include "tests/pipeline/exchange/bag_writers.h"

namespace cairn::pipeline {

inline constexpr int64_t kSecond = 1'000'000'000;
inline constexpr char kImage[] = "sensor_msgs/msg/Image";
inline constexpr char kCompressed[] = "sensor_msgs/msg/CompressedImage";
inline constexpr char kInfo[] = "sensor_msgs/msg/CameraInfo";
inline constexpr char kOdometry[] = "nav_msgs/msg/Odometry";
inline constexpr char kTf[] = "tf2_msgs/msg/TFMessage";

// A grey image of one value, stamped at `time_s`.
inline RawImage Grey(double time_s, int value = 100, int width = 8, int height = 6) {
  return {.stamp_ns = std::llround(time_s * 1e9),
          .width = width,
          .height = height,
          .pixels = std::string(static_cast<size_t>(width) * height, static_cast<char>(value))};
}
inline Recorded GreyMessage(double time_s, const std::string& topic = "/camera/image_raw") {
  return {topic, kImage, std::llround(time_s * 1e9), ImageBytes(Grey(time_s))};
}
// A wall full of corners, 120 pixels high, that cameras slide along.
inline cv::Mat Wall(int width) {
  cv::Mat wall(120, width, CV_8UC1);
  cv::theRNG().state = 1;
  cv::randu(wall, 0, 255);
  cv::GaussianBlur(wall, wall, {}, 2);
  cv::normalize(wall, wall, 0, 255, cv::NORM_MINMAX);
  return wall;
}
// What a camera sees of it.
inline Recorded ImageOf(const cv::Mat& picture, int64_t time_ns, int64_t stamp_ns) {
  return {"/i", kImage, time_ns,
          ImageBytes({.stamp_ns = stamp_ns,
                      .width = picture.cols,
                      .height = picture.rows,
                      .pixels = std::string(picture.ptr<char>(), picture.total())})};
}

inline Pose Turned(double yaw_deg, double x, double y, double z) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(yaw_deg), Eigen::Vector3d::UnitZ())), {x, y, z}};
}
// The optical frame in one whose x axis is ahead and whose z axis is up: x' = -y, y' = -z, z' = x.
inline const Pose kOptical = {Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0, 0, 0}};

inline Recorded OdometryMessageAt(double time_s, const Pose& pose, const std::string& topic = "/odom") {
  const int64_t time_ns = std::llround(time_s * 1e9);
  return {topic, kOdometry, time_ns, OdometryBytes(time_ns, pose)};
}
// base_link carries camera_link at (0.3, 0, 0.5), which has the optical frame.
inline Recorded StaticFrames() {
  return {"/tf_static", kTf, 0,
          TransformBytes({{"base_link", "camera_link", Turned(0, 0.3, 0, 0.5)},
                          {"/camera_link", "camera_optical", kOptical}})};
}

struct OdometryLine {
  std::string name;
  Pose world_from_camera;
};

// A bag that a test writes, and the capture that is made of it.
class ImportedBag : public testing::Test {
 protected:
  void SetUp() override {
    root_ =
        testing::TempDir() + "/import_bag_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(root_);
    std::filesystem::create_directories(root_);
  }
  Result<BagReport> Import(const std::vector<Recorded>& messages, const BagOptions& options = kAll) {
    std::filesystem::remove(root_ + "/bag.db3");
    WriteDb3(root_ + "/bag.db3", messages);
    return ImportFile(root_ + "/bag.db3", options);
  }
  Result<BagReport> ImportFile(const std::string& path, const BagOptions& options = kAll) {
    NoProgress progress;
    auto report = ImportBag(path, options, root_ + "/capture", progress);
    warnings_ = report.ok() ? report->warnings : std::vector<std::string>();
    return report;
  }
  std::string ErrorOf(const std::vector<Recorded>& messages, const BagOptions& options = kAll) {
    const auto report = Import(messages, options);
    return report.ok() ? "imported" : report.error().message;
  }
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(root_ + "/capture/images"))
      names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
  }
  bool Has(const std::string& name) const { return std::filesystem::exists(root_ + "/capture/" + name); }
  cv::Mat ReadImage(const std::string& name) const {
    return cv::imread(root_ + "/capture/images/" + name, cv::IMREAD_UNCHANGED);
  }
  std::vector<OdometryLine> ReadOdometry() const {
    const auto text = ReadFile(root_ + "/capture/odometry.txt");
    std::vector<OdometryLine> lines;
    if (!text.ok()) return lines;
    for (const std::string_view line : SplitLines(*text)) {
      const std::vector<std::string> words = SplitWords(line);
      EXPECT_EQ(words.size(), 8u) << line;
      double v[7] = {};
      for (int i = 0; i < 7; ++i) EXPECT_TRUE(ParseNumber(words[i + 1], &v[i]));
      lines.push_back({words[0], {Eigen::Quaterniond(v[6], v[3], v[4], v[5]), {v[0], v[1], v[2]}}});
    }
    return lines;
  }
  static inline const BagOptions kAll = {.choice = FrameChoice::kAll};
  std::string root_;
  std::vector<std::string> warnings_;
};

}  // namespace cairn::pipeline
