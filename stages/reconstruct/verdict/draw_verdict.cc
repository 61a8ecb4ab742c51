#include "stages/reconstruct/verdict/draw_verdict.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "core/base/printable.h"
#include "core/picture/floor_frame.h"
#include "core/picture/svg.h"
#include "stages/reconstruct/verdict/verdict_text.h"

namespace cairn::reconstruct {
namespace {

constexpr double kWidthPx = 1000, kMaxHeightPx = 760, kMarginPx = 44, kTitlePx = 60;
constexpr double kLegendLinePx = 26, kStrengthPx = 168;
constexpr int kFontPx = 15;
constexpr char kInk[] = "#000000", kGrey[] = "#555555", kPaper[] = "#ffffff";

constexpr size_t kMaxBytes = 300000;
constexpr int kMaxNumPieces = 1500, kMinNumPieces = 20;
constexpr size_t kMaxNumMarks = 60, kMaxNumChords = 150, kMaxNumPartLines = 4;
constexpr size_t kMaxNumLabelledWalks = 6;
constexpr size_t kMaxNameBytes = 60;
constexpr double kRingPx = 9, kEndPx = 3;  // of a loop, and of its ends
constexpr double kMarkSpacingPx = 11;      // of missing images
constexpr double kLeastStepPx = 0.7;       // corners of a line that are nearer to each other are left out

// How strongly points join two images: the colour-blind tell these apart, and their widths.
struct Strength {
  int min_num_points = 0;
  const char* text = nullptr;
  const char* colour = nullptr;
  double width_px = 0;
};
constexpr std::array<Strength, 4> kStrengths = {{{0, "fewer than 50", kSvgVermilion, 2.5},
                                                 {50, "50 to 149", kSvgOrange, 3.5},
                                                 {150, "150 to 499", kSvgSky, 4.5},
                                                 {500, "500 or more", kSvgBlue, 5.5}}};

size_t StrengthOf(int num_points) {
  size_t strength = 0;
  while (strength + 1 < kStrengths.size() && num_points >= kStrengths[strength + 1].min_num_points)
    ++strength;
  return strength;
}

// A name that fits, without markup: its end tells images of a folder apart.
std::string ShownName(const std::string& name) {
  if (name.size() <= kMaxNameBytes) return EscapeXml(name);
  std::string_view end = std::string_view(name).substr(name.size() - kMaxNameBytes);
  while (!end.empty() && FirstCharacter(end).num_bytes == 0) end.remove_prefix(1);
  return "\u2026" + EscapeXml(end);
}

std::string ShownRange(const std::string& first, const std::string& last) {
  return first == last ? ShownName(first) : ShownName(first) + " to " + ShownName(last);
}

// The picture, in pieces few enough for its size.
class Drawing {
 public:
  Drawing(const Verdict& verdict, const std::string& title, int max_num_pieces)
      : verdict_(verdict), title_(title), max_num_pieces_(max_num_pieces) {
    PlaceImages();
  }

  std::string Draw() {
    svg_.Begin(kWidthPx, Height(), kFontPx);
    DrawTitle();
    DrawLoopPairs();
    if (verdict_.is_drive) {
      DrawDrive();
      DrawOpenStretches();
      DrawMissing();
      DrawEnds();
    } else {
      DrawCollection();
    }
    DrawLoops();
    DrawWeakPlaces();
    DrawLegend();
    return svg_.End();
  }

 private:
  void PlaceImages() {
    view_.low = view_.high = verdict_.images[0].place;
    for (const JoinedImage& image : verdict_.images) {
      view_.low = view_.low.cwiseMin(image.place);
      view_.high = view_.high.cwiseMax(image.place);
    }
    const Eigen::Vector2d size = view_.high - view_.low;
    const double longer = size.maxCoeff() > 0 ? size.maxCoeff() : 1;
    view_.px_per_m = std::min((kWidthPx - 2 * kMarginPx) / std::max(size.x(), 1e-3 * longer),
                              (kMaxHeightPx - 2 * kMarginPx) / std::max(size.y(), 1e-3 * longer));
    view_.top_px = kTitlePx + kMarginPx;
    view_.left_px = 0.5 * (kWidthPx - view_.WidthPx());
    for (const JoinedImage& image : verdict_.images) pixels_.push_back(view_.Pixel(image.place));
  }

