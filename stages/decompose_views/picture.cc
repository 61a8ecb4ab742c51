#include "stages/decompose_views/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>

#include <fmt/format.h>

#include "core/picture/floor_frame.h"
#include "core/picture/svg.h"

namespace cairn::decompose_views {
namespace {

using Vec2 = Eigen::Vector2d;
constexpr double kLongSidePx = 1400, kMarginPx = 24, kLegendPx = 260;
// Regions smaller than this are not drawn, square pixels.
constexpr double kMinAreaPx = 0.5;
// Of poses and paths.
constexpr std::array kColours = {kSvgVermilion, kSvgBlue, kSvgGreen, kSvgPurple, kSvgOrange, kSvgSky};

// From light to dark along one hue, for a share in [0, 1].
std::string Shade(double share) {
  static constexpr std::array<Rgb, 4> kStops = {
      {{247, 251, 255}, {198, 219, 239}, {107, 174, 214}, {33, 113, 181}}};
  return SvgRamp(kStops, share);
}

class Picture {
 public:
  explicit Picture(const Views& views) : views_(views) {
    frame_.low = views.plan.Metres(views.plan.low);
    frame_.high = views.plan.Metres(views.plan.high);
    frame_.px_per_m = kLongSidePx / (frame_.high - frame_.low).cwiseMax(1e-3).maxCoeff();
    frame_.left_px = frame_.top_px = kMarginPx;
    width_ = frame_.WidthPx() + 2 * kMarginPx;
    height_ = frame_.HeightPx() + 2 * kMarginPx;
  }

  std::string Draw(const ViewsOverlay& overlay, bool regions) {
    svg_.Begin(width_ + kLegendPx,
               std::max(height_ + 40, 160.0 + 18.0 * static_cast<double>(overlay.captions.size())), 13);
    if (regions) DrawRegions();
    DrawAreas(overlay);
    DrawWalls();
    DrawOverlay(overlay);
    svg_.Append(ScaleBar(kMarginPx, height_ + 8, frame_.px_per_m, 240));
    DrawLegend(overlay, regions);
    return svg_.End();
  }

 private:
  Vec2 Px(const Vec2& metres) const { return frame_.Pixel(metres); }

  // One group per shade, its regions as one path.
  void DrawRegions() {
    int most = 1, least = 1 << 30;
    for (const ViewIndex& index : views_.index) {
      most = std::max(most, index.num_labels);
      least = std::min(least, index.num_labels);
    }
    least_ = least;
    most_ = most;
    std::vector<std::vector<FaceIdx>> by_count(most + 1);
    for (FaceIdx face = 0; face < views_.num_faces(); ++face) {
      if (views_.Area(face) * frame_.px_per_m * frame_.px_per_m < kMinAreaPx) continue;
      by_count[views_.index[face].num_labels].push_back(face);
    }
    svg_.Write("<g id=\"regions\" stroke=\"#ffffff\" stroke-width=\"0.25\" stroke-linejoin=\"round\">\n");
    for (int count = 0; count <= most; ++count) {
      if (by_count[count].empty()) continue;
      svg_.Write("<path fill=\"{}\" d=\"", Shade(Share(count)));
      for (const FaceIdx face : by_count[count]) {
        for (int64_t i = views_.face_offsets[face]; i < views_.face_offsets[face + 1]; ++i) {
          const Vec2 px = Px(views_.plan.Metres(views_.vertices[views_.face_vertices[i]]));
          svg_.Write("{}{:.1f} {:.1f}", i == views_.face_offsets[face] ? "M" : "L", px.x(), px.y());
        }
        svg_.Write("Z");
      }
      svg_.Write("\"/>\n");
    }
    svg_.Write("</g>\n");
  }

  double Share(int count) const {
    return most_ > least_ ? static_cast<double>(count - least_) / (most_ - least_) : 0;
  }

  void DrawWalls() {
    svg_.Write("<g id=\"walls\" stroke=\"black\" stroke-width=\"2\" stroke-linecap=\"round\">\n");
    for (const PlanWall& wall : views_.plan.walls) {
      const Vec2 a = Px(wall.start), b = Px(wall.end);
      svg_.Write("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\"/>\n", a.x(), a.y(), b.x(),
                 b.y());
    }
    svg_.Write("</g>\n");
  }

  void DrawAreas(const ViewsOverlay& overlay) {
    if (overlay.areas.empty()) return;
    // Stroked too: no gaps between neighbours.
    svg_.Write("<path id=\"areas\" fill=\"{0}\" fill-opacity=\"0.35\" stroke=\"{0}\" stroke-width=\"1\" d=\"",
               kSvgPurple);
    for (const std::vector<Vec2>& area : overlay.areas) {
      for (size_t i = 0; i < area.size(); ++i)
        svg_.Write("{}{:.1f} {:.1f}", i == 0 ? "M" : "L", Px(area[i]).x(), Px(area[i]).y());
      svg_.Write("Z");
    }
    svg_.Write("\"/>\n");
  }

  // What a scan saw: the area that its beams passed, and where they ended.
  void DrawBeams(const ViewsOverlay& overlay) {
    if (overlay.beams.empty() || overlay.robots.empty()) return;
    const Vec2 at = Px(overlay.robots[0].position);
    svg_.Write("<g id=\"beams\" fill=\"{}\">\n<polygon fill-opacity=\"0.1\" points=\"{:.1f},{:.1f}",
               kColours[0], at.x(), at.y());
    for (const auto& [end, met] : overlay.beams) svg_.Write(" {:.1f},{:.1f}", Px(end).x(), Px(end).y());
    svg_.Write("\"/>\n");
    for (const auto& [end, met] : overlay.beams) {
      if (met) svg_.Write("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\"/>\n", Px(end).x(), Px(end).y());
    }
    svg_.Write("</g>\n");
  }

