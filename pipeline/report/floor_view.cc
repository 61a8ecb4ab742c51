#include "pipeline/report/floor_view.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/geometry/pose.h"

namespace cairn::pipeline {
namespace {

constexpr double kMaxHeightPx = 1200;
constexpr double kMarginM = 0.5;

}  // namespace

FloorView MakeFloorView(const MapRows& rows, const std::vector<Eigen::Vector2d>& others) {
  std::vector<double> xs, ys;
  for (const Eigen::Vector2d& place : others) {
    xs.push_back(place.x());
    ys.push_back(place.y());
  }
  FloorView view;
  if (!xs.empty()) {  // all but the outermost percent: a few far landmarks would shrink the rest
    std::sort(xs.begin(), xs.end());
    std::sort(ys.begin(), ys.end());
    const size_t cut = xs.size() / 100;
    view.low = {xs[cut], ys[cut]};
    view.high = {xs[xs.size() - 1 - cut], ys[ys.size() - 1 - cut]};
  } else if (!rows.stations.empty()) {
    view.low = view.high = rows.stations[0].position;
  }
  for (const MapStation& station : rows.stations) {
    view.low = view.low.cwiseMin(station.position);
    view.high = view.high.cwiseMax(station.position);
  }
  view.low.array() -= kMarginM;
  view.high.array() += kMarginM;
  const Eigen::Vector2d size = view.high - view.low;
  view.px_per_m = std::min(FloorView::kWidthPx / size.x(), kMaxHeightPx / size.y());
  view.left_px = 0.5 * (FloorView::kWidthPx - size.x() * view.px_per_m);
  return view;
}

std::string ArrowPoints(const Eigen::Vector2d& center, double heading_deg, double size_px) {
  const double heading = RadFromDeg(heading_deg);
  const auto point = [&](double forward, double left) {
    return fmt::format("{:.1f},{:.1f}",
                       center.x() + size_px * (forward * std::cos(heading) - left * std::sin(heading)),
                       center.y() - size_px * (forward * std::sin(heading) + left * std::cos(heading)));
  };
  return point(1, 0) + " " + point(0.25, 0.34) + " " + point(0.25, -0.34);
}

std::string DrawScaleBar(const FloorView& view, double y) {
  const double wanted = 0.2 * FloorView::kWidthPx / view.px_per_m;
  const double power = std::pow(10, std::floor(std::log10(wanted)));
  const double length_m = wanted >= 5 * power ? 5 * power : wanted >= 2 * power ? 2 * power : power;
  const double end = 24 + length_m * view.px_per_m;
  return fmt::format(
      "<path d=\"M24 {0:.1f}v8h{1:.1f}v-8\" fill=\"none\" stroke=\"#000000\" stroke-width=\"2\"/>\n"
      "<text x=\"{2:.1f}\" y=\"{3:.1f}\">{4:g} m</text>\n",
      y, end - 24, end + 8, y + 9, length_m);
}

}  // namespace cairn::pipeline
