#include "stages/link_appearance/check_appearance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/base/parallel.h"
#include "core/base/progress.h"
#include "stages/link_appearance/dominating_set/domination.h"
#include "stages/link_appearance/dominating_set/greedy_dominating_set.h"

namespace cairn::link_appearance {
namespace {

// A kind of chosen set: one that meets its demands, or the order of a curve.
struct Kind {
  std::string name;
  LinkAppearanceOptions options;
};

std::vector<Kind> SetKinds(const LinkAppearanceOptions& base, const CheckAppearanceOptions& options) {
  std::vector<Kind> kinds;
  LinkAppearanceOptions plain = base;
  plain.num_kept = 0;
  LinkAppearanceOptions greedy = plain;
  greedy.num_dominators = 1;
  greedy.strong_num_inliers = 1;
  greedy.num_tries = 0;
  greedy.max_detour_links = 0;
  greedy.algorithm = "greedy";
  kinds.push_back({"greedy", greedy});
  LinkAppearanceOptions online = greedy;
  online.algorithm = "online";
  kinds.push_back({"one by one", online});
  for (int m = 1; m <= options.max_num_dominators; ++m) {
    LinkAppearanceOptions improved = greedy;
    improved.num_tries = base.num_tries;
    improved.num_dominators = m;
    kinds.push_back({m == 1 ? "improved" : fmt::format("{}-fold, improved", m), improved});
  }
  LinkAppearanceOptions weighted = greedy;
  weighted.num_tries = base.num_tries;
  weighted.strong_num_inliers = options.weighted_num_inliers;
  kinds.push_back({"weighted, improved", weighted});
  if (base.num_kept > 0) {
    LinkAppearanceOptions exact = base;
    exact.algorithm = "greedy";
    kinds.push_back({fmt::format("exactly {}", base.num_kept), exact});
  } else if (base.num_dominators > 1 || base.strong_num_inliers > 1) {
    LinkAppearanceOptions asked = greedy;
    asked.num_tries = base.num_tries;
    asked.num_dominators = base.num_dominators;
    asked.strong_num_inliers = base.strong_num_inliers;
    kinds.push_back({"as asked", asked});
  }
  return kinds;
}

std::vector<Kind> CurveKinds(const LinkAppearanceOptions& base, const CheckAppearanceOptions& options) {
  LinkAppearanceOptions greedy = base;
  greedy.num_dominators = 1;
  greedy.strong_num_inliers = 1;
  LinkAppearanceOptions weighted = greedy;
  weighted.strong_num_inliers = options.weighted_num_inliers;
  LinkAppearanceOptions twofold = greedy;
  twofold.num_dominators = 2;
  return {{"greedy", greedy}, {"weighted", weighted}, {"2-fold", twofold}};
}

// Probability that `num_kept` random nodes of `num_nodes` contain one of `num_linked`.
double ChanceOfRandom(int num_nodes, int num_linked, double num_kept) {
  const int k = static_cast<int>(std::lround(num_kept));
  double none = 1;
  for (int i = 0; i < num_linked; ++i) none *= std::max(0.0, 1 - static_cast<double>(k) / (num_nodes - i));
  return 1 - none;
}

// The sets of one graph: the marks of each kind, and each node's position in each curve's order.
struct ChosenSets {
  std::vector<std::vector<char>> kept;
  std::vector<int> num_kept;
  std::vector<std::vector<int>> position;
};

ChosenSets Choose(const AppearanceGraph& graph, NodeIdx left_out, const std::vector<Kind>& sets,
                  const std::vector<Kind>& curves, int max_size, uint64_t seed, Progress& progress) {
  ChosenSets chosen;
  CancelOnly quiet(progress);  // only left-out images are reported, not the tries of each search
  std::vector<NodeIdx> others;
  for (NodeIdx node = 0; node < graph.num_nodes(); ++node) {
    if (node != left_out) others.push_back(node);
  }
  for (const Kind& kind : sets) {
    // A set of a given size is chosen from the others: the left-out node stands alone by now, and would be
    // kept.
    const bool is_of_others = left_out >= 0 && kind.options.num_kept > 0;
    const std::vector<NodeRole> roles = ChooseKept(is_of_others ? InducedSubgraph(graph, others) : graph,
                                                   kind.options, seed, nullptr, &quiet);
    std::vector<char> kept(graph.num_nodes(), 0);
    int num_kept = 0;
    for (size_t i = 0; i < roles.size(); ++i) {
      const NodeIdx node = is_of_others ? others[i] : static_cast<NodeIdx>(i);
      kept[node] = node != left_out && roles[i] != NodeRole::kDropped;
      num_kept += kept[node];
    }
    chosen.kept.push_back(std::move(kept));
    chosen.num_kept.push_back(num_kept);
  }
  for (const Kind& kind : curves) {
    const Domination domination(graph, {.num_dominators = kind.options.num_dominators,
                                        .strong_num_inliers = kind.options.strong_num_inliers,
                                        .min_component_nodes = kind.options.min_component_nodes});
    std::vector<int> position(graph.num_nodes(), graph.num_nodes());
    int next = 0;
    for (const NodeIdx node : GreedyDominatingSet(domination, max_size + 1)) {
      if (node != left_out) position[node] = next++;
    }
    chosen.position.push_back(std::move(position));
  }
  return chosen;
}

struct Outcome {
  std::vector<char> by_set;            // per kind: localized
  std::vector<int> num_kept;           // per kind
  std::vector<int> position_by_curve;  // of the first node that locates the image
};

Outcome Locate(const LeftOutImage& image, const ChosenSets& chosen) {
  Outcome outcome;
  outcome.num_kept = chosen.num_kept;
  // [Booij06 §V-A] localized: "a link in the original graph to one of the nodes in the computed CDS"
  for (const std::vector<char>& kept : chosen.kept) {
    outcome.by_set.push_back(
        std::any_of(image.linked.begin(), image.linked.end(), [&](NodeIdx node) { return kept[node] != 0; }));
  }
  for (const std::vector<int>& position : chosen.position) {
    int first = std::numeric_limits<int>::max();
    for (const NodeIdx node : image.linked) first = std::min(first, position[node]);
    outcome.position_by_curve.push_back(first);
  }
  return outcome;
}

void Summarize(const std::vector<LeftOutImage>& left_out, const std::vector<Outcome>& outcomes,
               AppearanceCheck* check) {
  const double num_images = static_cast<double>(outcomes.size());
  const auto expected_of_random = [&](double num_kept) {
    double sum = 0;
    for (const LeftOutImage& image : left_out) {
      sum += ChanceOfRandom(check->num_nodes, static_cast<int>(image.linked.size()), num_kept);
    }
    return sum;
  };
  for (size_t kind = 0; kind < check->set_names.size(); ++kind) {
    AppearanceFigure figure;
    for (const Outcome& outcome : outcomes) {
      figure.num_kept += outcome.num_kept[kind] / num_images;
      figure.num_localized += outcome.by_set[kind];
    }
    figure.num_by_random = expected_of_random(figure.num_kept);
    check->sets.push_back(figure);
    std::vector<std::string>& missed = check->missed.emplace_back();
    for (size_t i = 0; i < outcomes.size(); ++i) {
      if (outcomes[i].by_set[kind] == 0 && !left_out[i].linked.empty()) missed.push_back(left_out[i].name);
    }
  }
  for (size_t kind = 0; kind < check->curve_names.size(); ++kind) {
    std::vector<AppearanceFigure>& curve = check->curves.emplace_back();
    for (const int size : check->sizes) {
      AppearanceFigure figure{.num_kept = static_cast<double>(size)};
      for (const Outcome& outcome : outcomes) {
        figure.num_localized += outcome.position_by_curve[kind] < size;
      }
      figure.num_by_random = expected_of_random(size);
      curve.push_back(figure);
    }
  }
}

}  // namespace

OptionTable DescribeOptions(CheckAppearanceOptions* options) {
  return {
      {"kept_ratios", &options->kept_ratios, "sizes of the curve's sets, as parts of the nodes", 0, 1},
      {"weighted_num_inliers", &options->weighted_num_inliers,
       "weighted sets: links of fewer inliers count in proportion", 1},
      {"max_num_dominators", &options->max_num_dominators, "m-fold domination is checked up to this m", 1},
  };
}

std::vector<LeftOutImage> EachNodeLeftOut(const AppearanceGraph& graph) {
  std::vector<LeftOutImage> left_out(graph.num_nodes());
  for (NodeIdx node = 0; node < graph.num_nodes(); ++node) {
    left_out[node].node = node;
    for (const AppearanceGraph::Neighbour& n : graph.Neighbours(node))
      left_out[node].linked.push_back(n.node);
  }
  return left_out;
}

Result<AppearanceCheck> CheckAppearance(const AppearanceGraph& graph,
                                        const std::vector<LeftOutImage>& left_out,
                                        const LinkAppearanceOptions& link_options,
                                        const CheckAppearanceOptions& options, uint64_t seed, int num_threads,
                                        Progress& progress) {
  CheckAppearanceOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (left_out.empty()) return MakeError(ErrorCode::kNoData, "no image is left out: nothing to check");
  if (graph.num_nodes() == 0)
    return MakeError(ErrorCode::kNoData, "all images are held out: no survey images are left to choose from");
  AppearanceCheck check;
  const bool is_of_graph = left_out[0].node >= 0;
  check.num_nodes = graph.num_nodes() - (is_of_graph ? 1 : 0);
  check.num_left_out = static_cast<int>(left_out.size());
  for (const LeftOutImage& image : left_out) check.num_linked += !image.linked.empty();
  for (const double ratio : options.kept_ratios) {
    check.sizes.push_back(std::max(1, static_cast<int>(std::lround(ratio * check.num_nodes))));
  }
  std::sort(check.sizes.begin(), check.sizes.end());
  check.sizes.erase(std::unique(check.sizes.begin(), check.sizes.end()), check.sizes.end());
  const std::vector<Kind> sets = SetKinds(link_options, options), curves = CurveKinds(link_options, options);
  for (const Kind& kind : sets) check.set_names.push_back(kind.name);
  for (const Kind& kind : curves) check.curve_names.push_back(kind.name);
  const int max_size = check.sizes.empty() ? 0 : *std::max_element(check.sizes.begin(), check.sizes.end());

  std::vector<Outcome> outcomes(left_out.size());
  progress.Begin("leave out", static_cast<int64_t>(left_out.size()), "images");
  if (is_of_graph) {
    ParallelFor(static_cast<int64_t>(left_out.size()), num_threads, [&](int64_t i) {
      if (progress.Cancelled()) return;
      // [Booij06 §V-A] one node with its links is left out, the set is computed of the rest
      const AppearanceGraph rest = WithoutLinksOf(graph, left_out[i].node);
      outcomes[i] =
          Locate(left_out[i], Choose(rest, left_out[i].node, sets, curves, max_size, seed, progress));
      progress.Advance();
    });
  } else {
    const ChosenSets chosen = Choose(graph, -1, sets, curves, max_size, seed, progress);
    for (size_t i = 0; i < left_out.size(); ++i) outcomes[i] = Locate(left_out[i], chosen);
  }
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "leaving images out was stopped");
  Summarize(left_out, outcomes, &check);
  return check;
}

