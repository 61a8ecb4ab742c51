#include "runtime/drive/start_hypotheses.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>

#include "core/vocabulary/document_scores.h"
#include "core/world/appearance_graph.h"
#include "runtime/drive/joint_way.h"
#include "runtime/map/appearance_map.h"

namespace cairn {
namespace {

// [Mariottini11 fn 5] X_1: "nodes in the graph connected with X_0 up to distance 2", itself among them.
std::vector<NodeIdx> WithinReach(const AppearanceGraph& graph, NodeIdx start, int num_links) {
  std::set<NodeIdx> reached = {start};
  std::vector<NodeIdx> front = {start};
  for (int i = 0; i < num_links && !front.empty(); ++i) {
    std::vector<NodeIdx> next;
    for (const NodeIdx node : front) {
      for (const AppearanceGraph::Neighbour& neighbour : graph.Neighbours(node)) {
        if (reached.insert(neighbour.node).second) next.push_back(neighbour.node);
      }
    }
    front = std::move(next);
  }
  return {reached.begin(), reached.end()};
}

// The nodes that may be the start, best score first: each stands for those near to it.
std::vector<NodeIdx> Candidates(const AppearanceGraph& graph, const std::vector<double>& scores,
                                const StartHypothesesOptions& options) {
  const std::vector<NodeIdx> order = BestFirst(scores);
  // [Mariottini11 fn 4] a percentage of the maximum: of the scores, before they become probabilities
  const double min_score = options.min_score_ratio * scores[order[0]];
  std::vector<char> is_taken(scores.size(), 0);
  std::vector<NodeIdx> candidates;
  for (const NodeIdx node : order) {
    if (scores[node] < min_score || static_cast<int>(candidates.size()) == options.max_num_hypotheses) break;
    if (is_taken[node]) continue;
    candidates.push_back(node);
    for (const NodeIdx near : WithinReach(graph, node, options.reach_links)) is_taken[near] = 1;
  }
  return candidates;
}

// The values at some bins, scaled to sum to 1.
std::vector<double> Restrict(const std::vector<double>& probabilities, const std::vector<NodeIdx>& bins) {
  std::vector<double> part;
  double sum = 0;
  for (const NodeIdx bin : bins) sum += part.emplace_back(probabilities[bin]);
  for (double& p : part) p = sum > 0 ? p / sum : 1.0 / static_cast<double>(bins.size());
  return part;
}

}  // namespace

const char* VerdictName(HypothesisVerdict verdict) {
  switch (verdict) {
    case HypothesisVerdict::kFollow:
      return "follow";
    case HypothesisVerdict::kSwitch:
      return "switch";
    case HypothesisVerdict::kLost:
      break;
  }
  return "lost";
}

OptionTable DescribeOptions(StartHypothesesOptions* options) {
  OptionTable table = {
      {.name = "min_score_ratio",
       .value = &options->min_score_ratio,
       .help = "places that score at least this part of the best score may be the start",
       .min = 1e-3,
       .max = 1},
      {.name = "max_num_hypotheses",
       .value = &options->max_num_hypotheses,
       .help = "most starts that are considered",
       .min = 1},
      {.name = "reach_links",
       .value = &options->reach_links,
       .help = "links that the robot may pass between two images; candidates nearer than that are one place",
       .min = 1},
      {.name = "compared_nodes",
       .value = &options->compared_nodes,
       .help = "places over which an image's distribution is compared with the expected one",
       .choices = {"all", "reachable"}},
      {.name = "uniform_ratio",
       .value = &options->uniform_ratio,
       .help = "part of a uniform distribution that is mixed into both compared distributions",
       .min = 1e-9,
       .max = 1},
      {.name = "switch_margin",
       .value = &options->switch_margin,
       .help = "margin of posterior by which another start must lead before the robot turns back for it",
       .min = 0,
       .max = 1},
      {.name = "switching",
       .value = &options->switching,
       .help = "turn back when another start is likelier; off: the first choice is followed to its end"},
      {.name = "on_switch",
       .value = &options->on_switch,
       .help = "retrace: go back to the start first; replan: go on from where the robot would be by now",
       .choices = {"retrace", "replan"}},
      {.name = "first_choice",
       .value = &options->first_choice,
       .help = "start that is followed first: the one whose way has least entropy, or that scores best",
       .choices = {"entropy", "score"}},
      {.name = "way_cost",
       .value = &options->way_cost,
       .help = "ways are compared by the total of their links, or by their mean",
       .choices = {"total", "mean"}},
      {.name = "min_reachable_ratio",
       .value = &options->min_reachable_ratio,
       .help = "smallest probability of the places within reach, by an image; with less the robot was "
               "carried away; 0: not checked",
       .min = 0,
       .max = 1},
  };
  const OptionTable route = DescribeOptions(&options->route);
  table.insert(table.end(), route.begin(), route.end());
  return table;
}

Result<StartHypotheses> StartHypotheses::Make(const PlaceModel& model, const PlaceScores& first, NodeIdx goal,
                                              const StartHypothesesOptions& options) {
  StartHypothesesOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (goal < 0 || goal >= model.num_nodes() ||
      first.scores.size() != static_cast<size_t>(model.num_nodes())) {
    return MakeError(ErrorCode::kInvalidArgument, "start: goal {} and {} scores for {} places", goal,
                     first.scores.size(), model.num_nodes());
  }
  if (*std::max_element(first.scores.begin(), first.scores.end()) <= 0) {
    return MakeError(ErrorCode::kNoData,
                     "start: the first image shares no visual word with the map; turn the camera to "
                     "something with more texture");
  }
  StartHypotheses result(model, goal, options);
  const std::vector<NodeIdx> candidates = Candidates(model.appearance().graph, first.scores, options);
  CAIRN_ASSIGN_OR_RETURN(const auto paths,
                         FindPaths(model.appearance(), model.node_poses(), candidates, goal, options.route));
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (!paths[i]) continue;
    result.hypotheses_.push_back(
        {.start = candidates[i], .score = first.scores[candidates[i]], .path = *paths[i]});
  }
  if (result.hypotheses_.empty()) {
    return MakeError(
        ErrorCode::kNotFound,
        "start: no way over kept images leads to the goal from any of the {} places that the first image "
        "may show; survey the way between them",
        candidates.size());
  }
  // [Mariottini11 eq. 3] the prior p(X_0 | Z_0) is uniform over the candidates
  for (StartHypothesis& hypothesis : result.hypotheses_)
    hypothesis.posterior = 1.0 / static_cast<double>(result.hypotheses_.size());
  const std::vector<double> costs = result.PlanWays();
  // [Mariottini11 §V] of the ways from all candidates the one of least entropy is followed
  result.followed_ = static_cast<int>(std::min_element(costs.begin(), costs.end()) - costs.begin());
  result.Restart();
  return result;
}

