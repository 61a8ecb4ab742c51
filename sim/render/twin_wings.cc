#include "sim/render/twin_wings.h"

#include <algorithm>
#include <cmath>

namespace cairn::sim {
namespace {

// Length of the spine on either side of a wing that looks the same at both wings, metres.
constexpr double kMarginM = 0.9;
// Least length of a wing and least width and depth of the goal room, metres.
constexpr double kMinWingM = 2.5;
constexpr double kMinGoalM = 2.5;

}  // namespace

Result<Layout> MakeTwinLayout(const SimulateOptions& options) {
  const double w = options.width_m, d = options.depth_m, t = options.wall_thickness_m;
  const double c = options.corridor_width_m;
  // Whole texels of the floor.
  const double floor_texel_m = 2 * options.texel_m;
  const double offset = std::ceil((c + 2 * kMarginM + t) / floor_texel_m) * floor_texel_m;
  const double first = kMarginM, second = first + offset;
  const double goal_x = second + c + std::max(kMarginM, 2 * t);
  const double upper_y = c + t;                                  // above the spine and its wall
  const double top_y = options.back_corridor ? d - upper_y : d;  // where wings and goal room end
  const double least_width = goal_x + kMinGoalM;
  const double least_depth = upper_y + std::max(kMinWingM, kMinGoalM) + d - top_y;
  if (w < least_width || d < least_depth) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "a building with twin_wings and corridor_width_m = {:g} needs width_m of at least {:.2f} "
        "and depth_m of at least {:.2f}, not {:g} x {:g}",
        c, least_width, least_depth, w, d);
  }
  Layout layout;
  layout.bounds = {0, 0, w, d};
  layout.twins = Twins{{first - kMarginM, 0, first + c + kMarginM, d}, offset, c};
  layout.walls.push_back({{-t, -t, w + t, 0}, true, {}});
  layout.walls.push_back({{-t, d, w + t, d + t}, true, {}});
  layout.walls.push_back({{-t, 0, 0, d}, false, {}});
  layout.walls.push_back({{w, 0, w + t, d}, false, {}});
  const Rect& near = layout.twins->rect;
  layout.walls[0].joints = {near.x0, near.x1, near.x0 + offset, near.x1 + offset};
  layout.walls[1].joints = layout.walls[0].joints;
  if (!options.back_corridor) layout.walls[1].joints = {first, first + c, second, second + c};

  // The solid parts between the wings: walls around closed space.
  double x = 0;
  const auto add_along_spines = [&](double low, double high, std::vector<std::pair<double, double>> doors) {
    layout.walls.push_back({{low, c, high, upper_y}, true, doors});
    if (options.back_corridor) layout.walls.push_back({{low, top_y, high, top_y + t}, true, doors});
  };
  const auto add_solid = [&](double low, double high) {
    add_along_spines(low, high, {});
    if (low > 0) layout.walls.push_back({{low, upper_y, low + t, top_y}, false, {}});
    layout.walls.push_back({{high - t, upper_y, high, top_y}, false, {}});
    const Rect inside = {low > 0 ? low + t : low, upper_y, high - t, top_y};
    if (inside.width() > 0) layout.furniture.push_back({inside, options.height_m, true});
  };
  for (const double wing : {first, second}) {
    add_solid(x, wing);
    layout.rooms.push_back(
        {fmt::format("wing {}", wing == first ? 0 : 1), {wing, upper_y, wing + c, top_y}, true});
    x = wing + c;
  }
  add_along_spines(x, goal_x - t, {});
  layout.walls.push_back({{x, upper_y, x + t, top_y}, false, {}});
  if (goal_x - t > x + t) {
    layout.furniture.push_back({{x + t, upper_y, goal_x - t, top_y}, options.height_m, true});
  }
  layout.walls.push_back({{goal_x - t, c, goal_x, options.back_corridor ? top_y + t : d}, false, {}});
  const double door = 0.5 * (goal_x + w);
  add_along_spines(goal_x, w, {{door - options.door_width_m / 2, door + options.door_width_m / 2}});
  layout.rooms.push_back({"spine", {0, 0, w, c}, true});
  if (options.back_corridor) layout.rooms.push_back({"back corridor", {0, top_y + t, w, d}, true});
  layout.rooms.push_back({"goal", {goal_x, upper_y, w, top_y}, false});
  return layout;
}

}  // namespace cairn::sim
