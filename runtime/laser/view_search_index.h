#pragma once

#include <array>
#include <complex>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Geometry>

#include "core/plan/views.h"

namespace cairn {

// A set of regions: words of 64, those without a member left out; ascending.
struct FaceSet {
  struct Word {
    int32_t block;
    uint64_t bits;
  };
  std::vector<Word> words;

  bool empty() const { return words.empty(); }
  int64_t Count() const;
  // REQUIRES: larger than those in it
  void Add(FaceIdx face) {
    if (words.empty() || words.back().block != face / 64) words.push_back({face / 64, 0});
    words.back().bits |= uint64_t{1} << (face % 64);
  }
};
FaceSet Intersection(const FaceSet& a, const FaceSet& b);
bool Intersects(const FaceSet& a, const FaceSet& b);

// What a search reads of a plan's regions: for each label the regions that see it and the labels that some
// region sees together with it, and for each region the numbers of its walls by length and the spread of
// their directions.
class ViewSearchIndex {
 public:
  // Lengths that walls are counted by, metres.
  static constexpr std::array<double, 8> kLengths = {0.25, 0.5, 1, 2, 4, 8, 16, 32};
  using LengthCounts = std::array<uint16_t, kLengths.size()>;

  // `views` outlives this.  O(regions * labels of each * labels / 64).
  explicit ViewSearchIndex(const Views& views);

  const Views& views() const { return views_; }
  const FaceSet& FacesOf(LabelIdx label) const { return faces_[label]; }
  bool SeenTogether(LabelIdx a, LabelIdx b) const {
    return (together_[static_cast<size_t>(a) * words_per_label_ + b / 64] >> (b % 64) & 1) != 0;
  }
  // Direction spectrum of a region's labels: sum over labels of exp(i m angle), m = 1 to kNumHarmonics.  A
  // heading turns it, its magnitudes are the same for all; one label more or less changes each by 1 at most.
  static constexpr int kNumHarmonics = 6;
  using Spectrum = std::array<std::complex<float>, kNumHarmonics>;
  const Spectrum& SpectrumOf(FaceIdx face) const { return spectra_[face]; }
  // The box around a region, metres.
  const Eigen::AlignedBox2f& BoxOf(FaceIdx face) const { return boxes_[face]; }
  // Those of a set's blocks of 64 regions that reach into a box.
  FaceSet BlocksNear(const Eigen::AlignedBox2f& box, const FaceSet& set) const;
  // How many of a region's walls are at least as long as each of kLengths.
  const LengthCounts& WallsByLength(FaceIdx face) const { return walls_by_length_[face]; }

 private:
  const Views& views_;
  std::vector<FaceSet> faces_;
  size_t words_per_label_ = 0;
  std::vector<uint64_t> together_;
  std::vector<LengthCounts> walls_by_length_;
  std::vector<Spectrum> spectra_;
  std::vector<Eigen::AlignedBox2f> boxes_;
  std::vector<Eigen::AlignedBox2f> block_boxes_;  // around 64 regions each
};

// The same of any directions.
ViewSearchIndex::Spectrum DirectionSpectrum(const std::vector<double>& angles_rad);

}  // namespace cairn
