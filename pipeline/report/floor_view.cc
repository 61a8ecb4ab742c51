#include "pipeline/report/floor_view.h"

#include <algorithm>

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
  view.px_per_m = std::min(FloorView::kPictureWidthPx / size.x(), kMaxHeightPx / size.y());
  view.top_px = FloorView::kTitlePx;
  view.left_px = 0.5 * (FloorView::kPictureWidthPx - size.x() * view.px_per_m);
  return view;
}

}  // namespace cairn::pipeline
