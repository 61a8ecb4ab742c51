#pragma once

#include <string>
#include <string_view>

#include "core/blocks/map_rows.h"

namespace cairn {

// Stations, what lies beside what, images, and nodes of the appearance graph, one element after the other, so
// that two maps with the same elements have the same bytes there.  Without the lists of landmarks that images
// see, and without regions.
//
//   per station   zigzag x, y (0.1 mm); u8 flags (1: covered, 2: has a heading); zigzag heading (0.001
//   degrees);
//                 varint number of neighbours of larger index, per neighbour a varint of the step
//   per image     varint image_id less the one before; varint bytes shared with the name before, varint bytes
//                 that follow, these; varint camera_id; varint station + 1; rotation; 3 x u32 translation
//                 (0.1 mm)
//   per node      u8 flags (1: kept, 2: has an entropy); varint entropy (1/1000); varint number of images,
//   per
//                 image a zigzag of the step from the node's index; varint number of links, per link a varint
//                 of the step and one of the inliers; the same of look-alikes and scores (1/1000)
std::string WriteRowText(const MapRows& rows);

// Fills in the stations, images and nodes of `rows`, which has as many of them, and its station edges.  False
// where the bytes make no sense: what they name exists, and ascends where a map has it so.
bool ReadRowText(std::string_view bytes, MapRows* rows);

}  // namespace cairn
