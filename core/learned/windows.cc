#include "core/learned/windows.h"

#include <algorithm>

namespace cairn {

std::vector<Window> CutWindows(int length_px, int window_px) {
  // Half of an overlap is then a multiple of 16 px: of whole cells.
  const int half_px = window_px / 2 / kWindowStepPx * kWindowStepPx;
  const int step_px = window_px - std::min(kWindowOverlapPx, half_px);
  const int last_px = length_px - window_px;
  std::vector<Window> windows{{0, 0, length_px}};
  for (int end_px = window_px; end_px < length_px; end_px = windows.back().begin_px + window_px) {
    const int begin_px = std::min(windows.back().begin_px + step_px, last_px);
    const int middle_px = (begin_px + end_px) / 2;
    windows.back().inner_end_px = middle_px;
    windows.push_back({begin_px, middle_px, length_px});
  }
  return windows;
}

}  // namespace cairn
