#include "sim/render/texture.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

namespace cairn::sim {
namespace {

// Most taps along a footprint: surfaces at more grazing angles are blurred instead.
constexpr int kMaxTaps = 8;

cv::Mat Halve(const cv::Mat& level) {
  cv::Mat half((level.rows + 1) / 2, (level.cols + 1) / 2, CV_8UC1);
  for (int y = 0; y < half.rows; ++y) {
    const uint8_t* row0 = level.ptr<uint8_t>(2 * y);
    const uint8_t* row1 = level.ptr<uint8_t>(std::min(2 * y + 1, level.rows - 1));
    uint8_t* out = half.ptr<uint8_t>(y);
    for (int x = 0; x < half.cols; ++x) {
      const int x0 = 2 * x, x1 = std::min(2 * x + 1, level.cols - 1);
      out[x] = static_cast<uint8_t>((row0[x0] + row0[x1] + row1[x0] + row1[x1] + 2) / 4);
    }
  }
  return half;
}

float Bilinear(const cv::Mat& level, float x, float y) {
  x = std::clamp(x - 0.5f, 0.0f, static_cast<float>(level.cols - 1));
  y = std::clamp(y - 0.5f, 0.0f, static_cast<float>(level.rows - 1));
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
  const int right = x0 + 1 < level.cols ? 1 : 0;
  const uint8_t* top = level.data + static_cast<size_t>(y0) * level.step[0] + x0;
  const uint8_t* bottom = y0 + 1 < level.rows ? top + level.step[0] : top;
  const float above = static_cast<float>(top[0]) + fx * static_cast<float>(top[right] - top[0]);
  const float below = static_cast<float>(bottom[0]) + fx * static_cast<float>(bottom[right] - bottom[0]);
  return above + fy * (below - above);
}

}  // namespace

Texture::Texture(const cv::Mat& grey) {
  levels_.push_back(grey.clone());
  while (levels_.back().cols > 1 || levels_.back().rows > 1) levels_.push_back(Halve(levels_.back()));
}

float Texture::SampleLevels(float x, float y, int level, float fraction) const {
  const float scale = std::bit_cast<float>(static_cast<uint32_t>(127 - level) << 23);  // 2^-level
  const float fine = Bilinear(levels_[level], x * scale, y * scale);
  if (fraction <= 0 || level + 1 >= static_cast<int>(levels_.size())) return fine;
  const float coarse = Bilinear(levels_[level + 1], 0.5f * x * scale, 0.5f * y * scale);
  return fine + fraction * (coarse - fine);
}

float Texture::Sample(const Eigen::Vector2f& position, const Eigen::Vector2f& step_x,
                      const Eigen::Vector2f& step_y) const {
  const bool x_is_major = step_x.squaredNorm() >= step_y.squaredNorm();
  const Eigen::Vector2f& major = x_is_major ? step_x : step_y;
  const float length = std::max(major.norm(), 1e-6f);
  const float area = std::abs(step_x.x() * step_y.y() - step_x.y() * step_y.x());
  const float minor = std::max(area / length, 1.0f);  // no detail below one texel
  const int num_taps = std::clamp(static_cast<int>(length / minor + 0.5f), 1, kMaxTaps);
  const float footprint = std::max(length / static_cast<float>(num_taps), minor);

  // log2 by its exponent and, linearly, its mantissa: continuous, and fast.
  const uint32_t bits = std::bit_cast<uint32_t>(footprint);
  int level = static_cast<int>(bits >> 23) - 127;
  float fraction = static_cast<float>(bits & 0x7fffff) * 0x1p-23f;
  if (level >= static_cast<int>(levels_.size()) - 1) {
    level = static_cast<int>(levels_.size()) - 1;
    fraction = 0;
  }
  if (num_taps == 1) return SampleLevels(position.x(), position.y(), level, fraction);
  float sum = 0;
  for (int i = 0; i < num_taps; ++i) {
    const float offset = (static_cast<float>(i) + 0.5f) / static_cast<float>(num_taps) - 0.5f;
    sum +=
        SampleLevels(position.x() + offset * major.x(), position.y() + offset * major.y(), level, fraction);
  }
  return sum / static_cast<float>(num_taps);
}

}  // namespace cairn::sim
