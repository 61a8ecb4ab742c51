#include "stages/match_features/command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/line/memory.h"
#include "tests/match_features/features_fixture.h"
#include "tests/ran_command.h"

namespace cairn::match_features {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Pair;

class MatchFeaturesCommandTest : public MatchFeaturesTest {
 protected:
  std::string Path(const std::string& name) const { return folder_ + "/" + name; }
  // match-features features.db -o OUTPUT WORDS...
  Ran Run(const std::string& output, const std::vector<std::string>& more,
          int64_t memory_mib = 1 << 20) const {
    return RunWords(MatchFeaturesCommand(), {Path("features.db"), "-o", Path(output)}, more, memory_mib);
  }
};

TEST_F(MatchFeaturesCommandTest, SaysHowManyPairsWereTriedVerifiedAndTakenOver) {
  WriteFeatures(4);
  options_.pairs = "exhaustive";
  const auto summary = MatchTo("of_function.db", false, {});
  ASSERT_TRUE(summary.ok());
  const Ran ran = Run("matches.db", {"--pairs", "exhaustive"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  const std::string tried = "match_features: 4 images, 6 pairs tried (exhaustive), 6 verified, ";
  EXPECT_EQ(ran.out, tried + fmt::format("{} of {} matches, 0 taken over\n", summary->num_inliers,
                                         summary->num_putative));
  EXPECT_EQ(ran.said, "");
  EXPECT_THAT(ran.report.in, ElementsAre(Pair("images", 4), Pair("pairs", 6)));
  EXPECT_THAT(ran.report.out, ElementsAre(Pair("verified pairs", 6), Pair("matches", summary->num_inliers)));
  EXPECT_THAT(ran.report.taken_over, ElementsAre(Pair("pairs", 0)));
  EXPECT_EQ(*HashFile(Path("matches.db")), *HashFile(Path("of_function.db")));
  const Ran again = Run("matches.db", {"--pairs", "exhaustive"});
  EXPECT_THAT(again.out, HasSubstr(tried));
  EXPECT_THAT(again.report.taken_over, ElementsAre(Pair("pairs", 6)));
}

TEST_F(MatchFeaturesCommandTest, WarnsOfImagesWithoutFeatures) {
  WriteFeatures(3, [](SQLite::Database& database) {
    database.exec("DELETE FROM keypoints WHERE image_id = 2; DELETE FROM descriptors WHERE image_id = 2");
  });
  const Ran ran = Run("matches.db", {});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.said, HasSubstr("features.db: 1 of 3 images without features are skipped"));
  ASSERT_EQ(ran.report.rejected.size(), 1U);
  EXPECT_EQ(ran.report.rejected[0].what, "images");
  EXPECT_EQ(ran.report.rejected[0].count, 1);
}

TEST_F(MatchFeaturesCommandTest, AShardSaysWhatItLeavesToTheOthers) {
  WriteFeatures(4);
  const Ran first = Run("shard_1.db", {"--pairs", "exhaustive", "--shard", "1/2"});
  ASSERT_TRUE(first.status.ok()) << first.status.error().message;
  EXPECT_EQ(first.out,
            "match_features: shard 1/2: round 1 of pairs (exhaustive): 3 tried, 3 verified, 0 taken over; 3 "
            "left to other shards\n");
  const Ran merged = Run("matches.db", {"--pairs", "exhaustive", "--reuse", Path("shard_1.db")});
  ASSERT_TRUE(merged.status.ok()) << merged.status.error().message;
  EXPECT_THAT(merged.report.taken_over, ElementsAre(Pair("pairs", 3)));
  const Ran nothing =
      Run("shard_2.db", {"--pairs", "exhaustive", "--shard", "2/2", "--reuse", Path("matches.db")});
  EXPECT_EQ(nothing.out, "match_features: shard 2/2: nothing to do, all pairs (exhaustive) are known\n");
}

TEST_F(MatchFeaturesCommandTest, AShardSaysOfWhichImagesItHasTheWords) {
  WriteFeatures(5);
  const Ran ran = Run("shard_1.db", {"--pairs", "retrieval", "--num-retrieved", "1", "--shard", "1/2"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.out, testing::MatchesRegex("match_features: shard 1/2: words of [23] images, 0 taken over; "
                                             "[23] left to other shards\n"));
}

TEST_F(MatchFeaturesCommandTest, APlanSaysHowManyShardsHaveWork) {
  WriteFeatures(4);
  const Ran ran = Run("plan.db", {"--pairs", "exhaustive", "--plan", "2", "--shard-images", "1"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.out, HasSubstr("match_features: plan for 2 shards: round 1 of pairs (exhaustive): "));
  EXPECT_THAT(ran.out, HasSubstr(" left to "));
  const Ran little = Run("little.db", {"--pairs", "exhaustive", "--plan", "2"});
  EXPECT_EQ(little.out,
            "match_features: plan for 2 shards: round 1 of pairs (exhaustive): too little left to be "
            "divided\n");
}

TEST_F(MatchFeaturesCommandTest, APlanIsForShards) {
  WriteFeatures(2);
  const Ran ran = Run("matches.db", {"--planned", Path("plan.db")});
  ASSERT_FALSE(ran.status.ok());
  EXPECT_THAT(ran.status.error().message, HasSubstr("say which one this is with --shard I/N"));
}

TEST_F(MatchFeaturesCommandTest, RefusesWhatChoosesPairsWhereAListHasThem) {
  WriteFeatures(3);
  ASSERT_TRUE(WriteFileAtomically(Path("pairs.txt"), "image0.png image1.png\n").ok());
  const Ran listed = Run("matches.db", {"--pair-list", Path("pairs.txt"), "--max-ratio", "0.9"});
  ASSERT_TRUE(listed.status.ok()) << listed.status.error().message;
  EXPECT_THAT(listed.out, HasSubstr("1 pairs tried (list)"));
  const Ran chosen = Run("matches.db", {"--pair-list", Path("pairs.txt"), "--pairs", "exhaustive"});
  ASSERT_FALSE(chosen.status.ok());
  EXPECT_THAT(chosen.status.error().message, HasSubstr("--pair-list gives the pairs"));
}

TEST_F(MatchFeaturesCommandTest, RefusesAVocabularyThatNothingReads) {
  WriteFeatures(3);
  ASSERT_TRUE(WriteFileAtomically(Path("pairs.txt"), "image0.png image1.png\n").ok());
  const std::string vocabulary = Path("none.db");
  const auto message_of = [&](const std::vector<std::string>& words) {
    std::vector<std::string> all = {"--vocabulary", vocabulary};
    all.insert(all.end(), words.begin(), words.end());
    const Ran ran = Run("matches.db", all);
    return ran.status.ok() ? "" : ran.status.error().message;
  };
  EXPECT_THAT(message_of({"--pairs", "exhaustive"}), HasSubstr("--pairs is exhaustive; leave it out"));
  EXPECT_THAT(message_of({"--pairs", "frustum"}), HasSubstr("--pairs is frustum; leave it out"));
  EXPECT_THAT(message_of({"--pair-list", Path("pairs.txt")}),
              HasSubstr("the pairs are those of --pair-list; leave it out"));
  EXPECT_EQ(message_of({"--pairs", "auto"}), "");  // of a few images all are matched
  for (const char* pairs : {"retrieval", "sequence"})
    EXPECT_THAT(message_of({"--pairs", pairs}), Not(HasSubstr("leave it out")));
}

TEST_F(MatchFeaturesCommandTest, NeedsTheMemoryOfTheProgram) {
  WriteFeatures(2);
  const int64_t program_mib = kProgramBytes >> 20;
  EXPECT_EQ(Run("matches.db", {}, program_mib - 1).status.error().code, ErrorCode::kNoMemory);
  EXPECT_TRUE(Run("matches.db", {}, program_mib).status.ok());
}

TEST_F(MatchFeaturesCommandTest, NeedsADiskWithRoomForAsMuchAsTheFeatures) {
  WriteFeatures(2);
  const auto refuses = [&](uintmax_t num_bytes, const std::vector<std::string>& words) {
    std::error_code error;
    std::filesystem::resize_file(Path("features.db"), num_bytes, error);
    if (error) GTEST_SKIP() << "no such file here: " << error.message();
    const Status status = Run("matches.db", words).status;
    EXPECT_EQ(!status.ok() && status.error().code == ErrorCode::kDiskFull,
              words.empty() && num_bytes > 1 << 30);
  };
  // Nothing is written in its holes.
  const uintmax_t more_than_there_is = 2 * std::filesystem::space(folder_).capacity;
  refuses(1 << 20, {});
  refuses(more_than_there_is, {});
  refuses(more_than_there_is, {"--no-space-check"});
  refuses(more_than_there_is, {"--plan", "2"});
}

}  // namespace
}  // namespace cairn::match_features
