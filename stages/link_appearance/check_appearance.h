#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/options/options.h"
#include "stages/link_appearance/link_appearance.h"

namespace cairn::link_appearance {

// How many left-out images the kept ones of the rest locate [Booij06 §V-A]: an image is localized when it is
// linked to a kept one.
struct CheckAppearanceOptions {
  // The curve's sizes, as parts of the nodes.  REQUIRES: in [0, 1]
  std::vector<double> kept_ratios = {0.02, 0.04, 0.06, 0.08, 0.11, 0.15, 0.2, 0.3, 0.5};
  // Weighted sets: links of fewer inliers count in proportion.  REQUIRES: >= 1
  int weighted_num_inliers = 100;
  // Sets of m-fold domination are checked up to this m.  REQUIRES: >= 1
  int max_num_dominators = 3;
};
OptionTable DescribeOptions(CheckAppearanceOptions* options);

// A left-out image: its links to nodes of the graph.
struct LeftOutImage {
  std::vector<NodeIdx> linked;  // ascending
  NodeIdx node = -1;            // the node of the graph that is this image, -1: none
  std::string name;             // for people
};

// The results of a set, or of sets of one size or kind.
struct AppearanceFigure {
  double num_kept = 0;       // mean over the left-out images
  double num_localized = 0;  // of the left-out images
  double num_by_random = 0;  // expected of random sets of the same size
};
struct AppearanceCheck {
  int num_nodes = 0;  // nodes that sets are chosen from, without the left-out one
  int num_left_out = 0;
  int num_linked = 0;  // of these, with any link: no set can locate more
  std::vector<std::string>
      set_names;  // of sets that meet their demands: "greedy", "improved", "weighted", ..., "as asked"
  std::vector<AppearanceFigure> sets;
  // Per set: the names of the left-out images that have links and are not localized, in their order.
  std::vector<std::vector<std::string>> missed;
  std::vector<int> sizes;                             // the curve's
  std::vector<std::string> curve_names;               // "greedy", "weighted", "2-fold"
  std::vector<std::vector<AppearanceFigure>> curves;  // per name and size
};

// Leave-one-out: each node in turn is taken out of the graph, and the sets are chosen from the rest, per
// component where the graph falls apart; ties go to the smallest node.
std::vector<LeftOutImage> EachNodeLeftOut(const AppearanceGraph& graph);

// Sets by `link_options` (its num_tries for the improved ones), by links that count by inliers, and of m-fold
// domination; last, the set that the options ask for, of so many dominators by so weighted links; and greedy
// sets of the curve's sizes.  The probability that a random set of k of n nodes locates an image with d
// neighbours is computed, without sampling: 1 - C(n - d, k) / C(n, k).  Same figures for any number of
// threads.  O(left-out nodes * sets).  Errors: InvalidArgument (options), NoData (nothing, or all, is left
// out), Cancelled.
Result<AppearanceCheck> CheckAppearance(const AppearanceGraph& graph,
                                        const std::vector<LeftOutImage>& left_out,
                                        const LinkAppearanceOptions& link_options,
                                        const CheckAppearanceOptions& options, uint64_t seed, int num_threads,
                                        Progress& progress);

// Takes images out of a survey by name, or by folder (a name with '/' at its end: a session of joined
// captures): the remaining survey, and the links of the images taken out.  A panorama's views are one
// held-out image.  Errors: NotFound (a name that the survey does not have).
struct HeldOutSplit {
  ImageLinks survey;
  std::vector<std::string> names;        // of the held-out images
  std::vector<std::vector<int>> linked;  // per held-out image: indices of survey images, ascending
};
Result<HeldOutSplit> HoldOut(const ImageLinks& images, const std::vector<std::string>& names);

}  // namespace cairn::link_appearance
