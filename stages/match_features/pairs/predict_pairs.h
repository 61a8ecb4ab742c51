#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/features/features.h"
#include "stages/match_features/pairs/matched_rays.h"
#include "stages/match_features/pairs/neighbourhood.h"
#include "stages/match_features/pairs/select_pairs.h"

namespace cairn::match_features {

struct PredictPairsOptions {
  // Fewest matches that a predicted pair is expected to have.  REQUIRES: >= 1
  int min_num_expected_matches;
  // Largest angle between two rays that may show the same thing, degrees.  REQUIRES: in (0, 180]
  double max_ray_angle_deg;
  // Largest distance of a ray to the epipolar plane of another that shows the same thing, pixels; as large as
  // the errors of the poses.  REQUIRES: > 0
  double max_prior_error_px;
  // A shorter baseline counts as zero, metres.  REQUIRES: > 0
  double min_baseline_m;
};

// A pair that is predicted, with how many matches it is expected to have.
struct PredictedPair {
  std::pair<int, int> idxs;  // ascending
  int num_expected = 0;
};

// Predicts which posed images show the same scene from the pairs that are already matched.  View frusta
// ignore walls; verified matches do not: where a feature f of image i matches one of image k, and that one
// matches a feature h of image j, f and h most likely show the same thing if the stated poses allow it: their
// rays meet in front of both cameras, up to the poses' error, at no more than max_ray_angle.  The matches
// that images i and j are expected to have are the features of i from which such a chain leads to j.  Chains
// of two matches, not whole tracks: one wrong match joins two tracks, but makes few chains.
// A chain by way of an image of a later generation than both of i and j does not count, so that what is
// predicted of them does not change when that generation is added (earlier_partners.h).  A pair is of the
// later one of its images' generations, and looked for from the image of that one.
class PairPredictor {
 public:
  struct View {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();  // world frame
    std::vector<Eigen::Vector3f> rays;                 // of each feature, unit vectors, world frame
    double focal_px = 0;
    int generation = 0;
  };
  // Of rays and of matches a sixteenth of `max_num_bytes` each is in memory, the others in a file without a
  // name, made where `beside` is.
  PairPredictor(const std::string& beside, int64_t max_num_bytes);

  // The next view; all are added before the first matches.
  void AddView(const View& view);
  // Adds the verified matches of two views.
  void Add(int idx1, int idx2, const std::vector<Match>& inliers);

  // Pairs (ascending) of enough expected matches that are not in `known` (ascending), without those of the
  // generations in `without`: what they predict is known from elsewhere.  Same for any order of
  // the calls of Add, any number of threads and any memory.  A later call only examines pairs that matches
  // added since the last call lead to: the expected matches of others are unchanged.  REQUIRES: later calls
  // have the same options, and the pairs of earlier calls in `known`.  Cost: sum over the features of the
  // generations that are looked for of (matches)^2; later, of images with such pairs.  Memory: half of
  // max_num_bytes for features and matches, but what an image needs and those that it matches, and what they
  // match; about 40 bytes per pair.  Errors: Cancelled; ReadOnly, DiskFull, Io (the files).
  Result<std::vector<PredictedPair>> Predict(const IndexPairs& known, const PredictPairsOptions& options,
                                             int num_threads, Progress& progress,
                                             const std::set<int>& without = {});

 private:
  struct Place {
    Eigen::Vector3d center;
    double focal_px;
    int generation;
  };
  // Images that have pairs to look for, ascending: those of their generation are asked for, and matches of it
  // or of earlier ones were added since the last call.
  std::vector<int> ImagesToExamine(const std::set<int>& without) const;
  // Whether the pair is looked for from `idx`.
  bool IsFrom(int idx, int other) const {
    const int generation = places_[idx].generation, other_generation = places_[other].generation;
    return generation != other_generation ? generation > other_generation : idx < other;
  }
  bool IsLater(int idx, int than) const { return places_[idx].generation > places_[than].generation; }
  // Calls visit(feature, whether one of its matches is new, its end) for the chains that begin in the image,
  // by ascending features.  `only_new`: those without a new match may be left out.
  template <typename Visit>
  void VisitChains(int idx, bool only_new, const Neighbourhood& near, const Visit& visit) const;
  // Images to which a chain leads that has a new match, flags by slot.
  std::vector<char> NewlyLinked(int idx, const Neighbourhood& near) const;
  // Expected matches with every image that is not in `settled`, both by slot.
  std::vector<int> ExpectedMatches(int idx, const std::vector<char>& settled, const Neighbourhood& near,
                                   const PredictPairsOptions& options) const;
  // The pairs to be looked for from `idx`, without those with `known`.
  std::vector<PredictedPair> PredictFrom(int idx, const std::vector<int>& known, const Neighbourhood& near,
                                         const PredictPairsOptions& options) const;

  std::vector<Place> places_;  // of each view
  MatchedRays matched_;
  int64_t max_num_bytes_;
  size_t num_predicted_from_ = 0;  // pairs that were there at the last call of Predict
};

}  // namespace cairn::match_features
