// XFeat's own net on real images, where they are.  The project ships neither.

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/features/features.h"
#include "core/files/file.h"
#include "core/learned/learned_model.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr char kData[] = CAIRN_SOURCE_DIR "/../shared/data";

std::string ModelPath() {
  if (const char* path = std::getenv("CAIRN_TEST_MODEL")) return path;
  return std::string(kData) + "/models/xfeat.onnx";
}

class XFeat : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(ModelPath())) GTEST_SKIP() << "no " << ModelPath();
    if (!fs::exists(kData)) GTEST_SKIP() << "no " << kData;
    num_threads_ = cv::getNumThreads();
    cv::setNumThreads(1);
    kitchen_ = Read("redkitchen/images/frame-000475.color.jpg");
  }
  void TearDown() override {
    if (num_threads_ > 0) cv::setNumThreads(num_threads_);
  }

  static cv::Mat Read(const std::string& name) {
    const cv::Mat image = cv::imread(std::string(kData) + "/" + name, cv::IMREAD_GRAYSCALE);
    EXPECT_FALSE(image.empty()) << name;
    return image;
  }

  static LearnedModel Open() {
    auto model = LearnedModel::Open(ModelPath());
    EXPECT_TRUE(model.ok()) << model.error().message;
    return std::move(model).value();
  }

  static LearnedFeatures Extract(LearnedModel* model, const cv::Mat& image,
                                 const LearnedOptions& options = {}, const cv::Mat& mask = {}) {
    auto features = model->Extract(image, options, mask);
    EXPECT_TRUE(features.ok()) << features.error().message;
    return std::move(features).value();
  }

  // Pairs that are each other's most similar.
  static std::vector<Match> MutualBest(const LearnedFeatures& a, const LearnedFeatures& b) {
    const Eigen::MatrixXf similarity = a.descriptors * b.descriptors.transpose();
    std::vector<Match> matches;
    for (Eigen::Index i = 0; i < similarity.rows(); ++i) {
      Eigen::Index j = 0, back = 0;
      similarity.row(i).maxCoeff(&j);
      similarity.col(j).maxCoeff(&back);
      if (back == i) matches.push_back({static_cast<uint32_t>(i), static_cast<uint32_t>(j)});
    }
    return matches;
  }

  // The share of features of `part`, a cut of the image, inside `inner` of that cut, that the whole image has
  // within a pixel.
  static double ShareFoundAgain(const LearnedFeatures& part, cv::Point part_begin, cv::Rect inner,
                                const LearnedFeatures& whole) {
    int num = 0, num_found = 0;
    for (const Keypoint& keypoint : part.keypoints) {
      if (!inner.contains(cv::Point(cvFloor(keypoint.x), cvFloor(keypoint.y)))) continue;
      ++num;
      const float x = keypoint.x + static_cast<float>(part_begin.x);
      const float y = keypoint.y + static_cast<float>(part_begin.y);
      for (const Keypoint& other : whole.keypoints) {
        if (std::max(std::abs(other.x - x), std::abs(other.y - y)) > 1) continue;
        ++num_found;
        break;
      }
    }
    EXPECT_GT(num, 20);
    return static_cast<double>(num_found) / std::max(1, num);
  }

  cv::Mat kitchen_;
  int num_threads_ = 0;
};

void ExpectSame(const LearnedFeatures& a, const LearnedFeatures& b) {
  ASSERT_EQ(a.keypoints.size(), b.keypoints.size());
  for (size_t i = 0; i < a.keypoints.size(); ++i) {
    EXPECT_EQ(a.keypoints[i].x, b.keypoints[i].x);
    EXPECT_EQ(a.keypoints[i].y, b.keypoints[i].y);
  }
  EXPECT_TRUE(a.descriptors == b.descriptors);
}

TEST_F(XFeat, HasDescriptorsOf64ValuesOfNormOne) {
  LearnedModel model = Open();
  EXPECT_EQ(model.num_values(), 64);
  const LearnedFeatures features = Extract(&model, kitchen_);
  ASSERT_GT(features.keypoints.size(), 500u);
  EXPECT_EQ(features.descriptors.rows(), static_cast<Eigen::Index>(features.keypoints.size()));
  EXPECT_LT((features.descriptors.rowwise().norm().array() - 1).abs().maxCoeff(), 1e-5);
  for (size_t i = 1; i < features.keypoints.size(); ++i) {
    const Keypoint &former = features.keypoints[i - 1], &keypoint = features.keypoints[i];
    EXPECT_LT(std::pair(former.y, former.x), std::pair(keypoint.y, keypoint.x));
  }
}

