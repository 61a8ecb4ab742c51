#pragma once

#include <cstdint>
#include <vector>

#include "stages/decompose_regions/cover/core_finder.h"
#include "stages/decompose_regions/cover/pricing.h"

namespace cairn::decompose_regions {

// Proves how large the value of a region can be, by branch and bound over the stations that it covers.  Each
// station in turn is the anchor: of the regions that cover it and no earlier anchor's station, the stations
// that share k features with the anchor are open.  A branch covers one of them, which leaves the features
// that both see, or leaves it out.  A region has k of the features that are left, so
//   - a station that sees fewer than k of them is out, one that sees all of them is covered;
//   - a feature that loses too much (the stations that do not see it are worth the slack, the value of all
//     stations that are left minus the threshold) is out, and a station of that value is covered;
//   - each open station's value is divided among the features that it does not see: any k features lose at
//     least the k smallest sums of such shares (the dual of the linear program with x_v <= 1 - z_f wherever v
//     does not see f, sum of z_f = k).
// The last one makes large k easy: few of an anchor's features can be given up.
class ExactPricer {
 public:
  explicit ExactPricer(const ReducedWorld& wide);

  // An upper bound of the value of every region of the world with k common features (CoreFinder): at least
  // `threshold`, and equal to the largest value if that is more and the search was complete.  After
  // `max_work` steps the threshold rises by a 32nd, and again and again after each further 32nd of
  // `max_work`.  Appends for each anchor the most valuable core found, if it is worth more than the
  // threshold.
  int64_t MaxValue(const StationValues& values, int64_t threshold, int64_t max_work,
                   std::vector<CoreRegion>* found);
  // Steps of the last call.
  int64_t work() const { return work_; }

 private:
  // The anchor's features are numbered 0, 1, ... here, and sets of them are bits of words.
  using Bits = std::vector<uint64_t>;
  struct OpenStation {
    int64_t value;
    int32_t station;      // in missing_
    int32_t num_missing;  // of the node's features, how many it does not see
  };
  struct Node {
    Bits features;
    int num_features = 0;
    std::vector<OpenStation> open;
    int64_t covered = 0;  // value of the stations that see all features
    int64_t total = 0;    // with the open ones
  };

  void KeepLive();
  std::vector<StationIdx> AnchorOrder();
  std::vector<StationIdx> Sharing(StationIdx anchor);
  int64_t TotalValue(StationIdx anchor, const std::vector<StationIdx>& others) const;
  Node Root(StationIdx anchor, const std::vector<StationIdx>& stations);
  void Search(Node node);
  bool Narrow(Node* node);
  bool DropFeatures(Node* node);
  int64_t LeastLoss(const Node& node);
  std::vector<int32_t> FeaturesWithoutLoss(const Node& node) const;
  bool Close(std::vector<int32_t> features, int64_t total);
  void Divide(const std::vector<int32_t>& features, size_t num_fixed);
  int64_t ReachableValue(const std::vector<int32_t>& features, size_t num_fixed);
  void Spend(int64_t work);

  const ReducedWorld& wide_;
  CoreFinder finder_;
  ComponentFinder components_;

  // Of the search that is running.
  const StationValues* values_ = nullptr;
  IndexLists live_areas_, live_sets_;  // stations of value and features worth more than the threshold only
  std::vector<char> was_anchor_;       // per station
  int64_t least_ = 0;                  // the threshold of all anchors
  int64_t threshold_ = 0;              // of this anchor: its best region so far, if that is more
  int64_t work_ = 0, work_left_ = 0, more_work_ = 0;
  // Of the anchor.
  StationIdx anchor_ = 0;
  CoreRegion best_;
  Bits missing_;  // per station, num_words_ words: the anchor's features that it does not see
  size_t num_words_ = 0;
  // Scratch.
  std::vector<int32_t> num_shared_, num_seen_;  // per station, zero between uses
  std::vector<StationIdx> sharing_;
  std::vector<int32_t> local_;            // per feature, -1 between uses
  std::vector<int64_t> losses_, shares_;  // per feature of the anchor
};

}  // namespace cairn::decompose_regions
