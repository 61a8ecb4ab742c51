#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/content_hash.h"
#include "core/base/error.h"
#include "stages/match_features/match_run.h"

namespace cairn::match_features {

// Work on each image before pairs are known, divided among shards: the result of an image is a row
// of numbers.
struct ImageStep {
  std::string name;  // "words"
  // Hash of all that the result of an image depends on.
  std::function<Result<ContentHash>(int idx)> key;
  // Whether this can be a result: what lies in a file may have been made by somebody else.
  std::function<bool(const std::vector<int>& numbers)> is_valid;
  // Results of some images, in their order.
  std::function<Result<std::vector<std::vector<int>>>(const std::vector<int>& idxs)> compute;
};

// Whether all numbers are in [0, end).
bool AreBelow(std::span<const int> numbers, int end);

// The results of all images, by index, taken over from reuse.files or computed.  A shard that lacks some
// computes its share of them, writes it to the database and is done: nothing is returned.  A plan leaves them
// to shards, if there are enough, and returns nothing; otherwise it computes and writes them itself.
// REQUIRES: a database for a shard and for a plan.  Errors: those of the step; throws SQLite::Exception.
Result<std::optional<std::vector<std::vector<int>>>> RunImageStep(const ImageStep& step,
                                                                  SQLite::Database* database, MatchRun* run);

}  // namespace cairn::match_features