  size_t NumPartLines() const {
    return verdict_.parts.empty() ? 0 : std::min(verdict_.parts.size(), kMaxNumPartLines) + 1;
  }
  double LegendTop() const { return view_.top_px + view_.HeightPx() + kMarginPx; }
  double Height() const { return LegendTop() + kLegendLinePx * (3.5 + static_cast<double>(NumPartLines())); }

  void DrawTitle() {
    std::string figures =
        fmt::format("{} of {} images joined", verdict_.images.size(), verdict_.num_images());
    if (verdict_.is_drive) {
      figures += fmt::format("; {}; {} loop{}", LengthText(verdict_, verdict_.way), verdict_.loops.size(),
                             verdict_.loops.size() == 1 ? "" : "s");
    }
    svg_.Write(
        "<text x=\"24\" y=\"34\" font-size=\"20\" font-weight=\"bold\">{}</text>\n"
        "<text x=\"{:.0f}\" y=\"34\" text-anchor=\"end\">{}</text>\n",
        ShownName(title_), kWidthPx - 24, figures);
  }

  // Thin lines between images that see the same after a loop; many of them are thinned out evenly.
  void DrawLoopPairs() {
    const size_t every = (verdict_.loop_pairs.size() + kMaxNumChords - 1) / kMaxNumChords;
    if (every == 0) return;
    std::string path;
    for (size_t p = 0; p < verdict_.loop_pairs.size(); p += every) {
      const Eigen::Vector2d &a = pixels_[verdict_.loop_pairs[p].image1],
                            &b = pixels_[verdict_.loop_pairs[p].image2];
      path += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", a.x(), a.y(), b.x(), b.y());
    }
    svg_.Write("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1\" stroke-opacity=\"0.4\"/>\n",
               path, kSvgGreen);
  }

  // Links of equal strength that follow each other are one piece, as many as there are for each of the
  // pieces; a gap is a piece of its own.
  void DrawDrive() {
    const std::vector<ImageLink>& links = verdict_.links;
    const size_t most = (links.size() + max_num_pieces_ - 1) / max_num_pieces_;
    std::array<std::string, kStrengths.size()> pieces;
    std::string gaps;
    for (size_t first = 0; first < links.size();) {
      size_t end = first + 1;
      if (links[first].num_missing > 0) {
        gaps += Piece(first, end);
        first = end;
        continue;
      }
      const size_t strength = StrengthOf(links[first].num_points);
      while (end < links.size() && end - first < most && links[end].num_missing == 0 &&
             links[end].image1 == links[end - 1].image2 && StrengthOf(links[end].num_points) == strength)
        ++end;
      pieces[strength] += Piece(first, end);
      first = end;
    }
    if (!gaps.empty()) {
      svg_.Write("<g fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\" stroke-dasharray=\"4 4\">\n{}</g>\n",
                 kGrey, gaps);
    }
    for (size_t strength = kStrengths.size(); strength-- > 0;) {  // the weakest on top
      if (pieces[strength].empty()) continue;
      svg_.Write(
          "<g fill=\"none\" stroke=\"{}\" stroke-width=\"{:g}\" stroke-linecap=\"round\" "
          "stroke-linejoin=\"round\">\n{}</g>\n",
          kStrengths[strength].colour, kStrengths[strength].width_px, pieces[strength]);
    }
  }