  void DrawOverlay(const ViewsOverlay& overlay) {
    DrawBeams(overlay);
    svg_.Write("<g id=\"scan\" stroke-linecap=\"round\">\n");
    for (const ViewsOverlay::Line& line : overlay.segments) {
      const Vec2 a = Px(line.start), b = Px(line.end);
      svg_.Write(
          "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" "
          "stroke-width=\"{}\"{}/>\n",
          a.x(), a.y(), b.x(), b.y(), line.strong ? kSvgVermilion : kSvgPurple, line.strong ? 4 : 3,
          line.strong ? "" : " stroke-dasharray=\"6 4\"");
    }
    svg_.Write("</g>\n<g id=\"paths\" fill=\"none\" stroke-width=\"2.5\">\n");
    for (size_t i = 0; i < overlay.paths.size(); ++i) {
      const std::vector<Vec2>& path = overlay.paths[i];
      const char* colour = kColours[i % kColours.size()];
      svg_.Write("<polyline stroke=\"{}\" points=\"", colour);
      for (const Vec2& point : path) svg_.Write("{:.1f},{:.1f} ", Px(point).x(), Px(point).y());
      svg_.Write("\"/>\n");
      for (const Vec2& point : path)
        svg_.Write("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.5\" fill=\"{}\"/>\n", Px(point).x(),
                   Px(point).y(), colour);
      if (path.size() > 1) DrawArrow(Px(path[path.size() - 2]), Px(path.back()), colour);
    }
    svg_.Write("</g>\n<g id=\"robots\">\n");
    for (size_t i = 0; i < overlay.robots.size(); ++i) {
      const ViewsOverlay::Robot& robot = overlay.robots[i];
      const Vec2 at = Px(robot.position);
      const Vec2 ahead(std::cos(robot.heading_rad), -std::sin(robot.heading_rad));
      const char* colour = kColours[i % kColours.size()];
      svg_.Write(
          "<circle cx=\"{0:.1f}\" cy=\"{1:.1f}\" r=\"7\" fill=\"{2}\" stroke=\"white\" stroke-width=\"1.5\"/>"
          "<line x1=\"{0:.1f}\" y1=\"{1:.1f}\" x2=\"{3:.1f}\" y2=\"{4:.1f}\" stroke=\"{2}\" "
          "stroke-width=\"3\"/>"
          "<text x=\"{5:.1f}\" y=\"{6:.1f}\" fill=\"{2}\" "
          "font-weight=\"bold\">{7}</text>\n",
          at.x(), at.y(), colour, at.x() + 16 * ahead.x(), at.y() + 16 * ahead.y(), at.x() + 10, at.y() - 9,
          EscapeXml(robot.caption));
    }
    svg_.Write("</g>\n");
  }

  void DrawArrow(const Vec2& from, const Vec2& to, const char* colour) {
    const Vec2 along = (to - from).normalized(), across(-along.y(), along.x());
    const Vec2 a = to - 11 * along + 5 * across, b = to - 11 * along - 5 * across;
    svg_.Write(
        "<polygon fill=\"{}\" stroke=\"none\" points=\"{:.1f},{:.1f} {:.1f},{:.1f} {:.1f},{:.1f}\"/>\n",
        colour, to.x(), to.y(), a.x(), a.y(), b.x(), b.y());
  }

  void DrawLegend(const ViewsOverlay& overlay, bool regions) {
    const double x = width_ + 4;
    double y = kMarginPx + 10;
    const std::string num_regions =
        views_.num_faces() > 0 ? fmt::format("{} regions, ", views_.num_faces()) : "";
    svg_.Write("<text x=\"{:.0f}\" y=\"{:.0f}\" font-weight=\"bold\">{}{} walls</text>\n", x, y, num_regions,
               views_.plan.num_walls());
    if (regions) {
      y += 24;
      svg_.Write("<text x=\"{:.0f}\" y=\"{:.0f}\">walls seen from a region:</text>\n", x, y);
      for (int i = 0; i < 5; ++i) {
        y += 18;
        const int count = least_ + (most_ - least_) * i / 4;
        svg_.Write(
            "<rect x=\"{:.0f}\" y=\"{:.0f}\" width=\"14\" height=\"14\" fill=\"{}\" stroke=\"#888\"/><text "
            "x=\"{:.0f}\" "
            "y=\"{:.0f}\">{}</text>\n",
            x, y - 11, Shade(Share(count)), x + 22, y, count);
      }
    }
    y += 8;
    for (const std::string& caption : overlay.captions) {
      y += 18;
      svg_.Write("<text x=\"{:.0f}\" y=\"{:.0f}\">{}</text>\n", x, y, EscapeXml(caption));
    }
  }

  const Views& views_;
  FloorFrame frame_;
  double width_ = 0, height_ = 0;
  int least_ = 0, most_ = 1;
  SvgWriter svg_;
};

}  // namespace

std::string DrawViews(const Views& views, const ViewsOverlay& overlay, bool regions) {
  return Picture(views).Draw(overlay, regions);
}

}  // namespace cairn::decompose_views
