#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/capture/capture.h"
#include "core/line/reuse.h"
#include "core/options/options.h"
#include "core/world/feature_class.h"
#include "stages/match_features/pairs/frustum_overlap.h"
#include "stages/match_features/two_views/match_pairs.h"

namespace cairn::match_features {

// Finds which keypoints of different images show the same thing, and keeps what the geometry of two views
// confirms [Booij06 §III: a link means that the local space can be reconstructed from the two images].
// Before: extract_features.  After: group_classes, link_appearance.
//
// Pairs of images are chosen first: all of them; those whose view frusta overlap most in the known poses, and
// then those that the verified ones predict (predict_pairs.h), of earlier sessions a bounded number
// (earlier_partners.h); those that look alike (retrieve_pairs.h); neighbours in the natural order of names
// and loop candidates, which look alike without being neighbours; or those of a list.  Descriptors are
// matched exactly (mutual nearest neighbours, ratio test), then verified with the known intrinsics
// (verify_pair.h), with a bounded part of the features in memory (match_pairs.h).
struct MatchFeaturesOptions {
  // "auto": frustum where all images have poses, else exhaustive for few images, else retrieval.
  std::string pairs = "auto";
  // auto: most images that are matched exhaustively.  REQUIRES: >= 0
  int max_num_exhaustive_images = 500;
  // Retrieval: number of most similar images that each image is matched with [COLMAP's vocabulary matcher:
  // 100].  REQUIRES: >= 1
  int num_retrieved = 50;
  // Sequence: number of successors that each image is matched with.  REQUIRES: >= 1
  int sequence_window = 10;
  // Sequence: number of most similar images, without neighbours, that each image is matched
  // with.  REQUIRES: >= 0
  int num_loop_candidates = 10;
  FrustumOverlapOptions frustum;
  // Frustum: number of images of largest overlap that each image is matched with at first; then the pairs
  // that these matches predict are matched (predict_pairs.h).  0: every pair whose frusta overlap is
  // matched.  REQUIRES: >= 0
  int num_frustum_seeds = 20;
  // Frustum: number of images, spread evenly over those of smaller overlap, that each is matched with at
  // first.  REQUIRES: >= 0
  int num_frustum_scouts = 5;
  // Frustum: fewest matches that a predicted pair is expected to have.  REQUIRES: >= 1
  int min_num_expected_matches = 25;
  // Frustum, from the third session on: most images of all earlier sessions together that an image is matched
  // with after the seeds, over the number of those of the one that has the most (earlier_partners.h).
  // REQUIRES: >= 0
  double earlier_partners_ratio = 1;
  MatchPairsOptions matching;
};
OptionTable DescribeOptions(MatchFeaturesOptions* options);

struct MatchFeaturesInputs {
  std::string features_path;         // a COLMAP database with features
  const Capture* capture = nullptr;  // its poses, by image name; none: pairs are verified from matches alone
  std::string vocabulary_path;  // for retrieval and loops; empty: a tree is grown from the images at hand
  std::string pair_list_path;   // replaces options.pairs (pair_list.h); empty: none
  std::string plan_path;        // a shard's, of PlanShards; empty: the shard finds out what its share is
};

// How a run plans what shards do.
struct PlanOptions {
  int num_shards = 0;  // REQUIRES: >= 1
  // Fewest images of a shard that work on images, or the number of pairs that take as long: of less work, or
  // of a round with less, fewer shards have a part, or none.  REQUIRES: >= 1
  int min_num_images = 64;
};

struct MatchFeaturesSummary {
  int num_images = 0;            // with features
  int num_without_features = 0;  // skipped
  int64_t num_pairs_tried = 0;
  int64_t num_pairs_verified = 0;
  int64_t num_putative = 0;  // matches before verification
  int64_t num_inliers = 0;
  DropCounts dropped_pairs;    // of those tried: why they were not verified (core/world/drop_reason.h)
  std::string pairs;           // how pairs were chosen
  int64_t num_taken_over = 0;  // of num_pairs_tried: unchanged since an earlier run
  int num_predictions_taken_over = 0;  // rounds of a generation (pairs/earlier_partners.h)
  int num_rounds = 0;  // of pairs; after a shard's last round the pairs of the next are not known yet
  // What a shard worked on, or is to work on, instead of pairs, to choose them: "seeds" or "overlaps",
  // "words" or "partners" of images; empty: nothing.
  std::string image_step;
  int num_image_results = 0;
  int64_t num_left_to_others = 0;       // pairs, or images, of a shard's last round that other shards work on
  int num_shards_with_work = 0;         // by a plan
  std::vector<std::string> not_reused;  // why earlier outputs gave no results
};

// Reads a COLMAP database with features, writes `matches_path`: its contents and the verified pairs as
// two_view_geometries; and its reuse file (core/line/reuse.h).  A pair is taken over from `reuse` where an
// earlier run of this program matched images with the same features and cameras, in the same relative pose,
// with the same options: same bytes as without.  Same bytes for any number of threads and any memory
// budget.  O(pairs * features^2).
//
// A shard matches the pairs that inputs.plan_path has for it, and writes a database with these pairs only; it
// may have none.  Without a plan it goes through the rounds of pairs with the results in `reuse.files` (and
// before these through the steps by which pairs are chosen: an image's seeds, or its words and its
// partners).  Of the first round that the files do not have completely, it matches its share of the missing
// pairs, a contiguous stretch of the order in which pairs are matched.
//
// Errors: Corrupt (a database), NoData (fewer than two images with features, no pair verified, a vocabulary
// without words), InvalidArgument (options; a line of the pair list), Io, Cancelled; of
// `reuse.files` NotFound.
Result<MatchFeaturesSummary> MatchFeatures(const MatchFeaturesInputs& inputs,
                                           const MatchFeaturesOptions& options,
                                           const std::string& matches_path, uint64_t seed, int num_threads,
                                           Progress& progress, const ReuseOptions& reuse = {});

// Goes through the rounds of pairs with the results in `reuse.files`, and plans the first that they do not
// have completely: `plan_path` says which pairs each shard matches, and plan_path.shards how many of them
// have work ("3"), and whether the rest will be too little for another plan ("3 last").  What the plan itself
// found out (seeds, predicted pairs) is taken over where it is among the files of a later run.  Errors: as
// MatchFeatures.
Result<MatchFeaturesSummary> PlanShards(const MatchFeaturesInputs& inputs,
                                        const MatchFeaturesOptions& options, const PlanOptions& plan,
                                        const std::string& plan_path, uint64_t seed, int num_threads,
                                        Progress& progress, const ReuseOptions& reuse);

}  // namespace cairn::match_features
