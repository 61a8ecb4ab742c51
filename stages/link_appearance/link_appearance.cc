#include "stages/link_appearance/link_appearance.h"
#include "core/camera/panorama.h"
#include "core/geometry/pose.h"

#include <algorithm>
#include <map>
#include <optional>

#include "stages/link_appearance/dominating_set/domination.h"
#include "stages/link_appearance/dominating_set/greedy_dominating_set.h"
#include "stages/link_appearance/dominating_set/online_dominating_set.h"
#include "stages/link_appearance/dominating_set/restore_cycles.h"

namespace cairn::link_appearance {
namespace {

DominationOptions DominationOf(const LinkAppearanceOptions& options) {
  return {.num_dominators = options.num_dominators,
          .strong_num_inliers = options.strong_num_inliers,
          .min_component_nodes = options.min_component_nodes};
}

std::vector<NodeIdx> ArriveOneByOne(const AppearanceGraph& graph, int max_num_dropped) {
  OnlineDominatingSet online(max_num_dropped);
  for (NodeIdx node = 0; node < graph.num_nodes(); ++node) {
    std::vector<AppearanceGraph::Neighbour> earlier;
    for (const AppearanceGraph::Neighbour& n : graph.Neighbours(node)) {
      if (n.node < node) earlier.push_back(n);
    }
    online.Add(earlier);
  }
  return online.kept();
}

// A set of exactly num_kept nodes, if there are that many: a dominating set and further nodes where that many
// suffice; otherwise the connected set with the smallest shortfall.
std::vector<NodeIdx> ChooseExactly(const Domination& domination, const LinkAppearanceOptions& options,
                                   const std::vector<NodeIdx>& dominating, uint64_t seed,
                                   Progress* progress) {
  // [Booij06 §VI: asks for it] "the number of images in the pruned set at a fixed size"
  const ImproveOptions improve{.num_tries = options.num_tries};
  const int target = options.num_kept;
  if (static_cast<int>(dominating.size()) <= target) {
    return GreedyDominatingSet(domination, target, dominating);
  }
  return ImproveDominatingSet(domination, GreedyDominatingSet(domination, target), improve, seed, target,
                              progress);
}

Status CheckTogether(const LinkAppearanceOptions& options) {
  if (options.max_detour_links == 1) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "option max_detour_links = 1: expected 0 (no cycles are restored) or at least 2, as two "
                     "kept neighbours of one image are linked by at least one link");
  }
  if (options.algorithm == "all" && options.num_kept > 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "option algorithm = 'all': num_kept must be 0; choose 'greedy' for a given size");
  }
  if (options.algorithm == "online" &&
      (options.num_dominators > 1 || options.strong_num_inliers > 1 || options.num_kept > 0)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "option algorithm = 'online': num_dominators and strong_num_inliers must be 1 and "
                     "num_kept 0; choose 'greedy' for others");
  }
  return Ok();
}

// Most tries of the local search in all components.
int64_t NumTries(const Domination& domination, const LinkAppearanceOptions& options) {
  int64_t num_searches = 0;
  for (const std::vector<NodeIdx>& nodes : domination.components().nodes) num_searches += nodes.size() > 1;
  return num_searches * options.num_tries * (options.num_kept > 0 ? 2 : 1);
}

// The bound of one component; replaces the kept nodes where the search finds fewer.
int BoundComponent(const AppearanceGraph& graph, const LinkAppearanceOptions& options, Progress* progress,
                   std::vector<NodeIdx>* kept) {
  const Domination domination(graph, DominationOf(options));
  const ConnectedBound bound = BoundConnectedSet(domination, *kept, options.bound, progress);
  if (!bound.smaller.empty()) *kept = bound.smaller;
  return bound.lower_bound;
}

