#include "stages/decompose_regions/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <iterator>
#include <map>
#include <numbers>
#include <set>

#include <fmt/format.h>

#include "core/base/quantiles.h"
#include "core/geometry/pose.h"
#include "core/picture/floor_frame.h"
#include "core/picture/svg.h"

namespace cairn::decompose_regions {
namespace {

// The longer side of the picture, while a cell of the grid is neither tiny nor huge.
constexpr double kLongSidePx = 1000, kMinCellPx = 8, kMaxCellPx = 56;
constexpr int kMaxLegendRegions = 30;

using Cell = std::pair<int, int>;
using Vec2 = Eigen::Vector2d;

// The grid that stations stand on: cell side and direction from the edges.
struct Grid {
  double side_m = 1;
  double angle_rad = 0;
  Vec2 origin = Vec2::Zero();

  explicit Grid(const World& world) {
    if (!world.positions.empty()) origin = world.positions[0];
    std::vector<double> lengths;
    std::complex<double> direction = 0;
    for (const auto& [u, v] : world.edges) {
      const Vec2 difference = world.positions[v] - world.positions[u];
      if (difference.isZero()) continue;  // between headings
      lengths.push_back(difference.norm());
      direction += std::polar(1.0, 4.0 * std::atan2(difference.y(), difference.x()));
    }
    if (!lengths.empty()) {
      side_m = UpperMedian(std::move(lengths));
      angle_rad = std::abs(direction) > 1e-9 ? std::arg(direction) / 4.0 : 0.0;
    }
    if (world.lattice_spacing_m > 0) side_m = world.lattice_spacing_m;
  }
  Cell CellOf(const Vec2& position) const {
    const Vec2 grid = Eigen::Rotation2Dd(-angle_rad) * (position - origin) / side_m;
    return {static_cast<int>(std::lround(grid.x())), static_cast<int>(std::lround(grid.y()))};
  }
  // A point in cell units (cell centres are integers) on the floor.
  Vec2 FloorFromGrid(double x, double y) const {
    return origin + Eigen::Rotation2Dd(angle_rad) * Vec2(x, y) * side_m;
  }
};

class Picture {
 public:
  Picture(const World& world, const Decomposition& decomposition)
      : world_(world), decomposition_(decomposition), grid_(world) {
    for (const Vec2& position : world.positions) station_cells_.push_back(grid_.CellOf(position));
    for (const Region& region : decomposition.regions) {
      std::set<Cell>& cells = region_cells_.emplace_back();
      Vec2 sum = Vec2::Zero();
      for (const StationIdx station : region.stations) {
        cells.insert(station_cells_[station]);
        sum += world.positions[station];
      }
      centres_.push_back(sum / static_cast<double>(region.stations.size()));
    }
    ChooseColours();
    SetExtent();
  }

  std::string Draw() {
    const int num_rows =
        std::min<int>(kMaxLegendRegions, static_cast<int>(decomposition_.regions.size())) + 6;
    const double height = std::max(height_ + 60, 18.0 * num_rows + 20);
    svg_.Begin(width_ + 300, height, 12);
    DrawStations();
    DrawOutlines();
    svg_.Append(ScaleBar(1.5 * cell_px_, height_ + 20, frame_.px_per_m, 0.4 * width_));
    DrawLegend();
    return svg_.End();
  }

 private:
  std::string Point(const Vec2& place) const {
    const Vec2 pixel = frame_.Pixel(place);
    return fmt::format("{:.1f} {:.1f}", pixel.x(), pixel.y());
  }

  // Each region in turn takes the colour that the fewest regions around it have.
  void ChooseColours() {
    std::map<Cell, std::vector<int>> regions_at;
    for (size_t i = 0; i < region_cells_.size(); ++i) {
      std::array<int, kSvgManyColours.size()> uses{};
      std::set<int> around;
      for (const auto& [x, y] : region_cells_[i]) {
        for (const Cell& cell :
             {Cell(x, y), Cell(x + 1, y), Cell(x - 1, y), Cell(x, y + 1), Cell(x, y - 1)}) {
          const auto entry = regions_at.find(cell);
          if (entry != regions_at.end()) around.insert(entry->second.begin(), entry->second.end());
        }
      }
      for (const int other : around) ++uses[colours_[other]];
      // Among unused colours start where the index points, so that neighbours in the list differ as well.
      int best = static_cast<int>(i % kSvgManyColours.size());
      for (size_t step = 1; step < kSvgManyColours.size(); ++step) {
        const int colour = static_cast<int>((i + step) % kSvgManyColours.size());
        if (uses[colour] < uses[best]) best = colour;
      }
      colours_.push_back(best);
      for (const Cell& cell : region_cells_[i]) regions_at[cell].push_back(static_cast<int>(i));
    }
  }

