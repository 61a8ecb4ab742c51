#pragma once

#include <cstdint>
#include <random>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace cairn {

// Gaussian blobs of many sizes, light and dark, with a little noise: several features for each blob.
inline cv::Mat RandomBlobs(cv::Size size, int num_blobs, uint32_t seed) {
  std::mt19937 generator(seed);
  const auto draw = [&](double from, double to) { return from + (to - from) * generator() / 4294967296.0; };
  cv::Mat picture(size, CV_32F, cv::Scalar(120));
  for (int i = 0; i < num_blobs; ++i) {
    const double x = draw(0, size.width), y = draw(0, size.height), sigma = draw(0.8, 4),
                 height = draw(-90, 90), flatness = draw(0.4, 1);
    const int reach = static_cast<int>(3 * sigma);
    for (int row = std::max(0, static_cast<int>(y) - reach);
         row < std::min(size.height, static_cast<int>(y) + reach); ++row) {
      for (int column = std::max(0, static_cast<int>(x) - reach);
           column < std::min(size.width, static_cast<int>(x) + reach); ++column) {
        const double dx = (column - x) * flatness, dy = row - y;
        picture.at<float>(row, column) +=
            static_cast<float>(height * std::exp(-0.5 * (dx * dx + dy * dy) / (sigma * sigma)));
      }
    }
  }
  cv::Mat grey;
  picture.convertTo(grey, CV_8U);
  for (int i = 0; i < grey.rows; ++i) {
    for (int j = 0; j < grey.cols; ++j) {
      uint8_t& pixel = grey.at<uint8_t>(i, j);
      pixel = cv::saturate_cast<uint8_t>(pixel + static_cast<int>(generator() % 5) - 2);
    }
  }
  return grey;
}

// Squares, seen askew: corners and edges, and few other extrema.
inline cv::Mat Checkerboard(cv::Size size, int square) {
  cv::Mat grey(size, CV_8UC1);
  for (int i = 0; i < size.height; ++i) {
    for (int j = 0; j < size.width; ++j) {
      const int u = (13 * j + 3 * i) / 14 + 1000 * square, v = (13 * i - 3 * j) / 14 + 1000 * square;
      grey.at<uint8_t>(i, j) = (u / square + v / square) % 2 == 0 ? 220 : 35;
    }
  }
  cv::GaussianBlur(grey, grey, {}, 0.7);
  return grey;
}

inline cv::Mat Noise(cv::Size size, uint32_t seed) {
  std::mt19937 generator(seed);
  cv::Mat grey(size, CV_8UC1);
  for (int i = 0; i < grey.rows; ++i) {
    for (int j = 0; j < grey.cols; ++j) grey.at<uint8_t>(i, j) = static_cast<uint8_t>(generator() >> 24);
  }
  return grey;
}

}  // namespace cairn
