#pragma once

#include <optional>
#include <string>

#include "core/geometry/geodesy.h"

namespace cairn {

// The tags of an image file's EXIF block that a capture uses.
struct ExifTags {
  double focal_length_35mm_mm = 0;  // 35 mm equivalent focal length; 0 where there is none
  double focal_length_mm = 0;       // of the lens itself; 0 where there is none
  double sensor_px_per_mm = 0;      // FocalPlaneXResolution; 0 where there is none
  double image_side_px = 0;         // the longer one, when the picture was taken; 0 where it is not said
  std::string camera;               // "Canon EOS 5D"; "": not said
  // Where the camera says that it stood.  Empty without a latitude and a longitude in range: a receiver
  // without a fix writes none, zero denominators, or nonsense.
  std::optional<GeodeticPosition> gps;
  bool has_altitude = false;  // false: gps->altitude_m is 0 because no valid altitude was found
};

// Reads the tags that are there; a file without EXIF, or with a damaged block, has no tags.
ExifTags ReadExif(const std::string& path);

// Where a focal length comes from.
enum class FocalSource { kFilmEquivalent, kSensorPixels };
const char* FocalSourceText(FocalSource source);

struct ExifFocal {
  double focal_px = 0;  // of the image as it is
  FocalSource source = FocalSource::kFilmEquivalent;
};

// The focal length of an image whose longer side is `image_side_px`, as its tags say: the 35 mm equivalent,
// whole millimetres, over 36 mm; without one, that of the lens and how close pixels are to each other on the
// sensor (FocalPlaneXResolution), times how much smaller the image was made since.  Nothing where neither is
// there, or where the sensor would be narrower than 1 mm or wider than 100 mm, or would see less than 1
// degree or more than 170: such tags are of a scanner, or wrong.
std::optional<ExifFocal> FocalOf(const ExifTags& tags, double image_side_px);

}  // namespace cairn
