#pragma once

#include <cmath>
#include <memory>

#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {

// A synthetic room, its map, and a drive through it, which tests of what follows a camera share.
inline const SyntheticRoom& Room() {
  static const SyntheticRoom room = MakeSyntheticRoom(1);
  return room;
}

inline std::shared_ptr<const Map> RoomMap() {
  static const std::shared_ptr<const Map> map = *Map::FromRows(Room().rows);
  return map;
}

// Frame i of a drive around the room's middle: 10 cm and 3 degrees a frame.
inline Pose OnDrive(int i) {
  const double angle_deg = 3.0 * i;
  const double angle = RadFromDeg(angle_deg);
  return PoseAt({2 * std::cos(angle), 2 * std::sin(angle), 1.2}, angle_deg + 90);
}

}  // namespace cairn