std::vector<double> StartHypotheses::PlanWays() {
  std::vector<double> costs;
  const bool is_mean = options_.way_cost == "mean";
  for (const StartHypothesis& hypothesis : hypotheses_)
    costs.push_back(is_mean ? hypothesis.path.MeanCost() : hypothesis.path.cost);
  if (options_.route.weight == "risk") {
    std::vector<PossibleStart> starts;
    for (const StartHypothesis& hypothesis : hypotheses_)
      starts.push_back({hypothesis.start, hypothesis.posterior});
    const std::vector<JointWay> ways = FindJointWays(model_.appearance(), model_.node_poses(), starts, goal_,
                                                     options_.route, options_.on_switch == "replan");
    for (size_t i = 0; i < ways.size(); ++i) {
      hypotheses_[i].path = ways[i].path;
      costs[i] = is_mean ? ways[i].path.MeanCost() : ways[i].expected_cost;
    }
  }
  if (options_.first_choice == "score") {
    for (size_t i = 0; i < costs.size(); ++i) costs[i] = -hypotheses_[i].score;
  }
  return costs;
}

void StartHypotheses::Restart() {
  num_images_ = 0;
  beliefs_.clear();
  for (const StartHypothesis& hypothesis : hypotheses_)
    beliefs_.push_back({{hypothesis.start, hypothesis.posterior}});
}

const std::vector<NodeIdx>& StartHypotheses::Reach(NodeIdx node) {
  const auto found = reach_.find(node);
  if (found != reach_.end()) return found->second;
  return reach_[node] = WithinReach(model_.appearance().graph, node, options_.reach_links);
}

double StartHypotheses::LogLikelihood(const std::vector<double>& seen, NodeIdx node,
                                      const std::vector<NodeIdx>& bins) {
  auto found = expected_.find(node);
  if (found == expected_.end()) found = expected_.emplace(node, model_.Expected(node)).first;
  // [Mariottini11 eq. 6] J between what is seen, h, and what is expected at the node, h'
  const double divergence = JeffreyDivergence(
      seen, bins.empty() ? found->second : Restrict(found->second, bins), options_.uniform_ratio);
  // [Mariottini11 eq. 8] p(Z | X) = exp(-J^2 / 2) / sqrt(2 pi), as its logarithm
  return -divergence * divergence / 2 - 0.5 * std::log(2 * std::numbers::pi);
}

