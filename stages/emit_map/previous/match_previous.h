#pragma once

#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "core/world/feature_class.h"

namespace cairn::emit_map {

// Of an image, a landmark or a node: the earlier map has none such.
inline constexpr int32_t kNotBefore = -1;

// What a survey has of an earlier map of the same place, in the same frame.
struct PreviousMatches {
  std::vector<int32_t> row_of_image;       // per Classes::images: its index in the map's images
  std::vector<int32_t> landmark_of_class;  // per Classes::classes; no landmark is of two classes
  // Per class that has a landmark: whether what the map stores of it still holds, so that it may stay as it
  // is: it lies where the class lies, as far as both are known, and looks as the class does.
  std::vector<char> holds;

  size_t NumMatched() const;
};

// Images are the same by name; where the map is of one survey, and so without sessions, by the name in the
// first.  A landmark is the class that most images of both see at its place, with a descriptor like its.
// O(images * landmarks * observations of an image).  Errors: InvalidArgument (no image or no landmark is of
// this survey; the frames differ), naming `path`, the map's.
Result<PreviousMatches> MatchPrevious(const Classes& classes, const MapRows& previous,
                                      const std::string& path);

struct PreviousMap {
  MapRows rows;
  PreviousMatches matches;
};

}  // namespace cairn::emit_map
