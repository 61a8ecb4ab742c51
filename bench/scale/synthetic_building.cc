// Writes a survey of a building of any size without rendering it, features.db and capture: for measuring how
// the stages after extraction grow.
//
// Rooms of 7 m x 7 m stand in a row.  A room's survey is a lattice of 12 x 12 stations, 0.5 m apart, with a
// camera of 90 degrees in each of four headings, so that a room has 576 images.  Its walls bear points, each
// with its size and its own random descriptor; an image has those that lie within its frustum, at an angle
// and a distance at which SIFT would find them, with noise on place and descriptor.  Stated poses may drift,
// so that stage 3 has something to adjust: from image to image by DRIFT_CM and 0.2 degrees for each of them,
// in a square root of a metre of way, a radian being as long as a metre.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "bench/survey_writer.h"
#include "core/base/pooled.h"
#include "core/base/random.h"

namespace cairn {
namespace {

constexpr double kRoomSide_m = 7;
constexpr double kWallHeight_m = 3;
constexpr double kCameraHeight_m = 1.5;
constexpr int kStationsPerSide = 12;
constexpr double kSpacing_m = 0.5;
constexpr int kNumHeadings = 4;
constexpr int kImagesPerRoom = kStationsPerSide * kStationsPerSide * kNumHeadings;
// Points of a room for each feature wanted in an image: about one in twelve is seen from a place and heading.
constexpr int kPointsPerFeature = 14;
constexpr double kDetectionProbability = 0.8;
constexpr double kMaxIncidence_deg = 65;
constexpr double kMinScale_px = 1.6, kMaxScale_px = 8;  // of features that are found
constexpr double kMinSize_m = 0.01, kMaxSize_m = 0.08;
constexpr double kKeypointNoise_px = 0.4;
constexpr double kDescriptorNoise = 4;
constexpr double kDegreesPerCm = 0.2;  // of drift

// A point on a wall, z up, metres.
struct WallPoint {
  Eigen::Vector3d position, normal;  // the normal looks into the room
  double size_m;
  Eigen::Matrix<double, 1, kSiftDescriptorDim> descriptor;
};

std::vector<WallPoint> MakeRoom(int room, int num_points) {
  Random random(MixSeed(0, static_cast<uint64_t>(room)));
  std::vector<WallPoint> points(num_points);
  for (WallPoint& point : points) {
    const double along = random.Uniform(0, kRoomSide_m), height = random.Uniform(0, kWallHeight_m);
    const Eigen::Vector3d places[] = {
        {along, 0, height}, {kRoomSide_m, along, height}, {along, kRoomSide_m, height}, {0, along, height}};
    const Eigen::Vector3d normals[] = {{0, 1, 0}, {-1, 0, 0}, {0, -1, 0}, {1, 0, 0}};
    const auto wall = random.UniformInt(0, 3);
    point.position = places[wall] + Eigen::Vector3d(room * (kRoomSide_m + 1), 0, 0);
    point.normal = normals[wall];
    point.size_m = kMinSize_m * std::pow(kMaxSize_m / kMinSize_m, random.Uniform());
    for (int k = 0; k < kSiftDescriptorDim; ++k) point.descriptor[k] = std::pow(random.Uniform(), 4);
    point.descriptor *= 512 / point.descriptor.norm();
  }
  return points;
}

Pose StationPose(int room, int station, int heading) {
  const double first = (kRoomSide_m - (kStationsPerSide - 1) * kSpacing_m) / 2;
  const Eigen::Vector3d center(room * (kRoomSide_m + 1) + first + kSpacing_m * (station % kStationsPerSide),
                               first + kSpacing_m * (station / kStationsPerSide), kCameraHeight_m);
  const double angle = 2 * std::numbers::pi * heading / kNumHeadings;
  Eigen::Matrix3d cam_from_world;  // rows: right, down, ahead
  cam_from_world << std::sin(angle), -std::cos(angle), 0, 0, 0, -1, std::cos(angle), std::sin(angle), 0;
  Pose pose;
  pose.rotation = Eigen::Quaterniond(cam_from_world);
  pose.translation = -(cam_from_world * center);
  return pose;
}

Features SeeRoom(const std::vector<WallPoint>& points, const Pose& cam_from_world, const Camera& camera,
                 int max_num_features, uint64_t seed) {
  Random random(seed);
  const double focal = camera.params[0];
  const double min_cos = std::cos(kMaxIncidence_deg * std::numbers::pi / 180);
  const Eigen::Vector3d center = cam_from_world.Center();
  PooledVector<Keypoint> keypoints;
  std::vector<const WallPoint*> seen;
  for (const WallPoint& point : points) {
    const Eigen::Vector3d in_camera = cam_from_world.rotation * point.position + cam_from_world.translation;
    if (in_camera.z() < 0.2) continue;
    const Eigen::Vector2d pixel(camera.params[2] + focal * in_camera.x() / in_camera.z(),
                                camera.params[3] + focal * in_camera.y() / in_camera.z());
    if ((pixel.array() < 1).any() || pixel.x() > camera.width - 1 || pixel.y() > camera.height - 1) continue;
    const Eigen::Vector3d ray = (point.position - center).normalized();
    const double scale = focal * point.size_m / in_camera.norm();
    if (-ray.dot(point.normal) < min_cos || scale < kMinScale_px || scale > kMaxScale_px) continue;
    if (random.Uniform() > kDetectionProbability) continue;
    keypoints.push_back({static_cast<float>(pixel.x() + random.Normal(0, kKeypointNoise_px)),
                         static_cast<float>(pixel.y() + random.Normal(0, kKeypointNoise_px)),
                         static_cast<float>(scale), 0});
    seen.push_back(&point);
    if (static_cast<int>(seen.size()) == max_num_features) break;
  }
  Features features;
  features.keypoints = std::move(keypoints);
  features.descriptors.resize(static_cast<Eigen::Index>(seen.size()), kSiftDescriptorDim);
  for (size_t i = 0; i < seen.size(); ++i) {
    for (int k = 0; k < kSiftDescriptorDim; ++k) {
      const double value = seen[i]->descriptor[k] + random.Normal(0, kDescriptorNoise);
      features.descriptors(static_cast<Eigen::Index>(i), k) =
          static_cast<uint8_t>(std::clamp(std::round(value), 0.0, 255.0));
    }
  }
  return features;
}

// The poses that a drifting tracker states, one after the other.
class Tracker {
 public:
  explicit Tracker(double drift_m) : drift_m_(drift_m) {}

