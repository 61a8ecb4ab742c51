#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "core/geometry/pose.h"
#include "core/picture/floor_frame.h"
#include "core/picture/svg.h"
#include "sim/robot/robot_drive.h"

namespace cairn::sim {
namespace {

constexpr double kWidthPx = 1000, kTopPx = 56, kMarginPx = 24, kChartPx = 150, kLegendPx = 56;

class Picture {
 public:
  Picture(const RobotDrive& drive, const Building& building, const std::vector<PlanarPose>& node_poses)
      : drive_(drive), building_(building), node_poses_(node_poses) {
    const Rect& bounds = building.layout.bounds;
    frame_.low = {bounds.x0, bounds.y0};
    frame_.high = {bounds.x1, bounds.y1};
    frame_.px_per_m = (kWidthPx - 2 * kMarginPx) / bounds.width();
    frame_.left_px = kMarginPx;
    frame_.top_px = kTopPx;
    for (const DriveLeg& leg : drive.legs) {
      for (const DriveHypothesis& hypothesis : leg.hypotheses) {
        if (std::find(starts_.begin(), starts_.end(), hypothesis.start) == starts_.end())
          starts_.push_back(hypothesis.start);
      }
    }
  }

  std::string Draw() {
    const double height = kTopPx + frame_.HeightPx() + kChartPx + kLegendPx + 40;
    svg_.Begin(kWidthPx, height, 14);
    svg_.Write(
        "<text x=\"{:.0f}\" y=\"34\" font-size=\"18\" font-weight=\"bold\">{}; {:.1f} m, turned back {} "
        "times, looked anew {} times</text>\n",
        kMarginPx, drive_.error ? "not at the goal" : "at the goal", drive_.way_m, drive_.num_switches,
        drive_.num_relocalizations);
    DrawFloor();
    DrawWay();
    DrawChart();
    return svg_.End();
  }

 private:
  Eigen::Vector2d Pixel(const Eigen::Vector2d& place) const { return frame_.Pixel(place); }

  const char* Colour(NodeIdx start) const {
    const auto found = std::find(starts_.begin(), starts_.end(), start);
    return kSvgColours[static_cast<size_t>(found - starts_.begin()) % kSvgColours.size()];
  }

  void DrawArrow(const PlanarPose& pose, double size, const std::string& paint) {
    const Eigen::Vector2d p = Pixel(pose.position);
    const double c = std::cos(pose.heading_rad), s = -std::sin(pose.heading_rad);
    svg_.Write("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}L{:.1f} {:.1f}z\" {}/>\n", p.x() + size * c,
               p.y() + size * s, p.x() - 0.4 * size * (c + s), p.y() - 0.4 * size * (s - c),
               p.x() - 0.4 * size * (c - s), p.y() - 0.4 * size * (s + c), paint);
  }

  void DrawFloor() {
    svg_.Write("<g fill=\"#cccccc\">\n");
    for (const Rect& rect : building_.obstacles) {
      const Eigen::Vector2d p = Pixel({rect.x0, rect.y1});
      svg_.Write("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/>\n", p.x(), p.y(),
                 rect.width() * frame_.px_per_m, rect.depth() * frame_.px_per_m);
    }
    svg_.Write("</g>\n");
    // The ways of the starts, later ones over earlier ones.
    for (const DriveLeg& leg : drive_.legs) {
      if (leg.kind != "start" && leg.kind != "relocalize") continue;
      for (const DriveHypothesis& hypothesis : leg.hypotheses) {
        for (const NodeIdx node : hypothesis.path) {
          DrawArrow(node_poses_[node], 7,
                    fmt::format("fill=\"none\" stroke=\"{}\"", Colour(hypothesis.start)));
        }
        const Eigen::Vector2d p = Pixel(hypothesis.start_pose.position);
        svg_.Write(
            "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"13\" fill=\"none\" stroke=\"{}\" "
            "stroke-width=\"3\"/>\n",
            p.x(), p.y(), Colour(hypothesis.start));
      }
    }
  }

  void DrawWay() {
    for (const DriveLeg& leg : drive_.legs) {
      std::string points;
      const auto add = [&](const PlanarPose& pose) {
        const Eigen::Vector2d p = Pixel(pose.position);
        points += fmt::format("{}{:.1f},{:.1f}", points.empty() ? "" : " ", p.x(), p.y());
      };
      for (const RobotStep& step : leg.steps) add(step.pose);
      add(leg.pose);
      svg_.Write("<polyline points=\"{}\" fill=\"none\" stroke=\"#000000\" stroke-width=\"1.5\"{}/>\n",
                 points, leg.kind == "retrace" ? " stroke-dasharray=\"4 3\"" : "");
    }
    DrawArrow(drive_.start, 12, "fill=\"#000000\"");
    DrawArrow(drive_.goal, 12, "fill=\"#D55E00\"");
    const double y = kTopPx + frame_.HeightPx() + 26;
    for (const auto& [line, text] :
         {std::pair(0, "black arrow: start, red: goal; line: the robot's way, dashed where it turns back"),
          std::pair(1,
                    "rings: starts held possible, with the images of their ways; below: posteriors after "
                    "each image")}) {
      svg_.Write("<text x=\"{:.0f}\" y=\"{:.0f}\">{}</text>\n", kMarginPx, y + 18 * line, text);
    }
  }

  void DrawChart() {
    const double top = kTopPx + frame_.HeightPx() + kLegendPx, bottom = top + kChartPx;
    std::vector<const DriveLeg*> looked;
    for (const DriveLeg& leg : drive_.legs) {
      if (!leg.hypotheses.empty()) looked.push_back(&leg);
    }
    const double step = (kWidthPx - 2 * kMarginPx) / std::max<double>(1, looked.size());
    svg_.Write("<path d=\"M{0:.0f} {1:.0f}v{2:.0f}h{3:.0f}\" fill=\"none\" stroke=\"#888888\"/>\n", kMarginPx,
               top, kChartPx, kWidthPx - 2 * kMarginPx);
    for (size_t i = 0; i < looked.size(); ++i) {
      double y = bottom;
      for (const DriveHypothesis& hypothesis : looked[i]->hypotheses) {
        const double part = hypothesis.posterior * kChartPx;
        y -= part;
        svg_.Write(
            "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"><title>start "
            "{}: {:.3f}</title></rect>\n",
            kMarginPx + static_cast<double>(i) * step + 1, y, std::max(1.0, step - 2), part,
            Colour(hypothesis.start), hypothesis.start, hypothesis.posterior);
      }
      const std::string& verdict = looked[i]->verdict;
      if (!verdict.empty() && verdict != "follow") {
        svg_.Write("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"11\">{}</text>\n",
                   kMarginPx + static_cast<double>(i) * step, bottom + 14, verdict);
      }
    }
  }

  const RobotDrive& drive_;
  const Building& building_;
  const std::vector<PlanarPose>& node_poses_;
  FloorFrame frame_;
  std::vector<NodeIdx> starts_;
  SvgWriter svg_;
};

}  // namespace

std::string DriveSvg(const RobotDrive& drive, const Building& building,
                     const std::vector<PlanarPose>& node_poses) {
  return Picture(drive, building, node_poses).Draw();
}

}  // namespace cairn::sim
