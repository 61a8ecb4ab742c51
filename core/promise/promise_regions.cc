#include "core/promise/promise_regions.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

namespace cairn {
namespace {

// A node is next to the nodes nearest to it.
constexpr size_t kNumNeighbours = 8;
constexpr int32_t kNoNode = -1;
// Demands count as met when this little is lacking: probabilities are sums of floats.
constexpr double kMetRegionTolerance = 1e-6;

// Per node the nearest others, and those whose nearest it is, ascending.
std::vector<std::vector<int32_t>> Neighbours(const std::vector<PromiseNode>& nodes, double radius,
                                             double radius_deg) {
  const ViewTree tree = TreeOf(nodes, radius, radius_deg);
  std::vector<std::vector<int32_t>> neighbours(nodes.size());
  for (int32_t a = 0; a < std::ssize(nodes); ++a) {
    for (const int32_t b : tree.Nearest(nodes[a].cam_from_world, kNumNeighbours, a)) {
      neighbours[a].push_back(b);
      neighbours[b].push_back(a);
    }
  }
  for (std::vector<int32_t>& list : neighbours) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return neighbours;
}

class Divider {
 public:
  Divider(const CoverProblem& problem, const std::vector<char>& keep, size_t max_landmarks)
      : problem_(problem),
        keep_(keep),
        max_landmarks_(max_landmarks),
        of_node_(problem.demands.size()),
        is_divided_(problem.demands.size(), 0) {
    for (size_t i = 0; i < keep.size(); ++i) {
      if (keep[i] == 0) continue;
      for (const ExpectedMatch& match : (*problem.of_class)[i])
        of_node_[match.view].push_back({static_cast<uint32_t>(i), match.probability});
    }
  }

  bool IsDivided(int32_t node) const { return is_divided_[node] != 0; }

  PromiseRegion GrowFrom(int32_t seed, const std::vector<std::vector<int32_t>>& neighbours) {
    PromiseRegion region;
    Restart({});
    int32_t next = seed;
    std::vector<int32_t> border;
    while (next != kNoNode) {
      const std::vector<size_t> before = region.classes;
      const std::vector<size_t> extra = ExtraFor(next);
      region.classes.insert(region.classes.end(), extra.begin(), extra.end());
      region.nodes.push_back(next);
      if (region.classes.size() > max_landmarks_) {
        region.classes = CoverOf(region.nodes);
        if (region.nodes.size() > 1 && region.classes.size() > max_landmarks_) {
          region.nodes.pop_back();
          region.classes = before;
          break;
        }
        Restart(region.classes);
      }
      is_divided_[next] = 1;
      for (const int32_t node : neighbours[next]) border.push_back(node);
      std::sort(border.begin(), border.end());
      border.erase(std::unique(border.begin(), border.end()), border.end());
      std::erase_if(border, [&](int32_t node) { return IsDivided(node); });
      next = kNoNode;
      for (const int32_t node : border) {
        if (next == kNoNode || Lack(node) < Lack(next)) next = node;
      }
    }
    return region;
  }

  // Joins neighbouring regions, the smallest first, while their nodes can do with so few landmarks.
  void Join(const std::vector<std::vector<int32_t>>& neighbours, std::vector<PromiseRegion>* regions) const {
    std::vector<size_t> region_of(problem_.demands.size());
    const auto renumber = [&] {
      for (size_t r = 0; r < regions->size(); ++r) {
        for (const int32_t node : (*regions)[r].nodes) region_of[node] = r;
      }
    };
    renumber();
    std::set<std::pair<std::pair<int32_t, size_t>, std::pair<int32_t, size_t>>> tried;
    while (true) {
      std::optional<std::pair<size_t, size_t>> joined;
      std::vector<size_t> by_size(regions->size());
      for (size_t r = 0; r < by_size.size(); ++r) by_size[r] = r;
      std::stable_sort(by_size.begin(), by_size.end(), [&](size_t a, size_t b) {
        return (*regions)[a].nodes.size() < (*regions)[b].nodes.size();
      });
      for (const size_t small : by_size) {
        std::set<size_t> others;
        for (const int32_t node : (*regions)[small].nodes) {
          for (const int32_t neighbour : neighbours[node]) others.insert(region_of[neighbour]);
        }
        others.erase(small);
        for (const size_t other : others) {
          PromiseRegion &a = (*regions)[small], &b = (*regions)[other];
          if (!tried.insert(std::minmax(Name(a), Name(b))).second) continue;
          std::vector<int32_t> nodes = a.nodes;
          nodes.insert(nodes.end(), b.nodes.begin(), b.nodes.end());
          std::vector<size_t> classes = CoverOf(nodes);
          if (classes.size() > max_landmarks_) continue;
          b = {std::move(nodes), std::move(classes)};
          joined = {small, other};
          break;
        }
        if (joined) break;
      }
      if (!joined) return;
      regions->erase(regions->begin() + static_cast<ptrdiff_t>(joined->first));
      renumber();
    }
  }

