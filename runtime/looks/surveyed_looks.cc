#include "runtime/looks/surveyed_looks.h"

#include <algorithm>
#include <cmath>

#include "core/blocks/map_blocks.h"
#include "core/geometry/floor_pose.h"
#include "core/geometry/pose.h"
#include "runtime/map/appearance_map.h"

namespace cairn {
namespace {

// As far as an image is localized from a survey image's place.
constexpr double kNearM = 1, kNearDeg = 30;

}  // namespace

Result<SurveyedLooks> SurveyedLooks::Make(const Map& map, const PlanarPose& robot_in_camera) {
  CAIRN_ASSIGN_OR_RETURN(const auto appearance, map.Appearance());
  if (appearance->look_alikes.empty()) {
    return MakeError(ErrorCode::kNotFound,
                     "the map does not say which of its places look alike; compile it with the stage "
                     "link-appearance");
  }
  SurveyedLooks made;
  made.camera_in_robot_ = MotionBetween(robot_in_camera, PlanarPose{});
  for (int64_t i = 0; i < map.num_images(); ++i) {
    const NodeIdx place = appearance->node_of_image[i];
    if (place < 0) continue;
    CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(i));
    const FloorPose camera = FloorPoseOf(image->cam_from_world, map.head().floor_from_world);
    made.looks_.push_back({{camera.position, RadFromDeg(camera.heading_deg)}, place});
  }
  std::stable_sort(made.looks_.begin(), made.looks_.end(), [](const Look& a, const Look& b) {
    return a.camera.position.x() < b.camera.position.x();
  });
  made.alike_.resize(appearance->look_alikes.size());
  for (size_t place = 0; place < made.alike_.size(); ++place) {
    for (const MapAppearanceNode::LookAlike& other : appearance->look_alikes[place])
      made.alike_[place].push_back(other.node);
  }
  return made;
}

NodeIdx SurveyedLooks::PlaceAt(const PlanarPose& robot) const {
  const PlanarPose camera = robot * camera_in_robot_;
  auto look = std::lower_bound(looks_.begin(), looks_.end(), camera.position.x() - kNearM,
                               [](const Look& other, double x) { return other.camera.position.x() < x; });
  NodeIdx place = -1;
  double nearest = 1;
  for (; look != looks_.end() && look->camera.position.x() <= camera.position.x() + kNearM; ++look) {
    const double turn = WrapAngle(look->camera.heading_rad - camera.heading_rad) / RadFromDeg(kNearDeg);
    const double squared =
        (look->camera.position - camera.position).squaredNorm() / (kNearM * kNearM) + turn * turn;
    if (squared > nearest || (squared == nearest && place >= 0)) continue;
    nearest = squared;
    place = look->place;
  }
  return place;
}

bool SurveyedLooks::AreAlike(NodeIdx a, NodeIdx b) const {
  return a == b || std::binary_search(alike_[a].begin(), alike_[a].end(), b);
}

}  // namespace cairn
