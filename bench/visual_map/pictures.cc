#include "bench/visual_map/pictures.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "core/base/quantiles.h"
#include "core/picture/svg.h"

namespace cairn {
namespace {

constexpr double kPxPerM = 120;
constexpr double kLeftPx = 62, kTopPx = 48, kBottomPx = 56, kLegendPx = 250;
// Room between the floor and the legend.
constexpr double kGapPx = 20;
constexpr int kFontPx = 15;
// A posterior's shades go down to 1e-8: each is a tenth as likely.
constexpr int kNumShades = 8;
// Factors by which error arrows may be longer than the floor's scale.
constexpr std::array<double, 7> kEnlargements = {100, 50, 20, 10, 5, 2, 1};
// Maximum lengths, as drawn, of nine in ten arrows and of all arrows.
constexpr double kLongArrowM = 0.4, kLongestArrowM = 1.5;
constexpr double kArrowHeadPx = 7;

std::string Text(double x, double y, const std::string& text, const char* anchor = "start") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", x, y, anchor,
                     EscapeXml(text));
}

// A floor in metres, framed, with both axes' numbers, and room for a legend on its right.
class FloorPicture {
 public:
  FloorPicture(const VisualMap& map, const std::vector<Eigen::Vector2d>& others, const std::string& title)
      : low_(map.places()[0]), high_(low_) {
    for (const auto* points : {&map.places(), &others}) {
      for (const Eigen::Vector2d& point : *points) {
        low_ = low_.cwiseMin(point);
        high_ = high_.cwiseMax(point);
      }
    }
    low_.array() -= map.spacing_m();
    high_.array() += map.spacing_m();
    size_ = (high_ - low_) * kPxPerM;
    // Small floors have the legend's height at least.
    const double height = kTopPx + std::max(size_.y(), kLeastHeightPx) + kBottomPx;
    svg_ = BeginSvg(LegendX() + kLegendPx, height, kFontPx) + Text(kLeftPx, 28, title);
    AddAxes();
  }

  Eigen::Vector2d Pixel(const Eigen::Vector2d& at) const {
    return {kLeftPx + (at.x() - low_.x()) * kPxPerM, kTopPx + (high_.y() - at.y()) * kPxPerM};
  }
  double LegendX() const { return kLeftPx + size_.x() + kGapPx; }
  // Where the next part of the legend goes.
  double TakeLegend(double height_px) {
    const double y = legend_y_;
    legend_y_ += height_px;
    return y;
  }
  void Add(const std::string& part) { svg_ += part; }
  std::string Finish() const { return svg_ + "</svg>\n"; }

 private:
  static constexpr double kLeastHeightPx = 330;

  void AddAxes() {
    const double bottom = kTopPx + size_.y(), middle = kTopPx + size_.y() / 2;
    svg_ += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" "
        "stroke=\"#555555\"/>\n",
        kLeftPx, kTopPx, size_.x(), size_.y());
    for (double x = std::ceil(low_.x()); x <= high_.x(); x += 1) {
      const double at = Pixel({x, low_.y()}).x();
      svg_ += fmt::format("<path d=\"M{:.1f} {:.1f}v6\" stroke=\"#555555\"/>\n", at, bottom) +
              Text(at, bottom + 21, fmt::format("{:.0f}", x), "middle");
    }
    for (double y = std::ceil(low_.y()); y <= high_.y(); y += 1) {
      const double at = Pixel({low_.x(), y}).y();
      svg_ += fmt::format("<path d=\"M{:.1f} {:.1f}h-6\" stroke=\"#555555\"/>\n", kLeftPx, at) +
              Text(kLeftPx - 10, at + 5, fmt::format("{:.0f}", y), "end");
    }
    svg_ += Text(kLeftPx + size_.x() / 2, bottom + 42, "x on the floor, m", "middle");
    svg_ += fmt::format(
        "<text transform=\"translate(20 {:.1f}) rotate(-90)\" text-anchor=\"middle\">y on the floor, "
        "m</text>\n",
        middle);
  }

  Eigen::Vector2d low_, high_, size_;  // m, m, px
  std::string svg_;
  double legend_y_ = kTopPx + 12;
};

