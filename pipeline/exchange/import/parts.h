#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/base/pooled.h"
#include "core/camera/camera.h"
#include "core/geometry/pose.h"

namespace cairn::pipeline {

// What several data sets' layouts have in common.

// A line of a list that is neither empty nor a comment (#), with the file and number to name in messages.
struct ListLine {
  std::string_view text;
  std::string place;  // "PATH:LINE"
};
// The lines of `contents`, the text of the file `path`; they point into it.
std::vector<ListLine> ListLines(std::string_view contents, const std::string& path);

// Errors: Corrupt, naming the word that is not a number; without the place.
Result<std::vector<double>> ParseNumbers(std::span<const std::string> words);

// Pose from the rows of a 3 x 4 or 4 x 4 matrix [R t], row-major.  R is turned into the nearest rotation.
// Errors: Corrupt when it is not finite, or not a rotation to 0.02 an entry of R R^T; without the place.
Result<Pose> PoseFromMatrix(std::span<const double> rows);

// Pose from qw qx qy qz tx ty tz.  Errors: as NormalizePose (core/colmap/colmap_model.h).
Result<Pose> PoseFromNumbers(std::span<const double> numbers);

// A camera whose principal point counts from the centre of the first pixel (OpenCV), in COLMAP's pixels.
Camera CameraFromOpenCv(CameraId camera_id, CameraModel model, int width, int height,
                        PooledVector<double> params);

// Width and height of an image, px.  Errors: as ReadGreyImage.
struct ImageSize {
  int width = 0;
  int height = 0;
};
Result<ImageSize> ReadImageSize(const std::string& path);

}  // namespace cairn::pipeline
