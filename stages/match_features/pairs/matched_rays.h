#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/features/features.h"
#include "stages/match_features/pairs/spilled_array.h"

namespace cairn::match_features {

// The rays of the features of posed images, and which of them match, pair by pair; mostly in a file without a
// name where a survey is large.  Memory: 16 bytes per pair and per image, and what is given.
class MatchedRays {
 public:
  struct Pair {
    int view1 = 0, view2 = 0;
    uint64_t first_match = 0;  // counted over all pairs
  };

  // Of the rays and of the matches `max_num_bytes` each are in memory; the files are made where `beside` is.
  MatchedRays(const std::string& beside, int64_t max_num_bytes)
      : rays_(beside, max_num_bytes), matches_(beside, max_num_bytes) {}

  // The next image.
  void AddView(std::span<const Eigen::Vector3f> rays);
  // REQUIRES: indices of images that were added, and of their features.
  void AddPair(int view1, int view2, std::span<const Match> matches);

  int num_views() const { return static_cast<int>(first_ray_.size()) - 1; }
  uint32_t NumFeatures(int view) const {
    return static_cast<uint32_t>(first_ray_[view + 1] - first_ray_[view]);
  }
  // In the order in which they were added.
  const std::vector<Pair>& pairs() const { return pairs_; }
  uint64_t NumMatches(size_t pair) const;

  // Whether everything could be kept.  Errors: ReadOnly, DiskFull, Io.
  Status status() const { return rays_.status().ok() ? matches_.status() : rays_.status(); }
  // On any thread.  REQUIRES: status() is ok.  Errors: Io.
  Result<std::vector<Eigen::Vector3f>> ReadRays(int view) const;
  Result<std::vector<Match>> ReadMatches(size_t pair) const;

 private:
  SpilledArray<Eigen::Vector3f> rays_;
  std::vector<uint64_t> first_ray_ = {0};  // of each image; then the number of all
  SpilledArray<Match> matches_;
  std::vector<Pair> pairs_;
};

}  // namespace cairn::match_features
