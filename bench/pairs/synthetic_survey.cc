// Writes a survey of many images for measuring memory, features.db and capture: a camera that moves sideways
// along a wall of random points, each with its own random descriptor, so that neighbours match and distant
// images do not.
#include <cmath>
#include <string>

#include "bench/survey_writer.h"
#include "core/base/random.h"

namespace cairn {
namespace {

// Each image sees the points of 2 m of wall, the first tenth of which the next image does not see.
constexpr int kNumStepsPerView = 10;
constexpr double kStep_m = 2.0 / kNumStepsPerView;

// One image's features: `num_features` points of the wall from `first_point` on, ascending.
Features MakeFeatures(int64_t first_point, int num_features, const Camera& camera) {
  Features features;
  features.descriptors.resize(num_features, kSiftDescriptorDim);
  for (int i = 0; i < num_features; ++i) {
    Random random(static_cast<uint64_t>(first_point + i));
    const double depth = random.Uniform(2, 4);
    const double x = camera.params[2] + camera.params[0] * (2.0 * i / num_features - 1) / depth;
    const double y = random.Uniform(0, camera.height);
    features.keypoints.push_back({static_cast<float>(x), static_cast<float>(y), 2, 0});
    Eigen::Matrix<double, 1, kSiftDescriptorDim> d;
    for (int k = 0; k < kSiftDescriptorDim; ++k) d[k] = std::pow(random.Uniform(), 4);
    features.descriptors.row(i) = (d * 512 / d.norm()).array().round().cwiseMin(255.0).cast<uint8_t>();
  }
  return features;
}

Status WriteSyntheticSurvey(const std::string& folder, int num_images, int num_features) {
  const Camera camera = InventedCamera(500);
  return WriteInventedSurvey(folder, camera, num_images, [&](int i) {
    InventedImage image;
    image.name = fmt::format("{:06}.png", i);
    image.cam_from_world.translation.x() = -kStep_m * i;
    image.features = MakeFeatures(int64_t{i} * num_features / kNumStepsPerView, num_features, camera);
    return image;
  });
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  return cairn::WriteSurveyOfArguments(argc, argv, "synthetic_survey FOLDER NUM_IMAGES NUM_FEATURES",
                                       cairn::WriteSyntheticSurvey);
}
