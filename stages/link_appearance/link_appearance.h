#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/base/progress.h"
#include "core/options/options.h"
#include "core/world/appearance.h"
#include "core/world/appearance_graph.h"
#include "stages/link_appearance/dominating_set/connected_bound.h"
#include "stages/link_appearance/dominating_set/improve_dominating_set.h"
#include "stages/link_appearance/find_ambiguity.h"
#include "stages/link_appearance/fuse_images.h"

namespace cairn::link_appearance {

// Finds the fewest images that still locate the robot: links images between which a relative pose can be
// recovered, and keeps a set of them in which every image is kept or linked to a kept one, and which is
// connected, so that a path over kept images leads everywhere (a connected dominating set, CDS).  Before:
// match_features.  After: emit_map.  Implements [Booij06]:
//   links                      fuse_images.h            [Booij06 §III]
//   the greedy algorithm       greedy_dominating_set.h  [Booij06 §IV-B]
//   restoring cycles           restore_cycles.h         [Booij06 §IV-C]
//   leave-one-out              check_appearance.h       [Booij06 §V-A]
// and of [Mariottini11 §V] where a vocabulary is given:
//   entropy, look-alikes       find_ambiguity.h         [Mariottini11 eq. 1]
// and what [Booij06] suggests: m-fold domination and weighted links (domination.h), a target size, images one
// by one (online_dominating_set.h), local search (improve_dominating_set.h), and a bound (connected_bound.h).
struct LinkAppearanceOptions {
  // Fewest verified inliers of a link.  REQUIRES: >= 1
  int min_num_inliers = 15;
  // Images that stand farther apart are not linked, by the capture's poses; 0: any.  Look-alike images that
  // differ by a shift are verified as if everything in them were far away.  REQUIRES: >= 0
  double max_link_distance_m = 0;
  // Images whose directions differ by more are not linked, by the capture's poses: a robot cannot be steered
  // from one to the other.  REQUIRES: in [0, 180]
  double max_link_turn_deg = 180;
  // Which images form one node of the graph (fuse_images.h): "none", "name", "place".
  std::string fuse = "none";
  // Images within this distance count as taken at one place.  REQUIRES: > 0
  double same_place_m = 0.1;
  // How nodes are chosen: "greedy" [Booij06]; "online": one by one in the order of their numbers; "all":
  // every node is kept, for robots that use all images.
  std::string algorithm = "greedy";
  // online: most kept nodes that an arrival drops.  REQUIRES: >= 0
  int max_num_dropped = 4;
  // domination.h
  int num_dominators = 1;
  int strong_num_inliers = 1;
  int min_component_nodes = 1;
  // Exact number of nodes to keep, chosen as the best set; 0: as many as domination needs.  REQUIRES: >= 0
  int num_kept = 0;
  // Tries of the local search that makes the set smaller, or of a given size better; 0: none.  REQUIRES: >= 0
  int num_tries = 5000;
  // c of restore_cycles.h, for sets without given size; 0: no cycles are restored.  REQUIRES: >= 0, not 1
  int max_detour_links = 0;
  ConnectedBoundOptions bound;
  // find_ambiguity.h
  AmbiguityOptions ambiguity;
};
OptionTable DescribeOptions(LinkAppearanceOptions* options);

struct LinkAppearanceResult {
  Appearance appearance;
  AppearanceGraph look_alikes;       // of the same nodes: those that look alike and are not linked
  int num_greedy = 0;                // before local search
  std::vector<NodeIdx> undominated;  // where the given size does not suffice
  std::vector<std::string> notes;    // anything unusual about the graph or the set, for people
};

// The links that max_link_distance_m and max_link_turn_deg allow: those of images no farther apart and with
// directions no more different, and of images without a pose.  `capture` may be null where there is no limit.
// Errors: InvalidArgument (a limit, but no poses).
Result<std::vector<AppearanceLink>> NearLinks(const ImageLinks& images, const Capture* capture,
                                              const LinkAppearanceOptions& options);

// The kept nodes of a graph, by the options, without a bound: used for a survey and for each left-out image
// (check_appearance.h).  Roles per node.  `num_greedy` may be null.
std::vector<NodeRole> ChooseKept(const AppearanceGraph& graph, const LinkAppearanceOptions& options,
                                 uint64_t seed, int* num_greedy, Progress* progress = nullptr);

// Pure: no files, no clock; same result for the same seed.  `capture` is for fuse = "place",
// max_link_distance_m and max_link_turn_deg, and may be null.  `progress` may be null.  Errors:
// InvalidArgument (an option; an option that needs poses where there are none), NoData (no image), Cancelled.
Result<LinkAppearanceResult> LinkAppearance(const ImageLinks& images, const Capture* capture,
                                            const LinkAppearanceOptions& options, uint64_t seed,
                                            Progress* progress = nullptr);

}  // namespace cairn::link_appearance
