#include "stages/link_appearance/find_ambiguity.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "core/structure/points.h"

namespace cairn::link_appearance {
namespace {

// Rounded as stored: the last bits of sums may differ between machines.
double AsStored(double value) { return OfThousandths(Thousandths(value)); }

// Nodes that together are less likely than this change the entropy by no more than the last digit stored.
constexpr double kNegligible = 1e-4;

// A node that looks like another one.
struct LookAlike {
  NodeIdx node = 0;
  double score = 0;
};

// The scores that a node's images get as queries.
struct NodeScores {
  double entropy = 0;
  std::vector<LookAlike> apart;
  // Over places: the best score at another image that shows the same place, 0 where there is none, and the
  // value up to which `again` changes nothing.
  double best_nearby = 0;
  double least_best = std::numeric_limits<double>::infinity();
};

Eigen::Vector3d OnFloor(const FloorPose& place) { return {place.position.x(), place.position.y(), 0}; }

// Where the nodes stand that have a place; `nodes`: which these are.
std::vector<Eigen::Vector3d> PlacesOnFloor(const std::vector<std::optional<FloorPose>>& places,
                                           std::vector<NodeIdx>* nodes) {
  std::vector<Eigen::Vector3d> on_floor;
  for (size_t node = 0; node < places.size(); ++node) {
    if (!places[node]) continue;
    nodes->push_back(static_cast<NodeIdx>(node));
    on_floor.push_back(OnFloor(*places[node]));
  }
  return on_floor;
}

class AmbiguitySearch {
 public:
  AmbiguitySearch(const Vocabulary& vocabulary, const std::vector<std::optional<FloorPose>>& places,
                  const AppearanceGraph* look_alikes, const AmbiguityOptions& options,
                  const Appearance& appearance)
      : vocabulary_(vocabulary),
        places_(places),
        look_alikes_(look_alikes),
        options_(options),
        appearance_(appearance),
        bags_(DocumentWords(vocabulary)),
        node_of_document_(vocabulary.document_ids.size(), -1),
        documents_(appearance.nodes.size()),
        on_floor_(PlacesOnFloor(places, &nodes_on_floor_)),
        near_(on_floor_, options.confusable_distance_m) {
    std::unordered_map<ImageId, NodeIdx> node_of_image;
    for (size_t node = 0; node < appearance.nodes.size(); ++node) {
      for (const ImageId image : appearance.nodes[node].images)
        node_of_image[image] = static_cast<NodeIdx>(node);
    }
    for (size_t document = 0; document < vocabulary.document_ids.size(); ++document) {
      const auto found = node_of_image.find(vocabulary.document_ids[document]);
      if (found == node_of_image.end()) continue;
      node_of_document_[document] = found->second;
      documents_[found->second].push_back(static_cast<int32_t>(document));
    }
  }

  bool OverPlaces() const { return options_.entropy_over == "places"; }

  // `again`: the least score of an image at its own place if it were taken again.
  NodeScores Score(NodeIdx node, double again) const {
    const size_t num_nodes = appearance_.nodes.size();
    NodeScores result;
    std::vector<double> probabilities(num_nodes, 0.0), best(num_nodes, 0.0);
    for (const int32_t document : documents_[node]) {
      std::vector<double> scores = ScoresOf(document);
      if (OverPlaces()) {
        const double own = std::exchange(scores[document], 0);
        const double best_other = *std::max_element(scores.begin(), scores.end());
        result.best_nearby = std::max(result.best_nearby, BestNearby(node, scores));
        if (own > 0) {
          result.least_best = std::min(result.least_best, best_other);
          scores[document] = std::max(again, best_other);
        }
      }
      const std::vector<double> p = ProbabilitiesOfScores(scores, options_.score_exponent);
      for (size_t i = 0; i < scores.size(); ++i) {
        const NodeIdx other = node_of_document_[i];
        if (other < 0) continue;
        probabilities[other] += p[i] / static_cast<double>(documents_[node].size());
        best[other] = std::max(best[other], scores[i]);
      }
    }
    double sum = 0;  // less than 1 where other documents share no words either
    for (const double p : probabilities) sum += p;
    for (double& p : probabilities) p = sum > 0 ? p / sum : 1.0 / static_cast<double>(num_nodes);
    // [Mariottini11 eq. 1] H_i, over places instead of images unless entropy_over asks for these
    result.entropy = Entropy(OverPlaces() ? OfPlaces(node, probabilities) : probabilities);
    best[node] = 0;
    const double best_other = *std::max_element(best.begin(), best.end());
    result.apart = LookAlikesApart(node, best, options_.confusable_score_ratio * best_other);
    return result;
  }

