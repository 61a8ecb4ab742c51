#pragma once

#include <vector>

#include "stages/reconstruct/verdict/covisibility.h"

namespace cairn::reconstruct {

struct FindLoopsOptions {
  // An image is in sight of another while they have this many points in common.  REQUIRES: >= 1
  int min_num_points_in_sight = 5;
  // Fewest images in a row, on the way between the two of a loop, that are out of the first one's sight.
  // REQUIRES: >= 1
  int min_num_images_away = 5;
  // Shortest way of a loop, in median steps: turning on the spot is none.  REQUIRES: >= 0
  double min_way_steps = 10;
  // Fewest points that the two images have in common.  REQUIRES: >= 1
  int min_num_points = 50;
  // Two such pairs are of one loop where along the drive neither image of one is farther from that of the
  // other than this part of the longer way.  REQUIRES: in [0, 1]
  double max_same_ratio = 0.25;
};

// Two images that see the same points although the drive left the first one's sight between them.
struct LoopPair {
  int image1 = 0;  // before image2
  int image2 = 0;
  int num_points = 0;  // that both see
  double way = 0;      // along the drive, in the map's unit
};

// The first and the last image of a drive that share enough points with other drives, which hold what is
// between them as a loop does; none: image1 = image2.
struct TiedImages {
  int image1 = 0;
  int image2 = 0;
};

// A piece of the drive that no loop spans: nothing tells how far off one of its ends is from the other.
struct OpenStretch {
  int image1 = 0;
  int image2 = 0;
  double length = 0;
};

struct Loops {
  std::vector<LoopPair> loops;  // the pair of each that has most points in common, ascending
  std::vector<LoopPair> pairs;  // all of them: of each image and each return to its sight the best, ascending
  // As long as the shortest way of a loop, in the drive's order; none where nothing spans any piece.
  std::vector<OpenStretch> open_stretches;
};

// Where a drive comes back to what it has seen: images [first, end) in its order, `way[i]` to image
// first + i, along the drive; `median_step` of it.  O(pairs of images with common points + pairs * loops).
Loops FindLoops(const Covisibility& covisibility, int first, int end, const std::vector<double>& way,
                double median_step, const TiedImages& tied, const FindLoopsOptions& options);

}  // namespace cairn::reconstruct
