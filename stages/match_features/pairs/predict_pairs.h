#pragma once

#include <cstdint>
#include <set>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/features/features.h"
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
  explicit PairPredictor(std::vector<View> views);

  // Adds the verified matches of two views.
  void Add(int idx1, int idx2, const std::vector<Match>& inliers);

  // Pairs (ascending) of enough expected matches that are not in `known` (ascending), without those of the
  // generations in `without`: what they predict is known from elsewhere.  Same for any order of
  // the calls of Add and any number of threads.  A later call only examines pairs that matches added since
  // the last call lead to: the expected matches of others are unchanged.  REQUIRES: later calls have the same
  // options, and the pairs of earlier calls in `known`.  Cost: sum over the features of the generations that
  // are looked for of (matches)^2; later, of images with such pairs.  Memory: 8 bytes per match, and for a
  // moment another 8, and 8 to 24 for each since the last call; 28 per feature.  Errors: Cancelled.
  Result<std::vector<PredictedPair>> Predict(const IndexPairs& known, const PredictPairsOptions& options,
                                             int num_threads, Progress& progress,
                                             const std::set<int>& without = {});

 private:
  // The features that each feature is matched with: feature[begin[f]] to feature[begin[f + 1]].
  struct Links {
    std::vector<uint64_t> begin;
    std::vector<uint32_t> feature;
  };
  // That were added.
  size_t num_matches() const { return num_forgotten_ + matches_.size(); }
  // Links of the matches from `first_match` on.
  Links CollectLinks(size_t first_match) const;
  // All matches that were added are linked.
  void LinkAll();
  // Per image, whether it has pairs to look for: those of its generation are asked for, and matches of it or
  // of earlier ones were added since the last call.
  std::vector<char> ImagesToExamine(const std::set<int>& without) const;
  // Whether the pair is looked for from `idx`.
  bool IsFrom(int idx, int other) const {
    const int generation = views_[idx].generation, other_generation = views_[other].generation;
    return generation != other_generation ? generation > other_generation : idx < other;
  }
  // Images to which a chain leads that has a match of `new_links`, flags per image.
  std::vector<char> NewlyLinked(int idx, const Links& new_links) const;
  // Expected matches with every image that is not in `settled`, flags per image.
  std::vector<int> ExpectedMatches(int idx, const std::vector<char>& settled,
                                   const PredictPairsOptions& options) const;
  bool CanMeet(uint32_t feature1, uint32_t feature2, const PredictPairsOptions& options) const;
  const Eigen::Vector3f& Ray(uint32_t feature) const {
    const int idx = view_of_[feature];
    return views_[idx].rays[feature - first_feature_[idx]];
  }

  std::vector<View> views_;
  std::vector<uint32_t> first_feature_;  // of each view, counted over all; one more than views
  std::vector<int> view_of_;             // of each feature
  // Matches in the order in which they were added: those that are linked, and that a call of Predict() has
  // seen, are forgotten.
  std::vector<std::pair<uint32_t, uint32_t>> matches_;
  size_t num_forgotten_ = 0;
  Links links_;                    // of the first matches
  size_t num_linked_ = 0;          // so many
  size_t num_predicted_from_ = 0;  // matches that were there at the last call of Predict
};

}  // namespace cairn::match_features
