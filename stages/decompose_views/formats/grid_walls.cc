#include "stages/decompose_views/formats/grid_walls.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "stages/decompose_views/formats/thin_lines.h"

namespace cairn::decompose_views {
namespace {

// Empty cells around the grid, so that each cell of it has neighbours.
constexpr int kBorder = 2;

cv::Mat Square(int side) { return cv::Mat::ones(side, side, CV_8U); }
cv::Mat Is(const cv::Mat& cells, CellState state) { return cells == static_cast<int>(state); }

// Takes connected parts of a mask that extend over no more than `max_side` cells out of it.
cv::Mat WithoutSmallParts(const cv::Mat& mask, int max_side, int connectivity) {
  if (max_side < 1) return mask.clone();
  cv::Mat labels, boxes, centres;
  const int num = cv::connectedComponentsWithStats(mask, labels, boxes, centres, connectivity, CV_32S);
  std::vector<uint8_t> kept(static_cast<size_t>(num), 0);
  for (int part = 1; part < num; ++part) {
    const int side =
        std::max(boxes.at<int>(part, cv::CC_STAT_WIDTH), boxes.at<int>(part, cv::CC_STAT_HEIGHT));
    kept[part] = side > max_side ? 255 : 0;
  }
  cv::Mat left(mask.size(), CV_8U);
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) left.at<uint8_t>(y, x) = kept[labels.at<int>(y, x)];
  }
  return left;
}

// What walls are made from: CV_8UC1 of the grid's size and a border, 0 or 255.
struct Masks {
  cv::Mat occupied;  // walls, filled
  cv::Mat solid;     // of them, those thicker than thin ones are
  cv::Mat lines;     // of them, thin walls, and the outermost cells of solid ones
};

Masks MakeMasks(const OccupancyGrid& grid, const GridWallsOptions& options) {
  cv::Mat cells;
  cv::copyMakeBorder(grid.cells, cells, kBorder, kBorder, kBorder, kBorder, cv::BORDER_CONSTANT,
                     static_cast<int>(CellState::kUnknown));
  const auto in_cells = [&](double metres) {
    return static_cast<int>(std::floor(std::min(1e6, metres / grid.resolution_m + 1e-6)));
  };
  const int max_speckle = in_cells(options.min_blob_m);
  Masks masks;
  masks.occupied = WithoutSmallParts(Is(cells, CellState::kOccupied), max_speckle, 8);
  masks.occupied = ~WithoutSmallParts(~masks.occupied, max_speckle, 4);
  const cv::Mat free = Is(cells, CellState::kFree) & ~masks.occupied;

  const int thin = std::clamp(in_cells(options.thin_wall_m), 1, 1000);
  cv::morphologyEx(masks.occupied, masks.solid, cv::MORPH_OPEN, Square(thin + 1), {-1, -1}, 1,
                   cv::BORDER_CONSTANT, 0);
  cv::Mat inside, beside_free, near_free;
  cv::erode(masks.occupied, inside, Square(3), {-1, -1}, 1, cv::BORDER_CONSTANT, 0);
  cv::dilate(free, beside_free, Square(3));
  cv::dilate(free, near_free, Square(2 * thin + 1));
  // Beams end at cells that have a free one beside them, or of a thin wall behind which there is one.
  masks.lines = masks.occupied & ((masks.solid & ~inside & beside_free) | (~masks.solid & near_free));
  return masks;
}

using Vec2 = Eigen::Vector2d;

// A straight line through points.
struct FittedLine {
  Vec2 middle = Vec2::Zero(), along = Vec2::UnitX();

  Vec2 Foot(const Vec2& point) const { return middle + along.dot(point - middle) * along; }
};

// A line of cells as straight parts: vertex i, part i, vertex i + 1 ...; closed: the last part leads to
// vertex 0.
struct WallLine {
  std::vector<size_t> bends;  // cells of the line, as many as vertices, closed lines one more
  std::vector<Vec2> vertices;
  std::vector<FittedLine> parts;
  bool is_closed = false;
  int start_junction = -1, end_junction = -1;
};

class Tracer {
 public:
  Tracer(const OccupancyGrid& grid, const GridWallsOptions& options)
      : options_(options), masks_(MakeMasks(grid, options)) {}

