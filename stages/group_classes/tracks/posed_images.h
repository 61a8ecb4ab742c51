#pragma once

#include <optional>
#include <vector>

#include "core/camera/pixel_ray.h"
#include "core/capture/capture.h"
#include "core/structure/triangulate.h"
#include "core/structure/union_matches.h"
#include "stages/group_classes/tracks/matched_features.h"

namespace cairn::group_classes {

// The survey's images that have a pose, contiguous: as stated, and as they are known by now.
struct PosedImages {
  std::vector<int> feature_idx;  // index into MatchedFeatures::images
  std::vector<int> camera_idx;
  std::vector<Camera> cameras;  // ascending camera_id; of images without a pose too
  std::vector<Pose> stated;
  std::vector<double> way_m;  // that a tracker drifts on from the image before; 0 for the first
  std::vector<Pose> poses;
  Pose camera_from_given;
  int num_images() const { return static_cast<int>(stated.size()); }
};

PosedImages CollectPosedImages(const MatchedFeatures& matched, const Capture& capture);

// The ray of a keypoint by `cameras` as they are by now: a ray of each would take a hundred bytes, so none is
// kept.  Nothing where the camera's model has none.
std::optional<PixelRay> RayOf(const MatchedFeatures& matched, const PosedImages& posed,
                              const TrackElement& element);
// The same of one that had a ray when tracks were made; where a camera has lost it since, a ray that no point
// is in front of.
PixelRay RayOfTrack(const MatchedFeatures& matched, const PosedImages& posed, const TrackElement& element);

// Each track triangulated from the images' poses.
std::vector<Triangulation> TriangulateTracks(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                                             const PosedImages& posed, const TriangulateOptions& options,
                                             int num_threads);

// Root mean square reprojection error of the keypoints kept, pixels; 0 without any.
double RmsErrorPx(const std::vector<Triangulation>& triangulations);

}  // namespace cairn::group_classes
