#include "core/packing/packed_sights.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>
#include <memory>

#include "core/base/blob.h"
#include "core/packing/range_coder.h"

namespace cairn {
namespace {

// Landmarks are coded by groups of groups: first whether an image sees any of so many.
constexpr std::array<int64_t, 3> kGroupSizes = {4096, 256, 16};
constexpr int kReferenceBits = 8;
constexpr int kNone = 0;  // reference 1 is the image before

struct SightModels {
  // Per size of groups: by how many of the landmarks in it the references see (at most 5), and whether the
  // image sees any of the two groups before.
  std::array<std::array<AdaptiveBit, 6 * 4>, kGroupSizes.size()> groups;
  // By whether each reference sees the landmark, how many of the block's images before see it (at most 3),
  // and how many of the two landmarks before the image sees.
  std::array<AdaptiveBit, 4 * 4 * 3> landmarks;
  std::array<AdaptiveSymbol<kReferenceBits>, 2> references;
};

int64_t CountBetween(const std::vector<int32_t>& sorted, int64_t begin, int64_t end) {
  const auto first = std::lower_bound(sorted.begin(), sorted.end(), begin);
  return std::lower_bound(first, sorted.end(), end) - first;
}

// Codes the list of an image, given those of the images before it.  Both directions.
template <typename Coder>
class SightsCoder {
 public:
  SightsCoder(Coder& coder, int64_t num_landmarks)
      : coder_(coder), num_landmarks_(num_landmarks), models_(std::make_unique<SightModels>()) {}

  // False where there are more landmarks than an image may have.
  bool Code(std::array<int, 2> references, const SightLists& images, size_t image, size_t max_num_seen,
            std::vector<int32_t>* landmarks) {
    static const std::vector<int32_t> kNothing;
    max_num_seen_ = max_num_seen;
    given_ = landmarks;
    for (size_t i = 0; i < references.size(); ++i) {
      const auto back = models_->references[i].Code(coder_, static_cast<uint32_t>(references[i]));
      if (back > image) return false;
      references_[i] = back == kNone ? &kNothing : &images[image - back];
    }
    seen_.clear();
    if (!CodeGroup(0, 0, num_landmarks_)) return false;
    // Landmarks and how many images have seen them: both ascending.
    std::vector<std::pair<int32_t, int>> merged;
    auto known = times_seen_.begin();
    for (const int32_t landmark : seen_) {
      for (; known != times_seen_.end() && known->first < landmark; ++known) merged.push_back(*known);
      const bool is_known = known != times_seen_.end() && known->first == landmark;
      merged.emplace_back(landmark, is_known ? (known++)->second + 1 : 1);
    }
    merged.insert(merged.end(), known, times_seen_.end());
    times_seen_ = std::move(merged);
    *landmarks = seen_;
    return true;
  }

 private:
  // The groups of a size between two landmarks.
  bool CodeGroup(size_t level, int64_t begin, int64_t end) {
    if (level == kGroupSizes.size()) return CodeLandmarks(begin, end);
    constexpr int64_t kMostSeen = 5;
    std::array<bool, 2> before = {};
    for (int64_t first = begin; first < end; first += kGroupSizes[level]) {
      if (!coder_.ok()) return false;
      const int64_t last = std::min(end, first + kGroupSizes[level]);
      const int64_t num =
          CountBetween(*references_[0], first, last) + CountBetween(*references_[1], first, last);
      const auto context =
          static_cast<size_t>(std::min(num, kMostSeen)) * 4 + (before[0] ? 2 : 0) + (before[1] ? 1 : 0);
      const bool sees_any =
          coder_.Bit(&models_->groups[level][context], CountBetween(*given_, first, last) > 0);
      before = {sees_any, before[0]};
      if (sees_any && !CodeGroup(level + 1, first, last)) return false;
    }
    return true;
  }

