#pragma once

#include <optional>
#include <string>

#include "core/line/command.h"

namespace cairn::pipeline {

// A question to `cairn inspect` about a part of a map.
struct PlaceQuestion {
  std::string map_path;
  std::optional<std::string> place;  // "X,Y" or "X,Y,HEADING": metres and degrees, floor frame
  std::optional<std::string> image;  // a survey image
  bool advice = false;               // on the whole map
  std::string build_dir;             // "" = the map's name with .build
  bool json = false;

  bool is_asked() const { return place || image || advice; }
};

// Prints why a place is covered by the map or not, what was dropped there and which images to take next.
// Errors: InvalidArgument, NotFound (an image that the map does not have), those of ReadMapRows.
Status AnswerPlaceQuestion(const PlaceQuestion& question, const CommandEnvironment& environment);

}  // namespace cairn::pipeline
