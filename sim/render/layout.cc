#include "sim/render/layout.h"

#include <algorithm>
#include <cmath>

#include "core/base/random.h"
#include "sim/render/furniture.h"
#include "sim/render/twin_wings.h"

namespace cairn::sim {
namespace {

// Least width and depth of a room, metres, and greatest share of the average by which walls between
// rooms shift.
constexpr double kMinRoomM = 2.0;
constexpr double kWallShift = 0.15;
// Depth of building per corridor, metres: a deeper building has another corridor.
constexpr double kDepthPerCorridorM = 11;
// Least wall beside a door, metres.
constexpr double kDoorMarginM = 0.25;

// A stretch of a strip that rooms share: the whole strip, or its part on one side of the spine.
struct Block {
  Rect rect;
  int corridor = 0;
  bool above_corridor = false;
  int num_rooms = 0;
};

double DoorPosition(double low, double high, const SimulateOptions& options, Random& random) {
  const double margin = kDoorMarginM + options.door_width_m / 2;
  if (high - low <= 2 * margin) return (low + high) / 2;
  return random.Uniform(low + margin, high - margin);
}

class LayoutMaker {
 public:
  LayoutMaker(const SimulateOptions& options, uint64_t seed) : options_(options), random_(MixSeed(seed, 1)) {}

  Result<Layout> Make() {
    layout_.bounds = {0, 0, options_.width_m, options_.depth_m};
    AddOuterWalls();
    CAIRN_RETURN_IF_ERROR(AddCorridors());
    CAIRN_RETURN_IF_ERROR(DistributeRooms());
    for (const Block& block : blocks_) AddRooms(block);
    layout_.rooms.insert(layout_.rooms.end(), corridors_.begin(), corridors_.end());
    for (Wall& wall : layout_.walls) std::sort(wall.doors.begin(), wall.doors.end());
    return std::move(layout_);
  }

 private:
  void AddOuterWalls() {
    const double w = options_.width_m, d = options_.depth_m, t = options_.wall_thickness_m;
    layout_.walls.push_back({{-t, -t, w + t, 0}, true, {}});
    layout_.walls.push_back({{-t, d, w + t, d + t}, true, {}});
    layout_.walls.push_back({{-t, 0, 0, d}, false, {}});
    layout_.walls.push_back({{w, 0, w + t, d}, false, {}});
  }

  // Corridors along x with a strip of rooms on either side, back to back; the spine cuts the strips in two.
  Status AddCorridors() {
    const double w = options_.width_m, d = options_.depth_m, t = options_.wall_thickness_m;
    const double corridor = options_.corridor_width_m;
    const int num_corridors = std::max(1, static_cast<int>(d / kDepthPerCorridorM));
    const double strip =
        (d - num_corridors * (corridor + 2 * t) - (num_corridors - 1) * t) / (2 * num_corridors);
    if (strip < kMinRoomM) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "a building of depth_m = {:g} with corridor_width_m = {:g} and wall_thickness_m = {:g} "
          "leaves {:.2f} m for rooms on either side, but {:g} m are needed; make it deeper, or "
          "the corridor narrower or the walls thinner",
          d, corridor, t, strip, kMinRoomM);
    }
    std::vector<std::pair<double, double>> intervals = {{0, w}};
    if (num_corridors > 1) {
      const double spine_x = random_.Uniform(0.4, 0.6) * w - corridor / 2;
      corridors_.push_back({"spine", {spine_x, 0, spine_x + corridor, d}, true});
      intervals = {{0, spine_x - t}, {spine_x + corridor + t, w}};
    }
    double y = 0;
    for (int c = 0; c < num_corridors; ++c) {
      const double corridor_y = y + strip + t;
      corridors_.push_back({fmt::format("corridor {}", c), {0, corridor_y, w, corridor_y + corridor}, true});
      const double upper_y = corridor_y + corridor + t;
      for (const auto& [x0, x1] : intervals) {
        blocks_.push_back({{x0, y, x1, y + strip}, c, false, 0});
        blocks_.push_back({{x0, upper_y, x1, upper_y + strip}, c, true, 0});
        // The wall at the spine's side of the block reaches over the corridor wall's corner.
        const double wall_x0 = x0 > 0 ? x0 - t : x0, wall_x1 = x1 < w ? x1 + t : x1;
        if (c + 1 < num_corridors) {
          layout_.walls.push_back({{wall_x0, upper_y + strip, wall_x1, upper_y + strip + t}, true, {}});
        }
        for (const double strip_y : {y, upper_y}) {
          if (x0 > 0) layout_.walls.push_back({{x0 - t, strip_y, x0, strip_y + strip}, false, {}});
          if (x1 < w) layout_.walls.push_back({{x1, strip_y, x1 + t, strip_y + strip}, false, {}});
        }
      }
      y = upper_y + strip + t;
    }
    return Ok();
  }

