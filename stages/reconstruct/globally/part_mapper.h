#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "core/base/progress.h"
#include "core/colmap/colmap_model.h"
#include "core/structure/triangulate.h"
#include "core/structure/union_matches.h"
#include "stages/reconstruct/globally/adjust_model.h"
#include "stages/reconstruct/globally/agreeing_pieces.h"
#include "stages/reconstruct/globally/free_camera.h"
#include "stages/reconstruct/globally/image_ways.h"
#include "stages/reconstruct/globally/misplaced_part.h"
#include "stages/reconstruct/view_graph/image_motion.h"
#include "stages/reconstruct/view_graph/view_pairs.h"

namespace cairn::reconstruct {

// Maps images that pairs join, from their rotations: places by the ways of the backbone's pairs, then rounds,
// each of which takes in the pairs that agree with the map so far, makes tracks of their matches,
// triangulates, and adjusts the longest.
class PartMapper {
 public:
  // `images`: indices into the input's, of a drive in its order; `pairs` and `motions`: of indices into
  // `images`; `backbone`: indices of pairs.
  PartMapper(const MapperInput& input, const std::map<CameraId, Camera>& cameras,
             const MapGloballyOptions& options, int num_threads, std::vector<int> images,
             std::vector<ViewPair> pairs, std::vector<ImageMotion> motions, const std::vector<int>& backbone,
             bool is_drive);

  // By how much Map advances progress: the iterations of its solvers.
  static int64_t NumSteps();

  // Images that see too few points are not in the model.  Nothing where a focal length is found off by more
  // than this ratio before pairs are taken in: then relative poses and rotations are, too, and Cameras() says
  // by what cameras to find them anew.  Ends early, with an empty model, when progress is cancelled.
  std::optional<ColmapModel> Map(const std::vector<Eigen::Quaterniond>& rotations,
                                 double max_focal_change_ratio, Progress& progress);

  // As refined so far.
  std::map<CameraId, Camera> Cameras() const;

 private:
  // Elements of a track that decide on poses.
  struct Chosen {
    int track = 0;
    std::vector<int> elements;
  };

  double FocalChange() const;
  Eigen::Vector2d PixelOf(const TrackElement& element) const;
  const Camera& CameraOf(int image) const { return problem_.cameras[problem_.camera_idx[image]].camera; }
  void KeepRotations(const std::vector<Eigen::Quaterniond>& rotations);
  void MakeTracks();
  std::vector<Chosen> ChooseTracks(int num_keypoints, const std::vector<std::vector<int>>& elements) const;
  void KeepSteps(const std::vector<Eigen::Vector3d>& centers);
  std::vector<Way> AcceptedWays(const std::vector<Eigen::Quaterniond>& rotations) const;
  void PlaceAlong(const std::vector<Eigen::Quaterniond>& rotations, const std::vector<Way>& ways);
  std::vector<Eigen::Vector3d> Centers() const;
  void MendDrive();
  void TriangulateAll(double max_error_px);
  int AcceptPairs(double max_error_rad);
  std::vector<Eigen::Quaterniond> Rotations() const;
  std::vector<std::vector<int>> TracksOfKeypoints() const;
  double MedianDepth() const;
  void HoldSteps(std::vector<SignedLink>* links) const;
  void Move(const MisplacedPart& part);
  bool KeepsDrive(const MisplacedPart& part) const;
  bool MoveMisplacedPart();
  void AgreeAgain(Progress& progress);
  void Adjust(int num_keypoints, bool adjust_cameras, Progress& progress);

  const MapperInput& input_;
  const MapGloballyOptions& options_;
  int num_threads_;
  bool is_drive_;
  std::vector<int> images_;
  std::vector<ViewPair> pairs_;
  std::vector<bool> is_accepted_;              // per pair
  std::vector<std::pair<int, int>> steps_;     // of a drive, that no motion measures
  std::vector<Track> tracks_;                  // longest first
  std::vector<Triangulation> triangulations_;  // per track; inliers are its elements
  ModelProblem problem_;
};

}  // namespace cairn::reconstruct