  std::string Piece(size_t first, size_t end) const {
    const std::vector<ImageLink>& links = verdict_.links;
    Eigen::Vector2d last = pixels_[links[first].image1];
    std::string corners = fmt::format("M{:.1f} {:.1f}", last.x(), last.y());
    int least = links[first].num_points;
    double length = 0;
    for (size_t l = first; l < end; ++l) {
      least = std::min(least, links[l].num_points);
      length += links[l].length;
      const Eigen::Vector2d& next = pixels_[links[l].image2];
      if (l + 1 < end && (next - last).norm() < kLeastStepPx) continue;
      corners += fmt::format("L{:.1f} {:.1f}", next.x(), next.y());
      last = next;
    }
    return fmt::format(
        "<path d=\"{}\"><title>{}{}: {} points{}, {}{}</title></path>\n", corners,
        ShownRange(verdict_.images[links[first].image1].name, verdict_.images[links[end - 1].image2].name),
        end - first > 1 ? fmt::format(", {} images", end - first + 1) : "", least,
        end - first > 1 ? " or more" : "", LengthText(verdict_, length),
        links[first].num_missing > 0 ? fmt::format(", {} missing", links[first].num_missing) : "");
  }

  // Light dashes on the line.
  void DrawOpenStretches() {
    for (const OpenStretch& stretch : verdict_.open_stretches) {
      std::string corners;
      Eigen::Vector2d last = pixels_[stretch.image1];
      for (int i = stretch.image1; i <= stretch.image2; ++i) {
        if (i > stretch.image1 && i < stretch.image2 && (pixels_[i] - last).norm() < kLeastStepPx) continue;
        last = pixels_[i];
        corners += fmt::format("{}{:.1f} {:.1f}", corners.empty() ? 'M' : 'L', last.x(), last.y());
      }
      svg_.Write(
          "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\" stroke-dasharray=\"3 "
          "6\"><title>in no loop: {}, {}</title></path>\n",
          corners, kPaper,
          ShownRange(verdict_.images[stretch.image1].name, verdict_.images[stretch.image2].name),
          LengthText(verdict_, stretch.length));
    }
  }

  // Marks evenly between the images before and after, or beyond the first or last one.
  void DrawMissing() {
    const std::vector<MissingImage>& missing = verdict_.missing;
    std::string marks;
    for (size_t first = 0; first < missing.size();) {
      const auto [before, after] = std::pair(missing[first].before, missing[first].after);
      size_t end = first + 1;
      while (end < missing.size() && missing[end].before == before && missing[end].after == after) ++end;
      if (before >= 0 || after >= 0) marks += MarksBetween(before, after, first, end);
      first = end;
    }
    if (marks.empty()) return;
    svg_.Write("<g fill=\"{}\" stroke=\"{}\" stroke-width=\"1.5\">\n{}</g>\n", kPaper, kGrey, marks);
  }

  std::string MarksBetween(int before, int after, size_t first, size_t end) const {
    const size_t num_missing = end - first;
    Eigen::Vector2d from, to;
    size_t num_marks = 1;
    if (before >= 0 && after >= 0) {
      from = pixels_[before];
      to = pixels_[after];
      num_marks =
          std::clamp<size_t>(static_cast<size_t>((to - from).norm() / kMarkSpacingPx), 1, num_missing);
    } else {
      from = pixels_[before >= 0 ? before : after];
      to = from + 2 * kMarkSpacingPx * Outwards(before >= 0 ? before : after, before >= 0 ? -1 : 1);
      num_marks = 1;
    }
    std::string marks;
    for (size_t mark = 0; mark < num_marks; ++mark) {
      const size_t of_first = first + mark * num_missing / num_marks,
                   of_last = first + (mark + 1) * num_missing / num_marks - 1;
      const double part = static_cast<double>(mark + 1) / static_cast<double>(num_marks + 1);
      const Eigen::Vector2d at = from + part * (to - from);
      marks += fmt::format(
          "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\"><title>missing: {}{}</title></circle>\n", at.x(),
          at.y(), ShownRange(verdict_.missing[of_first].name, verdict_.missing[of_last].name),
          of_last > of_first ? fmt::format(", {} images", of_last - of_first + 1) : "");
    }
    return marks;
  }

