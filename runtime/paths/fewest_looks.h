#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "runtime/paths/floor_pieces.h"

namespace cairn {

// Sets of whole numbers below a bound.
class NumberSet {
 public:
  explicit NumberSet(size_t num_numbers) : words_((num_numbers + 63) / 64, 0) {}
  void Insert(size_t number) { words_[number / 64] |= uint64_t{1} << (number % 64); }
  bool Contains(size_t number) const { return (words_[number / 64] >> (number % 64) & 1) != 0; }
  bool Meets(const NumberSet& other) const;
  bool IsWithin(const NumberSet& other) const;
  void InsertAll(const NumberSet& other);
  void EraseAll(const NumberSet& other);
  void KeepAll(const NumberSet& other);
  int Size() const;

 private:
  std::vector<uint64_t> words_;
};

// A small number of sets that together hold all numbers that any of them holds, the first set among them:
// greedily by the weight that each adds, then without those that the others make needless, then with one in
// place of two where that is enough.  Indices into `sets`, the first first.  `least_share`: of the weight of
// all, after which the greedy choice stops; nothing is improved if it is less than 1.
std::vector<size_t> FewSets(const std::vector<NumberSet>& sets, const std::vector<double>& weights,
                            double least_share);

// A place of the floor that someone must see, what is seen from it, and from which of some places it is seen.
struct Witness {
  LookAround look;
  NumberSet viewers;
};

// Whether a robot that keeps `radius_m` from walls might see two witnesses from one place.  False is certain
// up to rounding: what is seen from both has no area, or lies nearer to a wall.
bool HaveCommonView(const Witness& a, const Witness& b, double radius_m);

// How many places a search must look from at least: witnesses no two of which have a common view need a place
// each. So guards of art galleries are bounded from below [Amit, Mitchell & Packer, IJCGA 2010].  Greedily,
// those first that are seen from the fewest places, then two in place of one.
int LeastNumLooks(const std::vector<Witness>& witnesses, double radius_m);

}  // namespace cairn
