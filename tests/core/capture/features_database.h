#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "core/camera/camera.h"
#include "core/colmap/colmap_database.h"

namespace cairn {

// Keypoints in an image of 640 x 480 pixels with arbitrary descriptors.
inline Features RandomFeatures(uint64_t seed, int num) {
  Random random(seed);
  Features features;
  features.descriptors.resize(num, kSiftDescriptorDim);
  for (int i = 0; i < num; ++i) {
    features.keypoints.push_back({static_cast<float>(random.Uniform(0, 640)),
                                  static_cast<float>(random.Uniform(0, 480)),
                                  static_cast<float>(random.Uniform(1, 9)), 0.5F});
    for (int k = 0; k < kSiftDescriptorDim; ++k)
      features.descriptors(i, k) = static_cast<uint8_t>(random.UniformInt(0, 90));
  }
  return features;
}

// A camera of 640 x 480 pixels with this id.
inline Camera FeaturesCamera(CameraId camera_id) {
  Camera camera;
  camera.camera_id = camera_id;
  camera.model = CameraModel::kPinhole;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 500, 320, 240};
  return camera;
}

// A COLMAP database with these images, 1, 2, ..., of one camera.
inline Status WriteFeaturesDatabase(const std::string& path, const Camera& camera,
                                    const std::vector<std::pair<std::string, Features>>& images,
                                    const std::string& more_schema = "") {
  return WriteDatabase(path, kColmapSchema + more_schema, [&](SQLite::Database& database) -> Status {
    WriteDatabaseCamera(database, camera);
    ImageId image_id = 0;
    for (const auto& [name, features] : images) {
      WriteDatabaseImage(database, {++image_id, name, camera.camera_id});
      WriteDatabaseFeatures(database, image_id, features);
    }
    return Ok();
  });
}

}  // namespace cairn