// Bounds all components; where no size is given, better sets replace the kept ones.
void BoundAll(const Domination& domination, const LinkAppearanceOptions& options, Progress* progress,
              Appearance* appearance) {
  const AppearanceComponents& components = domination.components();
  for (const std::vector<NodeIdx>& nodes : components.nodes) {
    if (progress) progress->Advance();
    if (!domination.IsIn(nodes[0])) {
      appearance->lower_bounds.push_back(0);
      continue;
    }
    const AppearanceGraph graph = InducedSubgraph(domination.graph(), nodes);
    const Domination part(graph, DominationOf(options));
    std::vector<NodeIdx> kept;
    for (size_t i = 0; i < nodes.size(); ++i) {
      if (appearance->nodes[nodes[i]].role == NodeRole::kDominating) kept.push_back(static_cast<NodeIdx>(i));
    }
    // With a given size the set may not dominate, or may be larger than needed: the bound is for a
    // dominating set.
    const bool is_chosen = options.num_kept == 0 && options.algorithm != "all";
    if (!is_chosen) kept = GreedyDominatingSet(part);
    const size_t size_before = kept.size();
    appearance->lower_bounds.push_back(BoundComponent(graph, options, progress, &kept));
    if (!is_chosen || kept.size() == size_before) continue;
    for (const NodeIdx node : nodes) appearance->nodes[node].role = NodeRole::kDropped;
    for (const NodeIdx node : kept) appearance->nodes[nodes[node]].role = NodeRole::kDominating;
  }
}

void Restore(const AppearanceGraph& graph, int c, std::vector<NodeRole>* roles) {
  std::vector<NodeIdx> kept;
  for (NodeIdx node = 0; node < graph.num_nodes(); ++node) {
    if ((*roles)[node] != NodeRole::kDropped) kept.push_back(node);
  }
  for (const NodeIdx node : RestoreCycles(graph, kept, c)) (*roles)[node] = NodeRole::kRestored;
}

void AddNotes(const Domination& domination, const LinkAppearanceOptions& options,
              LinkAppearanceResult* result) {
  const int num_nodes = domination.graph().num_nodes();
  const auto& components = domination.components().nodes;
  const auto alone = std::count_if(components.begin(), components.end(),
                                   [](const std::vector<NodeIdx>& nodes) { return nodes.size() == 1; });
  std::vector<std::string>& notes = result->notes;
  if (domination.graph().num_links() == 0 && num_nodes > 1) {
    notes.push_back(fmt::format("no two of the {} nodes are linked by {} inliers: each is alone", num_nodes,
                                options.min_num_inliers));
  } else if (components.size() > 1) {
    notes.push_back(
        fmt::format("the graph has {} components, {} of them of one node; no path leads from one "
                    "to another",
                    components.size(), alone));
  }
  if (options.num_kept > num_nodes) {
    notes.push_back(fmt::format("num_kept = {}: there are {} nodes", options.num_kept, num_nodes));
  }
  if (!result->undominated.empty()) {
    const int needed = result->appearance.LowerBound();
    notes.push_back(fmt::format(
        "num_kept = {} leaves {} of {} nodes without enough kept neighbours{}", options.num_kept,
        result->undominated.size(), num_nodes,
        needed > options.num_kept ? fmt::format("; at least {} would be needed", needed) : std::string()));
  }
}

// Nodes with a look-alike link and no other.
AppearanceGraph LookAlikesOf(const ImageLinks& images, const std::vector<NodeIdx>& node_of_image,
                             const AppearanceGraph& linked) {
  std::vector<AppearanceLink> links = FusedGraph(images.look_alikes, node_of_image).Links();
  std::erase_if(links, [&](const AppearanceLink& link) { return linked.AreLinked(link.node1, link.node2); });
  return {linked.num_nodes(), std::move(links)};
}

}  // namespace

Result<std::vector<AppearanceLink>> NearLinks(const ImageLinks& images, const Capture* capture,
                                              const LinkAppearanceOptions& options) {
  const bool is_limited = options.max_link_distance_m > 0 || options.max_link_turn_deg < 180;
  if (!is_limited) return images.links;
  std::map<std::string, Pose> poses;
  if (capture != nullptr) {
    for (const CaptureImage& image : capture->images) {
      if (image.cam_from_world) poses.emplace(image.name, *image.cam_from_world);
    }
  }
  if (poses.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "max_link_distance_m and max_link_turn_deg need the capture's poses, and there are "
                     "none; give --capture with poses, or leave them out");
  }
  std::vector<std::optional<Pose>> pose_of;
  for (const DatabaseImage& image : images.images) pose_of.push_back(FindPose(poses, image.name));
  std::vector<AppearanceLink> near;
  for (const AppearanceLink& link : images.links) {
    const std::optional<Pose>&a = pose_of[link.node1], &b = pose_of[link.node2];
    if (a && b) {
      if (options.max_link_distance_m > 0 && CenterErrorM(*a, *b) > options.max_link_distance_m) continue;
      if (RotationErrorDeg(*a, *b) > options.max_link_turn_deg) continue;
    }
    near.push_back(link);
  }
  return near;
}