Result<HeldOutSplit> HoldOut(const ImageLinks& images, const std::vector<std::string>& names) {
  std::map<std::string, bool> wanted;  // whether an image of this name, or in this folder, was found
  for (const std::string& name : names) wanted[name] = false;
  const auto is_wanted = [&](const std::string& name) {
    bool found = false;
    const auto meet = [&](const std::string& whole) {
      const auto it = wanted.find(whole);
      if (it == wanted.end()) return;
      it->second = true;
      found = true;
    };
    meet(name);
    for (size_t end = name.find('/'); end != std::string::npos; end = name.find('/', end + 1)) {
      meet(name.substr(0, end + 1));
    }
    return found;
  };
  std::vector<int> held_out(images.images.size(), -1), survey(images.images.size(), -1);
  std::vector<char> is_survey(images.images.size(), 0);
  std::map<std::string, int> held_out_of_name;
  int num_survey = 0;
  for (size_t i = 0; i < images.images.size(); ++i) {
    const std::string name = CapturedName(images.images[i].name);
    is_survey[i] = !is_wanted(name);
    if (is_survey[i]) {
      survey[i] = num_survey++;
    } else {
      held_out[i] = held_out_of_name.emplace(name, static_cast<int>(held_out_of_name.size())).first->second;
    }
  }
  for (const auto& [name, is_met] : wanted) {
    if (is_met) continue;
    return MakeError(ErrorCode::kNotFound,
                     "held-out image {} is not in the database of matches; match it with the survey's", name);
  }
  HeldOutSplit split{.survey = SubsetOf(images, is_survey), .names = {}, .linked = {}};
  split.linked.resize(held_out_of_name.size());
  split.names.resize(held_out_of_name.size());
  for (const auto& [name, index] : held_out_of_name) split.names[index] = name;
  for (const AppearanceLink& link : images.links) {
    if (is_survey[link.node1] == is_survey[link.node2]) continue;
    const auto [inside, outside] =
        is_survey[link.node1] ? std::pair(link.node1, link.node2) : std::pair(link.node2, link.node1);
    split.linked[held_out[outside]].push_back(survey[inside]);
  }
  for (std::vector<int>& linked : split.linked) {
    std::sort(linked.begin(), linked.end());
    linked.erase(std::unique(linked.begin(), linked.end()), linked.end());
  }
  return split;
}

}  // namespace cairn::link_appearance
