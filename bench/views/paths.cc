// views_paths NUM_PAIRS NUM_STARTS PLAN...: paths between random places of plans, by default and for a point:
// in how many cases the fewest links are proven, and how many looking places a search takes beside those that
// are needed.
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <vector>

#include "bench/views/scan_places.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/line/memory.h"
#include "runtime/paths/plan_path.h"
#include "runtime/paths/search_path.h"
#include "stages/decompose_views/decompose_views.h"

namespace {

using namespace cairn;
using Vec2 = Eigen::Vector2d;

// A place in the plan's box that the robot fits at.
Vec2 RandomPlace(const PlanSpace& space, double radius_m, Random* random) {
  const FloorPlan& plan = space.views().plan;
  const Vec2 low = plan.Metres(plan.low), high = plan.Metres(plan.high);
  while (true) {
    const double x = random->Uniform(low.x(), high.x()), y = random->Uniform(low.y(), high.y());
    if (CheckStands(space, {x, y}, radius_m).ok()) return {x, y};
  }
}

struct Pairs {
  int num_ways = 0, num_proven = 0, num_saved = 0;
  int64_t num_links = 0, num_short_links = 0, num_bound = 0;
  int most_links = 0;
  double seconds = 0, short_seconds = 0, slowest = 0;
};

Pairs RunPairs(const PlanSpace& space, const PlanPathOptions& options, int num_pairs) {
  Pairs sum;
  for (int i = 0; i < num_pairs; ++i) {
    Random random(MixSeed(3, i));
    const Vec2 from = RandomPlace(space, options.radius_m, &random);
    const Vec2 to = RandomPlace(space, options.radius_m, &random);
    const double start = Seconds();
    const auto shortest = FindPath(space, from, to, options);
    const double middle = Seconds();
    if (!shortest.ok()) continue;
    const auto found = FindMinimumLinkPath(space, from, to, options);
    const double seconds = Seconds() - middle;
    ++sum.num_ways;
    sum.num_proven += found->is_optimal();
    sum.num_saved += found->path.num_links() < shortest->num_links();
    sum.num_links += found->path.num_links();
    sum.num_bound += found->fewest_links;
    sum.num_short_links += shortest->num_links();
    sum.most_links = std::max(sum.most_links, found->path.num_links());
    sum.short_seconds += middle - start;
    sum.seconds += seconds;
    sum.slowest = std::max(sum.slowest, seconds);
  }
  return sum;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "usage: views_paths NUM_PAIRS NUM_STARTS PLAN...\n");
    return 2;
  }
  std::printf(
      "| plan | radius | ways | fewest links proven | links | bound | most | of short paths | ms | slowest | "
      "ms, short |\n|---|---|---|---|---|---|---|---|---|---|---|\n");
  std::string searches;
  for (int i = 3; i < argc; ++i) {
    const std::string path = argv[i];
    const auto input = decompose_views::ReadPlan(path);
    if (!input.ok()) {
      std::fprintf(stderr, "%s\n", input.error().message.c_str());
      return 1;
    }
    NoProgress progress;
    const auto result = decompose_views::DecomposeViews(*input, {}, 0, DefaultMemoryMib(), progress);
    if (!result.ok()) {
      std::fprintf(stderr, "%s: %s\n", argv[i], result.error().message.c_str());
      return 1;
    }
    const PlanSpace space(result->views);
    const std::string name = path.substr(path.rfind('/') + 1);
    for (const double radius : {0.0, PlanPathOptions().radius_m}) {
      PlanPathOptions options;
      options.radius_m = radius;
      const Pairs pairs = RunPairs(space, options, std::atoi(argv[1]));
      const double num = std::max(1, pairs.num_ways);
      std::printf("| %s | %g | %d | %d | %.2f | %.2f | %d | %.2f | %.1f | %.1f | %.1f |\n", name.c_str(),
                  radius, pairs.num_ways, pairs.num_proven, static_cast<double>(pairs.num_links) / num,
                  static_cast<double>(pairs.num_bound) / num, pairs.most_links,
                  static_cast<double>(pairs.num_short_links) / num, 1e3 * pairs.seconds / num,
                  1e3 * pairs.slowest, 1e3 * pairs.short_seconds / num);
      std::fflush(stdout);
      for (int k = 0; k < std::atoi(argv[2]); ++k) {
        Random random(MixSeed(4, k));
        const double start = Seconds();
        const auto search = FindSearchPath(space, RandomPlace(space, radius, &random), options);
        if (!search.ok()) continue;
        char line[400];
        std::snprintf(line, sizeof line, "| %s | %g | %zu | %d | %.1f | %.3f | %.2f | %.1f | %.1f | %.1f |\n",
                      name.c_str(), radius, search->places.size(), search->fewest_places,
                      search->domain_area_m2, search->visible_area_m2 - search->seen_area_m2,
                      search->unseen_area_m2(), search->unreached_area_m2, search->path.length_m,
                      Seconds() - start);
        searches += line;
      }
    }
  }
  std::printf(
      "\n| plan | radius | places | needed | domain, m2 | visible, not seen | unseen | not reached | path, m "
      "| s "
      "|\n|---|---|---|---|---|---|---|---|---|---|\n%s",
      searches.c_str());
  return 0;
}
