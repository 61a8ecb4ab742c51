#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "core/base/content_hash.h"
#include "core/base/error.h"
#include "stages/match_features/match_run.h"
#include "stages/match_features/pairs/retrieve_pairs.h"

namespace cairn::match_features {

// The rule that makes images that look alike partners.
struct LooksRule {
  // Hash of all that the partners depend on besides the images' words.
  ContentHash key;
  // The partners of some images, in their order.
  std::function<std::vector<std::vector<int>>(const ImageSimilarity& similarity,
                                              const std::vector<int>& idxs)>
      partners;
};

// The partners of all images, in two steps that are divided among shards (image_step.h): the words of each
// image, then its partners.  Errors: those of retrieve_pairs.h.
Result<std::optional<std::vector<std::vector<int>>>> PartnersByLooks(const LooksRule& rule,
                                                                     SQLite::Database* database,
                                                                     MatchRun* run);

}  // namespace cairn::match_features
