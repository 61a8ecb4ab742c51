// Where is this picture?  localize MAP IMAGE
#include <cstdio>

#include "core/images/image_file.h"
#include "runtime/localize/localizer.h"

int main(int argc, char** argv) {
  const auto map = argc == 3 ? cairn::Map::Open(argv[1]) : cairn::Error{{}, "usage: localize MAP IMAGE"};
  if (!map.ok()) return std::fprintf(stderr, "%s\n", map.error().message.c_str()), 1;
  const auto image = cairn::ReadGreyImage(argv[2]);  // a robot takes its camera's pixels instead
  if (!image.ok()) return std::fprintf(stderr, "%s\n", image.error().message.c_str()), 1;
  const auto camera = (*map)->CameraForSize(image->cols, image->rows);
  if (!camera.ok()) return std::fprintf(stderr, "%s\n", camera.error().message.c_str()), 1;
  const auto fix = cairn::Localizer(*map).Localize(*image, *camera);
  if (!fix.ok() || !fix->has_fix())
    return std::puts(fix.ok() ? fix->message.c_str() : fix.error().message.c_str()), 1;
  const Eigen::Vector3d place = fix->cam_from_world.Center();
  std::printf("%.3f %.3f %.3f m, %d inliers, region %d\n", place.x(), place.y(), place.z(), fix->num_inliers,
              fix->region);
}
