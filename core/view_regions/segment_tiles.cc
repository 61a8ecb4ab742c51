#include "core/view_regions/segment_tiles.h"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

using Wide = __int128;

constexpr int64_t kOne = int64_t{1} << kSubBits, kHalf = kOne / 2;
// Tiles of fewer segments, or of no more pixels along a side, are not halved.
constexpr size_t kFewSegments = 32;
constexpr int64_t kFewPixels = 64;
// Largest error of a computed crossing, in 2^-kSubBits units: some roundings of doubles at the far end.
constexpr double kCrossingError = 64;

// > 0: (x, y) lies left of the segment.
int Side(const SubSegment& s, int64_t x, int64_t y) {
  const Wide cross = Wide{s.x1 - s.x0} * (y - s.y0) - Wide{s.y1 - s.y0} * (x - s.x0);
  return cross > 0 ? 1 : cross < 0 ? -1 : 0;
}

// Whether a segment comes within a pixel of a tile; sometimes also true for one slightly farther away.
bool MayPass(const SubSegment& s, const GridPoint& low, const GridPoint& high) {
  const int64_t x0 = (low.x - 1) * kOne, x1 = (high.x + 1) * kOne, y0 = (low.y - 1) * kOne,
                y1 = (high.y + 1) * kOne;
  if (std::max(s.x0, s.x1) < x0 || std::min(s.x0, s.x1) > x1 || std::max(s.y0, s.y1) < y0 ||
      std::min(s.y0, s.y1) > y1) {
    return false;
  }
  const auto dx = static_cast<double>(s.x1 - s.x0), dy = static_cast<double>(s.y1 - s.y0);
  const double to_x = 0.5 * static_cast<double>(x0 + x1) - static_cast<double>(s.x0),
               to_y = 0.5 * static_cast<double>(y0 + y1) - static_cast<double>(s.y0);
  const double half_x = 0.5 * static_cast<double>(x1 - x0), half_y = 0.5 * static_cast<double>(y1 - y0);
  return std::abs(dx * to_y - dy * to_x) <= half_x * std::abs(dy) + half_y * std::abs(dx);
}

class TileMaker {
 public:
  explicit TileMaker(const std::vector<SubSegment>& segments) : segments_(segments) {}

  SegmentTiles Run() {
    if (segments_.empty()) return std::move(result_);
    GridPoint low = PixelOf(segments_[0].x0, segments_[0].y0), high = low;
    std::vector<int32_t> all(segments_.size());
    for (size_t i = 0; i < segments_.size(); ++i) {
      all[i] = static_cast<int32_t>(i);
      const SubSegment& s = segments_[i];
      const GridPoint a = PixelOf(std::min(s.x0, s.x1), std::min(s.y0, s.y1)),
                      b = PixelOf(std::max(s.x0, s.x1), std::max(s.y0, s.y1));
      low = {std::min(low.x, a.x), std::min(low.y, a.y)};
      high = {std::max(high.x, b.x), std::max(high.y, b.y)};
    }
    Halve(low, {high.x + 1, high.y + 1}, std::move(all));
    return std::move(result_);
  }

 private:
  std::vector<int32_t> Within(const std::vector<int32_t>& from, const GridPoint& low,
                              const GridPoint& high) const {
    std::vector<int32_t> within;
    for (const int32_t segment : from) {
      if (MayPass(segments_[segment], low, high)) within.push_back(segment);
    }
    return within;
  }

  void Halve(const GridPoint& low, const GridPoint& high, std::vector<int32_t> segments) {
    const bool wide = high.x - low.x >= high.y - low.y;
    const int64_t side = wide ? high.x - low.x : high.y - low.y;
    if (segments.size() > kFewSegments && side > kFewPixels) {
      GridPoint first_high = high, second_low = low;
      (wide ? first_high.x : first_high.y) = (wide ? second_low.x : second_low.y) =
          (wide ? low.x : low.y) + side / 2;
      std::vector<int32_t> first = Within(segments, low, first_high),
                           second = Within(segments, second_low, high);
      // Nearly all of them in one half and many in the other too: they meet in a vertex.
      const bool gains = 10 * std::max(first.size(), second.size()) < 9 * segments.size() ||
                         4 * (first.size() + second.size()) < 5 * segments.size();
      if (gains) {
        segments = {};
        Halve(low, first_high, std::move(first));
        Halve(second_low, high, std::move(second));
        return;
      }
    }
    if (segments.empty()) return;
    Tile tile{.low = low, .high = high, .first = static_cast<int64_t>(result_.segments.size())};
    result_.segments.insert(result_.segments.end(), segments.begin(), segments.end());
    tile.last = static_cast<int64_t>(result_.segments.size());
    result_.tiles.push_back(tile);
  }