 private:
  std::vector<double> ScoresOf(int32_t document) const {
    std::vector<double> scores = ScoreDocuments(vocabulary_, bags_[document]);
    for (size_t i = 0; i < scores.size(); ++i) {
      if (node_of_document_[i] < 0) scores[i] = 0;  // in no node: not a survey image
    }
    return scores;
  }

  // The best score at another image that shows the same place as the node; 0 where there is none.
  double BestNearby(NodeIdx node, const std::vector<double>& scores) const {
    double best = 0;
    for (size_t i = 0; i < scores.size(); ++i) {
      if (scores[i] > best && ShowTheSame(node, node_of_document_[i])) best = scores[i];
    }
    return best;
  }

  // Probabilities of places instead of nodes: the first is the node's own, each other one that of the
  // likeliest remaining node; a place includes the nodes that show the same as its first one.  The remaining,
  // very unlikely nodes count as one place.
  std::vector<double> OfPlaces(NodeIdx node, const std::vector<double>& probabilities) const {
    std::vector<NodeIdx> left = {node};
    std::vector<char> is_left(probabilities.size(), 0);
    is_left[node] = 1;
    double rest = 1 - probabilities[node];
    for (const NodeIdx other : BestFirst(probabilities)) {
      if (rest < kNegligible || probabilities[other] <= 0) break;
      if (other == node) continue;
      left.push_back(other);
      is_left[other] = 1;
      rest -= probabilities[other];
    }
    std::vector<double> places = {std::max(rest, 0.0)};
    for (const NodeIdx first : left) {
      if (is_left[first] == 0) continue;
      double sum = 0;
      ForTheSame(first, [&](NodeIdx other) {
        if (is_left[other] != 0) sum += probabilities[other];
        is_left[other] = 0;
      });
      places.push_back(sum);
    }
    return places;
  }

  // Calls visit(other) for the nodes that ShowTheSame as this one, itself first; for some twice.
  template <typename Visit>
  void ForTheSame(NodeIdx node, const Visit& visit) const {
    visit(node);
    for (const AppearanceGraph::Neighbour& neighbour : appearance_.graph.Neighbours(node))
      visit(neighbour.node);
    if (places_.empty() || !places_[node]) return;
    near_.ForNear(OnFloor(*places_[node]), [&](int place, double distance) {
      const NodeIdx other = nodes_on_floor_[place];
      if (distance < options_.confusable_distance_m && !OnlyLookAlike(node, other)) visit(other);
    });
  }

  bool OnlyLookAlike(NodeIdx a, NodeIdx b) const {
    return look_alikes_ != nullptr && look_alikes_->AreLinked(a, b);
  }

  bool ShowTheSame(NodeIdx a, NodeIdx b) const {
    if (a == b || appearance_.graph.AreLinked(a, b)) return true;
    if (OnlyLookAlike(a, b)) return false;
    return !places_.empty() && places_[a] && places_[b] &&
           (places_[a]->position - places_[b]->position).norm() < options_.confusable_distance_m;
  }

  bool AreApart(NodeIdx a, NodeIdx b) const {
    if (OnlyLookAlike(a, b)) return true;
    if (places_.empty() || !places_[a] || !places_[b]) return false;
    return (places_[a]->position - places_[b]->position).norm() >= options_.confusable_distance_m &&
           !appearance_.graph.AreLinked(a, b);
  }

  std::vector<LookAlike> LookAlikesApart(NodeIdx node, const std::vector<double>& scores,
                                         double min_score) const {
    std::vector<LookAlike> apart;
    if (min_score <= 0) return apart;
    for (size_t other = 0; other < scores.size(); ++other) {
      if (scores[other] < min_score && !OnlyLookAlike(node, static_cast<NodeIdx>(other))) continue;
      if (!AreApart(node, static_cast<NodeIdx>(other))) continue;
      apart.push_back({static_cast<NodeIdx>(other), scores[other]});
    }
    std::stable_sort(apart.begin(), apart.end(),
                     [](const LookAlike& a, const LookAlike& b) { return a.score > b.score; });
    if (apart.size() > static_cast<size_t>(options_.max_num_confusable))
      apart.resize(options_.max_num_confusable);
    return apart;
  }

