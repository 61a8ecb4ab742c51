#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace cairn {

// A SIFT keypoint.  Position in COLMAP's pixels (first pixel's centre at (0.5, 0.5)); scale = sigma in pixels
// of the image; orientation in radians, as COLMAP stores it.
struct Keypoint {
  float x = 0;
  float y = 0;
  float scale = 0;
  float orientation = 0;
};

inline constexpr int kDescriptorDim = 128;
// One RootSIFT descriptor per row, quantised like COLMAP's: round(512 sqrt(v / |v|_1)), at most 255.  Squared
// norm near 512^2.
using DescriptorMatrix = Eigen::Matrix<uint8_t, Eigen::Dynamic, kDescriptorDim, Eigen::RowMajor>;

// The features of one image, row i of `descriptors` belonging to keypoint i.
struct Features {
  std::vector<Keypoint> keypoints;
  DescriptorMatrix descriptors;
};

// A pair of keypoint indices, of the first and of the second image (or of a query and a landmark).
struct Match {
  uint32_t idx1 = 0;
  uint32_t idx2 = 0;
  friend bool operator==(const Match&, const Match&) = default;
  friend auto operator<=>(const Match&, const Match&) = default;
};

}  // namespace cairn
