#pragma once

#include <string>

#include "core/capture.h"
#include "core/error.h"
#include "core/options.h"
#include "core/progress.h"
#include "stages/match_features/match_pairs.h"
#include "stages/match_features/select_pairs.h"

namespace cairn {

// Finds which keypoints of different images show the same thing, and keeps what the geometry of two views
// confirms [Booij06 §III: a link means that the local space can be reconstructed from the two images].
// Before: extract_features.  After: group_classes, link_appearance.
//
// Pairs of images are chosen first: all of them; those whose view frusta overlap most in the known poses, and
// then those that the verified ones predict (predict_pairs.h); those that look alike (retrieve_pairs.h);
// neighbours in the natural order of names and loop candidates, which look alike without being neighbours; or
// those of a list.  Descriptors are matched exactly (mutual nearest neighbours, ratio test), then verified
// with the known intrinsics (verify_pair.h), with a bounded part of the features in memory (match_pairs.h).
struct MatchFeaturesOptions {
  // "auto": frustum where all images have poses, else exhaustive for few images, else retrieval.
  std::string pairs = "auto";
  // auto: most images that are matched exhaustively.  REQUIRES: >= 0
  int max_num_exhaustive_images = 500;
  // Retrieval: how many images most like it each image is matched with [COLMAP's vocabulary matcher: 100].
  // REQUIRES: >= 1
  int num_retrieved = 50;
  // Sequence: how many successors each image is matched with.  REQUIRES: >= 1
  int sequence_window = 10;
  // Sequence: how many images most like it, but no neighbours, each image is matched with.  REQUIRES: >= 0
  int num_loop_candidates = 10;
  FrustumOverlapOptions frustum;
  // Frustum: how many images of largest overlap each image is matched with at first; then pairs are matched
  // that these matches predict (predict_pairs.h).  0: every pair whose frusta overlap is matched.
  // REQUIRES: >= 0
  int num_frustum_seeds = 20;
  // Frustum: how many images, spread evenly over those of smaller overlap, each is matched with at first.
  // REQUIRES: >= 0
  int num_frustum_scouts = 5;
  // Frustum: fewest matches that a predicted pair is expected to have.  REQUIRES: >= 1
  int min_num_expected_matches = 25;
  MatchPairsOptions matching;
};
// Without matching.memory_budget_mib, which like the number of threads changes no result.
OptionTable DescribeOptions(MatchFeaturesOptions* options);

struct MatchFeaturesInputs {
  std::string features_path;         // a COLMAP database with features
  const Capture* capture = nullptr;  // its poses, by image name; none: pairs are verified from matches alone
  std::string vocabulary_path;  // for retrieval and loops; empty: a tree is grown from the images at hand
  std::string pair_list_path;   // replaces options.pairs (pair_list.h); empty: none
};

struct MatchFeaturesSummary {
  int num_images = 0;            // with features
  int num_without_features = 0;  // skipped
  int64_t num_pairs_tried = 0;
  int64_t num_pairs_verified = 0;
  int64_t num_putative = 0;  // matches before verification
  int64_t num_inliers = 0;
  std::string pairs;  // how pairs were chosen
};

// Reads a COLMAP database with features, writes `matches_path`: its contents and the verified pairs as
// two_view_geometries.  Same bytes for any number of threads and any memory budget.  O(pairs * features^2).
// Errors: Corrupt (a database), NoData (fewer than two images with features, no pair verified, a vocabulary
// without words), InvalidArgument (options; a line of the pair list), Io, Cancelled.
Result<MatchFeaturesSummary> MatchFeatures(const MatchFeaturesInputs& inputs,
                                           const MatchFeaturesOptions& options,
                                           const std::string& matches_path, uint64_t seed, int num_threads,
                                           Progress& progress);

}  // namespace cairn