  // In cells from the grid's corner.
  std::vector<std::pair<Vec2, Vec2>> Run() {
    cv::Mat distance;
    cv::distanceTransform(masks_.lines, distance, cv::DIST_C, 3);
    const cv::Mat thinned = Thinned(masks_.lines);
    lines_ = LinesOf(thinned, distance);
    if (lines_.empty()) return {};
    AssignCells(thinned);
    for (size_t i = 0; i < lines_.size(); ++i) walls_.push_back(Straightened(i));
    JoinAtJunctions();
    std::vector<std::pair<Vec2, Vec2>> segments;
    for (const WallLine& wall : walls_) {
      for (size_t i = 0; i < wall.parts.size(); ++i)
        segments.push_back({wall.vertices[i], wall.vertices[(i + 1) % wall.vertices.size()]});
    }
    return segments;
  }

 private:
  static Vec2 Middle(const cv::Point& cell) { return Vec2(cell.x - kBorder + 0.5, cell.y - kBorder + 0.5); }

  // Where a cell's wall is: of the outermost cells of a solid wall, the border to what is no wall.
  Vec2 WallPoint(const cv::Point& cell) const {
    if (masks_.solid.at<uint8_t>(cell) == 0) return Middle(cell);
    Vec2 outward = Vec2::Zero();
    int num = 0;
    for (const auto& [dx, dy] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
      if (masks_.occupied.at<uint8_t>(cell.y + dy, cell.x + dx) != 0) continue;
      outward += Vec2(dx, dy);
      ++num;
    }
    return num == 0 ? Middle(cell) : Vec2(Middle(cell) + 0.5 * outward / num);
  }

  // The points of the mask by the cell of a line that they are nearest to.
  void AssignCells(const cv::Mat& thinned) {
    cv::Mat distance, labels;
    cv::distanceTransform(thinned == 0, distance, labels, cv::DIST_L2, 5, cv::DIST_LABEL_PIXEL);
    std::vector<std::pair<int, int>> of_label;  // line and cell
    points_.resize(lines_.size());
    for (size_t line = 0; line < lines_.size(); ++line) {
      points_[line].resize(lines_[line].cells.size());
      for (size_t i = 0; i < lines_[line].cells.size(); ++i) {
        const auto label = static_cast<size_t>(labels.at<int>(lines_[line].cells[i]));
        if (of_label.size() <= label) of_label.resize(label + 1, {-1, -1});
        if (of_label[label].first < 0) of_label[label] = {static_cast<int>(line), static_cast<int>(i)};
      }
    }
    for (int y = 0; y < masks_.lines.rows; ++y) {
      for (int x = 0; x < masks_.lines.cols; ++x) {
        if (masks_.lines.at<uint8_t>(y, x) == 0) continue;
        const auto label = static_cast<size_t>(labels.at<int>(y, x));
        if (label >= of_label.size() || of_label[label].first < 0) continue;
        points_[of_label[label].first][of_label[label].second].push_back(WallPoint({x, y}));
      }
    }
  }

  // The cells of a line at which it bends, its first and last among them, by Douglas and Peucker.
  std::vector<size_t> Bends(const CellLine& line) const {
    const std::vector<cv::Point>& cells = line.cells;
    std::vector<size_t> bends;
    const size_t last = line.is_closed ? cells.size() : cells.size() - 1;
    std::vector<std::pair<size_t, size_t>> open = {{0, last}};
    if (line.is_closed && cells.size() >= 3) {
      const size_t far = FarthestFrom(cells, 0);
      open = {{far, last}, {0, far}};
    }
    while (!open.empty()) {
      const auto [first, end] = open.back();
      open.pop_back();
      const Vec2 start = Middle(cells[first]), along = Middle(cells[end % cells.size()]) - start;
      double farthest = options_.trace_tolerance_cells;
      size_t bend = first;
      for (size_t i = first + 1; i < end; ++i) {
        const Vec2 offset = Middle(cells[i]) - start;
        const double share =
            along.isZero(0) ? 0 : std::clamp(offset.dot(along) / along.squaredNorm(), 0.0, 1.0);
        const double beside = (offset - share * along).norm();
        if (beside <= farthest) continue;
        farthest = beside;
        bend = i;
      }
      if (bend == first) {
        bends.push_back(first);
      } else {
        open.push_back({bend, end});
        open.push_back({first, bend});
      }
    }
    bends.push_back(last);
    return bends;
  }

