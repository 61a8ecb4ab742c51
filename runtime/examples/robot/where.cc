// Where is this picture?  where_cc MAP IMAGE.pgm
#include <cstdio>
#include <memory>

#include "pgm.h"
#include "runtime/localize/localizer.h"

int main(int argc, char** argv) {
  int width = 0, height = 0;
  const std::unique_ptr<uint8_t, void (*)(void*)> pixels(
      argc == 3 ? ReadPgm(argv[2], &width, &height) : nullptr, std::free);
  if (!pixels) return std::fprintf(stderr, "usage: where_cc MAP IMAGE.pgm (8-bit grey)\n"), 2;
  const cv::Mat image(height, width, CV_8UC1, pixels.get());

  const auto map = cairn::Map::Open(argv[1]);  // immutable, shared by all threads
  if (!map.ok()) return std::fprintf(stderr, "%s\n", map.error().message.c_str()), 1;
  const auto camera = (*map)->CameraForSize(image.cols, image.rows);
  if (!camera.ok()) return std::fprintf(stderr, "%s\n", camera.error().message.c_str()), 1;
  cairn::Localizer localizer(*map);                     // one per thread
  const auto fix = localizer.Localize(image, *camera);  // 8-bit grey pixels
  if (!fix.ok()) return std::fprintf(stderr, "%s\n", fix.error().message.c_str()), 1;
  if (fix->has_fix()) {
    const Eigen::Vector3d place = fix->cam_from_world.Center();  // metres, the capture's frame
    std::printf("%.3f %.3f %.3f m, %d inliers, region %d\n", place.x(), place.y(), place.z(),
                fix->num_inliers, fix->region);
  } else {
    std::printf("no fix: %s\n", fix->message.c_str());
  }
}
