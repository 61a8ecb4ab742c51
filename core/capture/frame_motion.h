#pragma once

#include <vector>

#include <opencv2/core/types.hpp>

namespace cairn {

// What corners that were found again say about how a camera moved between two frames of a film.  Lengths
// are parts of the frames' longer side.
struct FrameMotion {
  // Median distance by which the corners moved in the image.
  double shift = 0;
  // The same after the rotation that explains most of it: what only a camera that changed its place shows.
  // A camera that moves sideways along a flat wall shows less than it should, as a turn looks nearly the
  // same; the shift tells.
  double parallax = 0;
};

// Motion of the corners `before` and `after`, in pixels of a frame of that size; the same number of both.
// `focal_px`: of the camera, a pinhole's; 0: unknown, then several are tried and the one that leaves the
// least parallax counts.  Without corners: zeros.  O(corners).
FrameMotion MeasureMotion(const std::vector<cv::Point2f>& before, const std::vector<cv::Point2f>& after,
                          cv::Size frame_size, double focal_px);

}  // namespace cairn
