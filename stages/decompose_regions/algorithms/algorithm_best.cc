#include "stages/decompose_regions/algorithms/algorithm_best.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/structure/points.h"
#include "stages/decompose_regions/cover/column_generation.h"
#include "stages/decompose_regions/cover/core_finder.h"
#include "stages/decompose_regions/cover/cover_search.h"
#include "stages/decompose_regions/cover/world_parts.h"

namespace cairn::decompose_regions {
namespace {

// How often a large part is covered again, with windows of other borders.
constexpr int kNumRounds = 3;
// Hops around a window through which its regions may pass.
constexpr int kMarginHops = 8;
// A region of this x in a window's linear program is one that the whole part's starts with.
constexpr double kUseful = 1e-3;

// Tells a part of another progress, of `num_items`, about work of `num_steps`.
class ShareOfProgress : public Progress {
 public:
  ShareOfProgress(Progress& whole, int64_t num_items, int64_t num_steps)
      : whole_(whole), num_items_(num_items), num_steps_(std::max<int64_t>(1, num_steps)) {}
  void Begin(std::string_view, int64_t, std::string_view) override {}
  void Advance(int64_t num_steps) override {
    num_done_ = std::min(num_steps_, num_done_ + num_steps);
    const int64_t told = num_items_ * num_done_ / num_steps_;
    whole_.Advance(told - std::exchange(told_, told));
  }
  void End() override { Advance(num_steps_); }
  bool Cancelled() const override { return whole_.Cancelled(); }

 private:
  Progress& whole_;
  int64_t num_items_, num_steps_, num_done_ = 0, told_ = 0;
};

// A cover of a part, in the numbers of the whole, and what is proven of its number of regions.
struct PartCover {
  std::vector<CoreRegion> cores;
  int num_uncovered = 0;
  Certificate certificate;
};

// Adds regions, as far as they lie in the part, to an empty pool; returns their number.
int AddStart(const std::vector<CoreRegion>& start, const WorldPart& part, RegionPool* pool) {
  CoreFinder finder(part.world);
  for (const CoreRegion& whole : start) {
    const CoreRegion core = part.InPart(whole);
    if (static_cast<int>(core.features.size()) < part.world.k) continue;
    for (std::vector<StationIdx>& stations : finder.Cores(core.features)) {
      std::vector<StationIdx> common;
      std::set_intersection(stations.begin(), stations.end(), core.stations.begin(), core.stations.end(),
                            std::back_inserter(common));
      if (!common.empty()) pool->Add({core.features, std::move(stations)});
    }
  }
  return pool->size();
}

// Regions of the pool of which the linear program uses something.
std::vector<CoreRegion> UsefulRegions(const RegionPool& pool, const CoverLp& lp, const WorldPart& part) {
  std::vector<CoreRegion> useful;
  for (size_t region = 0; region < lp.region_values().size(); ++region) {
    if (lp.region_values()[region] > kUseful) useful.push_back(part.InWhole(pool[static_cast<int>(region)]));
  }
  return useful;
}

void DropLeastUseful(const ReducedWorld& wide, int max_lost, std::vector<CoreRegion>* cores) {
  std::vector<std::span<const StationIdx>> stations;
  for (const CoreRegion& core : *cores) stations.emplace_back(core.stations);
  const std::vector<char> is_kept = KeepMostUseful(stations, wide.num_stations(), max_lost);
  size_t i = 0;
  std::erase_if(*cores, [&](const CoreRegion&) { return is_kept[i++] == 0; });
}

// Covers a part's open stations but `max_uncovered`, with no more regions than `start` has.
PartCover CoverPart(const WorldPart& part, const std::vector<CoreRegion>& start, int max_uncovered,
                    const BestOptions& options, uint64_t seed, Progress& progress,
                    std::vector<CoreRegion>* useful) {
  ColumnGeneration generation(part.world, max_uncovered, {.cancel = &progress});
  std::vector<int> cover(AddStart(start, part, &generation.pool()));
  std::iota(cover.begin(), cover.end(), 0);
  generation.Run();
  progress.Advance();
  // [Sala06 Def. 3.8] as few regions as can be found
  cover = SearchCover(
      &generation, part.world, cover, seed,
      {.exchanges_per_station = options.exchanges_per_station, .num_repairs = options.num_repairs}, progress);
  PartCover found;
  std::vector<char> open = part.world.coverable;
  for (const int region : cover) {
    for (const StationIdx station : generation.pool()[region].stations) open[station] = 0;
    found.cores.push_back(part.InWhole(generation.pool()[region]));
  }
  found.num_uncovered = static_cast<int>(std::count(open.begin(), open.end(), 1));
  if (options.with_bound) generation.LowerMaxUncovered(found.num_uncovered);
  found.certificate = generation.certificate();
  if (useful != nullptr) *useful = UsefulRegions(generation.pool(), generation.lp(), part);
  return found;
}

// What is proven of a part by the linear program alone.
Certificate Certify(const WorldPart& part, const std::vector<CoreRegion>& start, int max_uncovered,
                    const Progress& progress) {
  ColumnGeneration generation(part.world, max_uncovered, {.cancel = &progress});
  AddStart(start, part, &generation.pool());
  generation.Run();
  return generation.certificate();
}

// Regions of the whole world, one part after the other.
class PartwiseCover {
 public:
  PartwiseCover(const World& world, const Decomposition& start, uint64_t seed)
      : world_(world),
        wide_(ReduceWorld(world, start.k, start.tau, seed, AreaSplit::kBeforeShrinking)),
        finder_(wide_),
        tau_(start.tau),
        seed_(seed) {
    std::vector<int> part_of(wide_.num_stations(), -1);
    for (std::vector<StationIdx>& stations : IndependentParts(wide_)) {
      Part& part = parts_.emplace_back();
      for (const StationIdx station : stations) {
        part_of[station] = static_cast<int>(parts_.size()) - 1;
        if (wide_.coverable[station]) part.open.push_back(station);
      }
      part.stations = std::move(stations);
    }
    for (const Region& region : start.regions) {
      std::vector<StationIdx> core = ShrinkStations(wide_.neighbours, region.stations, start.tau);
      std::erase_if(core, [&](StationIdx station) { return !wide_.coverable[station]; });
      if (core.empty()) continue;
      CoreRegion widened = finder_.Widened(region.features, core);
      parts_[part_of[widened.stations[0]]].cores.push_back(std::move(widened));
    }
    for (Part& part : parts_) part.num_uncovered = part.max_uncovered = NumUncovered(part.cores, part.open);
  }

