#pragma once

#include <string>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"

namespace cairn::pipeline {

// A picture of the floor as SVG: where each survey image was taken and which way it looked, coloured by the
// entropy of its place (viridis: dark places are unlike all others, bright ones like many), and a line
// between places that look alike, bolder for a higher score.  Same rows, same bytes.  Errors: NotFound (a map
// without entropies).
Result<std::string> AmbiguitySvg(const MapRows& rows);

}  // namespace cairn::pipeline