  // From an image away from its neighbour in the order, a unit vector.
  Eigen::Vector2d Outwards(int image, int to_neighbour) const {
    const int neighbour = image + to_neighbour;
    if (neighbour < 0 || neighbour >= static_cast<int>(pixels_.size())) return {0, 1};
    const Eigen::Vector2d away = pixels_[image] - pixels_[neighbour];
    return away.norm() > 0 ? Eigen::Vector2d(away.normalized()) : Eigen::Vector2d(0, 1);
  }

  // Discs, and the links between them.  Images that stand in one cell of a grid are one disc.
  void DrawCollection() {
    std::array<std::string, kStrengths.size()> paths;
    for (const ImageLink& link : verdict_.links) {
      const Eigen::Vector2d &a = pixels_[link.image1], &b = pixels_[link.image2];
      paths[StrengthOf(link.num_points)] +=
          fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", a.x(), a.y(), b.x(), b.y());
    }
    for (size_t strength = kStrengths.size(); strength-- > 0;) {
      if (paths[strength].empty()) continue;
      svg_.Write("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{:g}\"/>\n", paths[strength],
                 kStrengths[strength].colour, 0.6 * kStrengths[strength].width_px);
    }
    const double cell_px = 2.0 * kMaxNumPieces / max_num_pieces_;
    std::map<std::pair<int, int>, std::vector<int>> cells;
    for (int i = 0; i < static_cast<int>(pixels_.size()); ++i) {
      cells[{static_cast<int>(pixels_[i].y() / cell_px), static_cast<int>(pixels_[i].x() / cell_px)}]
          .push_back(i);
    }
    svg_.Write("<g fill=\"{}\" stroke=\"{}\" stroke-width=\"1\">\n", kInk, kPaper);
    for (const auto& [cell, images] : cells) {
      const JoinedImage& first = verdict_.images[images[0]];
      svg_.Write("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\"><title>{}: {} points{}</title></circle>\n",
                 pixels_[images[0]].x(), pixels_[images[0]].y(), ShownName(first.name), first.num_points,
                 images.size() > 1 ? fmt::format("; and {} more images", images.size() - 1) : "");
    }
    svg_.Append("</g>\n");
  }

  // Where each walk starts (a disc) and ends (a square).
  void DrawEnds() {
    int first = 0;
    for (const Walk& walk : verdict_.walks) {
      const int end = first + walk.num_joined;
      if (walk.num_joined > 0) {
        const std::string of = verdict_.walks.size() > 1 ? " of " + ShownName(walk.folder) : "";
        const Eigen::Vector2d &start = pixels_[first], &stop = pixels_[end - 1];
        svg_.Write(
            "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"6\" fill=\"{}\" stroke=\"{}\"><title>start{}: "
            "{}</title></circle>\n",
            start.x(), start.y(), kInk, kPaper, of, ShownName(verdict_.images[first].name));
        svg_.Write(
            "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"11\" height=\"11\" fill=\"{}\" "
            "stroke=\"{}\"><title>end{}: {}</title></rect>\n",
            stop.x() - 5.5, stop.y() - 5.5, kInk, kPaper, of, ShownName(verdict_.images[end - 1].name));
        const bool is_near = (start - stop).norm() < 40;
        if (verdict_.walks.size() == 1) {
          Label(start, "start", is_near ? -10 : 5);
          Label(stop, "end", is_near ? 20 : 5);
        } else if (verdict_.walks.size() <= kMaxNumLabelledWalks) {
          Label(start, ShownName(walk.folder), -10);
        }
      }
      first = end;
    }
  }