  const Vocabulary& vocabulary_;
  const std::vector<std::optional<FloorPose>>& places_;
  const AppearanceGraph* look_alikes_;  // null: none are
  const AmbiguityOptions& options_;
  const Appearance& appearance_;
  std::vector<BagOfWords> bags_;
  std::vector<NodeIdx> node_of_document_;        // -1: of none
  std::vector<std::vector<int32_t>> documents_;  // per node
  std::vector<NodeIdx> nodes_on_floor_;          // those that have a place
  std::vector<Eigen::Vector3d> on_floor_;        // where they stand
  PointGrid near_;                               // of on_floor_
};

}  // namespace

OptionTable DescribeOptions(AmbiguityOptions* options) {
  return {
      {.name = "score_exponent",
       .value = &options->score_exponent,
       .help =
           "probabilities are proportional to scores to this power; a larger one favours the best place more",
       .min = 1e-3,
       .max = 100},
      {.name = "entropy_over",
       .value = &options->entropy_over,
       .help = "what a place's entropy is taken over: places, each with the images around it, or all images",
       .choices = {"places", "images"}},
      {.name = "confusable_score_ratio",
       .value = &options->confusable_score_ratio,
       .help = "places are confusable when each scores at least this part of the other's best look-alike",
       .min = 1e-3,
       .max = 1},
      {.name = "confusable_distance_m",
       .value = &options->confusable_distance_m,
       .help = "confusable places lie at least this far apart, m",
       .min = 1e-6},
      {.name = "max_num_confusable",
       .value = &options->max_num_confusable,
       .help = "most confusable places of a place",
       .min = 0},
  };
}

Status FindAmbiguity(const Vocabulary& vocabulary, const std::vector<std::optional<FloorPose>>& places,
                     const AmbiguityOptions& options, int num_threads, Progress* progress,
                     Appearance* appearance, const AppearanceGraph* look_alikes) {
  AmbiguityOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  const AmbiguitySearch search(vocabulary, places, look_alikes, options, *appearance);
  const auto num_nodes = static_cast<int64_t>(appearance->nodes.size());
  std::vector<NodeScores> scores(num_nodes);
  std::vector<NodeIdx> nodes(num_nodes);
  std::iota(nodes.begin(), nodes.end(), 0);
  const auto score_nodes = [&](double again) {
    const auto num = static_cast<int64_t>(nodes.size());
    if (progress) progress->Begin("tell places apart", num, "nodes");
    ParallelFor(num, num_threads, [&](int64_t i) {
      if (progress && progress->Cancelled()) return;
      scores[nodes[i]] = search.Score(nodes[i], again);
      if (progress) progress->Advance();
    });
    if (progress) progress->End();
  };
  score_nodes(0);
  if (search.OverPlaces()) {
    std::vector<double> nearby;
    for (const NodeScores& of_node : scores) {
      if (of_node.best_nearby > 0) nearby.push_back(of_node.best_nearby);
    }
    const double again = nearby.empty() ? 1 : Decile(nearby, 1);
    std::erase_if(nodes, [&](NodeIdx node) { return again <= scores[node].least_best; });
    if (!nodes.empty()) score_nodes(again);
  }
  if (progress && progress->Cancelled())
    return MakeError(ErrorCode::kCancelled, "telling places apart was stopped");
  appearance->confusable.clear();
  for (NodeIdx node = 0; node < num_nodes; ++node) {
    appearance->nodes[node].entropy = AsStored(scores[node].entropy);
    for (const LookAlike& other : scores[node].apart) {
      const double score = AsStored(other.score);
      const std::vector<LookAlike>& back = scores[other.node].apart;
      const bool is_mutual = std::any_of(
          back.begin(), back.end(), [&](const LookAlike& look_alike) { return look_alike.node == node; });
      if (is_mutual && node < other.node && score > 0)
        appearance->confusable.push_back({node, other.node, score});
    }
  }
  std::sort(appearance->confusable.begin(), appearance->confusable.end(),
            [](const ConfusablePair& a, const ConfusablePair& b) {
              return std::pair(a.node1, a.node2) < std::pair(b.node1, b.node2);
            });
  return Ok();
}

}  // namespace cairn::link_appearance
