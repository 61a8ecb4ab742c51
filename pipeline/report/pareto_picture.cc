#include "pipeline/report/pareto_picture.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "core/picture/svg.h"

namespace cairn::pipeline {
namespace {

constexpr double kWidthPx = 900, kHeightPx = 720;
constexpr double kLeftPx = 90, kRightPx = 40;
constexpr double kPanelHeightPx = 250;
constexpr double kTopPanelPx = 80, kBottomPanelPx = 390;
constexpr const char* kBlue = "#0072B2";
constexpr const char* kOrange = "#D55E00";
constexpr const char* kGreen = "#009E73";
constexpr const char* kGrey = "#555555";
constexpr const char* kDash = "6 4";

std::string BytesText(double num_bytes) {
  if (num_bytes >= 1e6) return fmt::format("{:g} MB", num_bytes / 1e6);
  return fmt::format("{:g} kB", num_bytes / 1e3);
}

// Bytes to pixels, by powers of ten.
class ByteAxis {
 public:
  ByteAxis(double low, double high) : low_(std::log10(low / 1.25)), high_(std::log10(high * 1.25)) {}
  double Pixel(double num_bytes) const {
    return kLeftPx + (std::log10(num_bytes) - low_) / (high_ - low_) * (kWidthPx - kLeftPx - kRightPx);
  }
  // 1, 2 and 5 times powers of ten within.
  std::vector<double> Ticks() const {
    std::vector<double> ticks;
    for (int power = static_cast<int>(std::floor(low_)); power <= static_cast<int>(std::ceil(high_));
         ++power) {
      for (const double factor : {1.0, 2.0, 5.0}) {
        const double tick = factor * std::pow(10, power);
        if (std::log10(tick) >= low_ && std::log10(tick) <= high_) ticks.push_back(tick);
      }
    }
    return ticks;
  }

 private:
  double low_, high_;
};

// A panel with its own vertical axis.
struct Panel {
  double top_px = 0;
  double high = 1;  // value at the top; 0 at the bottom

  double Pixel(double value) const { return top_px + kPanelHeightPx * (1 - value / high); }
};

std::string DrawFrame(const Panel& panel, const ByteAxis& bytes, const std::string& title, double step,
                      const std::function<std::string(double)>& label) {
  std::string svg = fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\" font-weight=\"bold\">{}</text>\n", kLeftPx,
                                panel.top_px - 12, title);
  for (double value = 0; value <= panel.high * 1.0001; value += step) {
    svg += fmt::format(
        "<path d=\"M{:.0f} {:.1f}H{:.0f}\" stroke=\"#dddddd\"/>\n"
        "<text x=\"{:.0f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n",
        kLeftPx, panel.Pixel(value), kWidthPx - kRightPx, kLeftPx - 8, panel.Pixel(value) + 5, label(value));
  }
  for (const double tick : bytes.Ticks()) {
    svg += fmt::format(
        "<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" stroke=\"#eeeeee\"/>\n"
        "<text x=\"{0:.1f}\" y=\"{3:.1f}\" text-anchor=\"middle\">{4}</text>\n",
        bytes.Pixel(tick), panel.top_px, panel.top_px + kPanelHeightPx, panel.top_px + kPanelHeightPx + 20,
        BytesText(tick));
  }
  return svg;
}

using Curve = std::vector<std::pair<double, double>>;  // bytes, value

std::string DrawCurve(const Panel& panel, const ByteAxis& bytes, const Curve& curve, const char* colour,
                      const std::string& dash) {
  std::string points, dots;
  for (const auto& [num_bytes, value] : curve) {
    const double x = bytes.Pixel(num_bytes), y = panel.Pixel(std::min(value, panel.high));
    points += fmt::format("{}{:.1f},{:.1f}", points.empty() ? "" : " ", x, y);
    dots += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"/>\n", x, y, colour);
  }
  return fmt::format(
             "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\" "
             "stroke-dasharray=\"{}\"/>\n",
             points, colour, dash) +
         dots;
}

