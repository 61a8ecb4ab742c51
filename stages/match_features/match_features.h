#pragma once

#include <string>

#include "core/capture.h"
#include "core/descriptor_matcher.h"
#include "core/error.h"
#include "core/options.h"
#include "core/progress.h"
#include "stages/match_features/select_pairs.h"
#include "stages/match_features/verify_pair.h"

namespace cairn {

// Finds which keypoints of different images show the same thing, and keeps what the geometry of two views
// confirms [Booij06 §III: a link means that the local space can be reconstructed from the two images].
// Before: extract_features.  After: group_classes, link_appearance.
//
// Pairs of images are chosen first: all of them, neighbours in the order of names, or those whose view frusta
// overlap in the known poses.  Descriptors are matched exactly (mutual nearest neighbours, ratio test), then
// verified with the known intrinsics (verify_pair.h).
struct MatchFeaturesOptions {
  // "auto": frustum where all images have poses, else exhaustive.
  std::string pairs = "auto";
  // Sequence: how many successors each image is matched with.  REQUIRES: >= 1
  int sequence_window = 10;
  FrustumOverlapOptions frustum;
  DescriptorMatcherOptions matcher;
  VerifyPairOptions verification;
};
OptionTable DescribeOptions(MatchFeaturesOptions* options);

struct MatchFeaturesSummary {
  int num_images = 0;
  int64_t num_pairs_tried = 0;
  int64_t num_pairs_verified = 0;
  int64_t num_putative = 0;  // matches before verification
  int64_t num_inliers = 0;
  std::string pairs;  // how pairs were chosen
};

// Reads a COLMAP database with features, writes `matches_path`: its contents and the verified pairs as
// two_view_geometries.  `capture` gives poses (by image name); without it, pairs are verified from the
// matches alone. Same bytes for any number of threads.  O(pairs * features^2). Errors: Corrupt (database),
// NoData (fewer than two images with features, or no pair verified), Io, Cancelled.
Result<MatchFeaturesSummary> MatchFeatures(const std::string& features_path, const Capture* capture,
                                           const MatchFeaturesOptions& options,
                                           const std::string& matches_path, int num_threads,
                                           Progress& progress);

}  // namespace cairn
