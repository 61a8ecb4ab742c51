// Features of OpenCV's own detectors, as a stranger would bring them: a kapture folder.
//   extract_others akaze|brisk|kaze|orb|sift CAPTURE OUTPUT [MOST]     MOST: strongest features kept of an
//   image [2000]
#include <iostream>
#include <string>

#include "tests/end_to_end/opencv_features.h"

int main(int argc, char** argv) {
  const std::string name = argc > 1 ? argv[1] : "";
  const int most = argc > 4 ? std::stoi(argv[4]) : 2000;
  if (argc < 4 || argc > 5 || !cairn::OpenCvDetector(name, most)) {
    std::cerr << "usage: extract_others akaze|brisk|kaze|orb|sift CAPTURE OUTPUT [MOST]\n";
    return 2;
  }
  cv::setNumThreads(1);
  const auto counts = [&]() -> cairn::Result<cairn::OpenCvCounts> {
    CAIRN_ASSIGN_OR_RETURN(const cairn::Capture capture, cairn::ReadCapture(argv[2]));
    return cairn::WriteOpenCvFeatures(name, capture, argv[3], most);
  }();
  if (!counts.ok()) {
    std::cerr << counts.error().message << "\n";
    return 1;
  }
  std::cout << fmt::format("{} images, {} features, {:.1f} ms an image\n", counts->num_images,
                           counts->num_features,
                           1000 * counts->seconds / static_cast<double>(counts->num_images));
  return 0;
}
