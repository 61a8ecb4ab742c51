#include "pipeline/report/floor_svg.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

#include "core/geometry/pose.h"
#include "core/picture/svg.h"
#include "core/world/decomposition.h"
#include "pipeline/report/floor_view.h"

namespace cairn::pipeline {
namespace {

constexpr std::array<const char*, 4> kDashes = {"", "9 4", "3 3", "10 3 3 3"};

const char* Colour(RegionIdx region) { return kSvgColours[region % kSvgColours.size()]; }

// The convex hull, counter-clockwise (Andrew's monotone chain).
std::vector<Eigen::Vector2d> ConvexHull(std::vector<Eigen::Vector2d> points) {
  const auto less = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return std::pair(a.x(), a.y()) < std::pair(b.x(), b.y());
  };
  std::sort(points.begin(), points.end(), less);
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return points;
  const auto turns_left = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
    return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x() > 0;
  };
  std::vector<Eigen::Vector2d> hull;
  for (int pass = 0; pass < 2; ++pass) {  // lower, then upper half
    const size_t first = hull.size();
    for (const Eigen::Vector2d& point : points) {
      while (hull.size() >= first + 2 && !turns_left(hull[hull.size() - 2], hull.back(), point))
        hull.pop_back();
      hull.push_back(point);
    }
    hull.pop_back();
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

// Half of the smallest distance between stations' places, limited to visible sizes.
double MarkerSizePx(const MapRows& rows, const FloorView& view) {
  std::vector<Eigen::Vector2d> places;
  for (const MapStation& station : rows.stations) places.push_back(station.position);
  double least = 1;
  for (size_t i = 0; i < places.size(); ++i) {
    for (size_t k = i + 1; k < places.size() && k < i + 2000; ++k) {
      const double distance = (places[i] - places[k]).norm();
      if (distance > 1e-6) least = std::min(least, distance);
    }
  }
  return std::clamp(0.45 * least * view.px_per_m, 3.0, 26.0);
}

std::string DrawStation(const MapStation& station, RegionIdx region, const FloorView& view, double size) {
  const Eigen::Vector2d pixel = view.Pixel(station.position);
  const std::string paint = region >= 0
                                ? fmt::format("fill=\"{}\"", Colour(region))
                                : std::string("fill=\"#ffffff\" stroke=\"#555555\" stroke-width=\"1\"");
  std::string svg;
  Eigen::Vector2d mark = pixel;
  if (station.heading_deg) {
    svg +=
        fmt::format("<polygon points=\"{}\" {}/>\n", ArrowPoints(pixel, *station.heading_deg, size), paint);
    const double heading = RadFromDeg(*station.heading_deg);
    mark += 0.6 * size * Eigen::Vector2d(std::cos(heading), -std::sin(heading));
  } else {
    svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" {}/>\n", pixel.x(), pixel.y(),
                       0.6 * size, paint);
  }
  if (!station.is_covered) {
    const double arm = std::max(2.5, 0.35 * size);
    svg += fmt::format(
        "<path d=\"M{:.1f} {:.1f}l{:.1f} {:.1f}m0 {:.1f}l{:.1f} {:.1f}\" stroke=\"#000000\" "
        "stroke-width=\"1.5\"/>\n",
        mark.x() - arm, mark.y() - arm, 2 * arm, 2 * arm, -2 * arm, -2 * arm, 2 * arm);
  }
  return svg;
}

std::string DrawRegionOutline(const MapRows& rows, RegionIdx region, const FloorView& view, double size) {
  std::vector<Eigen::Vector2d> places;
  for (const StationIdx station : rows.regions[region].stations) {
    const Eigen::Vector2d pixel = view.Pixel(rows.stations[station].position);
    // A ring around each station, a little wider for later regions so that equal outlines stay visible.
    const double radius = size + 4 + 2.5 * (region % 7);
    for (int corner = 0; corner < 12; ++corner) {
      const double angle = RadFromDeg(30.0 * corner);
      places.push_back(pixel + radius * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    }
  }
  std::string points;
  for (const Eigen::Vector2d& corner : ConvexHull(std::move(places))) {
    points += fmt::format("{}{:.1f},{:.1f}", points.empty() ? "" : " ", corner.x(), corner.y());
  }
  const char* dash = kDashes[(static_cast<size_t>(region) / kSvgColours.size()) % kDashes.size()];
  return fmt::format(
      "<polygon points=\"{0}\" fill=\"{1}\" fill-opacity=\"0.05\" stroke=\"{1}\" stroke-width=\"2\" "
      "stroke-dasharray=\"{2}\" stroke-linejoin=\"round\"><title>region {3}: {4} stations, {5} "
      "landmarks</title></polygon>\n",
      points, Colour(region), dash, region, rows.regions[region].stations.size(),
      rows.regions[region].landmarks.size());
}

std::string DrawLegend(const MapRows& rows, double y) {
  const bool has_headings = !rows.stations.empty() && rows.stations[0].heading_deg.has_value();
  const auto station = [&](double x, const char* paint) {
    return has_headings ? fmt::format("<polygon points=\"{}\" {}/>\n", ArrowPoints({x - 6, y}, 0, 14), paint)
                        : fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"6\" {}/>\n", x, y, paint);
  };
  std::string svg = station(390, "fill=\"#0072B2\"");
  svg += fmt::format("<text x=\"404\" y=\"{:.1f}\">station, region's colour</text>\n", y + 5);
  svg += station(600, "fill=\"#ffffff\" stroke=\"#555555\"");
  svg += fmt::format("<text x=\"614\" y=\"{:.1f}\">in no region</text>\n", y + 5);
  svg += fmt::format(
      "<path d=\"M724 {0:.1f}l10 10m0 -10l-10 10\" stroke=\"#000000\" stroke-width=\"1.5\"/>\n"
      "<text x=\"740\" y=\"{1:.1f}\">not covered</text>\n"
      "<circle cx=\"850\" cy=\"{2:.1f}\" r=\"2\" fill=\"#888888\"/>\n<text x=\"860\" "
      "y=\"{1:.1f}\">landmark</text>\n",
      y - 5, y + 5, y);
  return svg;
}

}  // namespace

