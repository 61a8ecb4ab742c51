#pragma once

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "core/capture/capture.h"
#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_database.h"

namespace cairn {

// The content of an image, for programs that invent surveys instead of rendering them.
struct InventedImage {
  std::string name;
  Pose cam_from_world;
  Features features;
};

// A camera of 640 x 480 pixels without distortion.
inline Camera InventedCamera(double focal_px) {
  Camera camera;
  camera.model = CameraModel::kPinhole;
  camera.width = 640;
  camera.height = 480;
  camera.params = {focal_px, focal_px, 320, 240};
  return camera;
}

// Writes features.db and the capture of the images 0, 1, ... that `make_image` makes, in this order.  The
// image files are empty: only stages after extraction can read the survey.
inline Status WriteInventedSurvey(const std::string& folder, const Camera& camera, int num_images,
                                  const std::function<InventedImage(int)>& make_image) {
  std::filesystem::create_directories(folder + "/images");
  std::vector<CaptureImage> images;
  CAIRN_RETURN_IF_ERROR(
      WriteDatabase(folder + "/features.db", kColmapSchema, [&](SQLite::Database& database) {
        WriteDatabaseCamera(database, camera);
        for (int i = 0; i < num_images; ++i) {
          const InventedImage image = make_image(i);
          const auto image_id = static_cast<ImageId>(i + 1);
          images.push_back({image.name, camera.camera_id, image.cam_from_world});
          std::ofstream(folder + "/images/" + image.name).flush();
          WriteDatabaseImage(database, {image_id, image.name, camera.camera_id});
          WriteDatabaseFeatures(database, image_id, image.features);
        }
        return Ok();
      }));
  CAIRN_RETURN_IF_ERROR(WriteCamerasText(folder + "/cameras.txt", {{camera.camera_id, camera}}));
  return WriteImagesText(folder + "/images.txt", images);
}

// The main function of such a program: FOLDER NUM_IMAGES NUM_FEATURES.
inline int WriteSurveyOfArguments(
    int argc, char** argv, const char* usage,
    const std::function<Status(const std::string& folder, int num_images, int num_features)>& write) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: %s\n", usage);
    return 2;
  }
  const Status status = write(argv[1], std::atoi(argv[2]), std::atoi(argv[3]));
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.error().message.c_str());
  return status.ok() ? 0 : 1;
}

}  // namespace cairn
