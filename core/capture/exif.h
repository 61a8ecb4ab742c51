#pragma once

#include <optional>
#include <string>

#include "core/geometry/geodesy.h"

namespace cairn {

// The tags of an image file's EXIF block that a capture uses.
struct ExifTags {
  double focal_length_35mm_mm = 0;  // 35 mm equivalent focal length; 0 where there is none
  // Where the camera says that it stood.  Empty without a latitude and a longitude in range: a receiver
  // without a fix writes none, zero denominators, or nonsense.
  std::optional<GeodeticPosition> gps;
  bool has_altitude = false;  // false: gps->altitude_m is 0 because no valid altitude was found
};

// Reads the tags that are there; a file without EXIF, or with a damaged block, has no tags.
ExifTags ReadExif(const std::string& path);

}  // namespace cairn
