#pragma once

#include <opencv2/imgproc.hpp>

namespace cairn {

// A wall of rectangles, 2400 x 480 pixels, that has no two places alike.
inline cv::Mat DrawnWall(int seed = 1) {
  cv::RNG random(seed);
  cv::Mat wall(480, 2400, CV_8UC1, cv::Scalar(128));
  for (int i = 0; i < 6000; ++i) {
    const cv::Point corner(random.uniform(0, wall.cols), random.uniform(0, wall.rows));
    const cv::Size size(random.uniform(4, 30), random.uniform(4, 30));
    cv::rectangle(wall, {corner, size}, cv::Scalar(random.uniform(20, 236)), cv::FILLED);
  }
  cv::GaussianBlur(wall, wall, {}, 0.8);
  return wall;
}

}  // namespace cairn
