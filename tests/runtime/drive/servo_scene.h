#pragma once

#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "core/base/random.h"
#include "core/camera/camera.h"
#include "core/geometry/planar_pose.h"
#include "runtime/drive/servo.h"

namespace cairn {

// Points in space and a camera on a robot: the servo's input.  Floor frame, z up from the camera's height,
// metres; nothing hides anything.
struct ServoScene {
  std::vector<Eigen::Vector3d> points;
  Camera camera = {.model = CameraModel::kSimplePinhole,
                   .width = 640,
                   .height = 480,
                   .params = {320, 320, 240}};  // 90 degrees
  double noise_px = 0;
  double outlier_ratio = 0;  // of the matches
  // Features are matched where their distances in the two images have at most this ratio.
  double max_scale_ratio = 2.5;

  std::optional<Eigen::Vector2d> Project(const PlanarPose& pose, const Eigen::Vector3d& point) const {
    const Eigen::Vector2d local = pose.RobotFromFloor(point.head<2>());
    if (local.x() < 0.1) return std::nullopt;
    const auto pixel = ImageFromCamera(camera, {-local.y(), -point.z(), local.x()});
    if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() > camera.width ||
        pixel->y() > camera.height) {
      return std::nullopt;
    }
    return pixel;
  }

  std::vector<PixelPair> Match(const PlanarPose& current, const PlanarPose& target, Random* random) const {
    std::vector<PixelPair> pairs;
    for (const Eigen::Vector3d& point : points) {
      const auto a = Project(current, point), b = Project(target, point);
      if (!a || !b) continue;
      const double scale =
          (point.head<2>() - current.position).norm() / (point.head<2>() - target.position).norm();
      if (scale > max_scale_ratio || scale < 1 / max_scale_ratio) continue;
      const auto noise = [&] {
        const double x = random->Normal(0, noise_px), y = random->Normal(0, noise_px);
        return Eigen::Vector2d(x, y);
      };
      pairs.push_back({*a + noise(), *b + noise()});
    }
    for (PixelPair& pair : pairs) {
      if (random->Uniform() >= outlier_ratio) continue;
      const double x = random->Uniform(0, camera.width), y = random->Uniform(0, camera.height);
      pair.current_px = {x, y};
    }
    return pairs;
  }
};

// `num_points` on the walls, the floor and the ceiling of a room whose floor is [low, high], 2.6 m high, the
// camera at 1 m.
inline std::vector<Eigen::Vector3d> RoomPoints(const Eigen::Vector2d& low, const Eigen::Vector2d& high,
                                               int num_points, uint64_t seed) {
  Random random(seed);
  std::vector<Eigen::Vector3d> points;
  while (static_cast<int>(points.size()) < num_points) {
    const double z = random.Uniform(-1, 1.6), y = random.Uniform(low.y(), high.y()),
                 x = random.Uniform(low.x(), high.x());
    Eigen::Vector3d point(x, y, z);
    switch (random.UniformInt(0, 5)) {
      case 0:
        point.x() = low.x();
        break;
      case 1:
        point.x() = high.x();
        break;
      case 2:
        point.y() = low.y();
        break;
      case 3:
        point.y() = high.y();
        break;
      case 4:
        point.z() = -1;
        break;
      default:
        point.z() = 1.6;
    }
    points.push_back(point);
  }
  return points;
}

// Constant speed and turn rate: an arc of a circle.
inline PlanarPose Moved(const PlanarPose& pose, double speed_m_s, double turn_rad_s, double seconds) {
  const double turn = turn_rad_s * seconds, way = speed_m_s * seconds;
  const double chord = std::abs(turn) < 1e-9 ? way : way * std::sin(0.5 * turn) / (0.5 * turn);
  const double heading = pose.heading_rad + 0.5 * turn;
  return {pose.position + chord * Eigen::Vector2d(std::cos(heading), std::sin(heading)),
          WrapAngle(pose.heading_rad + turn)};
}

}  // namespace cairn
