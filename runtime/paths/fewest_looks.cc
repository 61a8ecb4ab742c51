#include "runtime/paths/fewest_looks.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

double WeightOf(const NumberSet& set, const std::vector<double>& weights) {
  double weight = 0;
  for (size_t i = 0; i < weights.size(); ++i) weight += set.Contains(i) ? weights[i] : 0;
  return weight;
}

// All that the chosen sets hold, but for some of them.
NumberSet UnionWithout(const std::vector<NumberSet>& sets, const std::vector<size_t>& chosen,
                       const std::array<size_t, 2>& without, size_t num_numbers) {
  NumberSet all(num_numbers);
  for (const size_t i : chosen) {
    if (i != without[0] && i != without[1]) all.InsertAll(sets[i]);
  }
  return all;
}

// Whether the convex polygons have a place in common that is not near to one of two walls.
bool MeetApartFromWalls(const ConvexPiece& a, const ConvexPiece& b, double radius_m) {
  ConvexPiece common = a;
  for (size_t i = 0; i < b.size() && !common.empty(); ++i)
    common = LeftOf(common, b[i], b[(i + 1) % b.size()] - b[i]);
  constexpr double kLeastArea = 1e-12;  // m2: rounding
  if (common.empty() || AreaOf(common) <= kLeastArea) return false;
  // What is near to a wall is convex: it holds a polygon if it holds its corners.  Walls are opposite corner
  // 0.
  for (const ConvexPiece* piece : {&a, &b}) {
    const bool is_near = std::all_of(common.begin(), common.end(), [&](const Vec2& corner) {
      return PointToSegment(corner, (*piece)[1], (*piece)[2]) < radius_m;
    });
    if (is_near) return false;
  }
  return true;
}

struct Box {
  Vec2 low, high;
};

// The triangles that a place sees, itself their corner 0.
std::vector<std::pair<ConvexPiece, Box>> Triangles(const LookAround& look) {
  std::vector<std::pair<ConvexPiece, Box>> triangles;
  for (const BlockedArc& arc : look.arcs()) {
    ConvexPiece triangle{look.place()};
    for (const double angle : {arc.from, arc.to})
      triangle.push_back(look.place() + arc.Distance(angle) * Vec2(std::cos(angle), std::sin(angle)));
    const Box box{triangle[0].cwiseMin(triangle[1]).cwiseMin(triangle[2]),
                  triangle[0].cwiseMax(triangle[1]).cwiseMax(triangle[2])};
    triangles.emplace_back(std::move(triangle), box);
  }
  return triangles;
}

bool AreApart(const Box& a, const Box& b) {
  return (a.low.array() > b.high.array()).any() || (b.low.array() > a.high.array()).any();
}

// Witnesses, and which of them are known to have a common view.
class WitnessGraph {
 public:
  WitnessGraph(const std::vector<Witness>& witnesses, double radius_m)
      : witnesses_(witnesses), radius_m_(radius_m), common_(witnesses.size() * witnesses.size(), kUnknown) {}

  bool AreJoined(size_t a, size_t b) {
    char& common = common_[std::min(a, b) * witnesses_.size() + std::max(a, b)];
    if (common == kUnknown) common = HaveCommonView(witnesses_[a], witnesses_[b], radius_m_) ? kYes : kNo;
    return common == kYes;
  }

  // Adds those of a list that are joined to none so far.
  void AddFree(const std::vector<size_t>& order, std::vector<size_t>* chosen) {
    for (const size_t next : order) {
      if (std::none_of(chosen->begin(), chosen->end(),
                       [&](size_t other) { return next == other || AreJoined(next, other); }))
        chosen->push_back(next);
    }
  }

 private:
  static constexpr char kUnknown = 0, kYes = 1, kNo = 2;
  const std::vector<Witness>& witnesses_;
  const double radius_m_;
  std::vector<char> common_;
};

}  // namespace

bool NumberSet::Meets(const NumberSet& other) const {
  for (size_t i = 0; i < words_.size(); ++i) {
    if ((words_[i] & other.words_[i]) != 0) return true;
  }
  return false;
}

bool NumberSet::IsWithin(const NumberSet& other) const {
  for (size_t i = 0; i < words_.size(); ++i) {
    if ((words_[i] & ~other.words_[i]) != 0) return false;
  }
  return true;
}

