#pragma once

#include <vector>

#include "core/geometry/pose.h"
#include "core/structure/union_matches.h"

namespace cairn::group_classes {

// A large survey that drifts is straightened in parts of successive images before it is adjusted as a whole:
// in each round the parts are adjusted, each by itself, and joined; the next round has half as many.
//
//   images  0 1 2 3 4 5 6 7 8 9 ...        Each part keeps the step that is stated from the last image of the
//   round 1 [--][--][--][--][-- ...        part before it, so all that follow move along when a part is bent:
//   round 2 [------][------][-- ...        what drifted by metres over the survey is nearly right where a
//   whole   [------------------ ...        part begins, and tracks agree in ever more of their images.
//
// A step of the whole serves the worst of its rooms, and what has drifted far apart does not see that it is
// the same point; a part has steps of its own, of few images.  O(images) where parts are of one size.

// How many parts each round has; none for a survey of no more than `num_images_at_once`.  Parts have at most
// a twelfth of that in the first round, and a third in the last one.  REQUIRES: num_images_at_once >= 10
std::vector<int> NumPartsOfRounds(int num_images, int num_images_at_once);

// The first image of each part, and num_images at the end.  REQUIRES: 1 <= num_parts <= num_images
std::vector<int> BeginsOfParts(int num_images, int num_parts);

// What each part sees of the tracks, by its own numbers of images: those of two of its images or more.
// REQUIRES: tracks in the order of their images
std::vector<std::vector<Track>> SplitTracks(const std::vector<Track>& tracks, const std::vector<int>& begins);

// Of the images of a part: poses, and the stated ones freed from drift.
struct PosesOfPart {
  std::vector<Pose> poses, drifted;
};

// Puts parts that were adjusted, each with the drifted pose of its first image fixed, behind one another.
// `before`: the drifted poses that they began with; the motion from the end of one part to the beginning of
// the next one stays what it was there.
PosesOfPart JoinParts(const std::vector<PosesOfPart>& parts, const std::vector<Pose>& before);

}  // namespace cairn::group_classes
