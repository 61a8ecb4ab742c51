#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/line/program_identity.h"
#include "stages/match_features/prediction_reuse.h"
#include "tests/match_features/features_fixture.h"

namespace cairn::match_features {
namespace {

namespace fs = std::filesystem;

// Eight images in a row of which each sees what its neighbours see.
class MatchFeaturesReuse : public MatchFeaturesTest {
 protected:
  void SetUp() override {
    MatchFeaturesTest::SetUp();
    WriteFeatures(8);
  }

  void Edit(const std::string& sql) {
    SQLite::Database database(folder_ + "/features.db", SQLite::OPEN_READWRITE);
    database.exec(sql);
  }
  // Another picture of the same place: the same keypoints but the last.
  void Replace(int image_id) {
    Edit(
        fmt::format("UPDATE keypoints SET rows = 79, data = substr(data, 1, 79 * 16) WHERE image_id = {0};"
                    "UPDATE descriptors SET rows = 79, data = substr(data, 1, 79 * 128) WHERE image_id = {0}",
                    image_id));
  }
  void ExpectAsClean(const std::string& name, bool with_poses) {
    const auto clean = MatchTo("clean.db", with_poses, {}, 1);
    ASSERT_TRUE(clean.ok()) << clean.error().message;
    EXPECT_EQ(clean->num_taken_over, 0);
    EXPECT_EQ(*HashFile(folder_ + "/" + name), *HashFile(folder_ + "/clean.db")) << name;
    EXPECT_EQ(*HashFile(folder_ + "/" + name + ".reuse"), *HashFile(folder_ + "/clean.db.reuse")) << name;
  }
  // Runs over matches.db and tells how many pairs were computed; the bytes must be a clean run's.
  int64_t Computed(bool with_poses) {
    const auto summary = MatchTo("matches.db", with_poses, {.previous = true});
    EXPECT_TRUE(summary.ok()) << summary.error().message;
    if (!summary.ok()) return -1;
    ExpectAsClean("matches.db", with_poses);
    return summary->num_pairs_tried - summary->num_taken_over;
  }
  // Runs rounds of shards until nothing is left to them; returns the files, and the number of rounds
  // with work.
  std::vector<std::string> RunShards(int num_shards, bool with_poses, int* num_rounds) {
    std::vector<std::string> files;
    for (*num_rounds = 0;; ++*num_rounds) {
      std::vector<std::string> outputs;
      int64_t num_done = 0, num_missing = 0;
      for (int i = 1; i <= num_shards; ++i) {
        const std::string name = fmt::format("round{}_{}.db", *num_rounds, i);
        const auto shard = MatchTo(name, with_poses, {.files = files, .shard = Shard{i, num_shards}});
        EXPECT_TRUE(shard.ok()) << shard.error().message;
        if (!shard.ok() || *num_rounds > 20) return {};
        const int64_t num_own = shard->num_pairs_tried + shard->num_image_results;
        num_done += num_own;
        num_missing = num_own + shard->num_left_to_others;
        outputs.push_back(folder_ + "/" + name);
      }
      EXPECT_EQ(num_done, num_missing) << "the shares are the whole round";
      if (num_done == 0) return files;
      files.insert(files.end(), outputs.begin(), outputs.end());
    }
  }
};

TEST_F(MatchFeaturesReuse, TakesOverAllPairsWhereNothingChanged) {
  for (const bool with_poses : {true, false}) {
    ASSERT_TRUE(Match(with_poses).ok());
    EXPECT_EQ(Computed(with_poses), 0);
  }
}

TEST_F(MatchFeaturesReuse, MatchesAReplacedImageWithTheOthersOnly) {
  for (const bool with_poses : {true, false}) {
    ASSERT_TRUE(Match(with_poses).ok());
    Replace(with_poses ? 3 : 4);
    EXPECT_EQ(Computed(with_poses), 7);
  }
}

TEST_F(MatchFeaturesReuse, AddedAndRemovedImagesLeaveTheOtherPairsAlone) {
  ASSERT_TRUE(Match(false).ok());
  fs::copy_file(folder_ + "/features.db", folder_ + "/eight.db");
  Edit(
      "DELETE FROM images WHERE image_id = 2; DELETE FROM keypoints WHERE image_id = 2;"
      "DELETE FROM descriptors WHERE image_id = 2");
  EXPECT_EQ(Computed(false), 0);
  fs::copy_file(folder_ + "/eight.db", folder_ + "/features.db", fs::copy_options::overwrite_existing);
  EXPECT_EQ(Computed(false), 7);
}

TEST_F(MatchFeaturesReuse, ImagesOfOtherIdsAndNamesAreTheSameImages) {
  ASSERT_TRUE(Match(false).ok());
  Edit(
      "UPDATE images SET image_id = image_id + 100, name = 'other ' || name; UPDATE keypoints SET image_id = "
      "image_id + 100; UPDATE descriptors SET image_id = image_id + 100");
  EXPECT_EQ(Computed(false), 0);
}

TEST_F(MatchFeaturesReuse, CamerasPosesAndOptionsCount) {
  ASSERT_TRUE(Match(true).ok());
  capture_.images[7].cam_from_world->translation.x() += 0.001;
  EXPECT_EQ(Computed(true), 7);
  options_.num_frustum_seeds = 3;  // other pairs at first, the same in the end
  EXPECT_EQ(Computed(true), 0);
  options_.matching.memory_budget_mib = 1;
  EXPECT_EQ(Computed(true), 0);
  options_.matching.matcher.max_ratio = 0.7;
  EXPECT_EQ(Computed(true), 28);
  options_.matching.verification.guided.max_ratio = 0.7;
  EXPECT_EQ(Computed(true), 28);
  EXPECT_EQ(Computed(false), 28) << "no pose";
  Edit("UPDATE cameras SET prior_focal_length = 0");
  EXPECT_EQ(Computed(false), 28);
}

TEST_F(MatchFeaturesReuse, WhatWasPredictedOfEarlierSessionsIsTakenOver) {
  //   session    a a b b c c d d     of the first two, one generation, of c and of d in each round
  options_.num_frustum_seeds = 1;
  options_.num_frustum_scouts = 0;
  capture_.sessions = {"a", "b", "c", "d"};
  for (int i = 0; i < 8; ++i) {
    capture_.images[i].name = fmt::format("{}/{}.png", capture_.sessions[i / 2], i);
    Edit(fmt::format("UPDATE images SET name = '{}' WHERE image_id = {}", capture_.images[i].name, i + 1));
  }
  fs::copy_file(folder_ + "/features.db", folder_ + "/four.db");
  Edit("DELETE FROM images WHERE image_id > 6");
  ASSERT_TRUE(Match(true).ok());
  const auto same = MatchTo("matches.db", true, {.previous = true});
  const int num_of_three = same->num_predictions_taken_over;
  EXPECT_GT(num_of_three, 2);
  fs::copy_file(folder_ + "/four.db", folder_ + "/features.db", fs::copy_options::overwrite_existing);
  const auto added = MatchTo("matches.db", true, {.previous = true});
  EXPECT_EQ(added->num_predictions_taken_over, num_of_three);
  EXPECT_LT(added->num_taken_over, added->num_pairs_tried);
  ExpectAsClean("matches.db", true);
  // Of another place of an image of c, c and d are predicted anew.
  capture_.images[5].cam_from_world->translation.y() += 0.001;
  const auto moved = MatchTo("matches.db", true, {.previous = true});
  EXPECT_GT(moved->num_predictions_taken_over, 0);
  EXPECT_LT(moved->num_predictions_taken_over, num_of_three);
  ExpectAsClean("matches.db", true);
  SQLite::Database(folder_ + "/matches.db", SQLite::OPEN_READWRITE)
      .exec("UPDATE cairn_predicted_pairs SET pairs = zeroblob(12)");
  EXPECT_EQ(MatchTo("matches.db", true, {.previous = true})->num_predictions_taken_over, 0)
      << "not what it was";
  ExpectAsClean("matches.db", true);
}

TEST_F(MatchFeaturesReuse, PairsThatWereTriedInVainAreNotTriedAgain) {
  Edit("UPDATE descriptors SET data = zeroblob(80 * 128) WHERE image_id = 5");
  const auto first = Match(false);
  ASSERT_EQ(first->num_pairs_verified, 21);
  const auto again = MatchTo("matches.db", false, {.previous = true});
  EXPECT_EQ(again->num_pairs_tried, 28);
  EXPECT_EQ(again->num_taken_over, 28);
  EXPECT_EQ(again->num_putative, first->num_putative);
  EXPECT_EQ(Computed(false), 0);
}

TEST_F(MatchFeaturesReuse, ResultsThatTheMemoryDoesNotHoldAreReadAgain) {
  //   780 pairs, each of 80 matches and three matrices: 0.7 MiB, of which a budget of 1 MiB holds the half
  capture_ = {};
  fs::remove(folder_ + "/features.db");
  WriteFeatures(40);
  options_.matching.memory_budget_mib = 1;
  ASSERT_TRUE(Match(false).ok());
  EXPECT_EQ(Computed(false), 0);
  Replace(40);
  EXPECT_EQ(Computed(false), 39);
}

TEST_F(MatchFeaturesReuse, DamagedFilesAreComputedAnew) {
  ASSERT_TRUE(Match(false).ok());
  const std::string path = folder_ + "/matches.db.reuse";
  const std::string whole = *ReadFile(path);
  for (const size_t length : {size_t{0}, size_t{5}, size_t{60}, whole.size() - 1}) {
    std::ofstream(path, std::ios::binary) << whole.substr(0, length);
    EXPECT_EQ(Computed(false), 28) << length;
  }
  for (const size_t position : {size_t{3}, size_t{20}, size_t{50}, whole.size() / 2, whole.size() - 3}) {
    std::string damaged = whole;
    damaged[position] ^= 1;
    std::ofstream(path, std::ios::binary) << damaged;
    EXPECT_EQ(Computed(false), 28) << position;
  }
  fs::remove(path);
  EXPECT_EQ(Computed(false), 28);
  EXPECT_EQ(Computed(false), 0);
  fs::resize_file(folder_ + "/matches.db", 8192);
  EXPECT_EQ(Computed(false), 28);
}

TEST_F(MatchFeaturesReuse, RowsThatAreNotWhatTheReuseFileSaysAreComputed) {
  ASSERT_TRUE(Match(false).ok());
  {
    SQLite::Database database(folder_ + "/matches.db", SQLite::OPEN_READWRITE);
    database.exec("UPDATE two_view_geometries SET data = zeroblob(length(data)) WHERE pair_id % 7 = 0");
    EXPECT_GT(database.getChanges(), 0);
    database.exec(
        "UPDATE two_view_geometries SET F = E WHERE rowid = (SELECT max(rowid) FROM two_view_geometries)");
  }
  EXPECT_GT(Computed(false), 1);
}

TEST_F(MatchFeaturesReuse, AnotherDatabasesReuseFileGivesNothingWrong) {
  ASSERT_TRUE(Match(false).ok());
  fs::copy_file(folder_ + "/matches.db.reuse", folder_ + "/old.reuse");
  for (int image_id = 1; image_id <= 8; ++image_id) Replace(image_id);
  ASSERT_TRUE(Match(false).ok());
  fs::copy_file(folder_ + "/old.reuse", folder_ + "/matches.db.reuse", fs::copy_options::overwrite_existing);
  EXPECT_EQ(Computed(false), 28);
}

TEST_F(MatchFeaturesReuse, ShardsMergeToTheSameBytesExhaustively) {
  int num_rounds = 0;
  const std::vector<std::string> files = RunShards(3, false, &num_rounds);
  EXPECT_EQ(num_rounds, 1);
  const auto merged = MatchTo("merged.db", false, {.files = files});
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  EXPECT_EQ(merged->num_taken_over, 28);
  ExpectAsClean("merged.db", false);
}

TEST_F(MatchFeaturesReuse, ShardsMergeToTheSameBytesThroughTheRoundsOfFrustum) {
  capture_.images.clear();
  WriteFeatures(20);
  options_.num_frustum_seeds = 2;
  options_.num_frustum_scouts = 1;
  int num_rounds = 0;
  std::vector<std::string> files = RunShards(3, true, &num_rounds);
  EXPECT_GE(num_rounds, 2);
  const auto merged = MatchTo("merged.db", true, {.files = files});
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  EXPECT_EQ(merged->num_taken_over, merged->num_pairs_tried);
  EXPECT_EQ(merged->num_rounds, num_rounds - 1) << "in the first the seeds were chosen";
  ExpectAsClean("merged.db", true);

  fs::remove(files[1]);  // a node died in the first round
  fs::remove(files[4]);
  files.erase(files.begin() + 4);
  files.erase(files.begin() + 1);
  const auto mended = MatchTo("mended.db", true, {.files = files});
  ASSERT_TRUE(mended.ok()) << mended.error().message;
  EXPECT_GT(mended->num_taken_over, 0);
  EXPECT_LT(mended->num_taken_over, mended->num_pairs_tried);
  ExpectAsClean("mended.db", true);
}

TEST_F(MatchFeaturesReuse, ShardsMergeToTheSameBytesWherePairsLookAlike) {
  ShowAnotherPlace(5);
  options_.num_retrieved = 3;
  options_.sequence_window = 2;
  options_.num_loop_candidates = 2;
  for (const char* method : {"retrieval", "sequence"}) {
    options_.pairs = method;
    int num_rounds = 0;
    std::vector<std::string> files = RunShards(3, false, &num_rounds);
    EXPECT_EQ(num_rounds, 3) << "words, partners, pairs";
    const auto merged = MatchTo("merged.db", false, {.files = files});
    ASSERT_TRUE(merged.ok()) << merged.error().message;
    EXPECT_EQ(merged->num_taken_over, merged->num_pairs_tried);
    ExpectAsClean("merged.db", false);
    // A node died in each round.
    const auto mended = MatchTo("mended.db", false, {.files = {files[0], files[2], files[3], files[7]}});
    ASSERT_TRUE(mended.ok()) << mended.error().message;
    EXPECT_GT(mended->num_taken_over, 0);
    ExpectAsClean("mended.db", false);
  }
}

TEST_F(MatchFeaturesReuse, AnotherSeedOrVocabularyMakesOtherWords) {
  ShowAnotherPlace(5);
  options_.pairs = "retrieval";
  ASSERT_EQ(MatchTo("a.db", false, {.shard = Shard{1, 1}})->image_step, "words");
  const ReuseOptions again{.files = {folder_ + "/a.db"}, .shard = Shard{1, 1}};
  EXPECT_EQ(MatchTo("b.db", false, again)->image_step, "partners");
  seed_ = 1;
  EXPECT_EQ(MatchTo("b.db", false, again)->image_step, "words");
}

TEST_F(MatchFeaturesReuse, ShardsOfARoundThatLostOneDoItsPairs) {
  for (const int i : {1, 3})
    ASSERT_TRUE(MatchTo(fmt::format("a{}.db", i), false, {.shard = Shard{i, 3}}).ok());
  const std::vector<std::string> files = {folder_ + "/a1.db", folder_ + "/a3.db"};
  int64_t num_pairs = 0;
  for (const int i : {1, 2, 3})
    num_pairs +=
        MatchTo(fmt::format("b{}.db", i), false, {.files = files, .shard = Shard{i, 3}})->num_pairs_tried;
  EXPECT_EQ(num_pairs, 9) << "the share of the second of three";
}

TEST_F(MatchFeaturesReuse, AShardThatRunsAgainTakesOverItsOwnOutput) {
  ASSERT_EQ(MatchTo("a.db", false, {.previous = true, .shard = Shard{2, 3}})->num_taken_over, 0);
  const std::string bytes = *HashFile(folder_ + "/a.db");
  const auto again = MatchTo("a.db", false, {.previous = true, .shard = Shard{2, 3}});
  EXPECT_EQ(again->num_taken_over, again->num_pairs_tried);
  EXPECT_EQ(again->num_pairs_tried, 9);
  EXPECT_EQ(*HashFile(folder_ + "/a.db"), bytes);
}

TEST_F(MatchFeaturesReuse, AShardWithoutWorkWritesAnEmptyDatabase) {
  ASSERT_TRUE(Match(true).ok());
  const auto done = MatchTo("a.db", true, {.files = {folder_ + "/matches.db"}, .shard = Shard{1, 2}});
  ASSERT_TRUE(done.ok()) << done.error().message;
  EXPECT_EQ(done->num_pairs_tried, 0);
  EXPECT_TRUE(OpenColmapDatabase(folder_ + "/a.db").ok());
  EXPECT_TRUE(fs::exists(folder_ + "/a.db.reuse"));
  Edit("DELETE FROM images; DELETE FROM keypoints; DELETE FROM descriptors");
  EXPECT_TRUE(MatchTo("b.db", true, {.shard = Shard{1, 2}}).ok())
      << "the merge says that there are no images";
  EXPECT_EQ(Match(true).error().code, ErrorCode::kNoData);
}

TEST_F(MatchFeaturesReuse, NamedFilesMustBeDatabases) {
  EXPECT_EQ(MatchTo("x.db", false, {.files = {folder_ + "/absent.db"}}).error().code, ErrorCode::kNotFound);
  std::ofstream(folder_ + "/text.db") << "no database";
  EXPECT_EQ(MatchTo("x.db", false, {.files = {folder_ + "/text.db"}}).error().code, ErrorCode::kCorrupt);
  EXPECT_FALSE(fs::exists(folder_ + "/x.db"));
}

// Who writes the results writes their hashes.
TEST(PredictionReuse, PairsOfImagesThatAreNotThereAreComputed) {
  const std::string path = testing::TempDir() + "/predicted_pairs.db";
  PredictionReuse reuse({HashContents("a"), HashContents("b"), HashContents("c")}, {0, 0, 0}, {});
  const auto found = [&](const std::vector<int32_t>& numbers) {
    const std::string bytes(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(int32_t));
    ReuseEntry entry;
    EXPECT_TRUE(WriteDatabase(path, "", [&](SQLite::Database& database) {
                  CreatePredictionTable(database);
                  entry = reuse.Write(0, {}, database);
                  SQLite::Statement update(database, "UPDATE cairn_predicted_pairs SET pairs = ?");
                  update.bind(1, bytes.data(), static_cast<int>(bytes.size()));
                  update.exec();
                  return Ok();
                }).ok());
    entry.contents = HashContents(bytes);
    EXPECT_TRUE(WriteReuseFile(path, {entry}).ok());
    ReuseSources sources;
    EXPECT_TRUE(sources.Add(path).ok());
    return reuse.Find(0, &sources);
  };
  const auto pairs = found({0, 1, 50, 2, 0, 7});
  ASSERT_TRUE(pairs.has_value());
  ASSERT_EQ(pairs->size(), 2u);
  EXPECT_EQ(pairs->at(0).idxs, std::pair(0, 1));
  EXPECT_EQ(pairs->at(0).num_expected, 50);
  EXPECT_EQ(pairs->at(1).idxs, std::pair(2, 0));
  for (const auto& [first, second] : {std::pair(0, 3), std::pair(3, 0), std::pair(-1, 0), std::pair(0, -1)})
    EXPECT_FALSE(found({0, 1, 50, first, second, 50}).has_value()) << first << " " << second;
  EXPECT_FALSE(found({0, 1}).has_value());
}

}  // namespace
}  // namespace cairn::match_features
