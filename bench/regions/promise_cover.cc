// The fewest landmarks that keep a promise at every node (core/promise/promise_cover.h), in halls that grow:
// how many there are, how many it takes at least, and time and memory over the number of nodes.
//
//   promise_cover --nodes 1000,2000,5000 --best
//   promise_cover --nodes 10000,100000,1000000
//
// A hall is an open square with a lattice of places 0.5 m apart, four headings each, and landmarks all over
// it, 7 a square metre, that face any way: a node sees those within 6 m, 35 degrees of its heading and 60
// degrees of their own direction.  All is coupled: no wall divides the problem.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <sys/resource.h>
#include <CLI/CLI.hpp>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/promise/promise_cover.h"

namespace cairn {
namespace {

constexpr double kSpacingM = 0.5;
constexpr int kNumHeadings = 4;
constexpr double kLandmarksPerM2 = 7;
constexpr double kRangeM = 6;
constexpr double kHalfViewDeg = 35;
constexpr double kMaxIncidenceDeg = 60;

struct Hall {
  int64_t num_nodes = 0;
  std::vector<std::vector<ExpectedMatch>> of_class;
};

Hall MakeHall(int64_t num_nodes, uint64_t seed, int num_threads) {
  const auto side = static_cast<int64_t>(std::ceil(std::sqrt(static_cast<double>(num_nodes) / kNumHeadings)));
  Hall hall{.num_nodes = side * side * kNumHeadings};
  const double length = static_cast<double>(side) * kSpacingM;
  struct Landmark {
    double x, y, direction, quality;
  };
  Random random(seed);
  std::vector<Landmark> landmarks(static_cast<size_t>(kLandmarksPerM2 * length * length));
  for (Landmark& l : landmarks) {
    l.x = length * random.Uniform();
    l.y = length * random.Uniform();
    l.direction = 2 * std::numbers::pi * random.Uniform();
    l.quality = random.Uniform();
  }
  hall.of_class.resize(landmarks.size());
  ParallelFor(static_cast<int64_t>(landmarks.size()), num_threads, [&](int64_t i) {
    const Landmark& l = landmarks[i];
    const auto first = [&](double at) {
      return std::max<int64_t>(0, static_cast<int64_t>((at - kRangeM) / kSpacingM));
    };
    const auto last = [&](double at) {
      return std::min<int64_t>(side - 1, static_cast<int64_t>((at + kRangeM) / kSpacingM));
    };
    for (int64_t row = first(l.y); row <= last(l.y); ++row) {
      for (int64_t column = first(l.x); column <= last(l.x); ++column) {
        const double dx = l.x - (static_cast<double>(column) + 0.5) * kSpacingM;
        const double dy = l.y - (static_cast<double>(row) + 0.5) * kSpacingM;
        const double distance = std::hypot(dx, dy);
        if (distance > kRangeM || distance < kSpacingM / 2) continue;
        const double bearing = std::atan2(dy, dx);
        const double incidence =
            std::abs(std::remainder(bearing + std::numbers::pi - l.direction, 2 * std::numbers::pi));
        if (incidence > kMaxIncidenceDeg * std::numbers::pi / 180) continue;
        for (int heading = 0; heading < kNumHeadings; ++heading) {
          const double turn =
              std::abs(std::remainder(bearing - heading * std::numbers::pi / 2, 2 * std::numbers::pi));
          if (turn > kHalfViewDeg * std::numbers::pi / 180) continue;
          const double probability =
              l.quality * std::cos(incidence) * std::exp(-distance * distance / (2 * 4.0 * 4.0));
          hall.of_class[i].push_back({static_cast<int32_t>((row * side + column) * kNumHeadings + heading),
                                      static_cast<float>(probability)});
        }
      }
    }
  });
  return hall;
}

double PeakMib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

int Main(int argc, char** argv) {
  CLI::App app{"The fewest landmarks that keep a promise, over the number of nodes"};
  std::vector<int64_t> sizes = {1000, 2000, 5000};
  bool best = false;
  double needed = 16;
  uint64_t seed = 0;
  CoverOptions options;
  app.add_option("--nodes", sizes, "numbers of nodes")->delimiter(',');
  app.add_flag("--best", best, "CoverBest, with its lower bound, beside CoverFast");
  app.add_option("--needed", needed, "expected matches that every node demands");
  app.add_option("--seed", seed, "of the landmarks");
  app.add_option("--iterations", options.num_iterations, "of the lower bound");
  app.add_option("--threads", options.num_threads, "threads [all cores]");
  CLI11_PARSE(app, argc, argv);
  std::printf(
      "| nodes | landmarks | sights | fast | s | best | at least | gap | s | peak MiB |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n");
  for (const int64_t size : sizes) {
    const Hall hall = MakeHall(size, seed, options.num_threads);
    int64_t num_sights = 0;
    for (const auto& matches : hall.of_class) num_sights += static_cast<int64_t>(matches.size());
    CoverProblem problem{.of_class = &hall.of_class};
    problem.demands = Demands(hall.of_class, static_cast<size_t>(hall.num_nodes), needed, 0.9);
    const auto timed = [](const auto& body) {
      const auto start = std::chrono::steady_clock::now();
      body();
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    size_t num_fast = 0;
    const double fast_s = timed([&] { num_fast = CoverFast(problem).size(); });
    std::string of_best = "| | | | ";
    if (best) {
      LandmarkCover cover;
      const double best_s = timed([&] { cover = CoverBest(problem, options); });
      of_best = fmt::format(
          "| {} | {} | {:.1f} % | {:.1f} ", cover.chosen.size(), cover.lower_bound,
          100 * (static_cast<double>(cover.chosen.size()) / static_cast<double>(cover.lower_bound) - 1),
          best_s);
    }
    std::printf("| %ld | %zu | %ld | %zu | %.2f %s| %.0f |\n", hall.num_nodes, hall.of_class.size(),
                num_sights, num_fast, fast_s, of_best.c_str(), PeakMib());
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) { return cairn::Main(argc, argv); }
