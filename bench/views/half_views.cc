// views_half [--seed N] PLAN...: scans of half the view around from 60 random places of each plan, located by
// the defaults: 180 beams, 2 cm of noise, and the same with a quarter of the beams hidden by what the plan
// does not show.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "bench/views/random_scan.h"
#include "bench/views/scan_places.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "runtime/beams/plan_rays.h"
#include "runtime/beams/scan_locator.h"
#include "stages/decompose_views/plan/clean_plan.h"
#include "stages/decompose_views/plan/read_plan.h"

namespace {

using namespace cairn;

constexpr int kNumPlaces = 60, kNumBeams = kNumRandomBeams;
constexpr double kNoiseM = kRandomScanNoiseM;

// Something in the way of 5 to 30 neighbouring beams, 0.3 to 2.3 m away, until a quarter of all are hidden.
void HideAQuarter(RangeScan* scan, Random* random) {
  std::vector<char> hidden(kNumBeams, 0);
  int num_hidden = 0;
  for (int tries = 0; tries < 10000 && num_hidden < kNumBeams / 4; ++tries) {
    const int first = static_cast<int>(random->Uniform(0, kNumBeams));
    const int num = static_cast<int>(random->Uniform(5, 30));
    const double distance = random->Uniform(0.3, 2.3);
    for (int i = first; i < std::min(kNumBeams, first + num); ++i) {
      if (hidden[i] != 0 || scan->ranges_m[i] <= distance) continue;
      scan->ranges_m[i] = distance + random->Normal(0, kNoiseM);
      hidden[i] = 1;
      ++num_hidden;
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  int seed = 1;
  std::vector<std::string> paths;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--seed" && i + 1 < argc) {
      seed = std::atoi(argv[++i]);
    } else {
      paths.emplace_back(argv[i]);
    }
  }
  std::printf(
      "| plan | hidden | first right | any right | one solution, determined: right | ms "
      "|\n|---|---|---|---|---|---|\n");
  for (const std::string& path : paths) {
    NoProgress progress;
    const auto input = decompose_views::ReadPlan(path);
    if (!input.ok()) {
      std::fprintf(stderr, "%s\n", input.error().message.c_str());
      return 1;
    }
    const auto cleaned = decompose_views::CleanPlan(*input, {}, progress);
    if (!cleaned.ok()) {
      std::fprintf(stderr, "%s\n", cleaned.error().message.c_str());
      return 1;
    }
    Views views;
    views.plan = cleaned->plan;
    const auto locator = ScanLocator::Make(views, {});
    if (!locator.ok()) {
      std::fprintf(stderr, "%s: %s\n", path.c_str(), locator.error().message.c_str());
      return 1;
    }
    const PlanRays rays(views.plan.walls);
    for (const bool hide : {false, true}) {
      Random random(seed);
      std::vector<RangeScan> scans;
      for (int tries = 0; tries < 1000000 && std::ssize(scans) < kNumPlaces; ++tries) {
        auto scan = RandomScan(views.plan, rays, &random);
        if (!scan) continue;
        if (hide) HideAQuarter(&*scan, &random);
        scans.push_back(std::move(*scan));
      }
      std::vector<char> first(scans.size(), 0), any(scans.size(), 0), single(scans.size(), 0);
      std::vector<double> seconds(scans.size());
      ParallelFor(std::ssize(scans), 0, [&](int64_t i) {
        const double begin = Seconds();
        const auto located = locator->Locate(ViewOf(scans[i], {}));
        seconds[i] = Seconds() - begin;
        if (!located.ok()) return;
        for (size_t k = 0; k < located->hypotheses.size(); ++k) {
          const bool right = IsRight(located->hypotheses[k].pose, scans[i].pose);
          any[i] |= right ? 1 : 0;
          if (k == 0) first[i] = right ? 1 : 0;
        }
        single[i] = located->hypotheses.size() == 1 && located->hypotheses[0].determined ? 1 : 0;
      });
      int num_first = 0, num_any = 0, num_single = 0, num_single_right = 0;
      double sum = 0;
      for (size_t i = 0; i < scans.size(); ++i) {
        num_first += first[i];
        num_any += any[i];
        num_single += single[i];
        num_single_right += single[i] & first[i];
        sum += seconds[i];
      }
      std::printf("| %s | %s | %d of %d | %d | %d of %d | %.1f |\n", path.c_str(),
                  hide ? "a quarter" : "none", num_first, static_cast<int>(scans.size()), num_any,
                  num_single_right, num_single, 1e3 * sum / static_cast<double>(scans.size()));
      std::fflush(stdout);
    }
  }
  return 0;
}