  // Fills what room is left with the landmarks that its nodes expect most.
  void Fill(PromiseRegion* region) const {
    std::vector<double> sums(keep_.size(), 0);
    for (const int32_t node : region->nodes) {
      for (const auto& [i, probability] : of_node_[node]) sums[i] += probability;
    }
    for (const size_t i : region->classes) sums[i] = 0;
    std::vector<size_t> order;
    for (size_t i = 0; i < sums.size(); ++i) {
      if (sums[i] > 0) order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return sums[a] > sums[b]; });
    for (const size_t i : order) {
      if (region->classes.size() >= max_landmarks_) break;
      region->classes.push_back(i);
    }
    std::sort(region->nodes.begin(), region->nodes.end());
    std::sort(region->classes.begin(), region->classes.end());
  }

 private:
  double Lack(int32_t node) const { return std::max(0.0, lacking_[node]); }

  void Take(size_t i) {
    is_in_[i] = 1;
    for (const ExpectedMatch& match : (*problem_.of_class)[i]) lacking_[match.view] -= match.probability;
  }

  void Restart(const std::vector<size_t>& classes) {
    lacking_ = problem_.demands;
    is_in_.assign(keep_.size(), 0);
    for (const size_t i : classes) Take(i);
  }

  // A small cover of these nodes alone.
  std::vector<size_t> CoverOf(const std::vector<int32_t>& nodes) const {
    return CoverNodes(of_node_, problem_.demands, nodes);
  }

  // A region that grows gets another.
  static std::pair<int32_t, size_t> Name(const PromiseRegion& region) {
    return {region.nodes[0], region.nodes.size()};
  }

  // Of what the node and those not yet divided lack, how much a class would meet.
  double GainFor(int32_t node, size_t i) const {
    double gain = 0;
    for (const ExpectedMatch& match : (*problem_.of_class)[i]) {
      if (match.view == node || is_divided_[match.view] == 0)
        gain += std::clamp<double>(lacking_[match.view], 0, match.probability);
    }
    return gain;
  }

  // Takes the landmarks that the node lacks: those first that meet most of what nodes around it lack, too.
  // Gains never grow: an earlier one is a bound.
  std::vector<size_t> ExtraFor(int32_t node) {
    std::vector<size_t> extra;
    if (!(lacking_[node] > kMetRegionTolerance)) return extra;
    using Candidate = std::pair<double, size_t>;  // a bound of its gain; class
    const auto worse = [](const Candidate& a, const Candidate& b) {
      return a.first != b.first ? a.first < b.first : a.second > b.second;
    };
    std::vector<Candidate> heap;
    for (const auto& [i, probability] : of_node_[node]) {
      if (is_in_[i] == 0) heap.emplace_back(GainFor(node, i), i);
    }
    std::make_heap(heap.begin(), heap.end(), worse);
    while (!heap.empty() && lacking_[node] > kMetRegionTolerance) {
      std::pop_heap(heap.begin(), heap.end(), worse);
      heap.back().first = GainFor(node, heap.back().second);
      if (worse(heap.back(), heap.front())) {
        std::push_heap(heap.begin(), heap.end(), worse);
        continue;
      }
      const auto [gain, i] = heap.back();
      heap.pop_back();
      if (!(gain > 0)) break;
      Take(i);
      extra.push_back(i);
    }
    return extra;
  }

  const CoverProblem& problem_;
  const std::vector<char>& keep_;
  size_t max_landmarks_;
  ClassesOfNodes of_node_;
  std::vector<char> is_divided_;
  std::vector<double> lacking_;  // per node, of the region that grows
  std::vector<char> is_in_;      // per class, the same
};

}  // namespace

PromiseRegions DivideNodes(const std::vector<PromiseNode>& nodes, double view_radius, double view_radius_deg,
                           const CoverProblem& problem, const std::vector<char>& keep, size_t max_landmarks,
                           int64_t cover_bound) {
  const auto neighbours = Neighbours(nodes, view_radius, view_radius_deg);
  Divider divider(problem, keep, max_landmarks);
  PromiseRegions result;
  for (int32_t seed = 0; seed < static_cast<int32_t>(nodes.size()); ++seed) {
    if (!divider.IsDivided(seed)) result.regions.push_back(divider.GrowFrom(seed, neighbours));
  }
  divider.Join(neighbours, &result.regions);
  for (PromiseRegion& region : result.regions) divider.Fill(&region);
  size_t most = max_landmarks;
  for (const PromiseRegion& region : result.regions) most = std::max(most, region.classes.size());
  if (!result.regions.empty() && most > 0) {
    const auto num = static_cast<int64_t>(most);
    result.lower_bound = static_cast<int>(std::max<int64_t>(1, (cover_bound + num - 1) / num));
  }
  return result;
}

}  // namespace cairn