  static size_t FarthestFrom(const std::vector<cv::Point>& cells, size_t from) {
    const auto distance = [&](const cv::Point& cell) {
      return (Middle(cell) - Middle(cells[from])).squaredNorm();
    };
    return static_cast<size_t>(
        std::max_element(cells.begin(), cells.end(),
                         [&](const cv::Point& a, const cv::Point& b) { return distance(a) < distance(b); }) -
        cells.begin());
  }

  // Through the points of a line's cells [first, last], by least squares; cells next to bends belong to both
  // of the parts that meet there, and count where there are few others only.
  FittedLine Fitted(size_t line, size_t first, size_t last) const {
    constexpr size_t kMinLength = 8, kNearBend = 2;  // cells
    const std::vector<cv::Point>& cells = lines_[line].cells;
    const size_t cut = last - first >= kMinLength ? kNearBend : 0;
    Vec2 sum = Vec2::Zero();
    Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
    double num = 0;
    for (size_t i = first + cut; i <= last - cut; ++i) {
      for (const Vec2& point : points_[line][i % cells.size()]) {
        sum += point;
        squares += point * point.transpose();
        ++num;
      }
    }
    const Vec2 start = Middle(cells[first]), end = Middle(cells[last % cells.size()]);
    const Vec2 chord = (end - start).normalized();
    if (num < 3 || last - first < 3) return {num > 0 ? Vec2(sum / num) : Vec2(0.5 * (start + end)), chord};
    const Vec2 middle = sum / num;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(squares / num - middle * middle.transpose());
    Vec2 along = axes.eigenvectors().col(1);
    if (along.dot(chord) < 0) along = -along;
    constexpr double kMinAgreement = 0.9;  // a blob has no direction of its own
    return {middle, along.dot(chord) < kMinAgreement ? chord : along};
  }

  // Where two parts meet near a cell: where their lines cross, or half-way between them.
  static Vec2 Meeting(const FittedLine& a, const FittedLine& b, const Vec2& near) {
    constexpr double kMinSine = 0.2, kFar = 3;  // 11.5 degrees; cells
    const double sine = a.along.x() * b.along.y() - a.along.y() * b.along.x();
    const Vec2 between = 0.5 * (a.Foot(near) + b.Foot(near));
    if (std::abs(sine) < kMinSine) return between;
    const Vec2 offset = b.middle - a.middle;
    const Vec2 crossing = a.middle + (offset.x() * b.along.y() - offset.y() * b.along.x()) / sine * a.along;
    return (crossing - near).norm() <= kFar ? crossing : between;
  }

  // The end of an open line: as far as its last cell's points reach.
  Vec2 End(size_t line, bool at_end, const FittedLine& part) const {
    const std::vector<cv::Point>& cells = lines_[line].cells;
    const size_t last = at_end ? cells.size() - 1 : 0;
    const double sign = at_end ? 1 : -1;
    double reach = sign * part.along.dot(Middle(cells[last]) - part.middle);
    for (const Vec2& point : points_[line][last])
      reach = std::max(reach, sign * part.along.dot(point - part.middle));
    return part.middle + sign * reach * part.along;
  }

  WallLine Straightened(size_t index) const {
    const CellLine& line = lines_[index];
    WallLine wall;
    wall.start_junction = line.start_junction;
    wall.end_junction = line.end_junction;
    if (line.cells.size() < 2) return wall;
    wall.bends = Bends(line);
    const std::vector<size_t>& bends = wall.bends;
    for (size_t i = 0; i + 1 < bends.size(); ++i) wall.parts.push_back(Fitted(index, bends[i], bends[i + 1]));
    wall.is_closed = line.is_closed && wall.parts.size() >= 3;
    const size_t num = wall.parts.size();
    const auto at = [&](size_t i) { return Middle(line.cells[bends[i] % line.cells.size()]); };
    if (wall.is_closed) {
      for (size_t i = 0; i < num; ++i)
        wall.vertices.push_back(Meeting(wall.parts[(i + num - 1) % num], wall.parts[i], at(i)));
      return wall;
    }
    wall.vertices.push_back(End(index, false, wall.parts.front()));
    for (size_t i = 1; i < num; ++i)
      wall.vertices.push_back(Meeting(wall.parts[i - 1], wall.parts[i], at(i)));
    wall.vertices.push_back(End(index, true, wall.parts.back()));
    return wall;
  }