  // Beside a place, on the side where there is room.
  void Label(const Eigen::Vector2d& pixel, const std::string& escaped, double below_px) {
    const bool is_left = pixel.x() > 0.75 * kWidthPx;
    svg_.Write(
        "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" stroke=\"{}\" stroke-width=\"4\" "
        "paint-order=\"stroke\">{}</text>\n",
        pixel.x() + (is_left ? -11 : 11), pixel.y() + below_px, is_left ? "end" : "start", kPaper, escaped);
  }

  // A line between the two images of each loop, or a ring around both, the longest loops first.
  void DrawLoops() {
    std::vector<LoopPair> loops = verdict_.loops;
    std::stable_sort(loops.begin(), loops.end(),
                     [](const LoopPair& a, const LoopPair& b) { return a.way > b.way; });
    if (loops.size() > kMaxNumMarks) loops.resize(kMaxNumMarks);
    if (loops.empty()) return;
    svg_.Write("<g fill=\"none\" stroke=\"{}\" stroke-width=\"2.5\" pointer-events=\"all\">\n", kSvgGreen);
    for (const LoopPair& loop : loops) {
      const Eigen::Vector2d &a = pixels_[loop.image1], &b = pixels_[loop.image2];
      svg_.Write(
          "<path d=\"{}\"><title>loop of {}: {}, {} points in common</title></path>\n",
          (a - b).norm() < 2 * kRingPx ? Ring(0.5 * (a + b)) : Ends(a, b), LengthText(verdict_, loop.way),
          ShownRange(verdict_.images[loop.image1].name, verdict_.images[loop.image2].name), loop.num_points);
    }
    svg_.Append("</g>\n");
  }

  // A circle, as a path.
  static std::string Ring(const Eigen::Vector2d& centre, double radius_px = kRingPx) {
    return fmt::format("M{0:.1f} {1:.1f}a{2:g} {2:g} 0 1 1 {3:g} 0a{2:g} {2:g} 0 1 1 {4:g} 0",
                       centre.x() - radius_px, centre.y(), radius_px, 2 * radius_px, -2 * radius_px);
  }
  static std::string Ends(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return Ring(a, kEndPx) + Ring(b, kEndPx) +
           fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", a.x(), a.y(), b.x(), b.y());
  }

  static std::string Triangle(const Eigen::Vector2d& tip) {
    return fmt::format("M{:.1f} {:.1f}l7 -12h-14z", tip.x(), tip.y());
  }

  void DrawWeakPlaces() {
    std::string marks;
    const auto add = [&](const Eigen::Vector2d& at, const std::string& escaped) {
      marks += fmt::format("<path d=\"{}\"><title>{}</title></path>\n", Triangle(at - Eigen::Vector2d(0, 4)),
                           escaped);
    };
    const auto middle = [&](const ImageLink& link) -> Eigen::Vector2d {
      return 0.5 * (pixels_[link.image1] + pixels_[link.image2]);
    };
    const auto names = [&](const ImageLink& link) {
      return ShownRange(verdict_.images[link.image1].name, verdict_.images[link.image2].name);
    };
    const auto first_of = [](const std::vector<int>& indices) {
      return std::vector<int>(indices.begin(), indices.begin() + static_cast<std::ptrdiff_t>(
                                                                     std::min(indices.size(), kMaxNumMarks)));
    };
    for (const int l : first_of(verdict_.weak_links)) {
      add(middle(verdict_.links[l]), fmt::format("weak: {}, joined by {} points", names(verdict_.links[l]),
                                                 verdict_.links[l].num_points));
    }
    for (const int l : first_of(verdict_.long_steps)) {
      add(middle(verdict_.links[l]), fmt::format("long step: {}, {}", names(verdict_.links[l]),
                                                 LengthText(verdict_, verdict_.links[l].length)));
    }
    for (const int i : first_of(verdict_.weak_images)) {
      add(pixels_[i], fmt::format("weak: {}, held by {} points", ShownName(verdict_.images[i].name),
                                  verdict_.images[i].num_points));
    }
    if (marks.empty()) return;
    svg_.Write("<g fill=\"{}\" stroke=\"{}\" stroke-width=\"1.5\">\n{}</g>\n", kSvgVermilion, kPaper, marks);
  }