void NumberSet::InsertAll(const NumberSet& other) {
  for (size_t i = 0; i < words_.size(); ++i) words_[i] |= other.words_[i];
}

void NumberSet::EraseAll(const NumberSet& other) {
  for (size_t i = 0; i < words_.size(); ++i) words_[i] &= ~other.words_[i];
}

void NumberSet::KeepAll(const NumberSet& other) {
  for (size_t i = 0; i < words_.size(); ++i) words_[i] &= other.words_[i];
}

int NumberSet::Size() const {
  int size = 0;
  for (const uint64_t word : words_) size += std::popcount(word);
  return size;
}

std::vector<size_t> FewSets(const std::vector<NumberSet>& sets, const std::vector<double>& weights,
                            double least_share) {
  const size_t num = weights.size();
  NumberSet left(num);
  for (const NumberSet& set : sets) left.InsertAll(set);
  const double all = WeightOf(left, weights);
  std::vector<size_t> chosen{0};
  left.EraseAll(sets[0]);
  double rest = WeightOf(left, weights);
  // [Simsarian96 §4.3] A path to every region is more than is needed: places that together see enough.
  while (rest > (1 - least_share) * all) {
    size_t best = 0;
    double most = 0;
    for (size_t i = 1; i < sets.size(); ++i) {
      NumberSet gain = sets[i];
      gain.KeepAll(left);
      const double weight = WeightOf(gain, weights);
      if (weight <= most) continue;
      most = weight;
      best = i;
    }
    chosen.push_back(best);
    left.EraseAll(sets[best]);
    rest = WeightOf(left, weights);
  }
  if (least_share < 1) return chosen;
  for (size_t i = chosen.size(); i-- > 1;) {
    if (sets[chosen[i]].IsWithin(UnionWithout(sets, chosen, {chosen[i], chosen[i]}, num)))
      chosen.erase(chosen.begin() + static_cast<std::ptrdiff_t>(i));
  }
  const auto one_for_two = [&] {
    for (size_t i = 1; i < chosen.size(); ++i) {
      for (size_t k = i + 1; k < chosen.size(); ++k) {
        NumberSet needed = sets[chosen[i]];
        needed.InsertAll(sets[chosen[k]]);
        needed.EraseAll(UnionWithout(sets, chosen, {chosen[i], chosen[k]}, num));
        const auto one = std::find_if(sets.begin(), sets.end(),
                                      [&](const NumberSet& set) { return needed.IsWithin(set); });
        if (one == sets.end()) continue;
        chosen[i] = static_cast<size_t>(one - sets.begin());
        chosen.erase(chosen.begin() + static_cast<std::ptrdiff_t>(k));
        return true;
      }
    }
    return false;
  };
  while (one_for_two()) {
  }
  return chosen;
}

bool HaveCommonView(const Witness& a, const Witness& b, double radius_m) {
  if (a.viewers.Meets(b.viewers)) return true;
  const auto triangles_a = Triangles(a.look), triangles_b = Triangles(b.look);
  for (const auto& [triangle_a, box_a] : triangles_a) {
    for (const auto& [triangle_b, box_b] : triangles_b) {
      if (!AreApart(box_a, box_b) && MeetApartFromWalls(triangle_a, triangle_b, radius_m)) return true;
    }
  }
  return false;
}

int LeastNumLooks(const std::vector<Witness>& witnesses, double radius_m) {
  WitnessGraph graph(witnesses, radius_m);
  std::vector<size_t> order(witnesses.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return witnesses[a].viewers.Size() < witnesses[b].viewers.Size();
  });
  std::vector<size_t> chosen;
  graph.AddFree(order, &chosen);
  const auto two_for_one = [&] {
    for (size_t i = 0; i < chosen.size(); ++i) {
      std::vector<size_t> others = chosen;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      std::vector<size_t> free;
      for (const size_t next : order) {
        if (next != chosen[i] && std::none_of(others.begin(), others.end(), [&](size_t other) {
              return next == other || graph.AreJoined(next, other);
            }))
          free.push_back(next);
      }
      for (const size_t first : free) {
        std::vector<size_t> more = others;
        more.push_back(first);
        graph.AddFree(free, &more);
        if (more.size() <= chosen.size()) continue;
        chosen = std::move(more);
        return true;
      }
    }
    return false;
  };
  while (two_for_one()) {
  }
  return static_cast<int>(chosen.size());
}

}  // namespace cairn
