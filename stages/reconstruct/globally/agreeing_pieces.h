#pragma once

#include <vector>

namespace cairn::reconstruct {

// Two images that a pair joins.
struct SignedLink {
  int image1 = 0, image2 = 0;
  // How much speaks for where the map has one beside the other; negative: against.
  double weight = 0;
};

// Images in pieces, such that between any two pieces the weight is not more than `min_mean_weight` on average
// over their images: joined in pairs, those first between which it is largest (average linkage [Sokal &
// Michener 1958]).  With 0, as much speaks against where the map has two pieces as for it.  Each piece
// ascending, the largest first, then by the first image.  O(links log links) for images that are linked to
// few.
std::vector<std::vector<int>> AgreeingPieces(int num_images, const std::vector<SignedLink>& links,
                                             double min_mean_weight);

}  // namespace cairn::reconstruct
