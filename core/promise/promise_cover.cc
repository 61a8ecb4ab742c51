#include "core/promise/promise_cover.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/parallel.h"

namespace cairn {
namespace {

// Demands count as met when this little is lacking: probabilities are sums of floats.
constexpr double kMetTolerance = 1e-6;
// The subgradient's step: halved when the bound has not grown for so many iterations.
constexpr int kPatience = 15;
constexpr int kIterationsPerCover = 100;
// Bodies of ParallelFor take so many at a time.
constexpr int64_t kCoveredAtOnce = 1024;
constexpr int64_t kNodesAtOnce = 64;

template <class Body>
void ForChunks(size_t num, int64_t at_once, int num_threads, const Body& body) {
  const auto count = static_cast<int64_t>(num);
  ParallelFor((count + at_once - 1) / at_once, num_threads, [&](int64_t chunk) {
    for (int64_t i = chunk * at_once; i < std::min(count, (chunk + 1) * at_once); ++i) body(i);
  });
}

class Cover {
 public:
  explicit Cover(const CoverProblem& problem)
      : problem_(problem), lacking_(problem.demands), is_taken_(problem.of_class->size(), 0) {}

  void Take(size_t i) {
    if (is_taken_[i] != 0) return;
    is_taken_[i] = 1;
    for (const ExpectedMatch& match : (*problem_.of_class)[i]) lacking_[match.view] -= match.probability;
  }

  // Of what is lacking, how much a class would meet.
  double Gain(size_t i) const {
    double gain = 0;
    for (const ExpectedMatch& match : (*problem_.of_class)[i]) {
      if (lacking_[match.view] > kMetTolerance)
        gain += std::min<double>(match.probability, lacking_[match.view]);
    }
    return gain;
  }

  // Gains never grow (the sum is submodular): an earlier one is a bound.
  void Complete() {
    struct Candidate {
      double bound;
      size_t i;
    };
    const auto worse = [](const Candidate& a, const Candidate& b) {
      return a.bound != b.bound ? a.bound < b.bound : a.i > b.i;
    };
    std::vector<Candidate> heap;
    for (size_t i = 0; i < is_taken_.size(); ++i) {
      if (is_taken_[i] != 0) continue;
      const double gain = Gain(i);
      if (gain > 0) heap.push_back({gain, i});
    }
    std::make_heap(heap.begin(), heap.end(), worse);
    while (!heap.empty()) {
      std::pop_heap(heap.begin(), heap.end(), worse);
      const double gain = Gain(heap.back().i);
      if (!(gain > 0)) {
        heap.pop_back();
        continue;
      }
      heap.back().bound = gain;
      if (heap.size() > 1 && worse(heap.back(), heap.front())) {
        std::push_heap(heap.begin(), heap.end(), worse);
        continue;
      }
      Take(heap.back().i);
      heap.pop_back();
    }
  }

  // Gives back what all its nodes can do without, in this order.
  void GiveBack(const std::vector<size_t>& order) {
    for (const size_t i : order) {
      if (is_taken_[i] == 0) continue;
      const std::vector<ExpectedMatch>& matches = (*problem_.of_class)[i];
      const bool is_needed = std::any_of(matches.begin(), matches.end(), [&](const ExpectedMatch& match) {
        return problem_.demands[match.view] > 0 && lacking_[match.view] + match.probability > kMetTolerance;
      });
      if (is_needed) continue;
      is_taken_[i] = 0;
      for (const ExpectedMatch& match : matches) lacking_[match.view] += match.probability;
    }
  }

  // Those taken, those that give least first.
  std::vector<size_t> LeastFirst() const {
    std::vector<size_t> order = Taken();
    std::vector<double> sums(is_taken_.size(), 0);
    for (const size_t i : order) {
      for (const ExpectedMatch& match : (*problem_.of_class)[i]) sums[i] += match.probability;
    }
    std::sort(order.begin(), order.end(),
              [&](size_t a, size_t b) { return std::pair(sums[a], b) < std::pair(sums[b], a); });
    return order;
  }

  std::vector<size_t> Taken() const {
    std::vector<size_t> taken;
    for (size_t i = 0; i < is_taken_.size(); ++i) {
      if (is_taken_[i] != 0) taken.push_back(i);
    }
    return taken;
  }

