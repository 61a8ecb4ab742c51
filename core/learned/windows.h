#pragma once

#include <vector>

namespace cairn {

// A net that takes one size of image alone sees a larger one in windows of that size, along each axis.
struct Window {
  int begin_px = 0;
  // What is taken of the window: up to the middle of what it shares with its neighbours.
  int inner_begin_px = 0;
  int inner_end_px = 0;
  friend bool operator==(const Window&, const Window&) = default;
};

// Sizes that the net halves five times: what its coarsest layer's cell covers, and where windows begin.
inline constexpr int kWindowStepPx = 32;
// Least that neighbours share, if the window is at least twice as long: what is taken is half of it away from
// the window's border.
inline constexpr int kWindowOverlapPx = 128;

// Windows whose inner parts are, in order, [0, length_px).  REQUIRES: both multiples of kWindowStepPx,
// 0 < window_px <= length_px
std::vector<Window> CutWindows(int length_px, int window_px);

}  // namespace cairn