std::string Cross(const Eigen::Vector2d& at) {
  return fmt::format(
      "<path d=\"M{0:.1f} {1:.1f}l12 12m0 -12l-12 12\" stroke=\"{2}\" stroke-width=\"2.5\"/>\n", at.x() - 6,
      at.y() - 6, kSvgColours[3]);
}

std::string Ring(const Eigen::Vector2d& at) {
  return fmt::format(
      "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"9\" fill=\"none\" stroke=\"{}\" stroke-width=\"2.5\"/>\n",
      at.x(), at.y(), kSvgColours[1]);
}

// Of a probability: the darker, the likelier.
std::string Shade(double probability) {
  const double tenths =
      probability > 0 ? std::clamp(-std::log10(probability), 0.0, double{kNumShades}) : kNumShades;
  const int grey = static_cast<int>(std::lround(30 + 220 * tenths / kNumShades));
  return fmt::format("rgb({},{},{})", grey, grey, std::min(255, grey + 60));
}

void AddShadeLegend(FloorPicture* picture) {
  constexpr double kStepPx = 22;
  const double x = picture->LegendX();
  picture->Add(Text(x, picture->TakeLegend(14) + 4, "probability of a place, p(x | z)"));
  for (int shade = 0; shade <= kNumShades; ++shade) {
    const double y = picture->TakeLegend(kStepPx);
    const std::string label = shade == 0            ? "1"
                              : shade == kNumShades ? fmt::format("1e-{} or less", shade)
                              : shade < 3           ? fmt::format("{:g}", std::pow(10, -shade))
                                                    : fmt::format("1e-{}", shade);
    picture->Add(fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"30\" height=\"{:.1f}\" fill=\"{}\" "
                             "stroke=\"#bbbbbb\"/>\n",
                             x, y, kStepPx, Shade(std::pow(10, -shade))) +
                 Text(x + 38, y + kStepPx / 2 + 5, label));
  }
  picture->TakeLegend(26);
}

void AddMarkLegend(const std::string& mark, const std::string& text, FloorPicture* picture, double y) {
  picture->Add(mark + Text(picture->LegendX() + 38, y + 5, text));
}

// From one pixel to another, with a head.
std::string Arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const char* colour) {
  std::string path = fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", from.x(), from.y(), to.x(), to.y());
  const double length = (to - from).norm();
  if (length > 0.5) {
    const Eigen::Vector2d along = std::min(kArrowHeadPx, 0.5 * length) / length * (to - from);
    for (const double side : {0.5, -0.5}) {
      const Eigen::Vector2d end = to - along + side * Eigen::Vector2d(-along.y(), along.x());
      path += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", to.x(), to.y(), end.x(), end.y());
    }
  }
  return fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\"/>\n", path, colour);
}

// The largest enlargement at which most arrows stay short, and all in the picture.
double EnlargementFor(const std::vector<ErrorArrow>& arrows) {
  std::vector<double> lengths_m;
  for (const ErrorArrow& arrow : arrows) {
    if (!arrow.is_flagged) lengths_m.push_back((arrow.found - arrow.truth).norm());
  }
  if (lengths_m.empty()) return 1;
  const double length_m =
      std::max(Decile(lengths_m, 9),
               kLongArrowM / kLongestArrowM * *std::max_element(lengths_m.begin(), lengths_m.end()));
  for (const double enlargement : kEnlargements) {
    if (enlargement * length_m <= kLongArrowM) return enlargement;
  }
  return 1;
}

std::string Dot(const Eigen::Vector2d& at, const char* colour, bool is_filled) {
  return fmt::format(
      "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.5\" fill=\"{}\" stroke=\"{}\" stroke-width=\"1.5\"/>\n",
      at.x(), at.y(), is_filled ? colour : "none", colour);
}

