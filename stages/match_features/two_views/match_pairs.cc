#include "stages/match_features/two_views/match_pairs.h"

#include <algorithm>
#include <future>
#include <memory>
#include <unordered_map>
#include <unordered_set>

#include "core/base/parallel.h"
#include "core/base/pooled.h"
#include "core/line/memory.h"

namespace cairn::match_features {
namespace {

// Number of pairs whose results may wait to be taken.
constexpr int64_t kBatchSize = 512;

using FeaturesOfImages = std::unordered_map<int, std::shared_ptr<const ImageFeatures>>;

// Every other bit of the result, from the lowest.
uint64_t SpreadBits(uint32_t value) {
  uint64_t bits = value;
  bits = (bits | bits << 16) & 0x0000ffff0000ffff;
  bits = (bits | bits << 8) & 0x00ff00ff00ff00ff;
  bits = (bits | bits << 4) & 0x0f0f0f0f0f0f0f0f;
  bits = (bits | bits << 2) & 0x3333333333333333;
  return (bits | bits << 1) & 0x5555555555555555;
}

uint64_t CurvePosition(const std::pair<int, int>& pair) {
  return SpreadBits(static_cast<uint32_t>(pair.first)) << 1 | SpreadBits(static_cast<uint32_t>(pair.second));
}

// Whether an image's pairs may be matched again by their geometry: that alone reads unpacked descriptors.
bool IsGuided(const MatchImage& image, const VerifyPairOptions& options) {
  return options.guided_matching == "all" || (options.guided_matching == "posed" && image.cam_from_world);
}

// Whether a pair of so many features is searched by indices.
bool IsSearchedByIndex(int64_t size1, int64_t size2, const DescriptorKind& kind, const std::string& search) {
  if (std::min(size1, size2) < ApproximateIndex::kMinNumDescriptors) return false;
  return search == "approximate" || (search == "auto" && IsApproximateFaster(size1, size2, kind.space()));
}

// Per image; an index where there is another one for which it is needed.
std::vector<NeededFeatures> NeededOfImages(const MatchImages& images, const MatchPairsOptions& options) {
  int most = 0, second = 0;
  for (const MatchImage& image : images.images) {
    second = std::max(second, std::min(most, image.num_features));
    most = std::max(most, image.num_features);
  }
  std::vector<NeededFeatures> needed;
  for (const MatchImage& image : images.images) {
    const int other = image.num_features == most ? second : most;
    needed.push_back({IsGuided(image, options.verification),
                      IsSearchedByIndex(image.num_features, other, images.descriptor_kind, options.search)});
  }
  return needed;
}

// Features of all images of pairs [begin, end); those in `held` are not read again.
Result<FeaturesOfImages> ReadStretch(SQLite::Database& database, const MatchImages& images,
                                     const std::vector<NeededFeatures>& needed, const IndexPairs& pairs,
                                     int64_t begin, int64_t end, const FeaturesOfImages& held,
                                     const Progress& progress) {
  FeaturesOfImages result;
  for (int64_t i = begin; i < end; ++i) {
    for (const int idx : {pairs[i].first, pairs[i].second}) {
      if (result.contains(idx)) continue;
      if (const auto it = held.find(idx); it != held.end()) {
        result.emplace(idx, it->second);
        continue;
      }
      if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while reading features");
      const MatchImage& image = images.images[idx];
      CAIRN_ASSIGN_OR_RETURN(ImageFeatures features,
                             ReadImageFeatures(database, image, images.cameras.at(image.camera_id),
                                               images.descriptor_kind, needed[idx]));
      result.emplace(idx, std::make_shared<const ImageFeatures>(std::move(features)));
    }
  }
  return result;
}

struct MatchedPair {
  TwoViewGeometry geometry;
  int num_putative = 0;
};

ViewForVerification ForVerification(const MatchImages& images, const MatchImage& image,
                                    const ImageFeatures& features) {
  return {&images.cameras.at(image.camera_id),
          &features.keypoints,
          &features.bearings,
          features.descriptors.rows() > 0 ? &features.descriptors : nullptr,
          features.packed.space(),
          image.cam_from_world};
}

MatchedPair MatchPair(const MatchImages& images, const std::pair<int, int>& pair,
                      const FeaturesOfImages& features, const MatchPairsOptions& options) {
  const MatchImage& image1 = images.images[pair.first];
  const MatchImage& image2 = images.images[pair.second];
  const ImageFeatures& features1 = *features.at(pair.first);
  const ImageFeatures& features2 = *features.at(pair.second);
  const bool by_index =
      IsSearchedByIndex(image1.num_features, image2.num_features, images.descriptor_kind, options.search);
  const PooledVector<Match> matches =
      by_index ? MatchApproximately(*features1.index, *features2.index, options.matcher)
               : MatchDescriptors(features1.packed, features2.packed, options.matcher);
  MatchedPair result;
  result.num_putative = static_cast<int>(matches.size());
  result.geometry = VerifyPair(ForVerification(images, image1, features1),
                               ForVerification(images, image2, features2), matches, options.verification);
  result.geometry.image_id1 = image1.image_id;
  result.geometry.image_id2 = image2.image_id;
  return result;
}

}  // namespace

void SortAlongCurve(IndexPairs* pairs) {
  std::sort(pairs->begin(), pairs->end(),
            [](const auto& a, const auto& b) { return CurvePosition(a) < CurvePosition(b); });
}

std::vector<int64_t> CutIntoStretches(const IndexPairs& pairs, const std::vector<int64_t>& num_bytes,
                                      int64_t max_num_bytes) {
  std::vector<int64_t> ends;
  std::unordered_set<int> held;
  int64_t num_held_bytes = 0;
  for (int64_t i = 0; i < static_cast<int64_t>(pairs.size()); ++i) {
    const auto [idx1, idx2] = pairs[i];
    const int64_t num_more =
        (held.contains(idx1) ? 0 : num_bytes[idx1]) + (held.contains(idx2) ? 0 : num_bytes[idx2]);
    if (!held.empty() && num_held_bytes + num_more > max_num_bytes) {
      ends.push_back(i);
      held.clear();
      num_held_bytes = num_bytes[idx1] + num_bytes[idx2];
    } else {
      num_held_bytes += num_more;
    }
    held.insert({idx1, idx2});
  }
  if (!pairs.empty()) ends.push_back(static_cast<int64_t>(pairs.size()));
  return ends;
}

Status MatchPairs(SQLite::Database& database, const MatchImages& images, IndexPairs pairs,
                  const MatchPairsOptions& options, int num_threads, Progress& progress,
                  const TakeGeometry& take) {
  SortAlongCurve(&pairs);
  const int64_t budget = static_cast<int64_t>(options.memory_budget_mib) << 20;
  const std::vector<NeededFeatures> needed = NeededOfImages(images, options);
  std::vector<int64_t> num_bytes;
  for (size_t i = 0; i < needed.size(); ++i) {
    num_bytes.push_back(
        ImageFeatures::NumBytes(images.images[i].num_features, images.descriptor_kind, needed[i]));
  }
  const std::vector<int64_t> ends = CutIntoStretches(pairs, num_bytes, budget / 2);
  FeaturesOfImages features;
  int64_t begin = 0;
  for (size_t stretch = 0; stretch < ends.size(); ++stretch) {
    if (stretch == 0) {
      CAIRN_ASSIGN_OR_RETURN(features,
                             ReadStretch(database, images, needed, pairs, 0, ends[0], {}, progress));
    }
    std::future<Result<FeaturesOfImages>> next;
    if (stretch + 1 < ends.size()) {
      next = std::async(std::launch::async | std::launch::deferred, [&, stretch] {
        return ReadStretch(database, images, needed, pairs, ends[stretch], ends[stretch + 1], features,
                           progress);
      });
    }
    for (; begin < ends[stretch]; begin = std::min(begin + kBatchSize, ends[stretch])) {
      std::vector<MatchedPair> results(std::min(kBatchSize, ends[stretch] - begin));
      ParallelFor(static_cast<int64_t>(results.size()), num_threads, [&](int64_t i) {
        if (progress.Cancelled()) return;
        results[i] = MatchPair(images, pairs[begin + i], features, options);
        progress.Advance();
      });
      if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while matching features");
      for (const MatchedPair& result : results) take(result.geometry, result.num_putative);
    }
    if (next.valid()) {
      CAIRN_ASSIGN_OR_RETURN(features, next.get());
      ReturnFreedMemory();  // those of the stretch that is done
    }
  }
  features.clear();
  ReturnFreedMemory();
  return Ok();
}

}  // namespace cairn::match_features