  // Rooms per block in proportion to its width, at least one, by largest remainder.
  Status DistributeRooms() {
    const int num_blocks = static_cast<int>(blocks_.size());
    double total_width = 0;
    for (const Block& block : blocks_) total_width += block.rect.width();
    if (options_.num_rooms < num_blocks) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "option num_rooms = {}: this building has {} stretches of rooms along its corridors, "
                       "and each needs at least one room; ask for {} rooms or a smaller depth_m",
                       options_.num_rooms, num_blocks, num_blocks);
    }
    std::vector<std::pair<double, int>> remainders;
    int left = options_.num_rooms;
    for (int b = 0; b < num_blocks; ++b) {
      const double share = options_.num_rooms * blocks_[b].rect.width() / total_width;
      blocks_[b].num_rooms = std::max(1, static_cast<int>(share));
      left -= blocks_[b].num_rooms;
      remainders.push_back({blocks_[b].num_rooms - share, b});
    }
    std::sort(remainders.begin(), remainders.end());
    for (int i = 0; left > 0; ++i, --left) ++blocks_[remainders[i % num_blocks].second].num_rooms;
    for (int i = num_blocks - 1; left < 0; i = (i + num_blocks - 1) % num_blocks) {
      Block& block = blocks_[remainders[i].second];
      if (block.num_rooms > 1) --block.num_rooms, ++left;
    }
    for (const Block& block : blocks_) {
      const double width = (block.rect.width() + options_.wall_thickness_m) / block.num_rooms;
      if (width * (1 - 2 * kWallShift) < std::max(kMinRoomM, options_.door_width_m + 2 * kDoorMarginM)) {
        return MakeError(
            ErrorCode::kInvalidArgument,
            "option num_rooms = {}: {} rooms side by side on {:.1f} m are too narrow; ask for fewer "
            "rooms or a greater width_m",
            options_.num_rooms, block.num_rooms, block.rect.width());
      }
    }
    return Ok();
  }

  void AddRooms(const Block& block) {
    const double t = options_.wall_thickness_m;
    const Rect& rect = block.rect;
    const double pitch = (rect.width() + t) / block.num_rooms;
    // The wall to the corridor, over the corner to the spine.
    const double wall_y = block.above_corridor ? rect.y0 - t : rect.y1;
    const double wall_x0 = rect.x0 > 0 ? rect.x0 - t : rect.x0;
    const double wall_x1 = rect.x1 < options_.width_m ? rect.x1 + t : rect.x1;
    Wall corridor_wall{{wall_x0, wall_y, wall_x1, wall_y + t}, true, {}};
    double x = rect.x0;
    for (int i = 0; i < block.num_rooms; ++i) {
      const bool last = i + 1 == block.num_rooms;
      const double end =
          last ? rect.x1 : rect.x0 + (i + 1 + random_.Uniform(-kWallShift, kWallShift)) * pitch - t;
      layout_.rooms.push_back(
          {fmt::format("room {}", layout_.rooms.size()), {x, rect.y0, end, rect.y1}, false});
      const double door = DoorPosition(x, end, options_, random_);
      corridor_wall.doors.push_back({door - options_.door_width_m / 2, door + options_.door_width_m / 2});
      if (!last) {
        Wall wall{{end, rect.y0, end + t, rect.y1}, false, {}};
        if (random_.Uniform() < options_.extra_door_ratio) {
          const double y = DoorPosition(rect.y0, rect.y1, options_, random_);
          wall.doors.push_back({y - options_.door_width_m / 2, y + options_.door_width_m / 2});
        }
        layout_.walls.push_back(wall);
      }
      x = end + t;
    }
    layout_.walls.push_back(corridor_wall);
  }

  const SimulateOptions& options_;
  Random random_;
  Layout layout_;
  std::vector<Room> corridors_;
  std::vector<Block> blocks_;
};

}  // namespace

double DistanceToRect(const Rect& rect, double x, double y) {
  const double dx = std::max({rect.x0 - x, 0.0, x - rect.x1});
  const double dy = std::max({rect.y0 - y, 0.0, y - rect.y1});
  return std::hypot(dx, dy);
}

Result<Layout> MakeLayout(const SimulateOptions& options, uint64_t seed) {
  CAIRN_RETURN_IF_ERROR(CheckSimulateOptions(options));
  CAIRN_ASSIGN_OR_RETURN(Layout layout,
                         options.twin_wings ? MakeTwinLayout(options) : LayoutMaker(options, seed).Make());
  PlaceFurniture(options, seed, &layout);
  return layout;
}

}  // namespace cairn::sim
