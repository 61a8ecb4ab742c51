#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/world/decomposition.h"
#include "core/world/world.h"
#include "stages/decompose_regions/decompose_regions.h"

namespace cairn::decompose_regions {

// The figures leave ties open; these orders settle them: of equal stations or features the earlier one is
// taken.  All of a world's stations, and its features, in some order.
struct PaperTies {
  std::vector<StationIdx> stations;
  std::vector<FeatureIdx> features;
  // [Sala06 Fig. 3 line 3] A.3: the stations as they are drawn.
  std::vector<StationIdx> drawn;
};

// The six algorithms of [Sala06 Fig. 3, Fig. 4, Fig. 5], written down a second time from the figures alone:
// with sets, without a counter that is kept up to date, and without a line of the stage's own.  The oracle
// that tells them apart.  Slow: for some hundred stations.
class PaperAlgorithms {
 public:
  using Set = std::set<int>;

  PaperAlgorithms(const World& world, DecomposeRegionsOptions options, PaperTies ties)
      : options_(std::move(options)), ties_(std::move(ties)), num_stations_(world.num_stations()) {
    for (int v = 0; v < num_stations_; ++v) neighbours_[v] = {};
    for (const auto& [u, v] : world.edges) {
      neighbours_[u].insert(v);
      neighbours_[v].insert(u);
    }
    Reduce(world);
  }

  Decomposition Run() {
    // [Sala06 Fig. 3 line 1, Fig. 4 line 1, Fig. 5 line 1] U = {v : |F_v| >= k}, D = {}
    unassigned_ = coverable_;
    const std::string& name = options_.algorithm;
    if (name == "a1" || name == "a2" || name == "a3") RunA();
    if (name == "b1") RunB(false);
    if (name == "b2") RunB(true);
    if (name == "c") RunC();
    if (name != "b2") DropRedundant();
    return Grown();
  }

 private:
  struct ReducedFeature {
    FeatureIdx original;
    Set area;
  };
  struct Piece {
    Set features, poses;
  };

  // --- Sets