  const std::vector<SubSegment>& segments_;
  SegmentTiles result_;
};

}  // namespace

SubSegment MakeSubSegment(const Eigen::Vector2d& start, const Eigen::Vector2d& end) {
  const auto sub = [](double value) { return std::llround(value * static_cast<double>(kOne)); };
  return {sub(start.x()), sub(start.y()), sub(end.x()), sub(end.y())};
}

SegmentTiles MakeTiles(const std::vector<SubSegment>& segments) { return TileMaker(segments).Run(); }

GridPoint PixelOf(int64_t sub_x, int64_t sub_y) {
  return {(sub_x + kHalf) >> kSubBits, (sub_y + kHalf) >> kSubBits};
}

bool Passes(const SubSegment& segment, const GridPoint& pixel) {
  SubSegment s = segment;
  if (s.x0 > s.x1) {
    std::swap(s.x0, s.x1);
    std::swap(s.y0, s.y1);
  }
  const int64_t low_x = pixel.x * kOne - kHalf, high_x = low_x + kOne, low_y = pixel.y * kOne - kHalf,
                high_y = low_y + kOne;
  if (s.x0 >= high_x || s.x1 < low_x || std::min(s.y0, s.y1) >= high_y || std::max(s.y0, s.y1) < low_y)
    return false;
  if (s.x0 == s.x1 || s.y0 == s.y1) return true;
  // Corners lie on both sides of the line.  Of corners that it only touches the lower left one counts.
  const bool rises = s.y0 < s.y1;
  const int upper_left = Side(s, low_x, high_y), lower_right = Side(s, high_x, low_y);
  if (rises) return upper_left > 0 && lower_right < 0;
  const int lower_left = Side(s, low_x, low_y), upper_right = Side(s, high_x, high_y);
  return lower_left <= 0 && upper_right > 0;
}

bool CrossAt(const SubSegment& a, const SubSegment& b, GridPoint* low, GridPoint* high) {
  if (std::max(a.x0, a.x1) < std::min(b.x0, b.x1) || std::max(b.x0, b.x1) < std::min(a.x0, a.x1) ||
      std::max(a.y0, a.y1) < std::min(b.y0, b.y1) || std::max(b.y0, b.y1) < std::min(a.y0, a.y1)) {
    return false;
  }
  const int64_t ax = a.x1 - a.x0, ay = a.y1 - a.y0, bx = b.x1 - b.x0, by = b.y1 - b.y0;
  // Sides of a's ends from the line of b, and of b's ends from that of a.
  const Wide of_start = Wide{bx} * (a.y0 - b.y0) - Wide{by} * (a.x0 - b.x0);
  const Wide of_end = Wide{bx} * (a.y1 - b.y0) - Wide{by} * (a.x1 - b.x0);
  if (!((of_start > 0 && of_end < 0) || (of_start < 0 && of_end > 0))) return false;
  const Wide of_b0 = Wide{ax} * (b.y0 - a.y0) - Wide{ay} * (b.x0 - a.x0);
  const Wide of_b1 = Wide{ax} * (b.y1 - a.y0) - Wide{ay} * (b.x1 - a.x0);
  if (!((of_b0 > 0 && of_b1 < 0) || (of_b0 < 0 && of_b1 > 0))) return false;
  const double share = static_cast<double>(of_start) / static_cast<double>(of_start - of_end);
  const double x = static_cast<double>(a.x0) + share * static_cast<double>(ax),
               y = static_cast<double>(a.y0) + share * static_cast<double>(ay);
  *low = PixelOf(std::llround(x - kCrossingError), std::llround(y - kCrossingError));
  *high = PixelOf(std::llround(x + kCrossingError), std::llround(y + kCrossingError));
  return true;
}

}  // namespace cairn
