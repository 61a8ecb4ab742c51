// views_labels NUM_POINTS PLAN...: label sets of regions beside those found by looking around from random
// points, and what the decomposition takes.
#include <cstdio>
#include <cstdlib>

#include "bench/views/scan_places.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/line/memory.h"
#include "core/view_regions/label_faces.h"
#include "stages/decompose_views/decompose_views.h"

namespace {

using namespace cairn;

struct Tally {
  int64_t inside = 0, near_border = 0, in_no_region = 0, wrong = 0, wrong_near_border = 0;
};

// Points within the tolerance of a border may see either side of it.
Tally Compare(const Views& views, int num_points, double tolerance_m) {
  const FloorPlan& plan = views.plan;
  const WallRays rays(plan);
  const FaceLocator locator(views);
  enum Outcome : char { kRight, kNoRegion, kNear, kWrong, kWrongNear };
  std::vector<char> outcomes(num_points);
  ParallelFor(num_points, 0, [&](int64_t i) {
    Random random(MixSeed(7, i));
    // Closed plans: points of the box that lie in no region are drawn again.
    for (int tries = 0; tries < 1000; ++tries) {
      const Eigen::Vector2d grid(
          random.Uniform(static_cast<double>(plan.low.x), static_cast<double>(plan.high.x)),
          random.Uniform(static_cast<double>(plan.low.y), static_cast<double>(plan.high.y)));
      const Eigen::Vector2d place = plan.Metres(grid.x(), grid.y());
      const FaceIdx face = locator.Find(place);
      outcomes[i] = kNoRegion;
      if (face < 0 && plan.closed) continue;
      if (face < 0) return;
      std::vector<LabelIdx> seen;
      for (const WindowChange& window : CountWindows(plan, rays, grid)) seen.push_back(window.label);
      const bool near = locator.BorderDistance(face, place) < tolerance_m;
      const bool right = seen == views.LabelSet(face);
      outcomes[i] = near ? (right ? kNear : kWrongNear) : (right ? kRight : kWrong);
      return;
    }
  });
  Tally tally;
  for (const char outcome : outcomes) {
    tally.inside += outcome == kRight || outcome == kWrong;
    tally.wrong += outcome == kWrong;
    tally.near_border += outcome == kNear || outcome == kWrongNear;
    tally.wrong_near_border += outcome == kWrongNear;
    tally.in_no_region += outcome == kNoRegion;
  }
  return tally;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: views_labels NUM_POINTS PLAN...\n");
    return 2;
  }
  std::printf(
      "| plan | walls | labels | boundaries | regions | borders | s | disagreeing borders | points | in no "
      "region | within the tolerance (differing) | differing |\n");
  std::printf("|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (int i = 2; i < argc; ++i) {
    const std::string path = argv[i];
    const auto input = decompose_views::ReadPlan(path);
    if (!input.ok()) {
      std::fprintf(stderr, "%s\n", input.error().message.c_str());
      return 1;
    }
    NoProgress progress;
    const double start = Seconds();
    const auto result = decompose_views::DecomposeViews(*input, {}, 0, DefaultMemoryMib(), progress);
    if (!result.ok()) {
      std::fprintf(stderr, "%s: %s\n", argv[i], result.error().message.c_str());
      return 1;
    }
    const double seconds = Seconds() - start;
    const Views& views = result->views;
    const Tally tally = Compare(views, std::atoi(argv[1]), 3 * views.plan.grid_m);
    std::printf("| %s | %d | %d | %lld | %d | %zu | %.2f | %lld | %lld | %lld | %lld (%lld) | %lld |\n",
                path.substr(path.rfind('/') + 1).c_str(), views.plan.num_walls(), views.plan.num_labels(),
                static_cast<long long>(result->num_boundaries), views.num_faces(), views.links.size(),
                seconds, static_cast<long long>(result->num_disagreements),
                static_cast<long long>(tally.inside), static_cast<long long>(tally.in_no_region),
                static_cast<long long>(tally.near_border), static_cast<long long>(tally.wrong_near_border),
                static_cast<long long>(tally.wrong));
    std::fflush(stdout);
  }
  return 0;
}
