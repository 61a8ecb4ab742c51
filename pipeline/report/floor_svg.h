#pragma once

#include <string>

#include "core/blocks/map_rows.h"

namespace cairn::pipeline {

// A picture of the floor as SVG: landmarks as dots, stations as arrows (or discs where they see all around)
// in the colour of the first region that has them, an outline around each region's stations, stations in no
// region hollow and those that no region covers crossed; a scale bar and a legend.  The colours are those of
// Okabe and Ito, which colour-blind people can tell apart; they repeat after 7 regions, with other dashes of
// the outline.  Same rows, same bytes.
std::string FloorSvg(const MapRows& rows);

}  // namespace cairn::pipeline
