#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "sim/render/layout.h"
#include "sim/render/options.h"
#include "sim/render/texture.h"

namespace cairn::sim {

// How the texture lies on a plane that is perpendicular to an axis: texel = offset + scale * coordinate, for
// two axes.
struct Surface {
  int texture = -1;  // index into Building::textures; -1 is never seen
  int u_axis = 0, v_axis = 2;
  double u_scale = 0, u_offset = 0;  // texels per metre (negative: mirrored), texels
  double v_scale = 0, v_offset = 0;
  float brightness = 1;  // of the side towards the light
};

// An axis-parallel box: a piece of wall as wide as one panel, a lintel, a piece of furniture.
struct Box {
  Eigen::Vector3d min, max;
  std::array<Surface, 6> faces;  // -x, +x, -y, +y, -z, +z
};

// A piece of a building's surface that shows something else than when it was built, or a piece of furniture
// that is gone, or stands elsewhere: what lay on it has vanished there.
struct ChangedSurface {
  enum class Kind {
    kPanel,
    kFurniture,
    kMovedPanel,      // what it showed is elsewhere now
    kMovedFurniture,  // it stands elsewhere now
  } kind = Kind::kPanel;
  Eigen::Vector3d min, max;  // of the panel flat
  // Of what moved: where it is now.
  Eigen::Vector3d now_min = Eigen::Vector3d::Zero(), now_max = Eigen::Vector3d::Zero();
};

// Where a ray ends.
struct RayHit {
  double distance = 0;  // in units of the ray's direction
  int face = 0;         // 6 * box + face of the box, kFloor or kCeiling
  static constexpr int kFloor = -1, kCeiling = -2;
};

// A synthetic building: geometry, textures, and an index for ray casting.  World frame: z up, floor at z = 0,
// metres.  Immutable after MakeBuilding and shareable between threads.
struct Building {
  Layout layout;
  double height_m = 0;
  std::vector<Box> boxes;
  std::vector<Rect> obstacles;  // what stands on the floor: pieces of wall, furniture, pillars
  Surface floor, ceiling;
  std::vector<Texture> textures;
  int num_wall_panels = 0;      // faces that carry a panel
  int num_repeated_panels = 0;  // of these, with a texture of the shared set
  std::vector<ChangedSurface> changed;

  // Boxes by cells of a square grid, as intervals of `cell_boxes`.
  double cell_m = 0.5;
  Eigen::Vector2d grid_origin = Eigen::Vector2d::Zero();
  int grid_cols = 0, grid_rows = 0;
  std::vector<int> cell_begins;
  std::vector<int> cell_boxes;

  const Surface& SurfaceOf(int face) const {
    return face >= 0 ? boxes[face / 6].faces[face % 6] : face == RayHit::kFloor ? floor : ceiling;
  }
};

// Builds and paints it.  The same options and seed give the same building for any number of threads.
// Cost: about 10 million texels a second and thread.  Errors: InvalidArgument, as CheckSimulateOptions
// and MakeLayout.
Result<Building> MakeBuilding(const SimulateOptions& options, uint64_t seed, int num_threads = 0);

// The first surface along a ray (world frame; `direction` need not have length 1).  Nothing for a ray that
// starts outside of the building or inside a box.
std::optional<RayHit> CastRay(const Building& building, const Eigen::Vector3d& origin,
                              const Eigen::Vector3d& direction);

// Distance from a place on the floor to the nearest wall or piece of furniture, metres; 0 inside of one and
// outside of the building.
double ClearanceM(const Building& building, double x, double y);

}  // namespace cairn::sim