StartHypotheses::Belief StartHypotheses::Predict(const Belief& belief) {
  Belief predicted;
  for (const auto& [node, probability] : belief) {
    const std::vector<NodeIdx>& reach = Reach(node);
    // [Mariottini11 eq. 4] p(X_1 | X_0), uniform over the nodes within reach; what comes to X_1 from several
    // nodes adds up, and the source's sum, over X_1, is in Normalise
    for (const NodeIdx next : reach) predicted[next] += probability / static_cast<double>(reach.size());
  }
  return predicted;
}

HypothesisVerdict StartHypotheses::Observe(const PlaceScores& image) {
  std::set<NodeIdx> reachable;
  for (Belief& belief : beliefs_) {
    belief = Predict(belief);
    for (const auto& [node, probability] : belief) reachable.insert(node);
  }
  // [Mariottini11 eq. 7] the sum's domain, which the source leaves open
  std::vector<NodeIdx> bins;  // none: all
  if (options_.compared_nodes == "reachable") bins.assign(reachable.begin(), reachable.end());
  const std::vector<double> seen = bins.empty() ? image.probabilities : Restrict(image.probabilities, bins);
  std::map<NodeIdx, double> log_likelihood;
  double largest = -std::numeric_limits<double>::infinity();
  double reachable_ratio = 0;
  for (const NodeIdx node : reachable) {
    log_likelihood[node] = LogLikelihood(seen, node, bins);
    reachable_ratio += image.probabilities[node];
  }
  for (const Belief& belief : beliefs_) {
    for (const auto& [node, probability] : belief) {
      if (probability > 0) largest = std::max(largest, log_likelihood[node]);
    }
  }
  for (Belief& belief : beliefs_) {
    // [Mariottini11 eq. 5] times p(Z_1 | X_1): image by image as they come, not recursively from the last.
    // Relative to the largest, since distributions that share nothing have likelihoods below the smallest
    // double.
    for (auto& [node, probability] : belief) probability *= std::exp(log_likelihood[node] - largest);
  }
  Normalise();
  ++num_images_;
  if (reachable_ratio < options_.min_reachable_ratio) return HypothesisVerdict::kLost;
  // [Mariottini11 §VI] the posterior's peak; the source has no switch_margin
  int best = followed_;
  for (int i = 0; i < static_cast<int>(hypotheses_.size()); ++i) {
    if (hypotheses_[i].posterior > hypotheses_[best].posterior) best = i;
  }
  if (!options_.switching || best == followed_ ||
      hypotheses_[best].posterior - hypotheses_[followed_].posterior < options_.switch_margin)
    return HypothesisVerdict::kFollow;
  followed_ = best;
  return HypothesisVerdict::kSwitch;
}

bool StartHypotheses::Refute() {
  int best = -1;
  for (int i = 0; i < static_cast<int>(hypotheses_.size()); ++i) {
    if (i == followed_ || hypotheses_[i].posterior <= 0) continue;
    if (best < 0 || hypotheses_[i].posterior > hypotheses_[best].posterior) best = i;
  }
  if (best < 0) return false;
  for (auto& [node, probability] : beliefs_[followed_]) probability = 0;
  followed_ = best;
  Normalise();
  return true;
}

void StartHypotheses::Normalise() {
  double sum = 0;
  std::vector<double> sums;
  for (const Belief& belief : beliefs_) {
    // [Mariottini11 eq. 4] the sum over X_1; after T images over X_T, as the sums before it have been taken
    double of_hypothesis = 0;
    for (const auto& [node, probability] : belief) of_hypothesis += probability;
    sums.push_back(of_hypothesis);
    sum += of_hypothesis;
  }
  for (size_t i = 0; i < beliefs_.size(); ++i) {
    // [Mariottini11 eq. 3] p(X_0 | Z_0:T): the source leaves out the factor that makes the sum over X_0 one
    hypotheses_[i].posterior = sums[i] / sum;
    for (auto& [node, probability] : beliefs_[i]) probability /= sum;
  }
}

NodeIdx StartHypotheses::Whereabouts(int hypothesis) const {
  const Belief& belief = beliefs_[hypothesis];
  return std::max_element(belief.begin(), belief.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

std::optional<NodePath> StartHypotheses::Replan(int hypothesis) const {
  const auto paths =
      FindPaths(model_.appearance(), model_.node_poses(), {Whereabouts(hypothesis)}, goal_, options_.route);
  return paths.ok() ? (*paths)[0] : std::nullopt;  // Make has checked the options
}

}  // namespace cairn
