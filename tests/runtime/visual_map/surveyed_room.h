#pragma once

#include <memory>

#include "runtime/map/map.h"
#include "runtime/visual_map/visual_map.h"
#include "stages/emit_map/learn_visual_errors.h"
#include "stages/emit_map/model_landmarks.h"
#include "tests/runtime/visual_map/visual_room.h"

namespace cairn {

// A room with its visual map, as the compiler makes it.
struct Surveyed {
  VisualRoom room;
  std::shared_ptr<const Map> map;
  std::shared_ptr<const VisualMap> visual;

  explicit Surveyed(double noise_px = 0, const CarriedSurvey& carried = {})
      : room(160, noise_px, {}, carried) {
    room.rows.visual_map = *emit_map::ModelLandmarks(room.classes, room.rows, {}, 1);
    room.rows.visual_map.errors =
        *emit_map::LearnVisualErrors(room.classes, room.rows, room.rows.visual_map, 1);
    map = *Map::FromRows(room.rows);
    visual = *VisualMap::Load(*map);
  }
};

inline const Surveyed& Clean() {
  static const Surveyed surveyed;
  return surveyed;
}

}  // namespace cairn
