#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "core/base/random.h"
#include "sim/render/layout.h"

namespace cairn::sim {

// Procedural surfaces, 8-bit grey.  All have structure at many scales, as things in buildings do, so that
// features found from one distance are found again from another; with noise of one scale they would not be.
// Same size, texel and random stream, same picture.

enum class Material { kPlaster, kBrick, kWood, kConcrete, kWallpaper };
inline constexpr int kNumMaterials = 5;

// A wall panel: a material with posters, text signs, notice boards and shelves of things on it.
cv::Mat PaintWallPanel(int width_px, int height_px, double texel_m, Material material, Random& random);
// The wall over a door: the same material with a sign.
cv::Mat PaintLintel(int width_px, int height_px, double texel_m, Material material, Random& random);
// The side or top of a piece of furniture: wood or lacquer with drawers, labels and stickers.
cv::Mat PaintFurnitureFace(int width_px, int height_px, double texel_m, Random& random);
// The floor inside `bounds`, each room with its own: carpet, planks or tiles.  Row 0 is the greatest y.
cv::Mat PaintFloor(const Rect& bounds, const std::vector<Room>& rooms, double texel_m, uint64_t seed);
// The ceiling: panels of 0.6 m with lamps and air vents.  Row 0 is the greatest y.
cv::Mat PaintCeiling(const Rect& bounds, double texel_m, uint64_t seed);
// Door jambs, lintels' undersides, tops of walls.
cv::Mat PaintTrim();

}  // namespace cairn::sim
