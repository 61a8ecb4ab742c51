// Localizes images and says how much processor time each took, for python_overhead.py to compare with:
// time_fixes MAP FOLDER IMAGE... Prints a line "FOLDER/NAME.pgm MILLISECONDS" per image, and leaves its grey
// pixels there.
#include <cstdio>
#include <ctime>
#include <filesystem>

#include <opencv2/imgcodecs.hpp>

#include "core/images/image_file.h"
#include "runtime/localize/localizer.h"

int main(int argc, char** argv) {
  const auto map =
      argc >= 4 ? cairn::Map::Open(argv[1]) : cairn::Error{{}, "usage: time_fixes MAP FOLDER IMAGE..."};
  if (!map.ok()) return std::fprintf(stderr, "%s\n", map.error().message.c_str()), 1;
  cairn::Localizer localizer(*map);
  for (int i = 3; i < argc; ++i) {
    const auto image = cairn::ReadGreyImage(argv[i]);
    if (!image.ok()) return std::fprintf(stderr, "%s\n", image.error().message.c_str()), 1;
    const std::clock_t begin = std::clock();
    const auto camera = (*map)->CameraForSize(image->cols, image->rows);
    const auto fix = camera.ok() ? localizer.Localize(*image, *camera) : camera.error();
    const double elapsed_ms = 1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    if (!fix.ok()) return std::fprintf(stderr, "%s\n", fix.error().message.c_str()), 1;
    const auto pgm =
        std::filesystem::path(argv[2]) / std::filesystem::path(argv[i]).filename().replace_extension("pgm");
    cv::imwrite(pgm.string(), *image);
    std::printf("%s %.3f\n", pgm.c_str(), elapsed_ms);
  }
}