  void Improve(const BestOptions& options, Progress& progress) {
    int64_t num_items = 0;
    std::vector<size_t> small, large;
    for (size_t p = 0; p < parts_.size(); ++p) {
      const bool is_small = std::ssize(parts_[p].open) <= WindowStations(parts_[p], options);
      (is_small ? small : large).push_back(p);
      num_items += std::ssize(parts_[p].open) * (is_small ? 1 : kNumRounds + (options.with_bound ? 1 : 0));
    }
    progress.Begin("save regions", num_items, "stations");
    // Those with most stations take longest.
    std::stable_sort(small.begin(), small.end(),
                     [&](size_t a, size_t b) { return parts_[a].open.size() > parts_[b].open.size(); });
    ParallelFor(std::ssize(small), options.num_threads, [&](int64_t i) {
      Part& part = parts_[small[i]];
      ShareOfProgress share(progress, std::ssize(part.open), 1 + options.num_repairs);
      if (share.Cancelled()) return;
      PartCover found = CoverPart(CutOut(wide_, part.stations, part.open), part.cores, part.num_uncovered,
                                  options, MixSeed(seed_, part.stations[0]), share, nullptr);
      part.cores = std::move(found.cores);
      part.num_uncovered = found.num_uncovered;
      part.certificate = found.certificate;
      share.End();
    });
    for (const size_t p : large) ImproveLarge(options, &parts_[p], progress);
    progress.End();
    SpendWhatIsLeft();
  }

  void Certify(int num_threads, const Progress& progress) {
    ParallelFor(std::ssize(parts_), num_threads, [&](int64_t p) {
      Part& part = parts_[p];
      part.certificate = decompose_regions::Certify(CutOut(wide_, part.stations, part.open), part.cores,
                                                    part.num_uncovered, progress);
    });
  }

  // Of regions that leave at most so many stations uncovered.
  int LowerBound(int max_uncovered) const {
    std::vector<Certificate> certificates;
    for (const Part& part : parts_) certificates.push_back(part.certificate);
    return LeastNumberOfRegions(certificates, max_uncovered);
  }

  void Write(Decomposition* decomposition) {
    decomposition->regions.clear();
    decomposition->uncovered.clear();
    std::vector<char> open = wide_.coverable;
    for (const CoreRegion& core : cores_) {
      Region& region = decomposition->regions.emplace_back();
      for (const int32_t feature : core.features) region.features.push_back(wide_.original[feature]);
      std::sort(region.features.begin(), region.features.end());
      region.stations = finder_.RegionOf(core, tau_);
      for (const StationIdx station : core.stations) open[station] = 0;
    }
    for (StationIdx station = 0; station < world_.num_stations(); ++station) {
      if (open[station]) decomposition->uncovered.push_back(station);
    }
    decomposition->uncovered_limit = static_cast<int>(decomposition->uncovered.size());
  }