OptionTable DescribeOptions(LinkAppearanceOptions* options) {
  ConnectedBoundOptions& bound = options->bound;
  OptionTable table = {
      {"min_num_inliers", &options->min_num_inliers, "fewest verified inliers of a link", 1},
      {"max_link_distance_m", &options->max_link_distance_m,
       "images that stand farther apart are not linked, by the capture's poses, m; 0: any", 0},
      {"max_link_turn_deg", &options->max_link_turn_deg,
       "images whose directions differ by more are not linked, by the capture's poses, degrees", 0, 180},
      {.name = "fuse",
       .value = &options->fuse,
       .help =
           "images that are one node: none, name: equal up to the last '_', place: taken within same_place_m",
       .choices = {"none", "name", "place"}},
      {"same_place_m", &options->same_place_m, "images within this distance were taken at one place, m",
       1e-6},
      {.name = "algorithm",
       .value = &options->algorithm,
       .help =
           "how nodes are chosen: greedy [Booij06], online: one by one in the order of their numbers, all: "
           "every node is kept",
       .choices = {"greedy", "online", "all"}},
      {"max_num_dropped", &options->max_num_dropped, "online: most kept nodes that an arrival drops", 0},
      {"num_dominators", &options->num_dominators,
       "number of kept neighbours of every other node that has as many neighbours [Booij06: 1]", 1},
      {"strong_num_inliers", &options->strong_num_inliers,
       "links of fewer inliers count in proportion; 1: all links count alike [Booij06: 1]", 1},
      {"min_component_nodes", &options->min_component_nodes,
       "no nodes are kept of components with fewer nodes than this", 1},
      {"num_kept", &options->num_kept, "exact number of nodes to keep; 0: as many as are needed", 0},
      {"num_tries", &options->num_tries, "tries of the local search for a better set; 0: none", 0},
      {"max_detour_links", &options->max_detour_links,
       "cycles are restored until kept neighbours of neighbours are fewer links apart than this; 0: none are "
       "restored [Booij06: c]",
       0},
      {.name = "lower_bound",
       .value = &bound.lower_bound,
       .help = "bound on the size: counting, program: an integer program, auto: program for components of "
               "few links",
       .choices = {"auto", "counting", "program", "none"}},
      {"max_num_program_links", &bound.max_num_program_links,
       "auto: most links of a component with a program", 0},
      {"max_num_cut_rounds", &bound.max_num_cut_rounds, "program: most rounds of cuts before branching", 0},
      {"max_num_branches", &bound.max_num_branches,
       "program: most parts of the search that fixes images; 0: none", 0},
  };
  const OptionTable ambiguity = DescribeOptions(&options->ambiguity);
  table.insert(table.end(), ambiguity.begin(), ambiguity.end());
  AddCondition({"fuse", {"place"}}, {"same_place_m"}, &table);
  AddCondition({"algorithm", {"online"}}, {"max_num_dropped"}, &table);
  AddCondition({"algorithm", {"greedy"}}, {"num_tries"}, &table);
  AddCondition({"num_kept", {"0"}}, {"max_detour_links"}, &table);
  AddCondition({"lower_bound", {"auto"}}, {"max_num_program_links"}, &table);
  AddCondition({"lower_bound", {"auto", "program"}}, {"max_num_cut_rounds", "max_num_branches"}, &table);
  AddCondition({"max_num_confusable", {"not 0"}}, {"confusable_score_ratio", "confusable_distance_m"},
               &table);
  return table;
}

