#pragma once

#include <string>

#include "stages/reconstruct/verdict/verdict.h"

namespace cairn::reconstruct {

// A picture of a reconstruction from above, as SVG of at most 300 kB.  Of a drive: its images as a line, in a
// colour and width for what joins each to the next (warm and thin: few points); thin lines and rings where it
// comes back to what it has seen; open discs for missing images, between their neighbours by name; triangles
// where it is weak; its start and end.  Of images in no order: discs, and the links that join them.  Hovering
// names images and counts points; where there are many, several of them in one piece.  A scale bar, and
// below it the parts that are not joined.  `title`: of the capture.  Same verdict, same bytes.
std::string DrawVerdict(const Verdict& verdict, const std::string& title);

}  // namespace cairn::reconstruct