 private:
  struct Part {
    std::vector<StationIdx> stations, open;  // all, and coverable ones
    std::vector<CoreRegion> cores;
    int num_uncovered = 0, max_uncovered = 0;
    Certificate certificate;
  };

  // As many as some number of regions cover, if that is more: fewer regions leave little to choose.
  static int64_t WindowStations(const Part& part, const BestOptions& options) {
    int64_t num_covered = 0;
    for (const CoreRegion& core : part.cores) num_covered += std::ssize(core.stations);
    const int64_t num_regions = std::max<int64_t>(1, std::ssize(part.cores));
    return std::max<int64_t>(options.window_stations, options.window_regions * num_covered / num_regions);
  }

  // Other parts may leave as many more stations uncovered as one covers more than it did.
  void SpendWhatIsLeft() {
    int max_lost = 0;
    std::vector<CoreRegion> cores;
    for (Part& part : parts_) {
      max_lost += part.max_uncovered - part.num_uncovered;
      for (CoreRegion& core : part.cores) cores.push_back(Whole(core));
    }
    DropLeastUseful(wide_, max_lost, &cores);
    cores_ = std::move(cores);
  }

  static int NumUncovered(const std::vector<CoreRegion>& cores, const std::vector<StationIdx>& open) {
    std::vector<StationIdx> covered;
    for (const CoreRegion& core : cores)
      covered.insert(covered.end(), core.stations.begin(), core.stations.end());
    std::sort(covered.begin(), covered.end());
    return static_cast<int>(std::count_if(open.begin(), open.end(), [&](StationIdx station) {
      return !std::binary_search(covered.begin(), covered.end(), station);
    }));
  }

  // The whole core that a part of it belongs to.
  CoreRegion Whole(const CoreRegion& core) {
    for (std::vector<StationIdx>& stations : finder_.Cores(core.features)) {
      if (std::binary_search(stations.begin(), stations.end(), core.stations[0]))
        return {core.features, std::move(stations)};
    }
    return core;  // not reached: it lies in one of them
  }

