#include "runtime/laser/view_search_index.h"

#include <algorithm>
#include <bit>

namespace cairn {

int64_t FaceSet::Count() const {
  int64_t count = 0;
  for (const Word& word : words) count += std::popcount(word.bits);
  return count;
}

namespace {

// Calls visit(word of a, word of b) for the blocks of both, until it returns true; whether it did.  A short
// set skips through a long one.
template <typename Visit>
bool ForCommonBlocks(const FaceSet& a, const FaceSet& b, const Visit& visit) {
  const auto leap = [](const std::vector<FaceSet::Word>& words, size_t at, int32_t block) {
    size_t step = 1;
    while (at + step < words.size() && words[at + step].block < block) step *= 2;
    const auto end = words.begin() + static_cast<std::ptrdiff_t>(std::min(words.size(), at + step + 1));
    return static_cast<size_t>(
        std::lower_bound(words.begin() + static_cast<std::ptrdiff_t>(at), end, block,
                         [](const FaceSet::Word& word, int32_t other) { return word.block < other; }) -
        words.begin());
  };
  for (size_t i = 0, j = 0; i < a.words.size() && j < b.words.size();) {
    if (a.words[i].block < b.words[j].block) {
      i = leap(a.words, i, b.words[j].block);
    } else if (a.words[i].block > b.words[j].block) {
      j = leap(b.words, j, a.words[i].block);
    } else if (visit(a.words[i++], b.words[j++])) {
      return true;
    }
  }
  return false;
}

}  // namespace

FaceSet Intersection(const FaceSet& a, const FaceSet& b) {
  FaceSet both;
  ForCommonBlocks(a, b, [&](const FaceSet::Word& x, const FaceSet::Word& y) {
    if ((x.bits & y.bits) != 0) both.words.push_back({x.block, x.bits & y.bits});
    return false;
  });
  return both;
}

bool Intersects(const FaceSet& a, const FaceSet& b) {
  return ForCommonBlocks(
      a, b, [](const FaceSet::Word& x, const FaceSet::Word& y) { return (x.bits & y.bits) != 0; });
}

FaceSet ViewSearchIndex::BlocksNear(const Eigen::AlignedBox2f& box, const FaceSet& set) const {
  FaceSet near;
  for (const FaceSet::Word& word : set.words) {
    if (block_boxes_[word.block].intersects(box)) near.words.push_back(word);
  }
  return near;
}

ViewSearchIndex::Spectrum DirectionSpectrum(const std::vector<double>& angles_rad) {
  ViewSearchIndex::Spectrum spectrum{};
  for (int m = 1; m <= ViewSearchIndex::kNumHarmonics; ++m) {
    std::complex<double> sum = 0;
    for (const double angle : angles_rad) sum += std::polar(1.0, m * angle);
    spectrum[m - 1] = std::complex<float>(sum);
  }
  return spectrum;
}

ViewSearchIndex::ViewSearchIndex(const Views& views) : views_(views) {
  const int num_labels = views.plan.num_labels();
  faces_.resize(num_labels);
  words_per_label_ = (static_cast<size_t>(num_labels) + 63) / 64;
  together_.assign(words_per_label_ * num_labels, 0);
  walls_by_length_.assign(views.num_faces(), {});
  spectra_.resize(views.num_faces());
  boxes_.resize(views.num_faces());
  block_boxes_.resize((static_cast<size_t>(views.num_faces()) + 63) / 64);
  std::vector<std::complex<double>> turns;
  for (LabelIdx label = 0; label < num_labels; ++label) {
    const Eigen::Vector2d along = LabelEnd(views.plan, label) - LabelStart(views.plan, label);
    turns.push_back(std::polar(1.0, std::atan2(along.y(), along.x())));
  }
  std::vector<uint64_t> bits(words_per_label_);
  views.ForEachLabelSet([&](FaceIdx face, const std::vector<LabelIdx>& labels) {
    for (int64_t i = views.face_offsets[face]; i < views.face_offsets[face + 1]; ++i)
      boxes_[face].extend(views.plan.Metres(views.vertices[views.face_vertices[i]]).cast<float>());
    block_boxes_[face / 64].extend(boxes_[face]);
    std::fill(bits.begin(), bits.end(), 0);
    std::array<std::complex<double>, kNumHarmonics> sums{};
    for (const LabelIdx label : labels) {
      bits[label / 64] |= uint64_t{1} << (label % 64);
      faces_[label].Add(face);
      std::complex<double> power = 1;
      for (std::complex<double>& sum : sums) sum += power *= turns[label];
      const double length = views.plan.walls[WallOf(label)].Length();
      for (size_t i = 0; i < kLengths.size() && length >= kLengths[i]; ++i) ++walls_by_length_[face][i];
    }
    for (int m = 0; m < kNumHarmonics; ++m) spectra_[face][m] = std::complex<float>(sums[m]);
    // [Simsarian96 §2.3] with each edge, the union of the label sets that include it
    for (const LabelIdx label : labels) {
      uint64_t* row = together_.data() + label * words_per_label_;
      for (size_t i = 0; i < words_per_label_; ++i) row[i] |= bits[i];
    }
  });
}

}  // namespace cairn
