#include "core/sift.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <opencv2/features2d.hpp>

namespace cairn {
namespace {

// RootSIFT [Arandjelovic & Zisserman 2012], quantised as COLMAP's FeatureDescriptorsToUnsignedByte.
void RootSiftRow(const float* sift, uint8_t* row) {
  float l1 = 0;
  for (int d = 0; d < kDescriptorDim; ++d) l1 += sift[d];
  const float scale = l1 > 0 ? 1.0f / l1 : 0.0f;
  for (int d = 0; d < kDescriptorDim; ++d) {
    row[d] = static_cast<uint8_t>(std::min(255.0f, std::round(512.0f * std::sqrt(sift[d] * scale))));
  }
}

}  // namespace

OptionTable DescribeOptions(SiftOptions* options) {
  return {{.name = "max_num_features",
           .value = &options->max_num_features,
           .help = "most features per image; the strongest are kept",
           .min = 1,
           .max = 1000000},
          {.name = "contrast_threshold",
           .value = &options->contrast_threshold,
           .help = "least contrast of an extremum, grey levels / 255",
           .min = 0,
           .max = 1},
          {.name = "edge_threshold",
           .value = &options->edge_threshold,
           .help = "largest ratio of principal curvatures, which rejects points on edges",
           .min = 1}};
}

Keypoint KeypointFromOpenCv(float x, float y, float size, float angle_deg) {
  // OpenCV puts the centre of the first pixel at (0, 0).  Its SIFT finds extrema in the doubled image, whose
  // pixel (i, j) it takes for (i / 2, j / 2) of the original, although resizing puts it at ((i - 0.5) / 2, (j
  // - 0.5) / 2): a quarter pixel too much.  Its size is a diameter, twice sigma; its angle is in degrees,
  // clockwise in the image as COLMAP's.
  constexpr float kCentreOffset = 0.5f;
  constexpr float kDoublingOffset = 0.25f;
  const float rad = angle_deg * static_cast<float>(M_PI / 180.0);
  return {x + kCentreOffset - kDoublingOffset, y + kCentreOffset - kDoublingOffset, 0.5f * size, rad};
}

Result<Features> ExtractSift(const cv::Mat& grey, const SiftOptions& options, const cv::Mat& mask) {
  if (grey.empty() || grey.type() != CV_8UC1) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "SIFT needs an 8-bit grey image, found {} x {} of OpenCV type {}", grey.cols, grey.rows,
                     grey.type());
  }
  if (!mask.empty() && (mask.size() != grey.size() || mask.type() != CV_8UC1)) {
    return MakeError(ErrorCode::kInvalidArgument, "a mask of {} x {} px does not fit the image of {} x {} px",
                     mask.cols, mask.rows, grey.cols, grey.rows);
  }
  Features features;
  features.descriptors.resize(0, kDescriptorDim);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  try {
    // nfeatures = 0: OpenCV's own cap keeps ties in an order that is not ours to rely on.
    const cv::Ptr<cv::SIFT> sift =
        cv::SIFT::create(0, 3, options.contrast_threshold, options.edge_threshold, 1.6, CV_32F);
    sift->detect(grey, keypoints, mask);
    const auto max_num = static_cast<size_t>(options.max_num_features);
    const auto place = [](const cv::KeyPoint& k) { return std::tuple(k.pt.y, k.pt.x, k.size, k.angle); };
    if (keypoints.size() > max_num) {
      std::sort(keypoints.begin(), keypoints.end(), [&](const cv::KeyPoint& a, const cv::KeyPoint& b) {
        return a.response != b.response ? a.response > b.response : place(a) < place(b);
      });
      keypoints.resize(max_num);
    }
    std::sort(keypoints.begin(), keypoints.end(),
              [&](const cv::KeyPoint& a, const cv::KeyPoint& b) { return place(a) < place(b); });
    if (!keypoints.empty()) sift->compute(grey, keypoints, descriptors);
  } catch (const cv::Exception& exception) {
    return MakeError(ErrorCode::kFailed, "SIFT failed on an image of {} x {} px: {}", grey.cols, grey.rows,
                     exception.err);
  }
  features.descriptors.resize(static_cast<Eigen::Index>(keypoints.size()), kDescriptorDim);
  features.keypoints.reserve(keypoints.size());
  for (size_t i = 0; i < keypoints.size(); ++i) {
    const cv::KeyPoint& k = keypoints[i];
    features.keypoints.push_back(KeypointFromOpenCv(k.pt.x, k.pt.y, k.size, k.angle));
    RootSiftRow(descriptors.ptr<float>(static_cast<int>(i)),
                features.descriptors.row(static_cast<Eigen::Index>(i)).data());
  }
  return features;
}

}  // namespace cairn
