#include "bench/visual_map/pictures.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/svg.h"

namespace cairn {
namespace {

constexpr double kMarginPx = 40, kPxPerM = 120;
constexpr int kFontPx = 15;
// Shades of a posterior: each is a tenth as likely.
constexpr int kNumShades = 8;

class Floor {
 public:
  Floor(const VisualMap& map, const std::vector<Eigen::Vector2d>& others)
      : low_(map.places()[0]), high_(low_) {
    for (const auto* points : {&map.places(), &others}) {
      for (const Eigen::Vector2d& point : *points) {
        low_ = low_.cwiseMin(point);
        high_ = high_.cwiseMax(point);
      }
    }
    low_.array() -= map.spacing_m();
    high_.array() += map.spacing_m();
  }
  Eigen::Vector2d Pixel(const Eigen::Vector2d& at) const {
    return {kMarginPx + (at.x() - low_.x()) * kPxPerM, kMarginPx + (high_.y() - at.y()) * kPxPerM};
  }
  std::string Begin(const std::string& title) const {
    const Eigen::Vector2d size = (high_ - low_) * kPxPerM;
    return BeginSvg(size.x() + 2 * kMarginPx, size.y() + 2 * kMarginPx, kFontPx) +
           fmt::format("<text x=\"{}\" y=\"26\">{}</text>\n", kMarginPx, EscapeXml(title)) +
           fmt::format(
               "<path d=\"M{} {:.1f}h{}\" stroke=\"#000000\" stroke-width=\"3\"/>"
               "<text x=\"{}\" y=\"{:.1f}\">1 m</text>\n",
               kMarginPx, size.y() + 1.5 * kMarginPx, kPxPerM, kMarginPx + kPxPerM + 8,
               size.y() + 1.5 * kMarginPx + 5);
  }

 private:
  Eigen::Vector2d low_, high_;
};

std::string Cross(const Eigen::Vector2d& at) {
  return fmt::format(
      "<path d=\"M{0:.1f} {1:.1f}l12 12m0 -12l-12 12\" stroke=\"{2}\" stroke-width=\"2.5\"/>\n", at.x() - 6,
      at.y() - 6, kSvgColours[3]);
}

}  // namespace

std::string PosteriorSvg(const std::string& title, const VisualMap& map, const VisualPose& pose,
                         const Eigen::Vector2d& truth) {
  const Floor floor(map, {truth, pose.position});
  std::string svg = floor.Begin(title);
  const double largest = *std::max_element(pose.at_place.begin(), pose.at_place.end());
  const double side = map.spacing_m() * kPxPerM;
  for (size_t i = 0; i < map.places().size(); ++i) {
    const Eigen::Vector2d at = floor.Pixel(map.places()[i]);
    const double tenths = pose.at_place[i] > 0 ? std::log10(largest / pose.at_place[i]) : kNumShades;
    const int grey = static_cast<int>(std::lround(30 + 220 * std::min(1.0, tenths / kNumShades)));
    svg += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"rgb({},{},{})\" "
        "stroke=\"#ffffff\"/>\n",
        at.x() - side / 2, at.y() - side / 2, side, side, grey, grey, std::min(255, grey + 60));
  }
  const Eigen::Vector2d found = floor.Pixel(pose.position);
  svg += Cross(floor.Pixel(truth)) +
         fmt::format(
             "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"9\" fill=\"none\" stroke=\"{}\" "
             "stroke-width=\"2.5\"/>\n</svg>\n",
             found.x(), found.y(), kSvgColours[1]);
  return svg;
}

std::string ErrorSvg(const std::string& title, const VisualMap& map, const std::vector<ErrorArrow>& arrows) {
  std::vector<Eigen::Vector2d> truths;
  for (const ErrorArrow& arrow : arrows) truths.push_back(arrow.truth);
  const Floor floor(map, truths);
  std::string svg = floor.Begin(title);
  for (const Eigen::Vector2d& place : map.places()) {
    const Eigen::Vector2d at = floor.Pixel(place);
    svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\" fill=\"#bbbbbb\"/>\n", at.x(), at.y());
  }
  for (const ErrorArrow& arrow : arrows) {
    const Eigen::Vector2d from = floor.Pixel(arrow.truth), to = floor.Pixel(arrow.found);
    svg += fmt::format(
        "<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"{}\" stroke-width=\"2\"{}/>"
        "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\"/>\n",
        from.x(), from.y(), to.x(), to.y(), kSvgColours[arrow.is_flagged ? 1 : 0],
        arrow.is_flagged ? " stroke-dasharray=\"2 4\"" : "", from.x(), from.y(),
        kSvgColours[arrow.is_flagged ? 1 : 0]);
  }
  return svg + "</svg>\n";
}

}  // namespace cairn
