#include "stages/decompose_views/formats/thin_lines.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <deque>
#include <utility>

#include <Eigen/Core>

namespace cairn::decompose_views {
namespace {

// The eight neighbours, counter-clockwise from the right.
constexpr std::array<std::pair<int, int>, 8> kAround = {
    {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};

// Whether the cell with these neighbours (a bit each) can go: it is no end, and what it joins stays joined.
bool CanGo(unsigned around) {
  int num_neighbours = 0, num_parts = 0;
  for (unsigned i = 0; i < 8; ++i) {
    const auto is_set = [&](unsigned k) { return (around >> (k % 8) & 1) != 0; };
    num_neighbours += is_set(i) ? 1 : 0;
    // Hilditch: borders of the cell that a line enters by.
    if (i % 2 == 0 && !is_set(i) && (is_set(i + 1) || is_set(i + 2))) ++num_parts;
  }
  return num_neighbours >= 2 && num_parts == 1;
}

std::array<bool, 256> MakeCanGo() {
  std::array<bool, 256> table{};
  for (unsigned around = 0; around < 256; ++around) table[around] = CanGo(around);
  return table;
}

unsigned Around(const cv::Mat& mask, const cv::Point& cell) {
  unsigned around = 0;
  for (unsigned i = 0; i < 8; ++i) {
    if (mask.at<uint8_t>(cell.y + kAround[i].second, cell.x + kAround[i].first) != 0) around |= 1U << i;
  }
  return around;
}

// A chain between two junctions or free ends; ends are numbered 2 * chain (its start) and 2 * chain + 1.
struct Strand {
  std::vector<cv::Point> cells;
  std::array<int, 2> junction = {-1, -1};
  bool is_closed = false;
};

// Chains of a thinned mask, and how they go on at junctions.
class LineGraph {
 public:
  LineGraph(const cv::Mat& thinned, const cv::Mat& distance) : thinned_(thinned), distance_(distance) {
    junctions_ = cv::Mat(thinned.size(), CV_32S, cv::Scalar(-1));
    passed_ = cv::Mat::zeros(thinned.size(), CV_8U);
  }

  std::vector<CellLine> Lines() {
    FindJunctions();
    FollowChains();
    DropSpurs();
    PairEnds();
    return Joined();
  }

 private:
  int NumNeighbours(const cv::Point& cell) const {
    return static_cast<int>(std::popcount(Around(thinned_, cell)));
  }
  std::vector<cv::Point> Neighbours(const cv::Point& cell) const {
    std::vector<cv::Point> found;
    const unsigned around = Around(thinned_, cell);
    for (unsigned i = 0; i < 8; ++i) {
      if ((around >> i & 1) != 0) found.emplace_back(cell.x + kAround[i].first, cell.y + kAround[i].second);
    }
    return found;
  }

  // Cells with three and more neighbours; those that touch are one junction.
  void FindJunctions() {
    for (int y = 1; y + 1 < thinned_.rows; ++y) {
      for (int x = 1; x + 1 < thinned_.cols; ++x) {
        if (thinned_.at<uint8_t>(y, x) == 0) continue;
        cells_.emplace_back(x, y);
        if (junctions_.at<int>(y, x) >= 0 || NumNeighbours({x, y}) < 3) continue;
        const int id = static_cast<int>(centres_.size());
        std::deque<cv::Point> open = {{x, y}};
        junctions_.at<int>(y, x) = id;
        Eigen::Vector2d sum = Eigen::Vector2d::Zero();
        double thickness = 0;
        int num = 0;
        while (!open.empty()) {
          const cv::Point cell = open.front();
          open.pop_front();
          sum += Eigen::Vector2d(cell.x, cell.y);
          thickness = std::max<double>(thickness, distance_.at<float>(cell));
          ++num;
          for (const cv::Point& next : Neighbours(cell)) {
            if (junctions_.at<int>(next) >= 0 || NumNeighbours(next) < 3) continue;
            junctions_.at<int>(next) = id;
            open.push_back(next);
          }
        }
        centres_.push_back(sum / num);
        thickness_.push_back(thickness);
      }
    }
  }

  void FollowChains() {
    for (const cv::Point& cell : cells_) {
      const int num = NumNeighbours(cell);
      if (num == 2 || num == 0) continue;
      for (const cv::Point& next : Neighbours(cell)) {
        if (NumNeighbours(next) == 2) {
          if (passed_.at<uint8_t>(next) == 0) chains_.push_back(Follow(cell, next));
          continue;
        }
        // Neighbours of which one at least is a free end.
        const int from = junctions_.at<int>(cell), to = junctions_.at<int>(next);
        const bool is_first = std::pair(cell.y, cell.x) < std::pair(next.y, next.x);
        if (is_first && (from < 0 || to < 0)) chains_.push_back({{cell, next}, {from, to}});
      }
    }
    for (const cv::Point& cell : cells_) {
      if (NumNeighbours(cell) != 2 || passed_.at<uint8_t>(cell) != 0) continue;
      Strand ring = Follow(cell, Neighbours(cell)[0]);
      ring.cells.pop_back();  // the first again
      ring.is_closed = true;
      chains_.push_back(std::move(ring));
    }
  }

  // From a cell through a neighbour to the next that has not two neighbours, or that was passed.
  Strand Follow(const cv::Point& from, const cv::Point& through) {
    Strand chain{{from, through}, {junctions_.at<int>(from), -1}};
    cv::Point before = from, cell = through;
    while (NumNeighbours(cell) == 2 && cell != from) {
      passed_.at<uint8_t>(cell) = 1;
      const std::vector<cv::Point> next = Neighbours(cell);
      const cv::Point onward = next[0] == before ? next[1] : next[0];
      before = cell;
      cell = onward;
      chain.cells.push_back(cell);
    }
    passed_.at<uint8_t>(from) = 1;
    chain.junction[1] = junctions_.at<int>(cell);
    return chain;
  }

  void DropSpurs() {
    std::erase_if(chains_, [&](const Strand& chain) {
      if (chain.is_closed || (chain.junction[0] < 0) == (chain.junction[1] < 0)) return false;
      const int junction = std::max(chain.junction[0], chain.junction[1]);
      return static_cast<double>(chain.cells.size()) - 1 <= thickness_[junction] + 1;
    });
  }

  Eigen::Vector2d DirectionOf(int end) const {
    constexpr size_t kFar = 8;  // cells: the next few only say which of eight ways they go
    const Strand& chain = chains_[end / 2];
    const size_t along = std::min(kFar, chain.cells.size() - 1);
    const cv::Point& cell = chain.cells[end % 2 == 0 ? along : chain.cells.size() - 1 - along];
    return (Eigen::Vector2d(cell.x, cell.y) - centres_[chain.junction[end % 2]]).normalized();
  }

  // At each junction, the two ends that are most nearly straight on, then the next two.
  void PairEnds() {
    constexpr double kMinStraight = 0.906;  // cosine of 25 degrees
    partner_.assign(2 * chains_.size(), -1);
    std::vector<std::vector<int>> at(centres_.size());
    for (size_t end = 0; end < partner_.size(); ++end) {
      const Strand& chain = chains_[end / 2];
      if (!chain.is_closed && chain.junction[end % 2] >= 0)
        at[chain.junction[end % 2]].push_back(static_cast<int>(end));
    }
    for (const std::vector<int>& ends : at) {
      std::vector<std::pair<double, std::pair<int, int>>> pairs;
      for (size_t i = 0; i < ends.size(); ++i) {
        for (size_t j = i + 1; j < ends.size(); ++j)
          pairs.push_back({DirectionOf(ends[i]).dot(DirectionOf(ends[j])), {ends[i], ends[j]}});
      }
      std::sort(pairs.begin(), pairs.end());
      for (const auto& [cosine, pair] : pairs) {
        if (cosine > -kMinStraight && ends.size() > 2) break;
        if (partner_[pair.first] >= 0 || partner_[pair.second] >= 0) continue;
        partner_[pair.first] = pair.second;
        partner_[pair.second] = pair.first;
      }
    }
  }

  std::vector<CellLine> Joined() const {
    std::vector<CellLine> lines;
    std::vector<char> used(chains_.size(), 0);
    // From ends that nothing continues.
    for (size_t end = 0; end < partner_.size(); ++end) {
      if (used[end / 2] == 0 && partner_[end] < 0 && !chains_[end / 2].is_closed)
        lines.push_back(JoinedFrom(static_cast<int>(end), /*is_round=*/false, &used));
    }
    // What is left goes round.
    for (size_t chain = 0; chain < chains_.size(); ++chain) {
      if (used[chain] == 0)
        lines.push_back(JoinedFrom(static_cast<int>(2 * chain), /*is_round=*/true, &used));
    }
    return lines;
  }

  // Of a line that goes round: the cell farthest from the first is more of a corner than any other is.
  static void BeginAtCorner(CellLine* line) {
    std::vector<cv::Point>& cells = line->cells;
    if (cells.size() > 1 && cells.front() == cells.back()) cells.pop_back();
    const auto distance = [&](const cv::Point& cell) { return cv::norm(cell - cells.front()); };
    const auto corner = std::max_element(
        cells.begin(), cells.end(), [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
    const auto offset = static_cast<size_t>(corner - cells.begin());
    std::rotate(cells.begin(), corner, cells.end());
    for (auto& [junction, cell] : line->passed_junctions)
      cell = (cell + cells.size() - offset) % cells.size();
  }

  CellLine JoinedFrom(int end, bool is_round, std::vector<char>* used) const {
    CellLine line;
    line.is_closed = is_round;
    if (!is_round) line.start_junction = chains_[end / 2].junction[end % 2];
    while (end >= 0 && (*used)[end / 2] == 0) {
      (*used)[end / 2] = 1;
      std::vector<cv::Point> cells = chains_[end / 2].cells;
      if (end % 2 == 1) std::reverse(cells.begin(), cells.end());
      for (const cv::Point& cell : cells) {
        if (line.cells.empty() || line.cells.back() != cell) line.cells.push_back(cell);
      }
      const int far = end ^ 1;
      if (!is_round) line.end_junction = chains_[far / 2].junction[far % 2];
      end = partner_[far];
      if (end >= 0)
        line.passed_junctions.push_back({chains_[far / 2].junction[far % 2], line.cells.size() - 1});
    }
    if (is_round) BeginAtCorner(&line);
    return line;
  }

  const cv::Mat& thinned_;
  const cv::Mat& distance_;
  cv::Mat junctions_, passed_;
  std::vector<cv::Point> cells_;
  std::vector<Eigen::Vector2d> centres_;
  std::vector<double> thickness_;
  std::vector<Strand> chains_;
  std::vector<int> partner_;
};

}  // namespace

cv::Mat Thinned(const cv::Mat& mask) {
  static const std::array<bool, 256> can_go = MakeCanGo();
  cv::Mat left = mask.clone();
  std::vector<cv::Point> cells;
  for (int y = 1; y + 1 < mask.rows; ++y) {
    for (int x = 1; x + 1 < mask.cols; ++x) {
      if (mask.at<uint8_t>(y, x) != 0) cells.emplace_back(x, y);
    }
  }
  for (size_t before = cells.size() + 1; before != cells.size();) {
    before = cells.size();
    // Opposite sides one after the other: what is left stays in the middle.
    for (const unsigned side : {0U, 4U, 2U, 6U}) {
      std::vector<cv::Point> edge;
      for (const cv::Point& cell : cells) {
        if ((Around(left, cell) >> side & 1) == 0) edge.push_back(cell);
      }
      for (const cv::Point& cell : edge) {
        if (can_go[Around(left, cell)]) left.at<uint8_t>(cell) = 0;
      }
      std::erase_if(cells, [&](const cv::Point& cell) { return left.at<uint8_t>(cell) == 0; });
    }
  }
  return left;
}

std::vector<CellLine> LinesOf(const cv::Mat& thinned, const cv::Mat& distance) {
  return LineGraph(thinned, distance).Lines();
}

}  // namespace cairn::decompose_views
