#include "core/sift/refine_extremum.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/sift/gaussian.h"
#include "core/sift/octave.h"

namespace cairn {
namespace {

constexpr int kMaxSteps = 5;  // as OpenCV
constexpr int kBorder = 5;    // pixels of the octave without keypoints, as OpenCV
constexpr float kPerGrey = 1 / 255.0f;

struct Place {
  int layer = 0;
  int x = 0;
  int y = 0;
};

// Value, gradient and Hessian of the difference of Gaussians by central differences, grey levels / 255.
struct Parabola {
  float value, dx, dy, ds;
  float dxx, dyy, dss, dxy, dxs, dys;
};

Parabola ParabolaAt(const Octave& octave, const Place& p) {
  float d[3][3][3];  // layer, row, column
  for (int s = 0; s < 3; ++s) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) d[s][r][c] = octave.Difference(p.layer + s - 1, p.x + c - 1, p.y + r - 1);
    }
  }
  constexpr float kHalf = 0.5f * kPerGrey, kQuarter = 0.25f * kPerGrey;
  const auto& here = d[1];
  const float twice = 2 * here[1][1];
  return {.value = here[1][1] * kPerGrey,
          .dx = (here[1][2] - here[1][0]) * kHalf,
          .dy = (here[2][1] - here[0][1]) * kHalf,
          .ds = (d[2][1][1] - d[0][1][1]) * kHalf,
          .dxx = (here[1][2] + here[1][0] - twice) * kPerGrey,
          .dyy = (here[2][1] + here[0][1] - twice) * kPerGrey,
          .dss = (d[2][1][1] + d[0][1][1] - twice) * kPerGrey,
          .dxy = (here[2][2] - here[2][0] - here[0][2] + here[0][0]) * kQuarter,
          .dxs = (d[2][1][2] - d[2][1][0] - d[0][1][2] + d[0][1][0]) * kQuarter,
          .dys = (d[2][2][1] - d[2][0][1] - d[0][2][1] + d[0][0][1]) * kQuarter};
}

struct Offset {
  double x = 0;
  double y = 0;
  double layer = 0;
};

// Where the parabola's gradient vanishes [Lowe04 eq. 3]; its middle if its Hessian is singular.
Offset Vertex(const Parabola& p) {
  const double xx = p.dxx, yy = p.dyy, ss = p.dss, xy = p.dxy, xs = p.dxs, ys = p.dys;
  const double cofactor_xx = yy * ss - ys * ys, cofactor_xy = xs * ys - xy * ss,
               cofactor_xs = xy * ys - xs * yy;
  const double determinant = xx * cofactor_xx + xy * cofactor_xy + xs * cofactor_xs;
  if (determinant == 0) return {};
  const double cofactor_yy = xx * ss - xs * xs, cofactor_ys = xy * xs - xx * ys,
               cofactor_ss = xx * yy - xy * xy;
  const double gx = p.dx, gy = p.dy, gs = p.ds;
  return {-(cofactor_xx * gx + cofactor_xy * gy + cofactor_xs * gs) / determinant,
          -(cofactor_xy * gx + cofactor_yy * gy + cofactor_ys * gs) / determinant,
          -(cofactor_xs * gx + cofactor_ys * gy + cofactor_ss * gs) / determinant};
}

bool IsInside(const Octave& octave, const Place& place, const Place& start) {
  const OctavePlan& plan = octave.plan();
  const int x = place.x + plan.window.x, y = place.y + plan.window.y;
  return place.layer >= 1 && place.layer <= kSiftLayers && x >= kBorder && x < plan.size.width - kBorder &&
         y >= kBorder && y < plan.size.height - kBorder && std::abs(place.x - start.x) <= kSiftMaxDrift &&
         std::abs(place.y - start.y) <= kSiftMaxDrift;
}

// [Lowe04 §4.1]
bool IsOnEdge(const Parabola& p, double edge_threshold) {
  const float trace = p.dxx + p.dyy, determinant = p.dxx * p.dyy - p.dxy * p.dxy;
  const auto ratio = static_cast<float>(edge_threshold);
  return determinant <= 0 || trace * trace * ratio >= (ratio + 1) * (ratio + 1) * determinant;
}

}  // namespace

std::optional<SiftExtremum> RefineExtremum(const Octave& octave, int layer, int x, int y,
                                           const SiftThresholds& thresholds) {
  const Place start{layer, x, y};
  Place place = start;
  for (int step = 0; step < kMaxSteps; ++step) {
    const Parabola parabola = ParabolaAt(octave, place);
    const Offset offset = Vertex(parabola);
    const double longest = std::max({std::abs(offset.x), std::abs(offset.y), std::abs(offset.layer)});
    if (longest < 0.5) {
      const auto dx = static_cast<float>(offset.x), dy = static_cast<float>(offset.y),
                 ds = static_cast<float>(offset.layer);
      // [Lowe04 eq. 4]
      const float contrast = parabola.value + 0.5f * (parabola.dx * dx + parabola.dy * dy + parabola.ds * ds);
      if (std::abs(contrast) * kSiftLayers < static_cast<float>(thresholds.contrast)) return std::nullopt;
      if (IsOnEdge(parabola, thresholds.edge)) return std::nullopt;
      const int octave_x = place.x + octave.window().x, octave_y = place.y + octave.window().y;
      const double sigma = octave.plan().sigma * ExactExp2((place.layer + offset.layer) / kSiftLayers);
      return SiftExtremum{.octave = octave.plan().octave,
                          .layer = place.layer,
                          .x = octave_x,
                          .y = octave_y,
                          .octave_x = static_cast<float>(octave_x) + dx,
                          .octave_y = static_cast<float>(octave_y) + dy,
                          .octave_sigma = static_cast<float>(sigma),
                          .response = std::abs(contrast)};
    }
    if (!(longest <= kSiftMaxDrift + 0.5)) return std::nullopt;
    place.x += static_cast<int>(std::nearbyint(offset.x));
    place.y += static_cast<int>(std::nearbyint(offset.y));
    place.layer += static_cast<int>(std::nearbyint(offset.layer));
    if (!IsInside(octave, place, start)) return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace cairn
