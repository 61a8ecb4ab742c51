#pragma once

#include <optional>

#include "core/sift/octave.h"

namespace cairn {

// Fits a parabola to the 26 neighbours of a pixel of `layer`, counted from the window's corner, moves to the
// pixel where its extremum lies, and rejects those of low contrast and on edges [Lowe04 §4].  As OpenCV's,
// but for one that leads away by more than kSiftMaxDrift pixels, which is rejected.
std::optional<SiftExtremum> RefineExtremum(const Octave& octave, int layer, int x, int y,
                                           const SiftThresholds& thresholds);

}  // namespace cairn
