#include "core/picture/floor_frame.h"

#include <cmath>

#include <fmt/format.h>

#include "core/geometry/pose.h"

namespace cairn {

std::string ArrowPoints(const Eigen::Vector2d& center, double heading_deg, double size_px) {
  const double heading = RadFromDeg(heading_deg);
  const auto point = [&](double forward, double left) {
    return fmt::format("{:.1f},{:.1f}",
                       center.x() + size_px * (forward * std::cos(heading) - left * std::sin(heading)),
                       center.y() - size_px * (forward * std::sin(heading) + left * std::cos(heading)));
  };
  return point(1, 0) + " " + point(0.25, 0.34) + " " + point(0.25, -0.34);
}

std::string ScaleBar(double x_px, double y_px, double px_per_m, double most_px, const char* unit) {
  const double most_m = most_px / px_per_m;
  const double power = std::pow(10, std::floor(std::log10(most_m)));
  const double length_m = most_m >= 5 * power ? 5 * power : most_m >= 2 * power ? 2 * power : power;
  const double length_px = length_m * px_per_m;
  return fmt::format(
      "<path d=\"M{0:.1f} {1:.1f}v8h{2:.1f}v-8\" fill=\"none\" stroke=\"#000000\" stroke-width=\"2\"/>\n"
      "<text x=\"{3:.1f}\" y=\"{4:.1f}\">{5:g} {6}</text>\n",
      x_px, y_px, length_px, x_px + length_px + 8, y_px + 9, length_m, unit);
}

}  // namespace cairn