  void SetExtent() {
    Vec2 low = Vec2::Zero(), high = Vec2::Zero();
    if (!world_.positions.empty()) low = high = world_.positions[0];
    for (const Vec2& position : world_.positions) {
      low = low.cwiseMin(position);
      high = high.cwiseMax(position);
    }
    const double margin = 1.5 * grid_.side_m;
    const double long_side = (high - low).maxCoeff() + 2 * margin;
    cell_px_ = std::clamp(kLongSidePx * grid_.side_m / long_side, kMinCellPx, kMaxCellPx);
    frame_.px_per_m = cell_px_ / grid_.side_m;
    frame_.low = low.array() - margin;
    frame_.high = high.array() + margin;
    width_ = frame_.WidthPx();
    height_ = frame_.HeightPx();
  }

  // The shape of a station around its place: a square of the grid, or a sector for a heading.
  std::string StationPath(StationIdx station, double size) const {
    const Vec2& at = world_.positions[station];
    if (world_.headings_deg.empty()) {
      std::string path;
      for (const auto& [x, y] :
           {std::pair(-0.5, -0.5), std::pair(0.5, -0.5), std::pair(0.5, 0.5), std::pair(-0.5, 0.5)}) {
        const Vec2 corner = at + size * (grid_.FloorFromGrid(x, y) - grid_.origin);
        path += (path.empty() ? "M" : "L") + Point(corner);
      }
      return path + "Z";
    }
    const double radius = 0.5 * size * grid_.side_m;
    std::string path = "M" + Point(at);
    for (const double side : {-0.5, 0.5}) {
      const double angle = RadFromDeg(world_.headings_deg[station] + side * HeadingWidthDeg());
      const Vec2 corner = at + radius * Vec2(std::cos(angle), std::sin(angle));
      path += side < 0 ? "L" + Point(corner)
                       : fmt::format("A{0:.1f} {0:.1f} 0 0 0 {1}", radius * frame_.px_per_m, Point(corner));
    }
    return path + "Z";
  }
  double HeadingWidthDeg() const {
    const std::set<double> headings(world_.headings_deg.begin(), world_.headings_deg.end());
    double width = 170;
    for (auto it = headings.begin(); std::next(it) != headings.end(); ++it)
      width = std::min(width, *std::next(it) - *it);
    return width;
  }

  void DrawStations() {
    std::vector<int> owner(world_.num_stations(), -1);
    for (size_t i = 0; i < decomposition_.regions.size(); ++i) {
      for (const StationIdx station : decomposition_.regions[i].stations) {
        const Vec2& at = world_.positions[station];
        if (owner[station] < 0 || (at - centres_[i]).norm() < (at - centres_[owner[station]]).norm()) {
          owner[station] = static_cast<int>(i);
        }
      }
    }
    std::vector<bool> uncovered(world_.num_stations(), false);
    for (const StationIdx station : decomposition_.uncovered) uncovered[station] = true;
    svg_.Write("<g id=\"stations\">\n");
    for (StationIdx station = 0; station < world_.num_stations(); ++station) {
      if (uncovered[station]) {
        svg_.Write("<path d=\"{}\" fill=\"white\" stroke=\"black\" stroke-width=\"1.2\"/>\n",
                   StationPath(station, 0.6));
      } else if (owner[station] >= 0) {
        svg_.Write("<path d=\"{}\" fill=\"{}\" fill-opacity=\"0.45\"/>\n", StationPath(station, 0.94),
                   kSvgManyColours[colours_[owner[station]]]);
      } else {
        svg_.Write("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"1.3\" fill=\"#888\"/>\n",
                   frame_.Pixel(world_.positions[station]).x(), frame_.Pixel(world_.positions[station]).y());
      }
    }
    svg_.Write("</g>\n");
  }

  // One side of a cell at the border of a region, moved inwards so that outlines of regions that share a
  // border lie beside each other; shortened at convex corners and lengthened at concave ones, so that
  // sides meet.
  void AddSide(const std::set<Cell>& cells, const Cell& cell, int nx, int ny, double inset,
               std::string* path) const {
    const int tx = -ny, ty = nx;
    const auto inside = [&](int dx, int dy) { return cells.count({cell.first + dx, cell.second + dy}) > 0; };
    const auto end = [&](int sign) {
      double along = 0.5;
      if (!inside(sign * tx, sign * ty)) {
        along -= inset;
      } else if (inside(sign * tx + nx, sign * ty + ny)) {
        along += inset;
      }
      return Point(grid_.FloorFromGrid(cell.first + nx * (0.5 - inset) + sign * tx * along,
                                       cell.second + ny * (0.5 - inset) + sign * ty * along));
    };
    *path += "M" + end(-1) + "L" + end(1);
  }