std::string PlaceDot(const Eigen::Vector2d& at) {
  return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\" fill=\"#bbbbbb\"/>\n", at.x(), at.y());
}

void AddErrorLegend(double enlargement, FloorPicture* picture) {
  const double x = picture->LegendX();
  // A round length of error, about half a metre as it is drawn.
  const double error_m = 0.5 / enlargement;
  const double y = picture->TakeLegend(30);
  const double length_px = error_m * enlargement * kPxPerM;
  picture->Add(Arrow({x, y}, {x + length_px, y}, kSvgColours[0]) +
               Text(x + length_px + 8, y + 5, fmt::format("error of {:g} m", error_m)));
  picture->Add(Text(x, picture->TakeLegend(36) + 5,
                    enlargement > 1 ? fmt::format("drawn {:g} times as long", enlargement)
                                    : std::string("drawn to the floor's scale")));
  const auto mark = [&](const std::string& of, const std::string& text, double at) {
    AddMarkLegend(of, text, picture, at);
  };
  double at = picture->TakeLegend(28);
  mark(Dot({x + 15, at}, kSvgColours[0], true), "where an image was taken", at);
  at = picture->TakeLegend(28);
  mark(Dot({x + 15, at}, kSvgColours[3], false), "flagged: it claims no place", at);
  at = picture->TakeLegend(28);
  mark(PlaceDot({x + 15, at}), "place of the survey", at);
}

}  // namespace

// [Sala06 Fig. 15]
std::string PosteriorSvg(const std::string& title, const VisualMap& map, const VisualPose& pose,
                         const Eigen::Vector2d& truth) {
  FloorPicture picture(map, {truth, pose.position}, title);
  const double side = map.spacing_m() * kPxPerM;
  for (size_t i = 0; i < map.places().size(); ++i) {
    const Eigen::Vector2d at = picture.Pixel(map.places()[i]);
    picture.Add(
        fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\" "
                    "stroke=\"#ffffff\"/>\n",
                    at.x() - side / 2, at.y() - side / 2, side, side, Shade(pose.at_place[i])));
  }
  picture.Add(Cross(picture.Pixel(truth)) + Ring(picture.Pixel(pose.position)));
  AddShadeLegend(&picture);
  const double x = picture.LegendX() + 15;
  double y = picture.TakeLegend(28);
  AddMarkLegend(Cross({x, y}), "where it was taken", &picture, y);
  y = picture.TakeLegend(28);
  AddMarkLegend(Ring({x, y}), "the maximum, refined", &picture, y);
  picture.Add(
      Text(picture.LegendX(), picture.TakeLegend(28) + 5, fmt::format("elsewhere: {:.1g}", pose.elsewhere)));
  return picture.Finish();
}

// [Sala06 Fig. 16]
std::string ErrorSvg(const std::string& title, const VisualMap& map, const std::vector<ErrorArrow>& arrows) {
  std::vector<Eigen::Vector2d> truths;
  for (const ErrorArrow& arrow : arrows) truths.push_back(arrow.truth);
  FloorPicture picture(map, truths, title);
  for (const Eigen::Vector2d& place : map.places()) picture.Add(PlaceDot(picture.Pixel(place)));
  const double enlargement = EnlargementFor(arrows);
  for (const ErrorArrow& arrow : arrows) {
    const Eigen::Vector2d from = picture.Pixel(arrow.truth);
    if (!arrow.is_flagged) {
      const Eigen::Vector2d to = picture.Pixel(arrow.truth + enlargement * (arrow.found - arrow.truth));
      picture.Add(Arrow(from, to, kSvgColours[0]));
    }
    picture.Add(Dot(from, kSvgColours[arrow.is_flagged ? 3 : 0], !arrow.is_flagged));
  }
  AddErrorLegend(enlargement, &picture);
  return picture.Finish();
}

}  // namespace cairn
