// How far greedy and improved sets are from the least possible size, and what cycle restoration does
// to paths.

#include <cstdio>
#include <ctime>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "bench/appearance/synthetic_graph.h"
#include "stages/link_appearance/dominating_set/connected_bound.h"
#include "stages/link_appearance/dominating_set/counting_bound.h"
#include "stages/link_appearance/dominating_set/greedy_dominating_set.h"
#include "stages/link_appearance/dominating_set/improve_dominating_set.h"
#include "stages/link_appearance/dominating_set/restore_cycles.h"

namespace cairn {
namespace {

double Seconds(std::clock_t start) { return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC; }

void MeasureGap(int size, double degree, uint64_t seed, int num_tries,
                const link_appearance::ConnectedBoundOptions& options) {
  const AppearanceGraph graph = LargestComponent(SyntheticGraph(size, degree, seed));
  const link_appearance::Domination domination(graph, {});
  const std::vector<NodeIdx> greedy = link_appearance::GreedyDominatingSet(domination);
  std::clock_t start = std::clock();
  const std::vector<NodeIdx> improved =
      link_appearance::ImproveDominatingSet(domination, greedy, {.num_tries = num_tries}, seed);
  const double improve_seconds = Seconds(start);
  start = std::clock();
  const link_appearance::ConnectedBound bound =
      link_appearance::BoundConnectedSet(domination, improved, options);
  const double bound_seconds = Seconds(start);
  const size_t best = bound.smaller.empty() ? improved.size() : bound.smaller.size();
  const auto gap = [&](size_t kept) {
    return 100.0 * (static_cast<double>(kept) - bound.lower_bound) / bound.lower_bound;
  };
  fmt::print("{:>6}{:>7}{:>8}{:>10}{:>7}{:>8}{:>12.1f}{:>12.1f}{:>11.1f}{:>11.1f}\n", graph.num_nodes(),
             graph.num_links(), greedy.size(), best, bound.lower_bound,
             cairn::link_appearance::CountingBound(graph), gap(greedy.size()), gap(best), improve_seconds,
             bound_seconds);
  std::fflush(stdout);
}

// Lengths of shortest paths over kept nodes, against those over all, between all pairs of nodes.
void MeasurePaths(const AppearanceGraph& graph, const std::vector<NodeIdx>& kept, int c) {
  std::vector<NodeIdx> all_kept = kept;
  if (c > 0) {
    for (const NodeIdx node : link_appearance::RestoreCycles(graph, kept, c)) all_kept.push_back(node);
  }
  const std::vector<char> marks = NodeMarks(graph.num_nodes(), all_kept), all(graph.num_nodes(), 1);
  std::vector<double> ratios;
  std::vector<int> neighbours;  // links between former neighbours
  int num_beyond = 0;           // longer than the bound of restore_cycles.h
  for (NodeIdx from = 0; from < graph.num_nodes(); ++from) {
    const std::vector<int> full = PathLengths(graph, from, all, graph.num_nodes());
    const std::vector<int> over_kept = PathLengths(graph, from, marks, graph.num_nodes());
    for (NodeIdx to = from + 1; to < graph.num_nodes(); ++to) {
      int length = marks[to] ? over_kept[to] : -1;
      if (!marks[to]) {
        for (const AppearanceGraph::Neighbour& n : graph.Neighbours(to)) {
          const bool is_way = marks[n.node] && over_kept[n.node] >= 0;
          if (is_way && (length < 0 || over_kept[n.node] + 1 < length)) length = over_kept[n.node] + 1;
        }
      }
      ratios.push_back(static_cast<double>(length) / full[to]);
      if (full[to] == 1) neighbours.push_back(length);
      num_beyond += c > 0 && length > (c - 1) * full[to] + 2;
    }
  }
  std::sort(ratios.begin(), ratios.end());
  std::sort(neighbours.begin(), neighbours.end());
  const auto part = [](const auto& sorted, double p) {
    return sorted[static_cast<size_t>(p * static_cast<double>(sorted.size() - 1))];
  };
  fmt::print("{:>4}{:>7}{:>10.2f}{:>8.2f}{:>8.2f}{:>8.2f}{:>12}{:>6}{:>6}{:>9}{:>8}\n", c, all_kept.size(),
             part(ratios, 0.5), part(ratios, 0.9), part(ratios, 0.99), ratios.back(), part(neighbours, 0.5),
             part(neighbours, 0.9), neighbours.back(), c > 0 ? std::to_string(c + 1) : "-",
             c > 0 ? std::to_string(num_beyond) : "-");
  std::fflush(stdout);
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  CLI::App app("Gaps of greedy and improved connected dominating sets; path lengths over them");
  std::vector<int> sizes = {100, 250};
  std::vector<double> degrees = {10, 20};
  int num_seeds = 3, num_tries = 5000, path_nodes = 600;
  cairn::link_appearance::ConnectedBoundOptions options{.lower_bound = "program"};
  app.add_option("--nodes", sizes)->delimiter(',')->capture_default_str();
  app.add_option("--degrees", degrees)->delimiter(',')->capture_default_str();
  app.add_option("--seeds", num_seeds)->capture_default_str();
  app.add_option("--tries", num_tries)->capture_default_str();
  app.add_option("--rounds", options.max_num_cut_rounds)->capture_default_str();
  app.add_option("--branches", options.max_num_branches)->capture_default_str();
  app.add_option("--path-nodes", path_nodes, "nodes of the graph whose paths are measured; 0: none")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  if (!sizes.empty()) {
    fmt::print("{:>6}{:>7}{:>8}{:>10}{:>7}{:>8}{:>12}{:>12}{:>11}{:>11}\n", "nodes", "links", "greedy",
               "improved", "bound", "counted", "greedy, %", "improved, %", "search, s", "bound, s");
  }
  for (const int size : sizes) {
    for (const double degree : degrees) {
      for (int seed = 0; seed < num_seeds; ++seed) cairn::MeasureGap(size, degree, seed, num_tries, options);
    }
  }
  if (path_nodes == 0) return 0;
  fmt::print("\n{:>4}{:>7}{:>10}{:>8}{:>8}{:>8}{:>12}{:>6}{:>6}{:>9}{:>8}\n", "c", "kept", "median", "90 %",
             "99 %", "most", "neighbours:", "90 %", "most", "allowed", "beyond");
  const cairn::AppearanceGraph graph = cairn::LargestComponent(cairn::SyntheticGraph(path_nodes, 8, 0));
  const cairn::link_appearance::Domination domination(graph, {});
  const std::vector<cairn::NodeIdx> kept = cairn::link_appearance::ImproveDominatingSet(
      domination, cairn::link_appearance::GreedyDominatingSet(domination), {.num_tries = num_tries}, 0);
  for (const int c : {0, 12, 8, 5, 3, 2}) cairn::MeasurePaths(graph, kept, c);
  return 0;
}
