#include "core/learned/dense_heads.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace cairn {
namespace {

// Half of the square in which a keypoint has the largest heat.
constexpr int kPeakRadius = 2;
// Of the cubic convolution kernel, as the authors' library has it [Keys81: -0.5].
constexpr float kCubicSlope = -0.75f;

// Row `y` of a channel of a net's output.
const float* RowOf(const cv::Mat& output, int channel, int y) { return output.ptr<float>(0, channel, y); }

// [Potje24 §3.2: softmax over 65 channels, of which the last is dropped; 64 become a cell's 8 x 8]
void TakeHeat(const cv::Mat& logits, cv::Point from, cv::Point to, cv::Mat* heat) {
  std::array<float, kNumKeypointLogits> exps;
  float largest = logits.ptr<float>(0, 0, from.y)[from.x];
  for (int k = 1; k < kNumKeypointLogits; ++k) largest = std::max(largest, RowOf(logits, k, from.y)[from.x]);
  float sum = 0;
  for (int k = 0; k < kNumKeypointLogits; ++k) {
    exps[k] = std::exp(RowOf(logits, k, from.y)[from.x] - largest);
    sum += exps[k];
  }
  for (int k = 0; k < kCellPx * kCellPx; ++k)
    heat->at<float>(to.y * kCellPx + k / kCellPx, to.x * kCellPx + k % kCellPx) = exps[k] / sum;
}

void TakeDescriptor(const cv::Mat& descriptors, cv::Point from, float* to) {
  const int num_values = descriptors.size[1];
  float squares = 0;
  for (int k = 0; k < num_values; ++k) {
    to[k] = RowOf(descriptors, k, from.y)[from.x];
    squares += to[k] * to[k];
  }
  if (squares == 0) return;
  const float norm = std::sqrt(squares);
  for (int k = 0; k < num_values; ++k) to[k] /= norm;
}

// A place between the centres of cells, along one axis.
struct Between {
  int cell = 0;        // the last whose centre is not beyond the place
  float fraction = 0;  // of the way to the next
};
Between BetweenCells(float px) {
  const float place = px / kCellPx - 0.5f;
  const float cell = std::floor(place);
  return {static_cast<int>(cell), place - cell};
}

float ReliabilityAt(const cv::Mat& reliability, float x, float y) {
  const Between across = BetweenCells(x), down = BetweenCells(y);
  const auto at = [&](int dy, int dx) {
    return reliability.at<float>(std::clamp(down.cell + dy, 0, reliability.rows - 1),
                                 std::clamp(across.cell + dx, 0, reliability.cols - 1));
  };
  const float above = at(0, 0) + across.fraction * (at(0, 1) - at(0, 0));
  const float below = at(1, 0) + across.fraction * (at(1, 1) - at(1, 0));
  return above + down.fraction * (below - above);
}

// Weights of the cells -1, 0, 1 and 2 from the last one [Keys81 eq. 15, with another slope].
std::array<float, 4> CubicWeights(float fraction) {
  const auto near = [](float t) { return ((kCubicSlope + 2) * t - (kCubicSlope + 3)) * t * t + 1; };
  const auto far = [](float t) { return kCubicSlope * (((t - 5) * t + 8) * t - 4); };
  return {far(1 + fraction), near(fraction), near(1 - fraction), far(2 - fraction)};
}

bool IsPeak(const cv::Mat& heat, cv::Size image, int x, int y) {
  const float value = heat.at<float>(y, x);
  for (int v = std::max(0, y - kPeakRadius); v <= std::min(image.height - 1, y + kPeakRadius); ++v) {
    for (int u = std::max(0, x - kPeakRadius); u <= std::min(image.width - 1, x + kPeakRadius); ++u) {
      const bool is_earlier = v < y || (v == y && u < x);
      const float other = heat.at<float>(v, u);
      if (other > value || (other == value && is_earlier)) return false;
    }
  }
  return true;
}

}  // namespace

DenseHeads EmptyHeads(cv::Size cells, int num_values) {
  DenseHeads heads;
  heads.heat = cv::Mat::zeros(cells.height * kCellPx, cells.width * kCellPx, CV_32F);
  heads.reliability = cv::Mat::zeros(cells, CV_32F);
  heads.descriptors = cv::Mat::zeros(cells.height, cells.width * num_values, CV_32F);
  heads.num_values = num_values;
  return heads;
}

void TakeOutputs(const cv::Mat& keypoints, const cv::Mat& reliability, const cv::Mat& descriptors,
                 cv::Rect from, cv::Point to, DenseHeads* heads) {
  for (int y = 0; y < from.height; ++y) {
    for (int x = 0; x < from.width; ++x) {
      const cv::Point step(x, y), source = from.tl() + step, target = to + step;
      TakeHeat(keypoints, source, target, &heads->heat);
      heads->reliability.at<float>(target) = RowOf(reliability, 0, source.y)[source.x];
      TakeDescriptor(descriptors, source,
                     heads->descriptors.ptr<float>(target.y) + target.x * heads->num_values);
    }
  }
}

std::vector<Peak> FindPeaks(const DenseHeads& heads, cv::Size image, double min_heat) {
  std::vector<Peak> peaks;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const float value = heads.heat.at<float>(y, x);
      if (!(value > min_heat) || !IsPeak(heads.heat, image, x, y)) continue;
      // As Potje24's program scores it.
      const float centre_x = static_cast<float>(x) + 0.5f, centre_y = static_cast<float>(y) + 0.5f;
      peaks.push_back({{x, y}, value * ReliabilityAt(heads.reliability, centre_x, centre_y)});
    }
  }
  return peaks;
}

Eigen::VectorXf DescriptorAt(const DenseHeads& heads, float x, float y) {
  const Between across = BetweenCells(x), down = BetweenCells(y);
  const std::array<float, 4> x_weights = CubicWeights(across.fraction);
  const std::array<float, 4> y_weights = CubicWeights(down.fraction);
  Eigen::VectorXf sum = Eigen::VectorXf::Zero(heads.num_values);
  for (int j = 0; j < 4; ++j) {
    const int row = std::clamp(down.cell - 1 + j, 0, heads.reliability.rows - 1);
    for (int i = 0; i < 4; ++i) {
      const int column = std::clamp(across.cell - 1 + i, 0, heads.reliability.cols - 1);
      const float* cell = heads.descriptors.ptr<float>(row) + column * heads.num_values;
      sum += y_weights[j] * x_weights[i] * Eigen::Map<const Eigen::VectorXf>(cell, heads.num_values);
    }
  }
  const float norm = sum.norm();
  if (norm > 0) sum /= norm;
  return sum;
}

}  // namespace cairn