  static Set Common(const Set& a, const Set& b) {
    Set common;
    std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::inserter(common, common.end()));
    return common;
  }
  static Set Without(const Set& a, const Set& b) {
    Set rest;
    std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::inserter(rest, rest.end()));
    return rest;
  }
  static bool Contains(const Set& whole, const Set& part) {
    return std::includes(whole.begin(), whole.end(), part.begin(), part.end());
  }
  static int Size(const Set& set) { return static_cast<int>(set.size()); }

  // [Sala06 Def. 3.6] N_t of all of these.
  Set Ball(const Set& poses, int t) const {
    Set ball = poses;
    for (int hop = 0; hop < t; ++hop) {
      Set wider = ball;
      for (const int v : ball) wider.insert(neighbours_.at(v).begin(), neighbours_.at(v).end());
      ball = wider;
    }
    return ball;
  }
  // [Sala06 Def. 3.4] The connected parts, by their smallest poses.
  std::vector<Set> Parts(Set poses) const {
    std::vector<Set> parts;
    while (!poses.empty()) {
      Set part = {*poses.begin()};
      for (Set wider; wider != part; wider = Common(Ball(part, 1), poses)) {
        if (!wider.empty()) part = wider;
      }
      parts.push_back(part);
      poses = Without(poses, part);
    }
    return parts;
  }
  // The features that all of these poses see.
  Set SeenByAll(const Set& poses) const {
    std::optional<Set> seen;
    for (const int v : poses) seen = seen ? Common(*seen, sees_.at(v)) : sees_.at(v);
    return seen.value_or(Set());
  }
  // The poses that see all of these features.
  Set ThatSee(const Set& features) const {
    Set poses;
    for (int v = 0; v < num_stations_; ++v) {
      if (Contains(sees_.at(v), features)) poses.insert(v);
    }
    return poses;
  }
  static int PlaceIn(const std::vector<int>& order, int value) {
    return static_cast<int>(std::find(order.begin(), order.end(), value) - order.begin());
  }

  // --- [Sala06 Theorem 4.1], §V-A, §V-C: the problem without overlap; each part of an area is a feature.

  void Reduce(const World& world) {
    std::map<FeatureIdx, Set> shrunk;
    std::map<int, int> num_seen;
    for (const FeatureIdx feature : ties_.features) {
      const Set area(world.areas[feature].begin(), world.areas[feature].end());
      for (const int v : area) {
        if (!Contains(area, Ball({v}, options_.tau))) continue;
        shrunk[feature].insert(v);
        ++num_seen[v];
      }
    }
    for (const auto& [v, num] : num_seen) {
      if (num >= options_.k) coverable_.insert(v);
    }
    for (int v = 0; v < num_stations_; ++v) sees_[v] = {};
    for (const FeatureIdx feature : ties_.features) {
      for (const Set& part : Parts(Common(shrunk[feature], coverable_))) {
        for (const int v : part) sees_[v].insert(static_cast<int>(features_.size()));
        features_.push_back({feature, part});
      }
    }
  }

  // --- What the figures share

  int NumNew(const Set& poses) const {
    Set fresh = poses;
    for (const Piece& piece : pieces_) fresh = Without(fresh, piece.poses);
    return Size(fresh);
  }
  // [Sala06 Fig. 3 lines 15-16, Fig. 4 lines 10-11, Fig. 5 lines 14-15] U = U \ R, D = D u {R}, subject to
  // rho.  Returns how many poses of R no other region covers, 0 where R is not added.
  int Add(const Set& features, const Set& poses) {
    const int num_new = NumNew(poses);
    unassigned_ = Without(unassigned_, poses);
    if (num_new <= options_.rho) return 0;
    pieces_.push_back({features, poses});
    return num_new;
  }

  // --- [Sala06 Fig. 3]

  int Seed() const {
    std::vector<int> open;  // in the order that settles ties
    for (const int v : options_.algorithm == "a3" ? ties_.drawn : ties_.stations) {
      if (unassigned_.count(v)) open.push_back(v);
    }
    const auto fewer = [&](int a, int b) { return sees_.at(a).size() < sees_.at(b).size(); };
    if (options_.algorithm == "a1") return *std::min_element(open.begin(), open.end(), fewer);
    if (options_.algorithm == "a2") return *std::max_element(open.begin(), open.end(), fewer);
    return open.front();
  }

  void RunA() {
    while (!unassigned_.empty()) {  // [Sala06 Fig. 3 line 2]
      Set region = {Seed()};        // [Sala06 Fig. 3 lines 3-4]
      for (;;) {
        const Set phi = SeenByAll(region);
        Set w;  // [Sala06 Fig. 3 line 6]
        for (const int u : Without(Ball(region, 1), region)) {
          if (Size(Common(sees_.at(u), phi)) >= options_.k) w.insert(u);
        }
        if (w.empty()) break;                                                  // [Sala06 Fig. 3 line 14]
        if (const Set open = Common(w, unassigned_); !open.empty()) w = open;  // [Sala06 Fig. 3 lines 8-9]
        int best = -1, most = -1;                                              // [Sala06 Fig. 3 line 11]
        for (const int u : ties_.stations) {
          if (!w.count(u) || Size(Common(sees_.at(u), phi)) <= most) continue;
          best = u;
          most = Size(Common(sees_.at(u), phi));
        }
        region.insert(best);  // [Sala06 Fig. 3 line 12]
      }
      Add(MostVisible(SeenByAll(region)), region);
    }
  }
  // Which k of the common features a region keeps is not in the figure: those with the largest areas.
  Set MostVisible(const Set& features) const {
    std::vector<int> order(features.begin(), features.end());
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return features_[a].area.size() > features_[b].area.size(); });
    return {order.begin(), order.begin() + options_.k};
  }

  // --- [Sala06 Fig. 4]

  // [Sala06 Fig. 4 lines 3-9, Fig. 5 lines 7-13] `allowed`: F in B.x, Phi in C.
  Piece Shrunk(const Set& allowed) const {
    Set poses = unassigned_, chosen;
    for (int i = 0; i < options_.k; ++i) {
      int best = -1, most = -1;
      for (const int f : Without(allowed, chosen)) {
        const int num_seeing = Size(Common(poses, features_[f].area));
        if (num_seeing <= most) continue;
        best = f;
        most = num_seeing;
      }
      poses = Common(poses, features_[best].area);
      chosen.insert(best);
    }
    return {chosen, ThatSee(chosen)};
  }
  Set AllFeatures() const {
    Set all;
    for (int f = 0; f < static_cast<int>(features_.size()); ++f) all.insert(all.end(), f);
    return all;
  }

  void RunB(bool purges) {
    while (!unassigned_.empty()) {  // [Sala06 Fig. 4 line 2]
      const Piece found = Shrunk(AllFeatures());
      for (const Set& part : Parts(found.poses)) {
        const int num_gained = Add(found.features, part);
        if (purges && num_gained > 0) Purge(num_gained);
      }
    }
  }
  // [Sala06 Fig. 4 line 12] The region with the least loss goes, while all losses together stay below the
  // gain.
  void Purge(int num_gained) {
    for (int num_lost = 0;;) {
      int best = -1, least = 0;
      Set lost_with_best;
      for (size_t i = 0; i < pieces_.size(); ++i) {
        Set alone = pieces_[i].poses;
        for (size_t j = 0; j < pieces_.size(); ++j) {
          if (j != i) alone = Without(alone, pieces_[j].poses);
        }
        if (best >= 0 && Size(alone) >= least) continue;
        best = static_cast<int>(i);
        least = Size(alone);
        lost_with_best = alone;
      }
      if (num_lost + least >= num_gained) return;
      num_lost += least;
      unassigned_.insert(lost_with_best.begin(), lost_with_best.end());
      pieces_.erase(pieces_.begin() + best);
    }
  }

  // --- [Sala06 Fig. 5]

  // [Sala06 Fig. 5 line 2] A disc that cannot grow counts no further.
  int Radius() const {
    for (int t = 0;; ++t) {
      int num_seeing = 0;
      for (const int u : unassigned_) {
        const Set ball = Ball({u}, t);
        if (t > 0 && ball == Ball({u}, t - 1)) continue;
        num_seeing += Size(SeenByAll(Common(ball, unassigned_))) >= options_.k;
      }
      if (2 * num_seeing < Size(unassigned_)) return t - 1;
    }
  }

  void RunC() {
    const int radius = Radius();
    for (int v = 0; v < num_stations_; ++v) {  // [Sala06 Fig. 5 line 3]
      const Set disc = Ball({v}, radius), open = Common(disc, unassigned_);
      if (open.empty()) continue;  // nothing to assign
      const Set phi = SeenByAll(open);
      // [Sala06 Fig. 5 line 6]
      if (Size(open) < options_.alpha * Size(disc) || Size(phi) < options_.k) continue;
      const Piece found = Shrunk(phi);
      for (const Set& part : Parts(found.poses)) Add(found.features, part);
    }
    RunB(false);  // [Sala06 §V-C] the rest of U
  }

  // --- [Sala06 §V-D]

  void DropRedundant() {
    for (;;) {
      int best = -1, largest = 1;
      for (size_t i = 0; i < pieces_.size(); ++i) {
        int mu = static_cast<int>(pieces_.size());
        for (const int v : pieces_[i].poses) {
          mu = std::min(
              mu, static_cast<int>(std::count_if(pieces_.begin(), pieces_.end(),
                                                 [&](const Piece& p) { return p.poses.count(v) > 0; })));
        }
        if (mu <= largest) continue;
        best = static_cast<int>(i);
        largest = mu;
      }
      if (best < 0) return;
      pieces_.erase(pieces_.begin() + best);
    }
  }

  // [Sala06 Theorem 4.2] Regions grow by tau.
  Decomposition Grown() const {
    Decomposition result{.algorithm = options_.algorithm, .k = options_.k, .tau = options_.tau};
    Set uncovered = coverable_;
    for (const Piece& piece : pieces_) {
      Region& region = result.regions.emplace_back();
      for (const int f : piece.features) region.features.push_back(features_[f].original);
      std::sort(region.features.begin(), region.features.end());
      const Set grown = Ball(piece.poses, options_.tau);
      region.stations.assign(grown.begin(), grown.end());
      uncovered = Without(uncovered, piece.poses);
    }
    result.uncovered.assign(uncovered.begin(), uncovered.end());
    return result;
  }

  const DecomposeRegionsOptions options_;
  const PaperTies ties_;
  const int num_stations_;
  std::map<int, Set> neighbours_;
  std::vector<ReducedFeature> features_;  // in the order of ties
  std::map<int, Set> sees_;               // F'_v
  Set coverable_, unassigned_;            // unassigned_: U
  std::vector<Piece> pieces_;             // D
};

}  // namespace cairn::decompose_regions