TEST_F(XFeat, AFileCutShortIsCorrupt) {
  const std::string bytes = ReadFile(ModelPath()).value();
  const std::string path = testing::TempDir() + "/cut_short.onnx";
  for (const size_t length : {bytes.size() / 100, bytes.size() / 2, bytes.size() - 100}) {
    ASSERT_TRUE(WriteFileAtomically(path, std::string_view(bytes).substr(0, length)).ok());
    const auto model = LearnedModel::Open(path);
    ASSERT_FALSE(model.ok()) << length;
    EXPECT_EQ(model.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(model.error().message,
                testing::HasSubstr("cut_short.onnx: is no ONNX file, or damaged, or cut short"));
  }
}

TEST_F(XFeat, SameBytesTwiceAndForAnyNumberOfThreads) {
  LearnedModel model = Open(), another = Open();
  const LearnedFeatures first = Extract(&model, kitchen_);
  const LearnedFeatures of_floor = Extract(&model, kitchen_(cv::Rect(0, 100, 333, 222)));  // leaves no trace
  EXPECT_FALSE(of_floor.keypoints.empty());
  ExpectSame(Extract(&model, kitchen_), first);
  cv::setNumThreads(2);
  ExpectSame(Extract(&model, kitchen_), first);
  ExpectSame(Extract(&another, kitchen_), first);
}

TEST_F(XFeat, KeypointsMoveWithTheImage) {
  LearnedModel model = Open();
  const LearnedFeatures part = Extract(&model, kitchen_(cv::Rect(32, 32, 608, 448)));
  const double share = ShareFoundAgain(part, {32, 32}, {64, 64, 480, 320}, Extract(&model, kitchen_));
  RecordProperty("share", std::to_string(share));
  EXPECT_GT(share, 0.85);
}

TEST_F(XFeat, KeypointsHaveNoOffset) {
  // The mirror image's keypoints are at the mirrored places: a constant error would show twice.
  LearnedModel model = Open();
  cv::Mat mirrored;
  cv::flip(kitchen_, mirrored, -1);
  const LearnedFeatures features = Extract(&model, kitchen_), mirror = Extract(&model, mirrored);
  cv::Point2d sum;
  int num = 0;
  for (const Keypoint& keypoint : features.keypoints) {
    for (const Keypoint& other : mirror.keypoints) {
      const cv::Point2d error(640 - other.x - keypoint.x, 480 - other.y - keypoint.y);
      if (std::max(std::abs(error.x), std::abs(error.y)) > 2) continue;
      sum += error;
      ++num;
    }
  }
  ASSERT_GT(num, 300);
  RecordProperty("offset_x_px", std::to_string(0.5 * sum.x / num));
  RecordProperty("offset_y_px", std::to_string(0.5 * sum.y / num));
  EXPECT_LT(std::abs(0.5 * sum.x / num), 0.25);
  EXPECT_LT(std::abs(0.5 * sum.y / num), 0.25);
}

TEST_F(XFeat, MutualBestOfAPlanarWarpLieUnderIt) {
  LearnedModel model = Open();
  const cv::Matx33d warp(0.93, -0.12, 60, 0.10, 0.95, -20, 1e-4, -5e-5, 1);
  cv::Mat warped;
  cv::warpPerspective(kitchen_, warped, warp, kitchen_.size());
  const LearnedFeatures a = Extract(&model, kitchen_), b = Extract(&model, warped);
  int num_right = 0, num = 0;
  for (const Match& match : MutualBest(a, b)) {
    const Keypoint &from = a.keypoints[match.idx1], &to = b.keypoints[match.idx2];
    // The warp maps centres of pixels that are counted from the first one's.
    const cv::Vec3d place = warp * cv::Vec3d(from.x - 0.5, from.y - 0.5, 1);
    const double x = place[0] / place[2] + 0.5, y = place[1] / place[2] + 0.5;
    if (x < 0 || y < 0 || x > 640 || y > 480) continue;
    ++num;
    if (std::hypot(to.x - x, to.y - y) < 3) ++num_right;
  }
  RecordProperty("matches", num);
  RecordProperty("right", num_right);
  EXPECT_GT(num_right, 300);
  EXPECT_GT(num_right, 0.8 * num);
}

TEST_F(XFeat, MutualBestOfTwoViewsHaveOneGeometry) {
  LearnedModel model = Open();
  const LearnedFeatures a = Extract(&model, kitchen_);
  const LearnedFeatures b = Extract(&model, Read("redkitchen/images/frame-000499.color.jpg"));
  std::vector<cv::Point2f> places_a, places_b;
  for (const Match& match : MutualBest(a, b)) {
    places_a.emplace_back(a.keypoints[match.idx1].x, a.keypoints[match.idx1].y);
    places_b.emplace_back(b.keypoints[match.idx2].x, b.keypoints[match.idx2].y);
  }
  ASSERT_GT(places_a.size(), 200u);
  cv::setRNGSeed(1);
  cv::Mat inliers;
  cv::findEssentialMat(places_a, places_b, 525, {320, 240}, cv::RANSAC, 0.999, 2, inliers);
  RecordProperty("matches", static_cast<int>(places_a.size()));
  RecordProperty("inliers", cv::countNonZero(inliers));
  EXPECT_GT(cv::countNonZero(inliers), 0.6 * static_cast<double>(places_a.size()));
}

TEST_F(XFeat, MaskedFeaturesAreDroppedAndTheOthersAreKept) {
  LearnedModel model = Open();
  cv::Mat mask(kitchen_.size(), CV_8UC1, cv::Scalar(0));
  mask(cv::Rect(100, 0, 300, 480)) = 255;
  const LearnedFeatures masked = Extract(&model, kitchen_, {.max_num_features = 1000000}, mask);
  size_t num = 0;
  for (const Keypoint& keypoint : Extract(&model, kitchen_, {.max_num_features = 1000000}).keypoints)
    num += keypoint.x > 100 && keypoint.x < 400 ? 1 : 0;
  EXPECT_GT(num, 100u);
  EXPECT_EQ(masked.keypoints.size(), num);
  for (const Keypoint& keypoint : masked.keypoints) {
    EXPECT_GT(keypoint.x, 100);
    EXPECT_LT(keypoint.x, 400);
  }
}

TEST_F(XFeat, ImagesOfAnySizeHaveTheirKeypointsInside) {
  LearnedModel model = Open();
  for (const cv::Size size : {cv::Size(64, 64), cv::Size(333, 77), cv::Size(639, 479)}) {
    const LearnedFeatures features =
        Extract(&model, kitchen_(cv::Rect({0, 0}, size)), {.max_num_features = 50});
    EXPECT_GT(features.keypoints.size(), 3u);
    EXPECT_LE(features.keypoints.size(), 50u);
    for (const Keypoint& keypoint : features.keypoints) {
      EXPECT_LT(keypoint.x, static_cast<float>(size.width));
      EXPECT_LT(keypoint.y, static_cast<float>(size.height));
    }
  }
  EXPECT_TRUE(Extract(&model, kitchen_(cv::Rect(0, 0, 1, 1))).keypoints.empty());
}

TEST_F(XFeat, BlankImagesHaveNoFeatures) {
  LearnedModel model = Open();
  for (const int grey : {0, 127, 255})
    EXPECT_TRUE(Extract(&model, cv::Mat(480, 640, CV_8UC1, cv::Scalar(grey))).keypoints.empty());
}

TEST_F(XFeat, WindowsOfALargeImageLeaveNoSeam) {
  // 960 px are windows from 0 and from 320 px, which meet at 480 px: in the middle of a cut from 160 px.
  LearnedModel model = Open();
  const fs::path folder = std::string(kData) + "/floors/floor1";
  std::vector<fs::path> paths;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".jpg" || entry.path().extension() == ".png")
      paths.push_back(entry.path());
  }
  ASSERT_FALSE(paths.empty()) << folder;
  std::sort(paths.begin(), paths.end());
  const cv::Mat floor = cv::imread(paths.front().string(), cv::IMREAD_GRAYSCALE);
  ASSERT_EQ(floor.size(), cv::Size(960, 540));
  const LearnedFeatures middle = Extract(&model, floor(cv::Rect(160, 0, 640, 540)));
  const double share = ShareFoundAgain(middle, {160, 0}, {320 - 64, 0, 128, 540}, Extract(&model, floor));
  RecordProperty("share", std::to_string(share));
  EXPECT_GT(share, 0.8);
}

}  // namespace
}  // namespace cairn
