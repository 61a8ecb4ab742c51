// Images under other lamps than the survey's: two cones of light in each image, at random places and of
// random widths, beside which it is as dark as RATIO says; what they make too bright is white, and the
// camera's noise stays what it is.
//   relight IMAGES OUTPUT RATIO      RATIO: brightest over darkest, 1 or more
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "core/base/random.h"

namespace {

constexpr double kBrightest = 1.3;  // of the survey's light
constexpr double kNoise = 2;        // grey levels

struct Cone {
  double x = 0, y = 0, sigma = 0;  // px
};

void Relight(double ratio, cairn::Random* random, cv::Mat* grey) {
  std::array<Cone, 2> cones;
  for (Cone& cone : cones) {
    cone.x = random->Uniform(0, grey->cols);
    cone.y = random->Uniform(0, grey->rows);
    cone.sigma = random->Uniform(0.1, 0.3) * grey->cols;
  }
  const double darkest = kBrightest / ratio;
  for (int y = 0; y < grey->rows; ++y) {
    for (int x = 0; x < grey->cols; ++x) {
      double beside = 1;  // both cones
      for (const Cone& cone : cones) {
        const double dx = (x - cone.x) / cone.sigma, dy = (y - cone.y) / cone.sigma;
        beside *= 1 - std::exp(-0.5 * (dx * dx + dy * dy));
      }
      const double light = darkest + (kBrightest - darkest) * (1 - beside);
      uint8_t& pixel = grey->at<uint8_t>(y, x);
      pixel = cv::saturate_cast<uint8_t>(light * pixel + random->Normal(0, kNoise));
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4 || !(std::atof(argv[3]) >= 1)) {
    std::cerr << "usage: relight IMAGES OUTPUT RATIO\n";
    return 2;
  }
  const std::filesystem::path from = argv[1], to = argv[2];
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(from))
    files.push_back(entry.path().filename());
  std::sort(files.begin(), files.end());
  std::filesystem::create_directories(to);
  for (size_t i = 0; i < files.size(); ++i) {
    cv::Mat grey = cv::imread((from / files[i]).string(), cv::IMREAD_GRAYSCALE);
    if (grey.empty()) {
      std::cerr << (from / files[i]).string() << ": no image\n";
      return 1;
    }
    cairn::Random random(cairn::MixSeed(0, i));
    Relight(std::atof(argv[3]), &random, &grey);
    if (!cv::imwrite((to / files[i]).string(), grey, {cv::IMWRITE_JPEG_QUALITY, 95})) {
      std::cerr << (to / files[i]).string() << ": cannot be written\n";
      return 1;
    }
  }
  return 0;
}
