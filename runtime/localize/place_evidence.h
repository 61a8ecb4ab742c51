#pragma once

#include <span>

#include "core/base/error.h"
#include "core/geometry/pose.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/landmark_set.h"
#include "runtime/map/map.h"

namespace cairn {

// What an image should show where a pose puts it, and what of that it does show.  Doors, lamps and signs of
// another floor agree on a pose as well as those of the right one; but what is between them is missing.
struct PlaceEvidence {
  // Landmarks in view that were looked for (WasLookedFor), each times the share of the nearest survey images
  // that see it: near ones count most, so that what stands behind a wall, is seen from another side only or
  // is much smaller from here counts little.
  double num_expected = 0;
  int num_matched = 0;  // matches, found without the pose, that agree with it
  // Square of the distance to the nearest survey image, in views (a tenth of the depth, 15 degrees): far from
  // all of them nobody knows what should be seen.  Of a rig, that of the camera that is nearest to one; what
  // others should show counts the less the farther off they are.
  double squared_distance = 0;
  // Cells of the images in which landmarks are expected, and those of them with one that was found.
  double num_cells_expected = 0;
  double num_cells_found = 0;
};

// `found`: what guided matching found at the pose, ascending by image.  `num_matched`: as in PlaceEvidence.
// `num_cells`: per side of the image.  Reads the nearest survey images only.  Errors: as Map::Landmarks.
// REQUIRES: num_cells >= 1; the landmarks found are in the set
Result<PlaceEvidence> EvidenceOfPlace(const Map& map, const Sighting& sighting, const Pose& rig_from_world,
                                      const LandmarkSet& landmarks, std::span<const Correspondence> found,
                                      int num_matched, int num_cells);

// Odds that a pose with this evidence is right, and not of a place that is not in the map or of a part of
// one that looks like this: P / (1 - P).
double OddsOfPlace(const PlaceEvidence& evidence);

// P(the first is right), of exclusive explanations with these odds, each against none of them being right.
double ProbabilityAmong(double odds, double odds_of_others);

}  // namespace cairn