  struct LineEnd {
    size_t wall = 0;
    bool at_end = false;
  };
  Vec2& VertexOf(const LineEnd& end) {
    std::vector<Vec2>& vertices = walls_[end.wall].vertices;
    return end.at_end ? vertices.back() : vertices.front();
  }

  // Ends that were left over at a junction go onto the walls that pass it; where none does, together.
  void JoinAtJunctions() {
    std::map<int, std::vector<LineEnd>> ends;
    std::map<int, std::vector<std::pair<size_t, size_t>>> passing;  // walls, and the part there
    for (size_t i = 0; i < walls_.size(); ++i) {
      const WallLine& wall = walls_[i];
      if (wall.parts.empty()) continue;
      if (wall.start_junction >= 0) ends[wall.start_junction].push_back({i, false});
      if (wall.end_junction >= 0) ends[wall.end_junction].push_back({i, true});
      for (const auto& [junction, cell] : lines_[i].passed_junctions) {
        const auto after = std::upper_bound(wall.bends.begin(), wall.bends.end() - 1, cell);
        passing[junction].push_back({i, static_cast<size_t>(after - wall.bends.begin()) - 1});
      }
    }
    for (const auto& [junction, ends_here] : ends) {
      Vec2 middle = Vec2::Zero();
      for (const LineEnd& end : ends_here) middle += VertexOf(end) / static_cast<double>(ends_here.size());
      for (const LineEnd& end : ends_here)
        VertexOf(end) = passing.contains(junction) ? OntoWalls(end, passing[junction]) : middle;
    }
  }

  // Where an end's line meets one of the parts that pass its junction, or those beside them.
  Vec2 OntoWalls(const LineEnd& end, const std::vector<std::pair<size_t, size_t>>& passing) {
    const WallLine& own = walls_[end.wall];
    const FittedLine& line = end.at_end ? own.parts.back() : own.parts.front();
    const Vec2 from = VertexOf(end);
    std::optional<Vec2> best;
    for (const auto& [wall_index, part] : passing) {
      const WallLine& wall = walls_[wall_index];
      for (size_t i = part == 0 ? 0 : part - 1; i < std::min(part + 2, wall.parts.size()); ++i) {
        const Vec2 start = wall.vertices[i], along = wall.vertices[(i + 1) % wall.vertices.size()] - start;
        if (along.isZero(0)) continue;
        const auto within = [&](const Vec2& place) {
          return Vec2(start + std::clamp((place - start).dot(along) / along.squaredNorm(), 0.0, 1.0) * along);
        };
        // A point of the part in any case: beyond its ends, the end.
        const Vec2 onto = within(Meeting({start, along.normalized()}, line, within(from)));
        if (!best || (onto - from).squaredNorm() < (*best - from).squaredNorm()) best = onto;
      }
    }
    return best.value_or(from);
  }

  const GridWallsOptions& options_;
  Masks masks_;
  std::vector<CellLine> lines_;
  std::vector<std::vector<std::vector<Vec2>>> points_;  // by line and cell
  std::vector<WallLine> walls_;
};

}  // namespace

Result<std::vector<InputSegment>> TraceGridWalls(const OccupancyGrid& grid, const GridWallsOptions& options) {
  std::vector<InputSegment> walls;
  for (const auto& [start, end] : Tracer(grid, options).Run()) {
    if (start != end)
      walls.push_back({grid.Metres(start), grid.Metres(end), static_cast<int>(walls.size()) + 1});
  }
  if (!walls.empty()) return walls;
  const auto num = [&](CellState state) { return cv::countNonZero(Is(grid.cells, state)); };
  return MakeError(
      ErrorCode::kNoData,
      "no walls: {} cells are occupied, {} free, {} unknown, and no group of occupied cells of more "
      "than {:g} m has a free cell beside it",
      num(CellState::kOccupied), num(CellState::kFree), num(CellState::kUnknown), options.min_blob_m);
}

}  // namespace cairn::decompose_views
