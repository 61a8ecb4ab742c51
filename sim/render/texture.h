#pragma once

#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace cairn::sim {

// A grey picture with its chain of half-size levels, sampled without aliasing: at the level that fits the
// pixel's footprint (trilinear), with several taps along the footprint where a surface is seen at a
// grazing angle.
class Texture {
 public:
  Texture() = default;
  // REQUIRES: CV_8UC1, not empty.
  explicit Texture(const cv::Mat& grey);

  int width() const { return levels_.empty() ? 0 : levels_[0].cols; }
  int height() const { return levels_.empty() ? 0 : levels_[0].rows; }
  // The full-size picture.
  const cv::Mat& base() const { return levels_[0]; }

  // Grey value in [0, 255] around `position` (texels; the first texel's centre is (0.5, 0.5)), averaged over
  // the parallelogram spanned by `step_x` and `step_y`: how far the position moves per pixel to the right and
  // down.  Beyond the border the outermost texels are repeated.
  float Sample(const Eigen::Vector2f& position, const Eigen::Vector2f& step_x,
               const Eigen::Vector2f& step_y) const;

 private:
  float SampleLevels(float x, float y, int level, float fraction) const;

  std::vector<cv::Mat> levels_;
};

}  // namespace cairn::sim
