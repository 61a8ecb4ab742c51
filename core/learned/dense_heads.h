#pragma once

// From a net's dense outputs to features, as XFeat does [Potje24 §3.2]: G. Potje, F. Cadar, A. Araujo,
// R. Martins, E. Nascimento, "XFeat: Accelerated Features for Lightweight Image Matching", CVPR 2024.
//
// The image has cells of 8 x 8 px.  For each cell the net gives 65 logits, one for each of its pixels, row by
// row, and one for "no keypoint here"; a reliability in [0, 1]; and a descriptor.  A pixel's heat is its
// softmax among the cell's 65.  Keypoints are pixels with the largest heat of the 5 x 5 around them; the best
// are those with the largest heat times reliability, as the authors' program has it.
//
// Differs from that program: the centre of a cell is the centre of its 64 pixels (theirs is off by up
// to half a pixel), beyond the outermost centres the nearest cells continue (theirs: zeros), and of equal
// neighbours the first is the keypoint (theirs: all).

#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace cairn {

inline constexpr int kCellPx = 8;
inline constexpr int kNumKeypointLogits = kCellPx * kCellPx + 1;

// All CV_32F.
struct DenseHeads {
  cv::Mat heat;         // a value for each pixel
  cv::Mat reliability;  // a value for each cell
  cv::Mat descriptors;  // a row of cells has their values one after the other; of norm 1 each
  int num_values = 0;   // of a descriptor
};

// Heads for an image of so many cells, all zero.
DenseHeads EmptyHeads(cv::Size cells, int num_values);

// Takes the net's outputs for one of an image's windows, [1, channels, rows, columns] each, into the image's
// heads: their cells `from` to the image's cells that begin at `to`.
// REQUIRES: keypoints of 65 channels, reliability of 1, descriptors of heads->num_values
void TakeOutputs(const cv::Mat& keypoints, const cv::Mat& reliability, const cv::Mat& descriptors,
                 cv::Rect from, cv::Point to, DenseHeads* heads);

struct Peak {
  cv::Point pixel;
  float score = 0;  // heat times reliability
  friend bool operator==(const Peak&, const Peak&) = default;
};

// Pixels of the image, which begins where the heads do and may be smaller, with the largest heat among the
// 5 x 5 of the image around them, of those above min_heat; by (y, x).
std::vector<Peak> FindPeaks(const DenseHeads& heads, cv::Size image, double min_heat);

// The descriptor at a place, px from the image's corner: bicubic between the cells, of norm 1 (0 where the
// cells cancel out).
Eigen::VectorXf DescriptorAt(const DenseHeads& heads, float x, float y);

}  // namespace cairn
