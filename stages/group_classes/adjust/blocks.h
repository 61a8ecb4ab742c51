#pragma once

#include <cstdint>
#include <vector>

#include "core/structure/triangulate.h"
#include "core/structure/union_matches.h"
#include "stages/group_classes/tracks/posed_images.h"

namespace cairn::group_classes {

// A survey too large for all of its poses to be adjusted together is adjusted block by block; what is around
// a block is fixed, and decides with it on what both see.
//
//   round 0: runs of successive images, the later ones not yet there. What follows a run moves along when it
//            bends: it begins right where the run ends.
//   then:    blocks of the world, of which each round has others, with all around them:
//
//            +--------+-----+            +-----+-----------+     An image at a border of one round is mostly
//            |        |     |            |     +-----------+     well within a block of another one.
//            |        +-----+            |     |           |
//            +--------+-----+            +-----+-----------+
//
// The solver's memory is that of a block with the images around it, whatever the survey's size.

// The images of each block of a round, by where they are by now, ascending: at most `most`.  Of round 0 they
// are runs, in their order.
// REQUIRES: most >= 1
std::vector<std::vector<int32_t>> BlocksOfRound(const PosedImages& posed, int round, int most);

// Per block, which tracks an image of it sees, ascending.
std::vector<std::vector<int64_t>> TracksOfBlocks(const std::vector<Track>& tracks,
                                                 const std::vector<std::vector<int32_t>>& blocks,
                                                 int num_images);

// A block with what is around it.
struct SurveyBlock {
  std::vector<int> images;     // of the survey, ascending: the block's, and those that are fixed
  std::vector<char> is_fixed;  // per image
  std::vector<Track> tracks;   // by its own numbers of images
  std::vector<Triangulation> triangulations;  // per track; all of its keypoints are inliers
};

// The block of these images, with the tracks that decide on their poses (choose_tracks.h) as they are
// triangulated by now.  Fixed are the images that share these, and those before and after one of the block's,
// from which a stated pose drifts.  `tracks_of_block`: of TracksOfBlocks().  `num_known`: the survey's first
// images, which alone are there; the block's are among them.
SurveyBlock CutOutBlock(const MatchedFeatures& matched, const PosedImages& posed,
                        const std::vector<Track>& tracks, const std::vector<int64_t>& tracks_of_block,
                        const std::vector<int32_t>& images, int num_known,
                        const TriangulateOptions& triangulate, int num_keypoints, int num_threads);

}  // namespace cairn::group_classes