  Pose State(const Pose& cam_from_world) {
    if (is_first_) stated_ = true_ = cam_from_world;
    is_first_ = false;
    const double turn_deg = RotationErrorDeg(true_, cam_from_world);
    const double root = std::sqrt(CenterErrorM(true_, cam_from_world) + RadFromDeg(turn_deg));
    Pose drift;
    const double sigma_rad = RadFromDeg(kDegreesPerCm * 100 * drift_m_) * root;
    Eigen::Vector3d turn;
    for (double& value : turn) value = random_.Normal(0, sigma_rad);
    for (double& value : drift.translation) value = random_.Normal(0, drift_m_ * root);
    if (turn.norm() > 0) drift.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized());
    stated_ = drift * (cam_from_world * true_.Inverse()) * stated_;
    true_ = cam_from_world;
    return stated_;
  }

 private:
  double drift_m_;
  bool is_first_ = true;
  Pose stated_, true_;
  Random random_{MixSeed(2, 0)};
};

Status WriteSyntheticBuilding(const std::string& folder, int num_images, int num_features, double drift_cm) {
  const Camera camera = InventedCamera(320);
  int64_t num_keypoints = 0;
  std::vector<WallPoint> points;
  Tracker tracker(drift_cm / 100);
  CAIRN_RETURN_IF_ERROR(WriteInventedSurvey(folder, camera, num_images, [&](int i) {
    const int room = i / kImagesPerRoom, in_room = i % kImagesPerRoom;
    if (in_room == 0) points = MakeRoom(room, num_features * kPointsPerFeature);
    const Pose pose = StationPose(room, in_room / kNumHeadings, in_room % kNumHeadings);
    Features features = SeeRoom(points, pose, camera, num_features, MixSeed(1, static_cast<uint64_t>(i)));
    num_keypoints += static_cast<int64_t>(features.keypoints.size());
    return InventedImage{fmt::format("{:07}.png", i), drift_cm > 0 ? tracker.State(pose) : pose,
                         std::move(features)};
  }));
  std::printf("%d images, %.0f features an image\n", num_images,
              static_cast<double>(num_keypoints) / num_images);
  return Ok();
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  const double drift_cm = argc == 5 ? std::atof(argv[4]) : 0;
  return cairn::WriteSurveyOfArguments(
      argc == 5 ? 4 : argc, argv, "synthetic_building FOLDER NUM_IMAGES MAX_NUM_FEATURES [DRIFT_CM]",
      [drift_cm](const std::string& folder, int num_images, int num_features) {
        return cairn::WriteSyntheticBuilding(folder, num_images, num_features, drift_cm);
      });
}
