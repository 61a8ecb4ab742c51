#include "stages/match_features/shard_plan.h"

#include <filesystem>
#include <fstream>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/match_features/features_fixture.h"

namespace cairn::match_features {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

TEST(ShardPlan, AShardHasTheLeastAtLeastAndOneAloneIsNone) {
  EXPECT_EQ(NumShardsOf(0, 10, 8), 0);
  EXPECT_EQ(NumShardsOf(19, 10, 8), 0);
  EXPECT_EQ(NumShardsOf(20, 10, 8), 2);
  EXPECT_EQ(NumShardsOf(79, 10, 8), 7);
  EXPECT_EQ(NumShardsOf(1000, 10, 8), 8);
  EXPECT_EQ(NumShardsOf(1000, 10, 1), 0);
}

TEST(ShardPlan, ItIsTheLastWhereTheNextRoundWillHardlyBeDivided) {
  const auto is_last = [](int num_rounds, int num_with_work, int num_shards = 8, bool predicts = true,
                          const std::string& image_step = "") {
    return IsLastPlan(
        {.num_rounds = num_rounds, .image_step = image_step, .num_shards_with_work = num_with_work},
        num_shards, predicts);
  };
  EXPECT_TRUE(is_last(1, 0));
  EXPECT_FALSE(is_last(1, 2)) << "what the first pairs predict may be more";
  EXPECT_TRUE(is_last(2, 3));
  EXPECT_FALSE(is_last(2, 4));
  EXPECT_TRUE(is_last(3, 3));
  EXPECT_FALSE(is_last(3, 2, 2)) << "all that there are";
  EXPECT_TRUE(is_last(1, 8, 8, false)) << "nothing follows";
  EXPECT_FALSE(is_last(0, 2, 8, false, "words"));
}

class ShardPlanTest : public MatchFeaturesTest {
 protected:
  static constexpr int kNumShards = 3;

  std::string Path(const std::string& name) const { return folder_ + "/" + name; }

  Result<MatchFeaturesSummary> PlanTo(const std::string& name, const std::vector<std::string>& files,
                                      int num_threads = 2) {
    inputs_.features_path = Path("features.db");
    inputs_.capture = with_poses_ ? &capture_ : nullptr;
    NoProgress progress;
    return PlanShards(inputs_, options_, {kNumShards, min_num_images_}, Path(name), seed_, num_threads,
                      progress, {.previous = true, .files = files});
  }
  Result<MatchFeaturesSummary> ShardTo(const std::string& name, int index, int num_shards,
                                       const std::string& plan, const std::vector<std::string>& files) {
    inputs_.plan_path = Path(plan);
    auto summary = MatchTo(name, with_poses_, {.files = files, .shard = Shard{index, num_shards}});
    inputs_.plan_path.clear();
    return summary;
  }

  bool IsLast(const MatchFeaturesSummary& planned) const {
    return IsLastPlan(planned, kNumShards, planned.pairs == "frustum" && options_.num_frustum_seeds > 0);
  }

  // Plans and runs shards until a plan is the last, and returns all files; what was planned is in `rounds_`.
  std::vector<std::string> GoThroughRounds() {
    std::vector<std::string> files;
    rounds_.clear();
    for (int round = 1; round < 20; ++round) {
      const std::string plan = fmt::format("plan{}.db", round);
      const auto planned = PlanTo(plan, files);
      EXPECT_TRUE(planned.ok()) << planned.error().message;
      if (!planned.ok()) return {};
      rounds_.push_back(*planned);
      const int num_shards = planned->num_shards_with_work;
      EXPECT_EQ(*ReadFile(Path(plan + ".shards")),
                fmt::format("{}{}\n", num_shards, IsLast(*planned) ? " last" : ""));
      std::vector<std::string> outputs = {Path(plan)};
      int64_t num_done = 0;
      for (int i = 1; i <= num_shards; ++i) {
        const std::string name = fmt::format("round{}_{}.db", round, i);
        const auto shard = ShardTo(name, i, num_shards, plan, files);
        EXPECT_TRUE(shard.ok()) << shard.error().message;
        if (!shard.ok()) return {};
        EXPECT_EQ(shard->num_taken_over, 0);
        num_done += shard->num_pairs_tried + shard->num_image_results;
        outputs.push_back(Path(name));
      }
      EXPECT_EQ(num_done, planned->num_left_to_others) << "the shares are all that was planned";
      files.insert(files.end(), outputs.begin(), outputs.end());
      if (IsLast(*planned)) break;
    }
    return files;
  }

  void ExpectAsClean(const std::string& name) {
    ASSERT_TRUE(MatchTo("clean.db", with_poses_, {}, 1).ok());
    EXPECT_EQ(*HashFile(Path(name)), *HashFile(Path("clean.db"))) << name;
    EXPECT_EQ(*HashFile(Path(name + ".reuse")), *HashFile(Path("clean.db.reuse"))) << name;
  }