 private:
  const CoverProblem& problem_;
  std::vector<double> lacking_;  // per node: demand less what is taken; negative: more than enough
  std::vector<char> is_taken_;
};

// The dual of the relaxation to 0 <= x_i <= 1:  max over y >= 0 of  sum b_v y_v - sum max(0, sum p_iv y_v -
// 1).
class Dual {
 public:
  Dual(const CoverProblem& problem, int num_threads)
      : problem_(problem),
        num_threads_(num_threads),
        worth_(problem.of_class->size()),
        pays_(problem.of_class->size()),
        first_(problem.demands.size() + 1, 0) {
    for (const std::vector<ExpectedMatch>& matches : *problem.of_class) {
      for (const ExpectedMatch& match : matches) ++first_[match.view + 1];
    }
    for (size_t v = 0; v + 1 < first_.size(); ++v) first_[v + 1] += first_[v];
    of_node_.resize(first_.back());
    std::vector<size_t> next(first_.begin(), first_.end() - 1);
    for (size_t i = 0; i < worth_.size(); ++i) {
      for (const ExpectedMatch& match : (*problem.of_class)[i])
        of_node_[next[match.view]++] = {static_cast<int32_t>(i), match.probability};
    }
  }

  // The bound that prices prove, and its subgradient.
  double Evaluate(const std::vector<double>& prices, std::vector<double>* gradient) {
    ForChunks(worth_.size(), kCoveredAtOnce, num_threads_, [&](int64_t i) {
      double worth = 0;
      for (const ExpectedMatch& match : (*problem_.of_class)[i])
        worth += match.probability * prices[match.view];
      worth_[i] = worth;
      pays_[i] = worth > 1 ? 1 : 0;
    });
    double bound = 0;
    for (size_t v = 0; v < prices.size(); ++v) bound += problem_.demands[v] * prices[v];
    for (const double worth : worth_) bound -= std::max(0.0, worth - 1);
    ForChunks(prices.size(), kNodesAtOnce, num_threads_, [&](int64_t v) {
      double rest = problem_.demands[v];
      for (size_t n = first_[v]; n < first_[v + 1]; ++n)
        rest -= pays_[of_node_[n].i] != 0 ? of_node_[n].probability : 0;
      (*gradient)[v] = rest;
    });
    return bound;
  }

  // Per class: what it is worth at the last prices; above 1 it pays.
  const std::vector<double>& worth() const { return worth_; }

  // Prices at which the best paid class is worth 1: a bound from the start.
  std::vector<double> FirstPrices() const {
    std::vector<double> prices(problem_.demands.size(), 0);
    std::vector<double> sums(worth_.size(), 0);
    for (size_t i = 0; i < worth_.size(); ++i) {
      for (const ExpectedMatch& match : (*problem_.of_class)[i])
        sums[i] += problem_.demands[match.view] > 0 ? match.probability : 0;
    }
    for (size_t v = 0; v < prices.size(); ++v) {
      if (!(problem_.demands[v] > 0)) continue;
      double most = 0;
      for (size_t n = first_[v]; n < first_[v + 1]; ++n) most = std::max(most, sums[of_node_[n].i]);
      prices[v] = most > 0 ? 1 / most : 0;
    }
    return prices;
  }

 private:
  const CoverProblem& problem_;
  int num_threads_;
  std::vector<double> worth_;
  std::vector<char> pays_;  // whether it is worth more than 1
  struct Entry {
    int32_t i;  // class
    float probability;
  };
  std::vector<size_t> first_;  // of node v: of_node_[first_[v]] up to first_[v + 1]
  std::vector<Entry> of_node_;
};

// A cover that begins with the classes that pay.
void TakeIfBetter(const CoverProblem& problem, const std::vector<double>& worth, LandmarkCover* best) {
  Cover cover(problem);
  for (size_t i = 0; i < worth.size(); ++i) {
    if (worth[i] > 1) cover.Take(i);
  }
  cover.Complete();
  std::vector<size_t> order = cover.Taken();
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return worth[a] < worth[b]; });
  cover.GiveBack(order);
  std::vector<size_t> chosen = cover.Taken();
  if (chosen.size() < best->chosen.size()) best->chosen = std::move(chosen);
}

}  // namespace

