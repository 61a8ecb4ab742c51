#include "pipeline/report/ambiguity_svg.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "core/geometry/floor_pose.h"
#include "core/picture/svg.h"
#include "pipeline/report/floor_view.h"

namespace cairn::pipeline {
namespace {

// Stops of the legend.
constexpr int kNumStops = 8;

class Picture {
 public:
  explicit Picture(const MapRows& rows) : rows_(rows) {
    std::vector<Eigen::Vector2d> landmarks;
    for (const MapLandmark& landmark : rows.landmarks)
      landmarks.push_back((rows.floor_from_world * landmark.position).head<2>());
    for (const MapImage& image : rows.images)
      places_.push_back(FloorPoseOf(image.cam_from_world, rows.floor_from_world));
    FitView(landmarks);
    for (const MapAppearanceNode& node : rows.appearance) most_ = std::max(most_, *node.entropy);
  }

  std::string Draw() {
    const double height = view_.PictureHeightPx();
    size_t num_pairs = 0;
    for (const MapAppearanceNode& node : rows_.appearance) num_pairs += node.look_alikes.size();
    std::string svg = BeginSvg(FloorView::kPictureWidthPx, height, FloorView::kFontPx);
    svg += fmt::format(
        "<text x=\"24\" y=\"34\" font-size=\"20\" font-weight=\"bold\">{}: where the robot can tell where it "
        "is</text>\n<text x=\"{:.0f}\" y=\"34\" text-anchor=\"end\">{} places, {} pairs look alike</text>\n",
        EscapeXml(rows_.name), FloorView::kPictureWidthPx - 24, rows_.appearance.size(), num_pairs);
    svg += DrawPairs();
    for (const MapAppearanceNode& node : rows_.appearance) svg += DrawNode(node);
    svg += ScaleBar(24, height - 36, view_.px_per_m, 0.2 * FloorView::kPictureWidthPx);
    return svg + DrawLegend(height - 32) + "</svg>\n";
  }

 private:
  void FitView(const std::vector<Eigen::Vector2d>& landmarks) {
    view_ = MakeFloorView(rows_, landmarks);
    double least_m = 1;
    for (size_t i = 0; i < places_.size(); ++i) {
      for (size_t k = i + 1; k < places_.size() && k < i + 200; ++k) {
        const double distance = (places_[i].position - places_[k].position).norm();
        if (distance > 0.02) least_m = std::min(least_m, distance);
      }
    }
    size_px_ = std::clamp(0.6 * least_m * view_.px_per_m, 6.0, 26.0);
  }

  // Where the arrow of a node's first image has its middle.
  Eigen::Vector2d Mark(const MapAppearanceNode& node) const {
    const FloorPose& place = places_[node.images.front()];
    const double heading = RadFromDeg(place.heading_deg);
    return view_.Pixel(place.position) +
           0.6 * size_px_ * Eigen::Vector2d(std::cos(heading), -std::sin(heading));
  }

  std::string DrawPairs() const {
    std::string svg;
    for (const MapAppearanceNode& node : rows_.appearance) {
      const Eigen::Vector2d from = Mark(node);
      for (const MapAppearanceNode::LookAlike& other : node.look_alikes) {
        const Eigen::Vector2d to = Mark(rows_.appearance[other.node]);
        svg += fmt::format(
            "<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"{}\" stroke-opacity=\"0.35\" "
            "stroke-width=\"{:.1f}\"/>\n",
            from.x(), from.y(), to.x(), to.y(), kSvgVermilion, 0.5 + 2.5 * other.score);
      }
    }
    return svg;
  }

  std::string DrawNode(const MapAppearanceNode& node) const {
    std::string svg;
    const std::string colour = SvgViridis(most_ > 0 ? *node.entropy / most_ : 0);
    for (const int32_t image : node.images) {
      svg +=
          fmt::format("<polygon points=\"{}\" fill=\"{}\"><title>{}: {:.2f} nat</title></polygon>\n",
                      ArrowPoints(view_.Pixel(places_[image].position), places_[image].heading_deg, size_px_),
                      colour, EscapeXml(rows_.images[image].name), *node.entropy);
    }
    return svg;
  }

  std::string DrawLegend(double y) const {
    constexpr double kLeft = 420, kBar = 240;
    std::string svg = "<defs><linearGradient id=\"entropy\">";
    for (int i = 0; i <= kNumStops; ++i) {
      const double share = static_cast<double>(i) / kNumStops;
      svg += fmt::format("<stop offset=\"{:.3f}\" stop-color=\"{}\"/>", share, SvgViridis(share));
    }
    svg += fmt::format(
        "</linearGradient></defs>\n<text x=\"{0:.0f}\" y=\"{1:.0f}\" text-anchor=\"end\">entropy "
        "0</text>\n<rect "
        "x=\"{2:.0f}\" y=\"{3:.0f}\" width=\"{4:.0f}\" height=\"14\" fill=\"url(#entropy)\"/>\n<text "
        "x=\"{5:.0f}\" y=\"{1:.0f}\">{6:.2f} nat</text>\n",
        kLeft - 8, y + 5, kLeft, y - 7, kBar, kLeft + kBar + 8, most_);
    return svg + fmt::format(
                     "<path d=\"M{0:.0f} {1:.0f}h40\" stroke=\"{2}\" stroke-opacity=\"0.6\" "
                     "stroke-width=\"2\"/>\n<text x=\"{3:.0f}\" y=\"{4:.0f}\">look alike</text>\n",
                     kLeft + kBar + 120, y, kSvgVermilion, kLeft + kBar + 168, y + 5);
  }

  const MapRows& rows_;
  FloorView view_;
  std::vector<FloorPose> places_;  // per image
  double size_px_ = 10, most_ = 0;
};

}  // namespace

Result<std::string> AmbiguitySvg(const MapRows& rows) {
  if (rows.appearance.empty() || !rows.appearance.front().entropy) {
    return MakeError(ErrorCode::kNotFound,
                     "map '{}' does not store how ambiguous its places are; compile it again, or give "
                     "link-appearance the vocabulary",
                     rows.name);
  }
  return Picture(rows).Draw();
}

}  // namespace cairn::pipeline