  bool with_poses_ = true;
  int min_num_images_ = 1;
  std::vector<MatchFeaturesSummary> rounds_;
};

TEST_F(ShardPlanTest, PlannedShardsMergeToTheSameBytesThroughTheRoundsOfFrustum) {
  WriteFeatures(40);
  options_.num_frustum_seeds = 2;
  options_.num_frustum_scouts = 1;
  std::vector<std::string> files = GoThroughRounds();
  ASSERT_GE(rounds_.size(), 3u);
  EXPECT_EQ(rounds_[0].image_step, "seeds");
  EXPECT_EQ(rounds_[1].num_rounds, 1);
  EXPECT_EQ(rounds_[2].num_rounds, 2);
  EXPECT_GT(rounds_[2].num_predictions_taken_over + rounds_[2].num_shards_with_work, 0);
  const auto merged = MatchTo("merged.db", true, {.files = files});
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  int64_t num_planned = 0;
  for (const MatchFeaturesSummary& round : rounds_)
    num_planned += round.image_step.empty() ? round.num_left_to_others : 0;
  EXPECT_EQ(merged->num_taken_over, num_planned) << "none was matched twice";
  EXPECT_GT(merged->num_predictions_taken_over, 0) << "of what plans predicted";
  ExpectAsClean("merged.db");

  std::erase_if(files, [&](const std::string& file) {  // a node died in each round
    return file.ends_with("_2.db") || file.ends_with("plan2.db");
  });
  const auto mended = MatchTo("mended.db", true, {.files = files});
  ASSERT_TRUE(mended.ok()) << mended.error().message;
  EXPECT_GT(mended->num_taken_over, 0);
  EXPECT_LT(mended->num_taken_over, num_planned);
  ExpectAsClean("mended.db");
}

TEST_F(ShardPlanTest, EveryWayToChoosePairsIsPlanned) {
  WriteFeatures(30);
  ShowAnotherPlace(16);
  options_.num_retrieved = 4;
  options_.sequence_window = 2;
  options_.num_loop_candidates = 2;
  with_poses_ = false;
  for (const char* method : {"exhaustive", "retrieval", "sequence"}) {
    options_.pairs = method;
    const std::vector<std::string> files = GoThroughRounds();
    ASSERT_FALSE(rounds_.empty());
    if (options_.pairs != "exhaustive") {
      ASSERT_GE(rounds_.size(), 3u);
      EXPECT_EQ(rounds_[0].image_step, "words");
      EXPECT_EQ(rounds_[1].image_step, "partners");
    }
    const auto merged = MatchTo("merged.db", false, {.files = files});
    ASSERT_TRUE(merged.ok()) << merged.error().message;
    EXPECT_EQ(merged->num_taken_over, merged->num_pairs_tried) << method;
    ExpectAsClean("merged.db");
  }
  // All overlapping pairs.
  options_.pairs = "frustum";
  options_.num_frustum_seeds = 0;
  with_poses_ = true;
  const std::vector<std::string> files = GoThroughRounds();
  EXPECT_EQ(rounds_[0].image_step, "overlaps");
  EXPECT_GT(MatchTo("merged.db", true, {.files = files})->num_taken_over, 0);
  ExpectAsClean("merged.db");
}

TEST_F(ShardPlanTest, WhatIsTooLittleIsLeftToTheMerge) {
  WriteFeatures(8);
  min_num_images_ = 64;
  const std::vector<std::string> files = GoThroughRounds();
  ASSERT_EQ(rounds_.size(), 1u);
  EXPECT_EQ(rounds_[0].num_shards_with_work, 0);
  EXPECT_EQ(rounds_[0].num_left_to_others, 0);
  EXPECT_EQ(rounds_[0].image_step, "") << "the plan ranks few images itself";
  ASSERT_TRUE(MatchTo("merged.db", true, {.files = files}).ok());
  ExpectAsClean("merged.db");
}

TEST_F(ShardPlanTest, WhatAnEarlierOutputHasIsNotPlanned) {
  WriteFeatures(20);
  ASSERT_TRUE(Match(true).ok());
  min_num_images_ = 2;  // seeds of 16 images a shard: the plan finds them itself
  const auto planned = PlanTo("plan.db", {Path("matches.db")});
  ASSERT_TRUE(planned.ok()) << planned.error().message;
  EXPECT_EQ(planned->num_shards_with_work, 0);
  EXPECT_EQ(*ReadFile(Path("plan.db.shards")), "0 last\n");
}

// A node died: the plan finds the few words that are missing itself, and leaves the next step to shards.
TEST_F(ShardPlanTest, ShardsKnowWhatTheirOwnPlanFoundOut) {
  WriteFeatures(30);
  ShowAnotherPlace(16);
  options_.pairs = "retrieval";
  with_poses_ = false;
  ASSERT_EQ(PlanTo("plan.db", {})->image_step, "words");
  std::vector<std::string> files = {Path("plan.db")};
  for (const int i : {1, 3}) {
    const std::string name = fmt::format("words{}.db", i);
    ASSERT_TRUE(ShardTo(name, i, 3, "plan.db", {}).ok());
    files.push_back(Path(name));
  }
  ASSERT_EQ(PlanTo("next.db", files)->image_step, "partners");
  const auto shard = ShardTo("partners.db", 1, 3, "next.db", files);
  ASSERT_TRUE(shard.ok()) << shard.error().message;
  EXPECT_EQ(shard->image_step, "partners");
}

TEST_F(ShardPlanTest, SeedsThatCannotBeAreFoundAnew) {
  WriteFeatures(20);
  ASSERT_EQ(MatchTo("seeds.db", true, {.shard = Shard{1, 1}})->image_step, "seeds");
  for (const std::vector<int>& numbers : {std::vector<int>{}, {-1}, {2, 1}, {1, 20}, {1, -1}, {0, 1000000}}) {
    const std::string_view bytes(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(int));
    {
      SQLite::Database database(Path("seeds.db"), SQLite::OPEN_READWRITE);
      SQLite::Statement update(database, "UPDATE cairn_image_steps SET numbers = ?");
      update.bind(1, bytes.data(), static_cast<int>(bytes.size()));
      update.exec();
    }
    auto entries = *ReadReuseFile(Path("seeds.db"));
    for (ReuseEntry& entry : entries) entry.contents = HashContents(bytes);
    ASSERT_TRUE(WriteReuseFile(Path("seeds.db"), entries).ok());
    ASSERT_TRUE(MatchTo("merged.db", true, {.files = {Path("seeds.db")}}).ok());
    ExpectAsClean("merged.db");
  }
}

TEST_F(ShardPlanTest, SameBytesForAnyNumberOfThreads) {
  WriteFeatures(20);
  options_.num_frustum_seeds = 4;
  ASSERT_TRUE(PlanTo("one.db", {}, 1).ok());
  ASSERT_TRUE(PlanTo("three.db", {}, 3).ok());
  EXPECT_EQ(*HashFile(Path("one.db")), *HashFile(Path("three.db")));
}

TEST_F(ShardPlanTest, PlansOfOthersAndDamagedOnesAreRefused) {
  WriteFeatures(12);
  with_poses_ = false;  // 66 pairs
  const auto planned = PlanTo("plan.db", {});
  ASSERT_TRUE(planned.ok()) << planned.error().message;
  ASSERT_EQ(planned->num_shards_with_work, 3);
  ASSERT_TRUE(ShardTo("a.db", 1, 3, "plan.db", {}).ok());
  const auto refuse = [&](const std::string& plan, ErrorCode code, const std::string& message,
                          int num_shards = 3) {
    const auto shard = ShardTo("bad.db", 1, num_shards, plan, {});
    ASSERT_FALSE(shard.ok()) << message;
    EXPECT_EQ(shard.error().code, code) << shard.error().message;
    EXPECT_THAT(shard.error().message, HasSubstr(message));
    EXPECT_FALSE(fs::exists(Path("bad.db")));
  };
  refuse("plan.db", ErrorCode::kInvalidArgument, "a plan for 3 shards, but this is one of 4", 4);
  refuse("absent.db", ErrorCode::kNotFound, "absent.db");
  refuse("features.db", ErrorCode::kCorrupt, "cairn_shard_plan");
  const auto damage = [&](const std::string& sql) {
    fs::copy_file(Path("plan.db"), Path("damaged.db"), fs::copy_options::overwrite_existing);
    SQLite::Database(Path("damaged.db"), SQLite::OPEN_READWRITE).exec(sql);
    return "damaged.db";
  };
  const std::string update = "UPDATE cairn_planned_pairs SET image_ids = ";
  refuse(damage("DELETE FROM cairn_shard_plan"), ErrorCode::kInvalidArgument, "not a whole plan");
  refuse(damage(update + "x'010000000d000000'"), ErrorCode::kInvalidArgument, "images 1 and 13 are no pair");
  refuse(damage(update + "x'0200000001000000'"), ErrorCode::kInvalidArgument, "images 2 and 1 are no pair");
  refuse(damage(update + "x'0200000002000000'"), ErrorCode::kInvalidArgument, "images 2 and 2 are no pair");
  refuse(damage(update + "x'01000000020000000100000002000000'"), ErrorCode::kInvalidArgument,
         "not a list of different pairs");
  refuse(damage(update + "x'010000000200000003000000'"), ErrorCode::kInvalidArgument,
         "not a list of different pairs");
  refuse(damage(update + "x'010203'"), ErrorCode::kCorrupt, "3 bytes");
  std::ofstream(Path("text.db")) << "no plan";
  refuse("text.db", ErrorCode::kCorrupt, "text.db");
  // Features with other images.
  SQLite::Database(Path("features.db"), SQLite::OPEN_READWRITE)
      .exec(
          "DELETE FROM images WHERE image_id = 1; DELETE FROM keypoints WHERE image_id = 1;"
          "DELETE FROM descriptors WHERE image_id = 1");
  refuse("plan.db", ErrorCode::kInvalidArgument, "images 1 and 2 are no pair of the features'");
}

TEST_F(ShardPlanTest, OfNoImagesOrOneThereIsNothingToPlan) {
  WriteFeatures(1);
  ASSERT_TRUE(PlanTo("plan.db", {}).ok());
  EXPECT_EQ(*ReadFile(Path("plan.db.shards")), "0 last\n");
}

}  // namespace
}  // namespace cairn::match_features
