#include "stages/decompose_regions/cover/cover_search.h"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <queue>
#include <utility>

#include "core/base/random.h"
#include "stages/decompose_regions/cover/cover_annealing.h"

namespace cairn::decompose_regions {
namespace {

// A region is fixed together with others if its x is at least this.
constexpr double kNearlyOne = 0.9;
constexpr size_t kMaxFixedTogether = 8;
// Number of regions of a neighbourhood that is covered again.
constexpr int kMinOpened = 6, kMaxOpened = 20;
// Number of times that nearly as valuable regions are added to the pool before annealing.
constexpr int kNumEnrichments = 2;

class CoverSearch {
 public:
  CoverSearch(ColumnGeneration* generation, const ReducedWorld& wide, const CoverSearchOptions& options)
      : generation_(*generation),
        wide_(wide),
        max_uncovered_(generation->lp().max_uncovered()),
        options_(options) {}

  int NumUncovered(const std::vector<int>& cover) const {
    const std::vector<char> open = OpenStations(cover);
    return static_cast<int>(std::count(open.begin(), open.end(), 1));
  }

  // Adds regions to `kept` until few enough stations are open: at most `max_regions` in all, or nothing.
  std::vector<int> Dive(const std::vector<int>& kept, size_t max_regions, bool price) {
    std::vector<int> cover = kept;
    CoverLp lp(generation_.pool(), OpenStations(kept), max_uncovered_);
    lp.StartFrom(generation_.lp());
    while (lp.num_open() > max_uncovered_) {
      lp.Iterate(options_.num_lp_iterations);
      if (price && generation_.Price(lp) > 0) lp.Iterate(options_.num_lp_iterations);
      for (const int region : RegionsToFix(lp, cover)) {
        if (lp.num_open() <= max_uncovered_) break;
        if (cover.size() == max_regions) return {};
        lp.Fix(region);
        cover.push_back(region);
      }
    }
    DropSuperfluous(&cover);
    return cover;
  }

  // A cover without its `num_opened` regions nearest to a station.
  std::vector<int> Opened(std::vector<int> cover, StationIdx center, size_t num_opened) const {
    std::vector<char> visited(wide_.num_stations(), 0);
    std::vector<StationIdx> stations = {center};
    visited[center] = 1;
    for (size_t i = 0; i < stations.size() && num_opened > 0; ++i) {
      std::erase_if(cover, [&](int region) {
        const std::vector<StationIdx>& covered = generation_.pool()[region].stations;
        if (num_opened == 0 || !std::binary_search(covered.begin(), covered.end(), stations[i])) return false;
        --num_opened;
        return true;
      });
      for (const StationIdx next : wide_.neighbours[stations[i]]) {
        if (!std::exchange(visited[next], 1)) stations.push_back(next);
      }
    }
    return cover;
  }

  // Drops regions as long as the others suffice.
  void DropSuperfluous(std::vector<int>* cover) const {
    std::vector<std::span<const StationIdx>> cores;
    for (const int region : *cover) cores.emplace_back(generation_.pool()[region].stations);
    const std::vector<char> is_kept =
        KeepMostUseful(cores, wide_.num_stations(), max_uncovered_ - NumUncovered(*cover));
    size_t i = 0;
    std::erase_if(*cover, [&](int) { return is_kept[i++] == 0; });
  }

  // Exchanges regions so that fewer stations are uncovered (cover_annealing.h), and drops regions that
  // become superfluous.
  void Anneal(std::vector<int>* cover, Random* random) {
    const int64_t num_exchanges = int64_t{options_.exchanges_per_station} * wide_.num_coverable;
    if (num_exchanges == 0) return;
    for (int i = 0; i < kNumEnrichments; ++i) generation_.AddNearlyAsValuable(random);
    *cover = CoverAnnealing(generation_.pool(), wide_.coverable).Search(*cover, num_exchanges, random);
    DropSuperfluous(cover);
  }

