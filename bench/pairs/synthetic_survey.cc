// Writes a survey of many images for measuring memory, features.db and capture: a camera that moves sideways
// along a wall of random points, each with its own random descriptor, so that neighbours match and distant
// images do not.  The image files are empty: only stages after extraction can read the survey.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/capture.h"
#include "core/colmap_database.h"
#include "core/random.h"

namespace cairn {
namespace {

// Each image sees the points of 2 m of wall, the first tenth of which the next image does not see.
constexpr int kNumStepsPerView = 10;
constexpr double kStep_m = 2.0 / kNumStepsPerView;

// One image's features: `num_features` points of the wall from `first_point` on, ascending.
Features MakeFeatures(int64_t first_point, int num_features, const Camera& camera) {
  Features features;
  features.descriptors.resize(num_features, kDescriptorDim);
  for (int i = 0; i < num_features; ++i) {
    Random random(static_cast<uint64_t>(first_point + i));
    const double depth = random.Uniform(2, 4);
    const double x = camera.params[2] + camera.params[0] * (2.0 * i / num_features - 1) / depth;
    const double y = random.Uniform(0, camera.height);
    features.keypoints.push_back({static_cast<float>(x), static_cast<float>(y), 2, 0});
    Eigen::Matrix<double, 1, kDescriptorDim> d;
    for (int k = 0; k < kDescriptorDim; ++k) d[k] = std::pow(random.Uniform(), 4);
    features.descriptors.row(i) = (d * 512 / d.norm()).array().round().cwiseMin(255.0).cast<uint8_t>();
  }
  return features;
}

Status WriteSyntheticSurvey(const std::string& folder, int num_images, int num_features) {
  Camera camera;
  camera.model = CameraModel::kPinhole;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 500, 320, 240};
  std::filesystem::create_directories(folder + "/images");
  std::vector<CaptureImage> images;
  CAIRN_RETURN_IF_ERROR(
      WriteDatabase(folder + "/features.db", kColmapSchema, [&](SQLite::Database& database) {
        WriteDatabaseCamera(database, camera);
        for (int i = 0; i < num_images; ++i) {
          const auto image_id = static_cast<ImageId>(i + 1);
          const std::string name = fmt::format("{:06}.png", i);
          Pose cam_from_world;
          cam_from_world.translation.x() = -kStep_m * i;
          images.push_back({name, camera.camera_id, cam_from_world});
          std::ofstream(folder + "/images/" + name).flush();
          WriteDatabaseImage(database, {image_id, name, camera.camera_id});
          WriteDatabaseFeatures(
              database, image_id,
              MakeFeatures(int64_t{i} * num_features / kNumStepsPerView, num_features, camera));
        }
        return Ok();
      }));
  CAIRN_RETURN_IF_ERROR(WriteCamerasText(folder + "/cameras.txt", {{camera.camera_id, camera}}));
  return WriteImagesText(folder + "/images.txt", images);
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: synthetic_survey FOLDER NUM_IMAGES NUM_FEATURES\n");
    return 2;
  }
  const cairn::Status status = cairn::WriteSyntheticSurvey(argv[1], std::atoi(argv[2]), std::atoi(argv[3]));
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.error().message.c_str());
  return status.ok() ? 0 : 1;
}
