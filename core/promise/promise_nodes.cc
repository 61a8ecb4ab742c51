#include "core/promise/promise_nodes.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "core/camera/camera.h"

namespace cairn {
namespace {

// Angle between the rays at the middle of the left and of the right edge, degrees; 0 where there is none or
// it is no angle of a pinhole's kind (panoramas see all around whichever way they look).
double FieldOfViewDeg(const Camera& camera) {
  const auto left = BearingFromImage(camera, {0, camera.height / 2.0});
  const auto right = BearingFromImage(camera, {static_cast<double>(camera.width), camera.height / 2.0});
  if (!left || !right) return 0;
  return DegFromRad(std::acos(std::clamp(left->dot(*right), -1.0, 1.0)));
}

}  // namespace

Pose PoseBetween(const Pose& a, const Pose& b, int part, int num_parts) {
  const Eigen::Vector3d center = (a.Center() + b.Center()) / 2;
  const Eigen::Quaterniond rotation = a.rotation.slerp(static_cast<double>(part) / num_parts, b.rotation);
  return {rotation, -(rotation * center)};
}

ViewTree TreeOf(const std::vector<PromiseNode>& nodes, double radius_m, double radius_deg) {
  std::vector<Pose> poses;
  for (const PromiseNode& node : nodes) poses.push_back(node.cam_from_world);
  return {poses, radius_m, radius_deg};
}

std::vector<int32_t> ImagesApart(const ViewDistance& distance, const std::vector<int32_t>& images,
                                 double spacing) {
  std::vector<int32_t> chosen;
  std::vector<char> is_covered(distance.tree().size(), 0);
  for (const int32_t image : images) {
    if (is_covered[image] != 0) continue;
    chosen.push_back(image);
    distance.tree().ForNear(image, spacing * spacing, [&](int32_t other, double) { is_covered[other] = 1; });
  }
  return chosen;
}

std::vector<PromiseNode> PromiseNodes(const Classes& classes, const ViewDistance& distance,
                                      const std::vector<int32_t>& of_images) {
  std::unordered_map<CameraId, double> view_deg;
  for (const Camera& camera : classes.cameras) view_deg[camera.camera_id] = FieldOfViewDeg(camera);
  const std::vector<int32_t> images = ImagesApart(distance, of_images, kViewSpacing);
  std::vector<char> is_apart(classes.images.size(), 0);
  for (const int32_t image : images) is_apart[image] = 1;
  std::vector<PromiseNode> nodes;
  for (const int32_t image : images) nodes.push_back({classes.images[image].cam_from_world, image, image});

  const auto pose_of = [&](int32_t image) -> const Pose& { return classes.images[image].cam_from_world; };
  const double step_deg = 2 * kNodeReach * distance.radius_deg();
  std::vector<PromiseNode> between;
  for (size_t n = 0; n < images.size(); ++n) {
    const int32_t a = images[n];
    std::vector<int32_t> here;  // at the same place, looking elsewhere
    distance.tree().ForPlacesNear(pose_of(a).Center(), distance.radius(), [&](int32_t b) {
      if (is_apart[b] != 0) here.push_back(b);
    });
    std::sort(here.begin(), here.end());
    for (const int32_t b : here) {
      if (b <= a || classes.images[b].camera_id != classes.images[a].camera_id) continue;
      const double turn_deg = RotationErrorDeg(pose_of(a), pose_of(b));
      if (turn_deg <= step_deg || turn_deg > view_deg[classes.images[a].camera_id]) continue;
      const bool has_other_between = std::any_of(here.begin(), here.end(), [&](int32_t c) {
        return c != a && c != b &&
               std::max(RotationErrorDeg(pose_of(a), pose_of(c)), RotationErrorDeg(pose_of(b), pose_of(c))) <
                   turn_deg;
      });
      if (has_other_between) continue;
      const int num_parts = static_cast<int>(std::ceil(turn_deg / step_deg));
      for (int part = 1; part < num_parts; ++part)
        between.push_back({PoseBetween(pose_of(a), pose_of(b), part, num_parts), a, b});
    }
  }
  nodes.insert(nodes.end(), between.begin(), between.end());
  return nodes;
}

}  // namespace cairn
