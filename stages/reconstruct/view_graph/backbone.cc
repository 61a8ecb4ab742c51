#include "stages/reconstruct/view_graph/backbone.h"

#include <algorithm>
#include <cstdlib>

#include "core/structure/disjoint_sets.h"

namespace cairn::reconstruct {
namespace {

// Trust from which a pair belongs to the backbone, of a drive and of images in no order, and the ladder down
// which parts of it are joined.
constexpr double kMinTrustOfDrive = 0.25, kMinTrust = 0.1, kLadderFactor = 0.8, kLeastTrust = 0.005;
// Of a drive: those at most this many images on or back.
constexpr int kMaxOrderDistance = 10;
// A drive: of this part of its neighbours the pair is at least this strong.
constexpr double kMinDriveRatio = 0.8, kMinStrengthOfNext = 0.4;

// Relative poses of fewer matches are doubtful.
constexpr int kNumCertainMatches = 50;
constexpr double kWeightOfAmbiguous = 0.3;  // of a pair that may have another rotation

}  // namespace

bool IsDrive(int num_images, const std::vector<ViewPair>& pairs, const std::vector<ImageMotion>& motions) {
  std::vector<bool> is_followed(num_images, false);
  const auto follow = [&](int a, int b) {
    if (std::abs(a - b) == 1) is_followed[std::min(a, b)] = true;
  };
  for (const ViewPair& pair : pairs) {
    if (pair.strength >= kMinStrengthOfNext) follow(pair.image1, pair.image2);
  }
  for (const ImageMotion& motion : motions) follow(motion.image1, motion.image2);
  const auto num_followed = std::count(is_followed.begin(), is_followed.end(), true);
  return static_cast<double>(num_followed) >= kMinDriveRatio * (num_images - 1);
}

void SetWeights(bool is_drive, std::vector<ViewPair>* pairs) {
  for (ViewPair& pair : *pairs) {
    const int distance = std::min(std::abs(pair.image1 - pair.image2), kMaxOrderDistance);
    const double certainty = std::min(1.0, static_cast<double>(pair.matches.size()) / kNumCertainMatches);
    const double unambiguity = pair.alternatives.empty() ? 1 : kWeightOfAmbiguous;
    pair.weight = pair.strength * pair.closed * certainty * unambiguity / (is_drive ? distance : 1);
  }
}

std::vector<int> Backbone(int num_images, const std::vector<ViewPair>& pairs,
                          const std::vector<ImageMotion>& motions, bool is_drive) {
  const double min_trust = is_drive ? kMinTrustOfDrive : kMinTrust;
  const auto trust = [](const ViewPair& pair) { return pair.strength * pair.closed; };
  std::vector<bool> is_taken(pairs.size());
  DisjointSets components(num_images);
  for (const ImageMotion& motion : motions) components.Join(motion.image1, motion.image2);
  for (size_t p = 0; p < pairs.size(); ++p) {
    const int distance = std::abs(pairs[p].image1 - pairs[p].image2);
    is_taken[p] = trust(pairs[p]) >= min_trust && (!is_drive || distance <= kMaxOrderDistance);
    if (is_drive && distance == 1) is_taken[p] = true;
    if (is_taken[p]) components.Join(pairs[p].image1, pairs[p].image2);
  }
  // What joins parts, the strongest first, all of one step of the ladder together.
  for (double least = min_trust; least >= kLeastTrust; least *= kLadderFactor) {
    std::vector<size_t> joining;
    for (size_t p = 0; p < pairs.size(); ++p) {
      if (trust(pairs[p]) >= least && components.Find(pairs[p].image1) != components.Find(pairs[p].image2))
        joining.push_back(p);
    }
    for (const size_t p : joining) {
      is_taken[p] = true;
      components.Join(pairs[p].image1, pairs[p].image2);
    }
  }
  std::vector<int> taken;
  for (size_t p = 0; p < pairs.size(); ++p) {
    if (is_taken[p]) taken.push_back(static_cast<int>(p));
  }
  return taken;
}

}  // namespace cairn::reconstruct
