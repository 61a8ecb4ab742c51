#include "stages/match_features/prediction_reuse.h"

#include <algorithm>
#include <string>

#include "core/base/blob.h"

namespace cairn::match_features {
namespace {

constexpr char kPredictionSchema[] =
    "DROP TABLE IF EXISTS cairn_predicted_pairs;"
    "CREATE TABLE cairn_predicted_pairs (idx INTEGER PRIMARY KEY NOT NULL, pairs BLOB)";
constexpr size_t kNumbersOfPair = 3;

}  // namespace

void CreatePredictionTable(SQLite::Database& database) { database.exec(kPredictionSchema); }

PredictionReuse::PredictionReuse(const std::vector<ContentHash>& image_keys, std::vector<int> generations,
                                 const PredictPairsOptions& options)
    : generations_(std::move(generations)) {
  const int num_generations =
      generations_.empty() ? 0 : *std::max_element(generations_.begin(), generations_.end()) + 1;
  is_changed_.resize(num_generations);
  for (int generation = 0; generation < num_generations; ++generation) {
    ContentHasher hasher;
    hasher.Text("predicted").UInt(options.min_num_expected_matches);
    hasher.Double(options.max_ray_angle_deg)
        .Double(options.max_prior_error_px)
        .Double(options.min_baseline_m);
    for (size_t idx = 0; idx < image_keys.size(); ++idx) {
      if (generations_[idx] == generation) hasher.UInt(idx).Hash(image_keys[idx]);
    }
    states_.push_back(hasher.Finish());
  }
}

int PredictionReuse::GenerationOf(const std::pair<int, int>& pair) const {
  return std::max(generations_[pair.first], generations_[pair.second]);
}

void PredictionReuse::Add(const std::pair<int, int>& pair, const ContentHash& contents) {
  const int generation = GenerationOf(pair);
  ContentHash& state = states_[generation];
  state = ContentHasher().Hash(state).UInt(pair.first).UInt(pair.second).Hash(contents).Finish();
  is_changed_[generation] = 1;
}

std::vector<int> PredictionReuse::EndRound() {
  const auto first = std::find(is_changed_.begin(), is_changed_.end(), 1);
  std::vector<int> changed;
  for (auto generation = first; generation != is_changed_.end(); ++generation)
    changed.push_back(static_cast<int>(generation - is_changed_.begin()));
  // Of matches that were there a round earlier less is new.
  for (ContentHash& state : states_) state = ContentHasher().Hash(state).Text("round").Finish();
  std::fill(is_changed_.begin(), is_changed_.end(), 0);
  return changed;
}

ContentHash PredictionReuse::KeyOf(int generation) const {
  ContentHasher hasher;
  for (int of = 0; of <= generation; ++of) hasher.Hash(states_[of]);
  return hasher.Finish();
}

std::optional<std::vector<PredictedPair>> PredictionReuse::Find(int generation, ReuseSources* sources) const {
  return sources->Find(KeyOf(generation), [&](const ReuseEntry& entry, ReuseSources::Source& source) {
    std::optional<std::vector<PredictedPair>> predicted;
    SQLite::Statement query(source.Database(), "SELECT pairs FROM cairn_predicted_pairs WHERE idx = ?");
    query.bind(1, entry.row);
    if (!query.executeStep()) return predicted;
    const auto numbers = BlobToVector<int32_t>(query.getColumn(0), source.path());
    if (!numbers.ok() || numbers->size() % kNumbersOfPair != 0 ||
        HashContents({reinterpret_cast<const char*>(numbers->data()), numbers->size() * sizeof(int32_t)}) !=
            entry.contents)
      return predicted;
    std::vector<PredictedPair> pairs;
    for (size_t i = 0; i < numbers->size(); i += kNumbersOfPair) {
      const int first = (*numbers)[i], second = (*numbers)[i + 1];
      // The hash is in a file beside it that somebody may have written as well.
      if (first < 0 || second < 0 || std::max(first, second) >= std::ssize(generations_)) return predicted;
      pairs.push_back({{first, second}, (*numbers)[i + 2]});
    }
    predicted = std::move(pairs);
    return predicted;
  });
}

ReuseEntry PredictionReuse::Write(int generation, const std::vector<PredictedPair>& predicted,
                                  SQLite::Database& database) {
  std::vector<int32_t> numbers;
  for (const PredictedPair& pair : predicted) {
    if (GenerationOf(pair.idxs) == generation)
      numbers.insert(numbers.end(), {pair.idxs.first, pair.idxs.second, pair.num_expected});
  }
  const std::string_view bytes(reinterpret_cast<const char*>(numbers.data()),
                               numbers.size() * sizeof(int32_t));
  SQLite::Statement insert(database, "INSERT INTO cairn_predicted_pairs VALUES (?, ?)");
  insert.bind(1, ++num_written_);
  insert.bind(2, bytes.data(), static_cast<int>(bytes.size()));
  insert.exec();
  return {.key = KeyOf(generation), .contents = HashContents(bytes), .row = num_written_};
}

}  // namespace cairn::match_features
