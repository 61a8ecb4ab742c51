#include "stages/reconstruct/globally/pair_evidence.h"

namespace cairn::reconstruct {
namespace {

constexpr size_t kMaxNumShared = 60;  // matches of a pair

}  // namespace

PairEvidence EvidenceOf(const std::vector<ViewPair>& pairs, const std::vector<bool>& agrees,
                        const std::vector<Pose>& cams_from_world, const PointOf& point_of) {
  PairEvidence evidence;
  for (size_t p = 0; p < pairs.size(); ++p) {
    const ViewPair& pair = pairs[p];
    const auto num_matches = static_cast<double>(pair.matches.size());
    evidence.links.push_back({pair.image1, pair.image2, agrees[p] ? num_matches : -num_matches});
    const auto add_turn = [&](const Pose& cam2_from_cam1) {
      evidence.turns.push_back(
          {pair.image1, pair.image2,
           (cam2_from_cam1.rotation * cams_from_world[pair.image1].rotation).conjugate() *
               cams_from_world[pair.image2].rotation});
    };
    add_turn(pair.cam2_from_cam1);
    for (const Pose& other : pair.alternatives) add_turn(other);
    const size_t stride = 1 + pair.matches.size() / kMaxNumShared;
    for (size_t m = 0; m < pair.matches.size(); m += stride) {
      const Eigen::Vector3d *in1 = point_of(pair.image1, pair.matches[m].idx1),
                            *in2 = point_of(pair.image2, pair.matches[m].idx2);
      if (in1 != nullptr && in2 != nullptr) evidence.points.push_back({pair.image1, pair.image2, *in1, *in2});
    }
  }
  return evidence;
}

}  // namespace cairn::reconstruct
