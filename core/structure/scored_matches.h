#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/files/temporary.h"

namespace cairn {

// A keypoint of an image, by contiguous image index.
struct TrackElement {
  int32_t image_idx = 0;
  KeypointIdx keypoint_idx = 0;
  friend bool operator==(const TrackElement&, const TrackElement&) = default;
  friend auto operator<=>(const TrackElement&, const TrackElement&) = default;
};

// Verified matches between images, with how alike their descriptors are.  There are millions: one takes
// twelve bytes, and those that memory has no room for are in a file, in sorted runs.
class ScoredMatches {
 public:
  struct Match {
    int32_t keypoint1 = 0, keypoint2 = 0;  // counted over all images
    int32_t dot_product = 0;
    // Most alike first.
    friend bool operator<(const Match& a, const Match& b) {
      if (a.dot_product != b.dot_product) return a.dot_product > b.dot_product;
      return std::pair(a.keypoint1, a.keypoint2) < std::pair(b.keypoint1, b.keypoint2);
    }
  };

  // num_keypoints[i]: number of keypoints of image i.
  explicit ScoredMatches(const std::vector<int>& num_keypoints);
  // At most so many are in memory, the others in a file without a name that is made where `beside` is.
  // REQUIRES: max_num_in_memory >= 1
  ScoredMatches(const std::vector<int>& num_keypoints, std::string beside, size_t max_num_in_memory);

  // A larger dot product is more alike.
  void Add(const TrackElement& element1, const TrackElement& element2, int32_t dot_product);
  // Whether the file could be written so far.
  const Status& status() const { return status_; }
  // Calls visit(match) for all, most alike first; gives up their memory.  Errors: ReadOnly, DiskFull, Io.
  Status Visit(const std::function<void(const Match&)>& visit) &&;

  // Per image: its first keypoint, counted over all; then the number of all.
  const std::vector<int32_t>& first_keypoint() const { return first_keypoint_; }

 private:
  class RunReader;
  void WriteRun();

  std::vector<int32_t> first_keypoint_;
  size_t max_num_in_memory_;
  std::vector<Match> matches_;
  ScratchFile file_;
  std::vector<size_t> run_sizes_;  // of the file's runs, one after the other
  Status status_;
};

}  // namespace cairn
