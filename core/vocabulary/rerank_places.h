#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/camera/camera.h"
#include "core/features/features.h"
#include "core/features/packed_descriptors.h"
#include "core/options/options.h"

namespace cairn {

// Words find images that show the same things.  Of these, the image taken nearest shows the place: its
// features obey one geometry with the query's, and that geometry gives the distance between the two cameras,
// in units of the distance to what they see.  Each candidate scores
//
//   s = n / sqrt(f_q f_c) * exp(-r / r_0)
//
// with n matches that agree with one essential matrix, or with one rotation where at least as many agree with
// it, f_q and f_c features of query and candidate, r the length of the baseline over the median distance of
// the agreeing features from the query, and r_0 an option.  The first factor alone, a cosine, favours views
// from farther back, which show more of the same things.  The source keeps the words' order
// [Mariottini11 §IV].
struct RerankOptions {
  // Number of candidates, from the first on, that are verified.  REQUIRES: >= 0
  int num_candidates = 20;
  // Largest ratio of best to second-best descriptor angle, both ways, and largest angle of a match, radians.
  // REQUIRES: in (0, 1], > 0
  double max_ratio = 0.8;
  double max_angle_rad = 0.7;
  // Largest distance of an agreeing match from its epipolar line, pixels of the query (Sampson distance).
  // REQUIRES: > 0
  double max_epipolar_error_px = 2;
  // With fewer agreeing matches a candidate is not verified.  REQUIRES: >= 6 (five always agree)
  int min_num_inliers = 15;
  // r_0: baseline, in median distances of what is seen, at which the score falls to 1 / e.  REQUIRES: > 0
  double baseline_ratio = 0.33;
  // Most samples of five matches.  REQUIRES: >= 1
  int max_num_samples = 1000;
};
OptionTable DescribeOptions(RerankOptions* options);

// What verification reads of an image.
struct PlaceView {
  std::vector<Eigen::Vector3d> bearings;  // per descriptor: unit vector, camera frame; NaN: undefined
  PackedDescriptors packed;
  double focal_px = 0;  // mean focal length: turns the query's pixels into angles
};
// REQUIRES: a row of descriptors for each keypoint, at camera's scale
PlaceView MakePlaceView(const Features& features, const Camera& camera);

struct RerankedPlace {
  int candidate = 0;           // position in the list that was given
  double score = 0;            // s, in [0, 1]; 0 where it is not verified
  int num_inliers = 0;         // matches that agree; 0 where it is not verified
  double baseline_ratio = -1;  // r; -1 where it is not verified
  bool is_verified() const { return num_inliers > 0; }
};

// Verifies one candidate.  Same views, same result.  O(f_q * f_c).
RerankedPlace VerifyPlace(const PlaceView& query, const PlaceView& candidate, const RerankOptions& options);

// The candidates, given as the words rank them, best first: those verified by descending score, then the
// others in the given order; ties in the given order.  The same for any number of threads.  A focal length
// that is only guessed costs inliers, not the order.  Errors: InvalidArgument (an option).
Result<std::vector<RerankedPlace>> RerankPlaces(const PlaceView& query,
                                                const std::vector<const PlaceView*>& candidates,
                                                const RerankOptions& options, int num_threads);

}  // namespace cairn