  bool CodeLandmarks(int64_t begin, int64_t end) {
    constexpr int kMostTimes = 3;
    std::array<std::vector<int32_t>::const_iterator, 2> reference;
    for (size_t i = 0; i < reference.size(); ++i)
      reference[i] = std::lower_bound(references_[i]->begin(), references_[i]->end(), begin);
    auto given = std::lower_bound(given_->begin(), given_->end(), begin);
    auto known =
        std::lower_bound(times_seen_.begin(), times_seen_.end(), std::pair(static_cast<int32_t>(begin), 0));
    for (int64_t landmark = begin; landmark < end; ++landmark) {
      size_t by_references = 0;
      for (size_t i = 0; i < reference.size(); ++i) {
        const bool sees = reference[i] != references_[i]->end() && *reference[i] == landmark;
        if (sees) ++reference[i];
        by_references = 2 * by_references + (sees ? 1 : 0);
      }
      int times = 0;
      if (known != times_seen_.end() && known->first == landmark)
        times = std::min(kMostTimes, (known++)->second);
      size_t just_seen = 0;
      for (auto last = seen_.rbegin(); last != seen_.rend() && *last >= landmark - 2; ++last) ++just_seen;
      const bool is_given = given != given_->end() && *given == landmark;
      if (is_given) ++given;
      AdaptiveBit* model =
          &models_->landmarks[(static_cast<size_t>(times) * 4 + by_references) * 3 + just_seen];
      if (!coder_.Bit(model, is_given)) continue;
      if (seen_.size() == max_num_seen_) return false;
      seen_.push_back(static_cast<int32_t>(landmark));
    }
    return true;
  }

  Coder& coder_;
  int64_t num_landmarks_;
  size_t max_num_seen_ = 0;
  std::unique_ptr<SightModels> models_;
  std::vector<std::pair<int32_t, int>> times_seen_;
  std::vector<int32_t> seen_;
  const std::vector<int32_t>* given_ = nullptr;
  std::array<const std::vector<int32_t>*, 2> references_ = {};
};

// How many images back the two lie that have most landmarks in common with an image, less those that they do
// not have in common.
std::array<int, 2> BestReferences(const SightLists& images, size_t image) {
  std::vector<std::pair<int64_t, int>> order;
  const std::vector<int32_t>& own = images[image];
  const size_t num_before = std::min(image, (size_t{1} << kReferenceBits) - 1);
  for (size_t back = 1; back <= num_before; ++back) {
    const std::vector<int32_t>& other = images[image - back];
    std::vector<int32_t> common;
    std::set_intersection(own.begin(), own.end(), other.begin(), other.end(), std::back_inserter(common));
    order.emplace_back(static_cast<int64_t>(other.size()) - 2 * static_cast<int64_t>(common.size()),
                       static_cast<int>(back));
  }
  std::sort(order.begin(), order.end());
  std::array<int, 2> best = {kNone, kNone};
  for (size_t i = 0; i < std::min(best.size(), order.size()); ++i) best[i] = order[i].second;
  return best;
}

}  // namespace

std::string PackSights(const SightLists& images) {
  int64_t num_landmarks = 0;
  for (const std::vector<int32_t>& image : images) {
    if (!image.empty()) num_landmarks = std::max<int64_t>(num_landmarks, image.back() + 1);
  }
  BlobWriter writer;
  writer.Varint(static_cast<uint64_t>(num_landmarks));
  RangeEncoder coder;
  SightsCoder<RangeEncoder> sights(coder, num_landmarks);
  for (size_t image = 0; image < images.size(); ++image) {
    std::vector<int32_t> landmarks = images[image];
    sights.Code(BestReferences(images, image), images, image, landmarks.size(), &landmarks);
  }
  writer.Bytes(coder.Take());
  return writer.Take();
}

bool UnpackSights(std::string_view bytes, int64_t max_num_landmarks, size_t max_num_seen, int64_t* num_left,
                  SightLists* images) {
  BlobReader reader(bytes);
  const auto num_landmarks = static_cast<int64_t>(reader.Varint());
  if (!reader.ok() || num_landmarks < 0 || num_landmarks > max_num_landmarks) return false;
  RangeDecoder coder(reader.Bytes(reader.num_left()));
  SightsCoder<RangeDecoder> sights(coder, num_landmarks);
  for (size_t image = 0; image < images->size() && coder.ok(); ++image) {
    std::vector<int32_t> landmarks;
    const size_t most = std::min(max_num_seen, static_cast<size_t>(std::max<int64_t>(0, *num_left)));
    if (!sights.Code({}, *images, image, most, &landmarks)) return false;
    *num_left -= std::ssize(landmarks);
    (*images)[image] = std::move(landmarks);
  }
  return coder.Finished();
}

}  // namespace cairn
