#pragma once

#include <map>
#include <optional>
#include <vector>

#include "core/camera/camera.h"
#include "core/geometry/pose.h"
#include "core/structure/triangulate.h"
#include "core/structure/union_matches.h"
#include "stages/reconstruct/view_graph/mapper_input.h"

namespace cairn::reconstruct {

// Images of which some have a pose.
struct PosedInput {
  const MapperInput& input;
  std::map<CameraId, Camera> cameras;               // as they are known by now
  std::vector<std::optional<Pose>> cam_from_world;  // per image of the input

  const Camera& CameraOf(int image) const { return cameras.at(input.images[image].camera_id); }
  Eigen::Vector2d PixelOf(const TrackElement& element) const {
    const Keypoint& keypoint = input.keypoints[element.image_idx][element.keypoint_idx];
    return {keypoint.x, keypoint.y};
  }
};

// What images that have a pose see.
struct SeenPoints {
  std::vector<Track> tracks;                  // of two images at least
  std::vector<Triangulation> triangulations;  // per track; inliers are its elements; none: it is no point
  std::vector<std::vector<int>> track_of;  // per image and keypoint: the track whose point it sees; -1: none
};

// Triangulates what posed images match where their poses allow the match: up to this error, as a distance
// from the epipolar line and of the point from its keypoints.  The same for any number of threads.
SeenPoints TriangulateSeen(const PosedInput& posed, double max_error_px, int num_threads);

}  // namespace cairn::reconstruct
