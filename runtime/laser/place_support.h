#pragma once

#include <functional>
#include <vector>

#include "runtime/laser/pairing.h"

namespace cairn {

// A further pairing, and where along the places of a first one it may be true: metres from Pairing::from.
struct PlaceStretch {
  double low = 0, high = 0;
  int segment = 0;
  LabelIdx label = 0;
};

// Places along a first pairing's line where a number of other segments may have a pairing.
struct SupportedPlaces {
  double low = 0, high = 0;
  int num_segments = 0;
};

// Bounds what a first pairing can lead to: a pairing leaves the robot on a line of places, and each further
// one on a stretch of that line.  No interpretation pairs more segments than have stretches over one place,
// so where these are too few, no branch below the first pairing needs to be tried.
//
// Stretches of the pairings of `others` with the labels that pass `may_be`, whose headings agree and whose
// places come close (PairingTable's loose tolerance).  By segment, in the order of `others`.  O(log labels +
// labels with that heading), each segment.
std::vector<PlaceStretch> StretchesAlong(const PairingTable& table, int segment, LabelIdx label,
                                         const std::vector<int>& others,
                                         const std::function<bool(LabelIdx)>& may_be);

// Places with stretches of at least `least` different segments, ascending, divided where the number changes;
// empty where `least` is 0 and there is no stretch.  `stretches`: by segment.  O(n log n)
std::vector<SupportedPlaces> PlacesWithSupport(const std::vector<PlaceStretch>& stretches, int least);

// Those of ascending places that touch none with more support.
std::vector<SupportedPlaces> BestSupported(const std::vector<SupportedPlaces>& places);

// For each segment, of its stretches over a place the one whose middle is nearest; by segment as `stretches`.
std::vector<PlaceStretch> StretchesOver(const std::vector<PlaceStretch>& stretches, double place);

}  // namespace cairn