std::string FloorSvg(const MapRows& rows) {
  std::vector<Eigen::Vector2d> landmarks;
  for (const MapLandmark& landmark : rows.landmarks) {
    landmarks.push_back((rows.floor_from_world * landmark.position).head<2>());
  }
  const FloorView view = MakeFloorView(rows, landmarks);
  const double size = MarkerSizePx(rows, view);
  const double height = view.PictureHeightPx();
  std::string svg = BeginSvg(FloorView::kPictureWidthPx, height, FloorView::kFontPx);
  std::set<std::pair<double, double>> places;
  for (const MapStation& station : rows.stations) places.emplace(station.position.x(), station.position.y());
  svg += fmt::format(
      "<text x=\"24\" y=\"34\" font-size=\"20\" font-weight=\"bold\">{}</text>\n"
      "<text x=\"{:.0f}\" y=\"34\" text-anchor=\"end\">{}; {} landmarks; {} stations at {} "
      "places</text>\n",
      EscapeXml(rows.name), FloorView::kPictureWidthPx - 24,
      NumRegionsText(rows.regions.size(), rows.lower_bound), rows.landmarks.size(), rows.stations.size(),
      places.size());

  svg += fmt::format(
      "<clipPath id=\"floor\"><rect x=\"0\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/></clipPath>\n"
      "<g fill=\"#888888\" fill-opacity=\"0.55\" clip-path=\"url(#floor)\">\n",
      FloorView::kTitlePx, FloorView::kPictureWidthPx, view.HeightPx());
  for (const Eigen::Vector2d& landmark : landmarks) {
    const Eigen::Vector2d pixel = view.Pixel(landmark);
    svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"1.3\"/>\n", pixel.x(), pixel.y());
  }
  svg += "</g>\n";
  std::vector<RegionIdx> first_region(rows.stations.size(), -1);
  for (RegionIdx region = static_cast<RegionIdx>(rows.regions.size()) - 1; region >= 0; --region) {
    for (const StationIdx station : rows.regions[region].stations) first_region[station] = region;
    if (!rows.regions[region].stations.empty()) svg += DrawRegionOutline(rows, region, view, size);
  }
  for (size_t i = 0; i < rows.stations.size(); ++i)
    svg += DrawStation(rows.stations[i], first_region[i], view, size);
  svg += ScaleBar(24, height - 36, view.px_per_m, 0.2 * FloorView::kPictureWidthPx);
  svg += DrawLegend(rows, height - 32);
  return svg + "</svg>\n";
}

}  // namespace cairn::pipeline