  const World& world_;
  const ReducedWorld wide_;
  CoreFinder finder_;
  const int tau_;
  const uint64_t seed_;
  std::vector<Part> parts_;
  std::vector<CoreRegion> cores_;  // of all parts, in the end
  // Of large parts.
  struct Window {
    std::vector<StationIdx> stations, open;
    std::vector<size_t> regions;  // that lie in it: indices of cores
    int num_uncovered = 0, max_uncovered = 0;
    std::optional<PartCover> found;  // something better than they are
    std::vector<CoreRegion> useful;
  };
  void ImproveLarge(const BestOptions& options, Part* part, Progress& progress);
  void CoverWindow(const Part& part, const BestOptions& options, uint64_t seed, Window* window,
                   Progress& progress) const;
  std::vector<Window> MakeWindows(const Part& part, int most, Random* random);
  std::vector<int> Owners(const Part& part) const;
};

// Per station, of those regions that cover it the one whose middle is nearest; -1: none does.
std::vector<int> PartwiseCover::Owners(const Part& part) const {
  std::vector<int> owner(wide_.num_stations(), -1);
  std::vector<double> least(wide_.num_stations(), std::numeric_limits<double>::infinity());
  for (size_t r = 0; r < part.cores.size(); ++r) {
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const StationIdx station : part.cores[r].stations) middle += world_.positions[station];
    middle /= static_cast<double>(part.cores[r].stations.size());
    for (const StationIdx station : part.cores[r].stations) {
      const double distance = (world_.positions[station] - middle).squaredNorm();
      if (distance >= least[station]) continue;
      least[station] = distance;
      owner[station] = static_cast<int>(r);
    }
  }
  return owner;
}

// A region lies in the window that has all stations that it owns: without it, what it leaves uncovered is
// in there.
std::vector<PartwiseCover::Window> PartwiseCover::MakeWindows(const Part& part, int most, Random* random) {
  std::vector<Window> windows;
  std::vector<int> window_of(wide_.num_stations(), -1);
  for (std::vector<StationIdx>& stations : DividePoints(world_.positions, part.open, most, random)) {
    for (const StationIdx station : stations) window_of[station] = static_cast<int>(windows.size());
    windows.emplace_back().stations = std::move(stations);
  }
  constexpr int kNone = -1, kSeveral = -2;
  std::vector<int> window_of_region(part.cores.size(), kNone);
  const std::vector<int> owner = Owners(part);
  for (const StationIdx station : part.open) {
    if (owner[station] < 0) {
      ++windows[window_of[station]].num_uncovered;
      continue;
    }
    int& window = window_of_region[owner[station]];
    window = window == kNone || window == window_of[station] ? window_of[station] : kSeveral;
  }
  std::vector<char> stays_covered(wide_.num_stations(), 0);
  for (size_t r = 0; r < part.cores.size(); ++r) {
    if (window_of_region[r] >= 0) windows[window_of_region[r]].regions.push_back(r);
    if (window_of_region[r] != kSeveral) continue;
    for (const StationIdx station : part.cores[r].stations) stays_covered[station] = 1;
  }
  for (Window& window : windows) {
    for (const StationIdx station : window.stations) {
      if (!stays_covered[station]) window.open.push_back(station);
    }
  }
  return windows;
}

void PartwiseCover::CoverWindow(const Part& part, const BestOptions& options, uint64_t seed, Window* window,
                                Progress& progress) const {
  std::vector<CoreRegion> start;
  for (const size_t r : window->regions) start.push_back(part.cores[r]);
  PartCover found =
      CoverPart(CutOut(wide_, GrowStations(wide_.neighbours, window->stations, kMarginHops), window->open),
                start, window->max_uncovered, options, seed, progress, &window->useful);
  if (std::pair(found.cores.size(), found.num_uncovered) <= std::pair(start.size(), window->num_uncovered))
    window->found = std::move(found);
}

void PartwiseCover::ImproveLarge(const BestOptions& options, Part* part, Progress& progress) {
  Random random(MixSeed(seed_, part->stations[0]));
  std::vector<CoreRegion> useful;
  const auto num_stations = static_cast<int>(WindowStations(*part, options));
  for (int round = 0; round < kNumRounds && !progress.Cancelled(); ++round) {
    std::vector<Window> windows = MakeWindows(*part, num_stations, &random);
    // Each may leave its share of what is left uncovered.
    const int num_left = part->max_uncovered - part->num_uncovered;
    for (Window& window : windows) {
      window.max_uncovered =
          window.num_uncovered +
          static_cast<int>(int64_t{num_left} * std::ssize(window.stations) / std::ssize(part->open));
    }
    std::vector<uint64_t> seeds;
    for (size_t w = 0; w < windows.size(); ++w) seeds.push_back(random.Bits());
    ParallelFor(std::ssize(windows), options.num_threads, [&](int64_t w) {
      Window& window = windows[w];
      ShareOfProgress share(progress, std::ssize(window.stations), 1 + options.num_repairs);
      if (!share.Cancelled() && !window.open.empty()) CoverWindow(*part, options, seeds[w], &window, share);
      share.End();
    });
    std::vector<char> is_replaced(part->cores.size(), 0);
    std::vector<CoreRegion> cores;
    for (Window& window : windows) {
      for (const CoreRegion& core : window.useful) useful.push_back(Whole(core));
      if (!window.found) continue;
      for (const size_t r : window.regions) is_replaced[r] = 1;
      for (const CoreRegion& core : window.found->cores) cores.push_back(Whole(core));
    }
    for (size_t r = 0; r < part->cores.size(); ++r) {
      if (!is_replaced[r]) cores.push_back(std::move(part->cores[r]));
    }
    part->cores = std::move(cores);
    DropLeastUseful(wide_, 0, &part->cores);
    part->num_uncovered = NumUncovered(part->cores, part->open);
  }
  if (progress.Cancelled() || !options.with_bound) return;
  useful.insert(useful.begin(), part->cores.begin(), part->cores.end());
  part->certificate = decompose_regions::Certify(CutOut(wide_, part->stations, part->open), useful,
                                                 part->num_uncovered, progress);
  progress.Advance(std::ssize(part->open));
}

}  // namespace

Decomposition AlgorithmBest(const World& world, const Decomposition& start, const BestOptions& options,
                            uint64_t seed, Progress& progress) {
  PartwiseCover cover(world, start, seed);
  cover.Improve(options, progress);
  Decomposition fewest = start;
  cover.Write(&fewest);
  fewest.lower_bound = cover.LowerBound(fewest.uncovered_limit);
  return fewest;
}

int CertifiedLowerBound(const World& world, const Decomposition& decomposition, int num_threads,
                        const Progress& progress) {
  PartwiseCover cover(world, decomposition, decomposition.seed);
  cover.Certify(num_threads, progress);
  return cover.LowerBound(static_cast<int>(decomposition.uncovered.size()));
}

}  // namespace cairn::decompose_regions
