#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"

namespace cairn {

// What leads from the rows of one map to those of another.  Packed blocks (core/packing) are range codes:
// one landmark more, and all bytes after it are others.  Their rows are not: of a landmark, an image or a
// node that both maps have nothing is sent.
//
//   renumbering     of landmarks, images, stations, nodes: runs of those that the first map has
//   varint          number of regions
//   u8, 129 x u8    1: a code of descriptors of its own, its step and mean; 0: the first map's
//   packed          the new landmarks in this code (PackMoreLandmarks, after the first map's where that is
//   their
//                   code, too); varint of their bytes before it
//   3 x packed      how lists differ from the first map's under the new numbers: landmarks that images see,
//                   landmarks of regions, stations of regions, PackSights of 64 lists at a time, each with a
//                   varint of its bytes before it
//   varint, frame   row text (row_text.h): its bytes, and what it has beyond that of the first map's
//
// Nothing where there is no such delta: a map whose landmarks are not packed.  Errors: Failed (libzstd).
Result<std::optional<std::string>> MakeRowDelta(const MapRows& from, const MapRows& to,
                                                const std::string& what);

// The rows that the delta leads to: stations, station edges, regions, images, landmarks and appearance nodes;
// nothing else of a map.  Takes at most `max_num_bytes` of lists and texts.  Errors: Corrupt, with `what`
// before it.
Result<MapRows> ApplyRowDelta(const MapRows& from, std::string_view delta, int64_t max_num_bytes,
                              const std::string& what);

// The blocks of these rows as a map's file has them, one after the other.
std::string EncodedBlocks(const MapRows& rows);

}  // namespace cairn