std::vector<NodeRole> ChooseKept(const AppearanceGraph& graph, const LinkAppearanceOptions& options,
                                 uint64_t seed, int* num_greedy, Progress* progress) {
  if (options.algorithm == "all") {
    if (num_greedy) *num_greedy = graph.num_nodes();
    return std::vector<NodeRole>(graph.num_nodes(), NodeRole::kDominating);
  }
  const Domination domination(graph, DominationOf(options));
  std::vector<NodeIdx> kept = options.algorithm == "online" ? ArriveOneByOne(graph, options.max_num_dropped)
                                                            : GreedyDominatingSet(domination);
  std::erase_if(kept, [&](NodeIdx node) { return !domination.IsIn(node); });
  if (num_greedy) *num_greedy = static_cast<int>(kept.size());
  if (options.num_tries > 0 && options.algorithm == "greedy") {
    kept = ImproveDominatingSet(domination, kept, {.num_tries = options.num_tries}, seed, -1, progress);
  }
  if (options.num_kept > 0) kept = ChooseExactly(domination, options, kept, seed, progress);
  std::vector<NodeRole> roles(graph.num_nodes(), NodeRole::kDropped);
  for (const NodeIdx node : kept) roles[node] = NodeRole::kDominating;
  if (options.max_detour_links > 0 && options.num_kept == 0) Restore(graph, options.max_detour_links, &roles);
  return roles;
}

Result<LinkAppearanceResult> LinkAppearance(const ImageLinks& images, const Capture* capture,
                                            const LinkAppearanceOptions& options, uint64_t seed,
                                            Progress* progress) {
  LinkAppearanceOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_RETURN_IF_ERROR(CheckTogether(options));
  if (images.images.empty()) {
    return MakeError(ErrorCode::kNoData, "no image: expected a database of matched images");
  }
  CAIRN_ASSIGN_OR_RETURN(const std::vector<NodeIdx> node_of_image,
                         FuseImages(images.images, options.fuse, options.same_place_m, capture));
  LinkAppearanceResult result;
  Appearance& appearance = result.appearance;
  CAIRN_ASSIGN_OR_RETURN(const std::vector<AppearanceLink> links, NearLinks(images, capture, options));
  appearance.graph = FusedGraph(links, node_of_image);
  result.look_alikes = LookAlikesOf(images, node_of_image, appearance.graph);
  appearance.num_dominators = options.num_dominators;
  appearance.strong_num_inliers = options.strong_num_inliers;
  appearance.max_detour_links = options.num_kept == 0 ? options.max_detour_links : 0;
  const Domination domination(appearance.graph, DominationOf(options));
  appearance.nodes.resize(appearance.graph.num_nodes());
  for (size_t i = 0; i < node_of_image.size(); ++i) {
    appearance.nodes[node_of_image[i]].images.push_back(images.images[i].image_id);
  }
  // The bound is that of dominating sets, before cycles are restored.
  LinkAppearanceOptions without_cycles = options;
  without_cycles.max_detour_links = 0;
  const auto is_cancelled = [&] { return progress && progress->Cancelled(); };
  const Error cancelled = MakeError(ErrorCode::kCancelled, "linking images was stopped");
  if (progress) progress->Begin("choose images", NumTries(domination, options), "tries");
  std::vector<NodeRole> roles =
      ChooseKept(appearance.graph, without_cycles, seed, &result.num_greedy, progress);
  if (progress) progress->End();
  if (is_cancelled()) return cancelled;
  for (size_t i = 0; i < roles.size(); ++i) {
    appearance.nodes[i].component = domination.components().component_of[i];
    appearance.nodes[i].role = roles[i];
  }
  const auto num_components = static_cast<int64_t>(domination.components().nodes.size());
  if (progress) progress->Begin("bound", num_components, "components");
  BoundAll(domination, options, progress, &appearance);
  if (progress) progress->End();
  if (is_cancelled()) return cancelled;
  if (appearance.max_detour_links > 0) {
    for (size_t i = 0; i < roles.size(); ++i) roles[i] = appearance.nodes[i].role;
    Restore(appearance.graph, appearance.max_detour_links, &roles);
    for (size_t i = 0; i < roles.size(); ++i) appearance.nodes[i].role = roles[i];
  }
  result.undominated = domination.Undominated(NodeMarks(appearance.graph.num_nodes(), appearance.Kept()));
  AddNotes(domination, options, &result);
  return result;
}

}  // namespace cairn::link_appearance