std::vector<double> Demands(const std::vector<std::vector<ExpectedMatch>>& of_class, size_t num_nodes,
                            double needed, double reachable_ratio) {
  std::vector<double> demands(num_nodes, 0);
  for (const std::vector<ExpectedMatch>& matches : of_class) {
    for (const ExpectedMatch& match : matches) demands[match.view] += match.probability;
  }
  for (double& demand : demands) demand = demand >= needed ? needed : reachable_ratio * demand;
  return demands;
}

std::vector<size_t> CoverFast(const CoverProblem& problem, const std::vector<size_t>& taken) {
  Cover cover(problem);
  for (const size_t i : taken) cover.Take(i);
  cover.Complete();
  std::vector<size_t> order = cover.LeastFirst();
  std::erase_if(order, [&](size_t i) { return std::binary_search(taken.begin(), taken.end(), i); });
  cover.GiveBack(order);
  return cover.Taken();
}

std::vector<size_t> CoverNodes(const ClassesOfNodes& of_node, const std::vector<double>& demands,
                               const std::vector<int32_t>& nodes, const std::vector<size_t>& taken) {
  std::vector<size_t> classes;
  for (const int32_t node : nodes) {
    for (const auto& [i, probability] : of_node[node]) classes.push_back(i);
  }
  std::sort(classes.begin(), classes.end());
  classes.erase(std::unique(classes.begin(), classes.end()), classes.end());
  const auto place_of = [&](size_t i) {
    return static_cast<size_t>(std::lower_bound(classes.begin(), classes.end(), i) - classes.begin());
  };
  std::vector<std::vector<ExpectedMatch>> of_class(classes.size());
  CoverProblem problem{.of_class = &of_class};
  for (size_t n = 0; n < nodes.size(); ++n) {
    problem.demands.push_back(demands[nodes[n]]);
    for (const auto& [i, probability] : of_node[nodes[n]])
      of_class[place_of(i)].push_back({static_cast<int32_t>(n), probability});
  }
  std::vector<size_t> taken_places;
  for (const size_t i : taken) {
    if (std::binary_search(classes.begin(), classes.end(), i)) taken_places.push_back(place_of(i));
  }
  std::vector<size_t> cover = CoverFast(problem, taken_places);
  for (size_t& i : cover) i = classes[i];
  return cover;
}

LandmarkCover CoverBest(const CoverProblem& problem, const CoverOptions& options) {
  LandmarkCover best{.chosen = CoverFast(problem)};
  Dual dual(problem, options.num_threads);
  std::vector<double> prices = dual.FirstPrices(), gradient(prices.size()), best_prices = prices;
  double best_bound = 0, step_ratio = 1;
  int num_without_gain = 0;
  for (int iteration = 0; iteration < options.num_iterations; ++iteration) {
    const double bound = dual.Evaluate(prices, &gradient);
    if (bound > best_bound) {
      best_bound = bound;
      best_prices = prices;
      num_without_gain = 0;
    } else if (++num_without_gain == kPatience) {
      step_ratio /= 2;
      num_without_gain = 0;
      prices = best_prices;
      dual.Evaluate(prices, &gradient);
    }
    if (iteration % kIterationsPerCover == kIterationsPerCover - 1)
      TakeIfBetter(problem, dual.worth(), &best);
    double norm2 = 0;
    for (size_t v = 0; v < prices.size(); ++v) {
      if (prices[v] > 0 || gradient[v] > 0) norm2 += gradient[v] * gradient[v];
    }
    if (!(norm2 > 0)) break;
    const double step =
        step_ratio * (static_cast<double>(best.chosen.size()) - std::min(bound, best_bound)) / norm2;
    for (size_t v = 0; v < prices.size(); ++v) prices[v] = std::max(0.0, prices[v] + step * gradient[v]);
  }
  dual.Evaluate(best_prices, &gradient);
  TakeIfBetter(problem, dual.worth(), &best);
  best.lower_bound = static_cast<int64_t>(std::ceil(best_bound - 1e-6 * std::max(1.0, best_bound)));
  return best;
}

}  // namespace cairn
