// Writes the poster's map and two pictures, of it and of nothing:  make_poster_map FOLDER
#include <cstdio>
#include <filesystem>
#include <fstream>

#include <opencv2/imgcodecs.hpp>

#include "core/blocks/map_rows.h"
#include "tests/runtime/localize/poster_scene.h"

int main(int argc, char** argv) {
  using namespace cairn;
  if (argc != 2) return std::fprintf(stderr, "usage: make_poster_map FOLDER\n"), 2;
  const std::string folder = argv[1];
  std::filesystem::create_directories(folder);
  const PosterScene scene = MakePosterScene(1);
  if (const Status status = WriteMapRows(MakePosterMap(scene), folder + "/poster.cairn"); !status.ok())
    return std::fprintf(stderr, "%s\n", status.error().message.c_str()), 1;
  const cv::Mat blank(scene.camera.height, scene.camera.width, CV_8UC1, cv::Scalar(90));
  const bool written = cv::imwrite(folder + "/poster.pgm", RenderPoster(scene, PosterQueryPose())) &&
                       cv::imwrite(folder + "/blank.pgm", blank);
  return written ? 0 : 1;
}