std::string DrawPeer(const Panel& panel, const ByteAxis& bytes, const ParetoPeer& peer, double value) {
  const double x = bytes.Pixel(peer.num_bytes), y = panel.Pixel(std::min(value, panel.high));
  return fmt::format(
      "<path d=\"M{0:.1f} {1:.1f}l7 7l-7 7l-7 -7z\" fill=\"{2}\"/>\n"
      "<text x=\"{3:.1f}\" y=\"{4:.1f}\" text-anchor=\"end\" fill=\"{2}\">{5}</text>\n",
      x, y - 7, kGrey, x - 12, y + 5, EscapeXml(peer.name));
}

// 1, 2 or 5 times a power of ten, such that `high` takes about five of them.
double NiceStep(double high) {
  const double power = std::pow(10, std::floor(std::log10(high / 5)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= high / 5) return factor * power;
  }
  return 10 * power;
}

// Lines with their names.
std::string DrawKey(double y, const std::vector<std::tuple<const char*, const char*, const char*>>& names) {
  std::string svg;
  double x = 330;
  for (const auto& [colour, dash, name] : names) {
    svg += fmt::format(
        "<path d=\"M{0:.0f} {1:.0f}h28\" stroke=\"{2}\" stroke-width=\"2\" stroke-dasharray=\"{6}\"/>\n<text "
        "x=\"{3:.0f}\" "
        "y=\"{4:.0f}\">{5}</text>\n",
        x, y - 5, colour, x + 36, y, name, dash);
    x += 150;
  }
  return svg;
}

}  // namespace

std::string ParetoSvg(const std::string& map_name, const std::vector<ParetoPoint>& points,
                      const std::optional<ParetoPeer>& peer) {
  double low = peer ? peer->num_bytes : 1e12, high = peer ? peer->num_bytes : 1, worst_cm = 0;
  Curve localized, within, error_cm;
  for (const ParetoPoint& point : points) {
    const auto num_bytes = static_cast<double>(point.num_bytes);
    low = std::min(low, num_bytes);
    high = std::max(high, num_bytes);
    localized.emplace_back(num_bytes, 100 * point.localized_ratio);
    within.emplace_back(num_bytes, 100 * point.within_10cm_5deg_ratio);
    if (!point.median_error_m) continue;
    error_cm.emplace_back(num_bytes, 100 * *point.median_error_m);
    worst_cm = std::max(worst_cm, error_cm.back().second);
  }
  if (peer) worst_cm = std::max(worst_cm, 100 * peer->median_error_m);
  const ByteAxis bytes(low, high);
  const double step_cm = NiceStep(std::max(worst_cm, 1e-3));
  const Panel recall{.top_px = kTopPanelPx, .high = 100};
  const Panel error{.top_px = kBottomPanelPx, .high = step_cm * std::ceil(worst_cm / step_cm + 0.1)};
  std::string svg = BeginSvg(kWidthPx, kHeightPx, 15);
  svg += fmt::format(
      "<text x=\"24\" y=\"34\" font-size=\"20\" font-weight=\"bold\">{}: what a smaller map costs</text>\n",
      EscapeXml(map_name));
  svg += DrawFrame(recall, bytes, "held-out images, %", 20,
                   [](double value) { return fmt::format("{:.0f}", value); });
  svg += DrawKey(kTopPanelPx - 12, {{kBlue, "", "localized"}, {kGreen, kDash, "within 10 cm, 5 deg"}});
  svg += DrawCurve(recall, bytes, within, kGreen, kDash) + DrawCurve(recall, bytes, localized, kBlue, "");
  svg += DrawFrame(error, bytes, "median error of those localized, cm", step_cm,
                   [](double value) { return fmt::format("{:g}", value); });
  svg += DrawCurve(error, bytes, error_cm, kOrange, "");
  if (peer) {
    svg += DrawPeer(recall, bytes, *peer, 100 * peer->localized_ratio);
    svg += DrawPeer(error, bytes, *peer, 100 * peer->median_error_m);
  }
  svg += fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"middle\">bytes of the map</text>\n",
                     (kLeftPx + kWidthPx - kRightPx) / 2, kBottomPanelPx + kPanelHeightPx + 48);
  return svg + "</svg>\n";
}

}  // namespace cairn::pipeline
