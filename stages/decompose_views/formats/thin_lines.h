#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

namespace cairn::decompose_views {

// Cells in a row, each one of the eight neighbours of the one before.
struct CellLine {
  std::vector<cv::Point> cells;
  bool is_closed = false;  // the last cell is a neighbour of the first
  // The junction at which each end was left over, -1: none, a free end.
  int start_junction = -1, end_junction = -1;
  // Junctions at which it goes on, and the cell there, an index.
  std::vector<std::pair<int, size_t>> passed_junctions;
};

// A mask's cells peeled from all four sides until lines of one cell are left that are connected as the mask
// is (Hilditch's crossing numbers).  Ends of lines stay, but for about half of their thickness.  `mask`:
// CV_8UC1, not 0 inside, 0 on its outermost rows and columns.  Deterministic.  O(cells * thickness).
cv::Mat Thinned(const cv::Mat& mask);

// The lines of a thinned mask.  At a junction those that continue each other within 25 degrees are one line,
// and others end.  Lines from a free end to a junction that are no longer than the mask is thick there,
// `distance` (CV_32F, cells to the nearest that is not of the mask) and one cell, are dropped: they come from
// rough edges.
std::vector<CellLine> LinesOf(const cv::Mat& thinned, const cv::Mat& distance);

}  // namespace cairn::decompose_views
