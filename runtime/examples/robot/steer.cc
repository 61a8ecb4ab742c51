// How does a robot get to where the survey image TARGET was taken?  The command after each of these pictures,
// one every quarter of a second.  steer_cc MAP TARGET PICTURE.pgm...
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "pgm.h"
#include "runtime/drive/image_servo.h"
#include "runtime/drive/route.h"
#include "runtime/map/map.h"
#include "value_or_exit.h"

int main(int argc, char** argv) {
  if (argc < 4) return std::fprintf(stderr, "usage: steer_cc MAP TARGET PICTURE.pgm... (8-bit grey)\n"), 2;

  const auto map = ValueOrExit(cairn::Map::Open(argv[1]));  // immutable, shared by all threads
  const int32_t target = ValueOrExit(cairn::FindImage(*map, argv[2]));
  auto servo = ValueOrExit(cairn::ImageServo::ToImage(map, target));  // one for each image of a way
  for (int i = 3; i < argc; ++i) {
    int width = 0, height = 0;
    const std::unique_ptr<uint8_t, void (*)(void*)> pixels(ReadPgm(argv[i], &width, &height), std::free);
    if (!pixels) return std::fprintf(stderr, "%s is no 8-bit grey PGM file\n", argv[i]), 1;
    const cv::Mat image(height, width, CV_8UC1, pixels.get());
    const cairn::Camera camera = ValueOrExit(map->CameraForSize(width, height));
    const cairn::ServoCommand command = ValueOrExit(servo.Step(image, camera));
    // drive like this, until the next image; stop where none comes
    std::printf("%s %.17g m/s %.17g rad/s, %d matches\n", cairn::ServoStateName(command.state),
                command.speed_m_s, command.turn_rad_s, command.num_matches);
    if (command.state == cairn::ServoState::kArrived) break;  // to the next image of the way
  }
}
