#pragma once

#include <cstdint>
#include <vector>

#include "core/features/features.h"
#include "core/vocabulary/vocabulary_tree.h"

namespace cairn {

// Descriptors of images along an invented tour: RootSIFT-like (not negative, mostly small, norm 512), of
// families that look alike, as scenes have edges, corners and blobs.  An image shows its own features and
// some that it has in common with all (doors, lamps); the image after it shows half of its own again.  Any
// image can be made by itself, and is the same each time.
struct SyntheticPlaces {
  int num_places = 10000;
  int num_features = 1000;  // of an image
  // Part of an image's features that are of a small pool common to all places.
  double common_ratio = 0.2;
  int num_common = 2000;
  int num_families = 2000;
  // Spread of the features of a family, and of views of one feature: parts of a mean value of 45.
  double family_sigma = 0.9;
  double view_sigma = 0.35;
  uint64_t seed = 0;
};

// Directions of the families, num_families rows.
DescriptorMatrix Families(const SyntheticPlaces& places);

// What a camera sees at a place.  `view` 0: the survey; others: queries, of which the part `clutter_ratio` of
// the features belongs to no place.
DescriptorMatrix ViewOfPlace(const SyntheticPlaces& places, const DescriptorMatrix& families, int place,
                             int view, double clutter_ratio);

}  // namespace cairn