 private:
  // The region of the largest x, and others that are nearly 1.
  std::vector<int> RegionsToFix(const CoverLp& lp, const std::vector<int>& cover) const {
    const std::vector<double>& x = lp.region_values();
    std::vector<int> order;
    for (int region = 0; region < static_cast<int>(x.size()); ++region) {
      if (x[region] > 0) order.push_back(region);
    }
    if (order.empty()) return {MostUseful(cover)};
    const size_t num_sorted = std::min(kMaxFixedTogether, order.size());
    std::partial_sort(order.begin(), order.begin() + static_cast<ptrdiff_t>(num_sorted), order.end(),
                      [&](int a, int b) { return std::pair(-x[a], a) < std::pair(-x[b], b); });
    size_t num_fixed = 1;
    while (num_fixed < num_sorted && x[order[num_fixed]] >= kNearlyOne) ++num_fixed;
    order.resize(num_fixed);
    return order;
  }

  // The region that covers most of the stations that a cover leaves open.
  int MostUseful(const std::vector<int>& cover) const {
    const std::vector<char> open = OpenStations(cover);
    int best = 0, most = -1;
    for (int region = 0; region < generation_.pool().size(); ++region) {
      int count = 0;
      for (const StationIdx station : generation_.pool()[region].stations) count += open[station];
      if (count > most) {
        best = region;
        most = count;
      }
    }
    return best;
  }

  std::vector<char> OpenStations(const std::vector<int>& cover) const {
    std::vector<char> open = wide_.coverable;
    for (const int region : cover) {
      for (const StationIdx station : generation_.pool()[region].stations) open[station] = 0;
    }
    return open;
  }

  ColumnGeneration& generation_;
  const ReducedWorld& wide_;
  const int max_uncovered_;
  const CoverSearchOptions options_;
};

}  // namespace

std::vector<char> KeepMostUseful(const std::vector<std::span<const StationIdx>>& cores, int num_stations,
                                 int max_lost) {
  std::vector<char> is_kept(cores.size(), 1);
  std::vector<int> count(num_stations, 0);
  for (const auto& core : cores) {
    for (const StationIdx station : core) ++count[station];
  }
  const auto loss = [&](size_t r) {
    return static_cast<int>(std::count_if(cores[r].begin(), cores[r].end(),
                                          [&](StationIdx station) { return count[station] == 1; }));
  };
  // Losses only grow: what is in the queue is at most what it is now.
  using Entry = std::pair<int, size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (size_t r = 0; r < cores.size(); ++r) queue.emplace(loss(r), r);
  while (!queue.empty() && queue.top().first <= max_lost) {
    const auto [least, r] = queue.top();
    queue.pop();
    if (const int now = loss(r); now > least) {
      queue.emplace(now, r);
      continue;
    }
    max_lost -= least;
    for (const StationIdx station : cores[r]) --count[station];
    is_kept[r] = 0;
  }
  return is_kept;
}

std::vector<int> SearchCover(ColumnGeneration* generation, const ReducedWorld& wide, std::vector<int> start,
                             uint64_t seed, const CoverSearchOptions& options, Progress& progress) {
  CoverSearch search(generation, wide, options);
  std::vector<int> best = std::move(start);
  search.DropSuperfluous(&best);
  if (std::vector<int> cover = search.Dive({}, best.size(), true); !cover.empty()) best = std::move(cover);
  Random random(seed);
  int num_uncovered = search.NumUncovered(best);
  std::vector<StationIdx> centers;
  for (StationIdx station = 0; station < wide.num_stations(); ++station) {
    if (wide.coverable[station]) centers.push_back(station);
  }
  for (int repair = 0; repair < options.num_repairs; ++repair) {
    if (static_cast<int>(best.size()) <= generation->lower_bound() || progress.Cancelled()) break;
    progress.Advance();
    const StationIdx center = centers[random.UniformInt(0, static_cast<int64_t>(centers.size()) - 1)];
    const size_t num_opened = static_cast<size_t>(random.UniformInt(kMinOpened, kMaxOpened));
    std::vector<int> cover = search.Dive(search.Opened(best, center, num_opened), best.size(), false);
    if (cover.empty()) continue;
    const int now = search.NumUncovered(cover);
    if (std::pair(cover.size(), now) > std::pair(best.size(), num_uncovered)) continue;
    best = std::move(cover);
    num_uncovered = now;
  }
  if (!progress.Cancelled()) search.Anneal(&best, &random);
  std::sort(best.begin(), best.end());
  return best;
}

}  // namespace cairn::decompose_regions
