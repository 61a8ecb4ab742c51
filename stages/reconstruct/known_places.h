#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/capture/capture.h"
#include "core/capture/exif.h"

namespace cairn::reconstruct {

// What is known of the images of a capture besides their pixels: positions of some, or distances
// between them.

// A distance between the cameras of two images.
struct KnownDistance {
  std::string name1;
  std::string name2;
  double distance_m = 0;
};

// "IMAGE1 IMAGE2 METRES" a line; empty lines and lines that begin with '#' are skipped.  Errors: NotFound,
// Io; Corrupt, with the line (an image that the capture lacks, equal images, a distance that is
// not positive).
Result<std::vector<KnownDistance>> ReadKnownDistances(const std::string& path, const Capture& capture);

// "IMAGE X Y Z" a line, metres: the position of the camera of an image in a frame of the user's choice, z up
// (the form of COLMAP's model_aligner).  Errors as above; an image listed twice is Corrupt.
Result<std::map<std::string, Eigen::Vector3d>> ReadControlPoints(const std::string& path,
                                                                 const Capture& capture);

// GPS tags of the images that have them, by name.
std::map<std::string, ExifTags> ReadGpsTags(const Capture& capture);

// Component-wise median, rounded to 1e-7 degrees and 1 cm: the anchor of a frame.  REQUIRES: not empty.
// Longitudes are taken relative to the first one, so that the 180th meridian may run through the capture.
GeodeticPosition MedianPosition(const std::map<std::string, ExifTags>& tags);

}  // namespace cairn::reconstruct
