#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "tests/core/capture/drawn_wall.h"

namespace cairn::pipeline {

// What a camera of 320 x 240 pixels sees that goes along the wall, `step_px` a frame.
inline std::vector<cv::Mat> DrawnWalk(int num_frames, int step_px, int seed = 1) {
  const cv::Mat wall = DrawnWall(seed);
  std::vector<cv::Mat> frames;
  for (int i = 0; i < num_frames; ++i) frames.push_back(wall(cv::Rect(10 + step_px * i, 100, 320, 240)));
  return frames;
}

// Runs a shell command line that has to succeed.
inline void RunTool(const std::string& command_line) {
  ASSERT_EQ(std::system(command_line.c_str()), 0) << command_line;
}

// Encodes grey frames of one size at 30 a second by the program ffmpeg, with its options `options`.
inline void EncodeFilm(const std::string& path, const std::vector<cv::Mat>& frames,
                       const std::string& options = "-c:v libx264 -pix_fmt yuv420p -crf 12") {
  const std::string command_line = "ffmpeg -v error -y -f rawvideo -pix_fmt gray -r 30 -s " +
                                   std::to_string(frames[0].cols) + "x" + std::to_string(frames[0].rows) +
                                   " -i - -threads 1 " + options + " '" + path + "'";
  std::FILE* pipe = popen(command_line.c_str(), "w");
  ASSERT_NE(pipe, nullptr);
  for (const cv::Mat& frame : frames) {
    ASSERT_EQ(frame.size(), frames[0].size());
    for (int y = 0; y < frame.rows; ++y) std::fwrite(frame.ptr(y), 1, static_cast<size_t>(frame.cols), pipe);
  }
  ASSERT_EQ(pclose(pipe), 0) << command_line;
}

}  // namespace cairn::pipeline
