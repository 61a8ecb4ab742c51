// Writes the poster's map and two pictures, of it and of nothing, and the map, pictures (0.pgm, 1.pgm, ...)
// and odometry of a drive, and the map and pictures (wing0.pgm, ...) of two wings that look alike,
// and those (room0.pgm, ...) of a room through which a robot is steered, and the map with its plan, and
// scans and odometry (scans.txt) of a drive with a laser through the room:
// make_poster_map FOLDER
#include <cstdio>
#include <filesystem>
#include <fstream>

#include <opencv2/imgcodecs.hpp>

#include "core/blocks/map_rows.h"
#include "tests/install/laser_room.h"
#include "tests/install/poster_drive.h"
#include "tests/install/poster_room.h"
#include "tests/install/poster_wings.h"

namespace {

bool WriteDrive(const std::string& folder) {
  const cairn::PosterDrive drive;
  std::ofstream odometry(folder + "/odometry.txt");
  odometry << "# metres ahead, metres to the left, degrees turned to the left\n";
  for (size_t i = 0; i < drive.frames().size(); ++i) {
    const cairn::DriveFrame& frame = drive.frames()[i];
    odometry << frame.ahead_m << " 0 0\n";
    if (!cv::imwrite(folder + "/" + std::to_string(i) + ".pgm", frame.picture)) return false;
  }
  return odometry.flush() && cairn::WriteMapRows(drive.rows(), folder + "/drive.cairn").ok();
}

bool WriteWings(const std::string& folder) {
  const cairn::PosterWings wings;
  for (size_t i = 0; i < wings.pictures().size(); ++i) {
    if (!cv::imwrite(folder + "/wing" + std::to_string(i) + ".pgm", wings.pictures()[i])) return false;
  }
  return cairn::WriteMapRows(wings.rows(), folder + "/wings.cairn").ok();
}

// Pictures from every 5 cm of the way: room0.pgm at r0, room8.pgm at r1, ...
bool WriteRoom(const std::string& folder) {
  const cairn::PosterRoom room;
  for (int i = 0; i <= 24; ++i) {
    if (!cv::imwrite(folder + "/room" + std::to_string(i) + ".pgm",
                     room.PictureAt(cairn::PosterRoom::kFirstM + 0.05 * i)))
      return false;
  }
  return cairn::WriteMapRows(room.rows(), folder + "/room.cairn").ok();
}

// A scan a line.
bool WriteLaser(const std::string& folder) {
  std::ofstream scans(folder + "/scans.txt");
  scans << "# metres ahead, metres to the left, radians turned to the left; ranges, metres, from pi on, "
           "counter-clockwise\n";
  scans.precision(17);
  for (const cairn::LaserStep& step : cairn::LaserDrive()) {
    scans << step.moved.way_m.x() << " " << step.moved.way_m.y() << " " << step.moved.turn_left_rad;
    for (const double range : step.scan.ranges_m) scans << " " << range;
    scans << "\n";
  }
  return scans.flush() && cairn::WriteMapRows(cairn::LaserRoomRows(), folder + "/laser.cairn").ok();
}

}  // namespace

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
                       cv::imwrite(folder + "/blank.pgm", blank) && WriteDrive(folder) &&
                       WriteWings(folder) && WriteRoom(folder) && WriteLaser(folder);
  return written ? 0 : 1;
}
