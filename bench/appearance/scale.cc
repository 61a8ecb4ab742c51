// Time and memory of the greedy algorithm on large graphs, and how both grow.

#include <sys/resource.h>

#include <cmath>
#include <cstdio>
#include <ctime>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "bench/appearance/synthetic_graph.h"
#include "stages/link_appearance/dominating_set/greedy_dominating_set.h"

int main(int argc, char** argv) {
  CLI::App app("Time and memory of the greedy connected dominating set, from few links to five million");
  std::vector<int> sizes = {6250, 12500, 25000, 50000, 100000};
  double degree = 100;
  int num_runs = 3;
  bool is_random = false;
  app.add_option("--nodes", sizes, "sizes of the graphs, ascending")->delimiter(',')->capture_default_str();
  app.add_option("--degree", degree, "neighbours of a node, about")->capture_default_str();
  app.add_option("--runs", num_runs, "runs, of which the median counts")->capture_default_str();
  app.add_flag("--random-order", is_random, "number nodes at random, not in the order of a drive");
  CLI11_PARSE(app, argc, argv);
  fmt::print("{:>8}{:>12}{:>8}{:>16}{:>12}{:>14}\n", "nodes", "links", "kept", "processor, s", "2-fold, s",
             "peak, MiB");
  std::vector<double> seconds, links;
  for (const int size : sizes) {
    const cairn::AppearanceGraph graph = cairn::SyntheticGraph(size, degree, 0, !is_random);
    const auto median_seconds = [&](int m, size_t* num_kept) {
      std::vector<double> runs;
      for (int run = 0; run < num_runs; ++run) {
        const std::clock_t start = std::clock();
        *num_kept = cairn::link_appearance::GreedyDominatingSet(
                        cairn::link_appearance::Domination(graph, {.num_dominators = m}))
                        .size();
        runs.push_back(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
      }
      std::sort(runs.begin(), runs.end());
      return runs[runs.size() / 2];
    };
    size_t num_kept = 0, num_twofold = 0;
    const double once = median_seconds(1, &num_kept), twice = median_seconds(2, &num_twofold);
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    seconds.push_back(once);
    links.push_back(static_cast<double>(graph.num_links()));
    fmt::print("{:>8}{:>12}{:>8}{:>16.3f}{:>12.3f}{:>14.0f}\n", size, graph.num_links(), num_kept, once,
               twice, static_cast<double>(usage.ru_maxrss) / 1024);
    std::fflush(stdout);
  }
  if (sizes.size() > 1) {
    fmt::print("exponent in links from {} to {} nodes: {:.3f}\n", sizes.front(), sizes.back(),
               std::log(seconds.back() / seconds.front()) / std::log(links.back() / links.front()));
  }
  return 0;
}
