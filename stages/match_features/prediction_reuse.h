#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/content_hash.h"
#include "core/files/database.h"
#include "core/line/reuse.h"
#include "stages/match_features/pairs/predict_pairs.h"

namespace cairn::match_features {

// Takes over what was predicted of earlier sessions.  No pair depends on images of a later session than its
// own two (pairs/earlier_partners.h), and most of the images of a survey of many sessions are of
// earlier ones.  What is predicted of a generation in a round is a function of what is stated and seen in its
// images and in those of earlier ones, and of the pairs of these that were matched so far, in which rounds:
// its key is the hash of all that (core/line/reuse.h).  The pairs themselves are a row of matches.db.
class PredictionReuse {
 public:
  // `image_keys`: hash of what a view is made of, and `generations`, by index of the image.
  PredictionReuse(const std::vector<ContentHash>& image_keys, std::vector<int> generations,
                  const PredictPairsOptions& options);

  // A pair that was matched, with the hash of its result.
  void Add(const std::pair<int, int>& pair, const ContentHash& contents);

  // Ends a round of pairs: the generations, ascending, of which something may be predicted by now: pairs
  // of them or of earlier ones were added.
  std::vector<int> EndRound();
  // What an earlier run predicted of a generation in this round, if it is known.
  std::optional<std::vector<PredictedPair>> Find(int generation, ReuseSources* sources) const;
  // Those of `predicted` (ascending) that are of a generation go into the database: where a later run finds
  // them.
  ReuseEntry Write(int generation, const std::vector<PredictedPair>& predicted, SQLite::Database& database);

 private:
  int GenerationOf(const std::pair<int, int>& pair) const;
  ContentHash KeyOf(int generation) const;

  std::vector<int> generations_;
  std::vector<ContentHash> states_;  // of what was added of each generation, in its order
  std::vector<char> is_changed_;     // since the last round
  int64_t num_written_ = 0;
};

// To be made before anything is written.
void CreatePredictionTable(SQLite::Database& database);

}  // namespace cairn::match_features
