// [Sala06 Fig. 4] Algorithm B.1: all open stations shrink to those that see k features, until none is open.
#include "stages/decompose_regions/algorithms/algorithms.h"

namespace cairn::decompose_regions {

void AlgorithmB1(Cover* cover) {
  FeatureChooser chooser(cover);
  while (cover->HasOpen()) {                     // [Sala06 Fig. 4 line 2]
    const CoreRegion region = chooser.Choose();  // [Sala06 Fig. 4 lines 3-9]
    cover->AddComponents(region.features,
                         region.stations);  // [Sala06 Fig. 4 lines 10-11], subject to rho, part by part
  }
}

}  // namespace cairn::decompose_regions
