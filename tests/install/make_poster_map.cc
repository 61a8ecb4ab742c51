// Writes the poster's map and two pictures, of it and of nothing, and the map, pictures (0.pgm, 1.pgm, ...)
// and odometry of a drive, and the map and pictures (wing0.pgm, ...) of two wings that look alike:
// make_poster_map FOLDER
#include <cstdio>
#include <filesystem>
#include <fstream>

#include <opencv2/imgcodecs.hpp>

#include "core/blocks/map_rows.h"
#include "tests/install/poster_drive.h"
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
                       cv::imwrite(folder + "/blank.pgm", blank) && WriteDrive(folder) && WriteWings(folder);
  return written ? 0 : 1;
}