  void DrawOutlines() {
    svg_.Write("<g id=\"outlines\" fill=\"none\" stroke-width=\"1.6\" stroke-linecap=\"round\">\n");
    for (size_t i = 0; i < region_cells_.size(); ++i) {
      std::string path;
      const double inset = 0.06 + 0.08 * static_cast<double>(i % 4);
      for (const Cell& cell : region_cells_[i]) {
        for (const auto& [nx, ny] : {Cell(1, 0), Cell(-1, 0), Cell(0, 1), Cell(0, -1)}) {
          if (!region_cells_[i].count({cell.first + nx, cell.second + ny})) {
            AddSide(region_cells_[i], cell, nx, ny, inset, &path);
          }
        }
      }
      svg_.Write("<path d=\"{}\" stroke=\"{}\"/>\n", path, kSvgManyColours[colours_[i]]);
    }
    svg_.Write("</g>\n<g id=\"numbers\" font-weight=\"bold\" text-anchor=\"middle\">\n");
    for (size_t i = 0; i < centres_.size(); ++i) {
      svg_.Write(
          "<text x=\"{0:.1f}\" y=\"{1:.1f}\" stroke=\"white\" stroke-width=\"3\">{2}</text>"
          "<text x=\"{0:.1f}\" y=\"{1:.1f}\">{2}</text>\n",
          frame_.Pixel(centres_[i]).x(), frame_.Pixel(centres_[i]).y() + 4, i);
    }
    svg_.Write("</g>\n");
  }

  void DrawLegend() {
    double y = 24;
    const double x = width_ + 10;
    svg_.Write("<text x=\"{:.0f}\" y=\"{:.0f}\" font-weight=\"bold\">{}</text>\n", x, y,
               NumRegionsText(decomposition_.regions.size(), decomposition_.lower_bound));
    y += 18;
    svg_.Write("<text x=\"{:.0f}\" y=\"{:.0f}\">algorithm {}, k = {}, tau = {}, rho = {}</text>\n", x, y,
               EscapeXml(decomposition_.algorithm), decomposition_.k, decomposition_.tau, decomposition_.rho);
    y += 6;
    for (size_t i = 0; i < decomposition_.regions.size() && i < kMaxLegendRegions; ++i) {
      y += 18;
      svg_.Write(
          "<rect x=\"{0:.0f}\" y=\"{1:.0f}\" width=\"12\" height=\"12\" fill=\"{2}\" fill-opacity=\"0.45\" "
          "stroke=\"{2}\"/><text x=\"{3:.0f}\" y=\"{4:.0f}\">{5}: {6} stations, {7} landmarks</text>\n",
          x, y - 10, kSvgManyColours[colours_[i]], x + 20, y, i, decomposition_.regions[i].stations.size(),
          decomposition_.regions[i].features.size());
    }
    if (decomposition_.regions.size() > kMaxLegendRegions) {
      y += 18;
      svg_.Write("<text x=\"{:.0f}\" y=\"{:.0f}\">and {} more</text>\n", x + 20, y,
                 decomposition_.regions.size() - kMaxLegendRegions);
    }
    y += 18;
    svg_.Write(
        "<rect x=\"{0:.0f}\" y=\"{1:.0f}\" width=\"10\" height=\"10\" fill=\"white\" stroke=\"black\"/>"
        "<text x=\"{2:.0f}\" y=\"{3:.0f}\">in no region: {4} coverable stations</text>\n",
        x + 1, y - 9, x + 20, y, decomposition_.uncovered.size());
    y += 18;
    svg_.Write(
        "<circle cx=\"{0:.0f}\" cy=\"{1:.0f}\" r=\"1.5\" fill=\"#888\"/>"
        "<text x=\"{2:.0f}\" y=\"{3:.0f}\">sees fewer than k all around</text>\n",
        x + 6, y - 4, x + 20, y);
  }

  const World& world_;
  const Decomposition& decomposition_;
  const Grid grid_;
  FloorFrame frame_;
  double width_ = 0, height_ = 0, cell_px_ = 0;
  std::vector<Cell> station_cells_;
  std::vector<std::set<Cell>> region_cells_;
  std::vector<Vec2> centres_;
  std::vector<int> colours_;
  SvgWriter svg_;
};

}  // namespace

std::string DrawDecomposition(const World& world, const Decomposition& decomposition) {
  return Picture(world, decomposition).Draw();
}

}  // namespace cairn::decompose_regions
