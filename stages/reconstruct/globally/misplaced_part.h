#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "stages/reconstruct/globally/pair_evidence.h"

namespace cairn::reconstruct {

struct MisplacedPartOptions {
  // Points this near to each other are one; and how far apart points are that count as two.  REQUIRES: > 0
  double tolerance = 0.1;
  // Another place must hold the images by this many times as much.  REQUIRES: >= 1
  double min_gain = 1.2;
  // And at least by so many points apart.
  int min_num_cells = 30;
};

// Images of a map that belong elsewhere.
struct MisplacedPart {
  std::vector<int> images;  // ascending
  Eigen::Isometry3d move = Eigen::Isometry3d::Identity();
  int num_cells_here = 0, num_cells_there = 0;  // of space, that they share with the rest
};

// The part of a map that is held by look-alikes alone, as far as the map can tell: there is another place
// where it shares more of space with the rest.  Look-alikes agree with each other, and may have more matches
// than what is true, but they are few surfaces; what is true joins places all over the two sides, if each but
// weakly.  What counts is therefore how many cells of space hold points that both sides have in one place,
// not how many matches or images do [as Heinly, Dunn & Frahm 2014, "Correcting for duplicate scene structure
// in sparse 3D reconstruction", split a map and ask what each side sees of the other]. `pieces`: images
// between which the map is doubtful; `clusters`: smaller ones, of images that look at the same.  Nothing
// where the map holds.  Twins share more of space where they are not: a part is only moved to where it
// `may_stand`, by what else is known.  Same result for any number of threads.  O(points * pairs of pieces).
std::optional<MisplacedPart> FindMisplacedPart(
    const std::vector<std::vector<int>>& pieces, const std::vector<std::vector<int>>& clusters,
    const PairEvidence& evidence, const MisplacedPartOptions& options, int num_threads,
    const std::function<bool(const MisplacedPart&)>& may_stand = [](const MisplacedPart&) { return true; });

}  // namespace cairn::reconstruct
