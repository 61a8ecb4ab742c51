#pragma once

#include <optional>
#include <vector>

#include "core/geometry/similarity.h"
#include "stages/reconstruct/registration/fix_images.h"

namespace cairn::reconstruct {

// Images that are joined with each other, in a frame of their own.
struct Piece {
  std::vector<int> images;           // indices into the input's
  std::vector<Pose> cam_from_piece;  // per image
};

// Where a piece is in the world.
struct PiecePlace {
  Similarity world_from_piece;
  std::vector<int> num_inliers;  // per image: its point matches that agree
  int num_supported = 0;         // images with enough of them
  // Agreeing matches of the images that support the place, of each at most 50 among 100 that are evenly
  // spread; and how many matches of the same images agree with another place, the best of all elsewhere.  As
  // many as here: what these images see is there twice.  Images that agree with another place alone do not
  // count: they are no part of what is placed here.
  int num_matches = 0, num_matches_elsewhere = 0;
};

struct PlacePieceOptions {
  double max_error_px = 8;  // REQUIRES: > 0
  // Fewest point matches that agree of an image that supports a place.  REQUIRES: >= 4
  int min_num_inliers = 12;
  // Places are different where cameras are farther apart than this, beside the median distance of what they
  // see, or turned by more.  REQUIRES: > 0
  double min_shift_ratio = 0.2;
  double min_turn_deg = 15;
};

// The place at which most point matches of all its images agree.  Hypotheses: the similarity that two fixes
// give, from each two of the surest that are far enough apart; a piece of one image has its fix, of scale 1.
// The best is refined over its inliers (Gauss-Newton, Cauchy's loss) with the images rigid to each other.
// `fixes`: of the piece's images, in their order.  Nothing where too few images have a fix.  No randomness.
std::optional<PiecePlace> PlacePiece(const Piece& piece, const std::vector<ImageFix>& fixes,
                                     const PlacePieceOptions& options);

}  // namespace cairn::reconstruct