  void DrawLegend() {
    double y = LegendTop() + 12;
    if (view_.high != view_.low) {
      svg_.Append(ScaleBar(24, y - 8, view_.px_per_m, 0.18 * kWidthPx,
                           verdict_.is_metric ? "m" : "units: the scale is not known"));
    }
    y += kLegendLinePx;
    svg_.Write("<text x=\"24\" y=\"{:.1f}\">points that join {}:</text>\n", y + 5,
               verdict_.is_drive ? "an image to the next" : "two images");
    double x = 322;
    for (const Strength& strength : kStrengths) {
      svg_.Write(
          "<path d=\"M{:.1f} {:.1f}h34\" stroke=\"{}\" stroke-width=\"{:g}\" stroke-linecap=\"round\"/>\n"
          "<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n",
          x, y, strength.colour, strength.width_px, x + 44, y + 5, strength.text);
      x += kStrengthPx;
    }
    y += kLegendLinePx;
    DrawSigns(y);
    DrawParts(y + kLegendLinePx);
  }

  void DrawSigns(double y) {
    double x = 24;
    const auto text = [&](const char* words, double width_px) {
      svg_.Write("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", x + 18, y + 5, words);
      x += width_px;
    };
    if (verdict_.is_drive) {
      svg_.Write("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2.5\"/>\n",
                 Ends({x + 3, y}, {x + 34, y}), kSvgGreen);
      x += 26;
      text("loop: it sees again what it has seen", 322);
      svg_.Write(
          "<path d=\"M{0:.1f} {1:.1f}h34\" stroke=\"{2}\" stroke-width=\"5.5\" stroke-linecap=\"round\"/>\n"
          "<path d=\"M{0:.1f} {1:.1f}h34\" stroke=\"{3}\" stroke-width=\"2\" stroke-dasharray=\"3 6\"/>\n",
          x, y, kSvgBlue, kPaper);
      x += 26;
      text("in no loop", 124);
      svg_.Write(
          "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\" stroke=\"{}\" stroke-width=\"1.5\"/>\n",
          x + 6, y, kPaper, kGrey);
      text("missing images", 168);
    } else {
      svg_.Write("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"/>\n", x + 6, y, kInk);
      text("image", 90);
    }
    svg_.Write("<path d=\"{}\" fill=\"{}\"/>\n", Triangle({x + 6, y + 6}), kSvgVermilion);
    text("weak place", 0);
  }

  void DrawParts(double y) {
    if (verdict_.parts.empty()) return;
    svg_.Write("<text x=\"24\" y=\"{:.1f}\">not joined with the rest:</text>\n", y + 5);
    for (size_t p = 0; p + 1 < NumPartLines(); ++p) {
      const SeparatePart& part = verdict_.parts[p];
      y += kLegendLinePx;
      const size_t num_more = verdict_.parts.size() - p - 1;
      svg_.Write("<text x=\"42\" y=\"{:.1f}\">{} images: {}{}</text>\n", y + 5, part.num_images,
                 ShownRange(part.first, part.last),
                 p + 2 == NumPartLines() && num_more > 0 ? fmt::format("; and {} more parts", num_more) : "");
    }
  }

  const Verdict& verdict_;
  const std::string& title_;
  int max_num_pieces_;
  FloorFrame view_;
  std::vector<Eigen::Vector2d> pixels_;  // of the images
  SvgWriter svg_;
};

}  // namespace

std::string DrawVerdict(const Verdict& verdict, const std::string& title) {
  for (int max_num_pieces = kMaxNumPieces;; max_num_pieces /= 2) {
    std::string svg = Drawing(verdict, title, max_num_pieces).Draw();
    if (svg.size() <= kMaxBytes || max_num_pieces < kMinNumPieces) return svg;
  }
}

}  // namespace cairn::reconstruct
