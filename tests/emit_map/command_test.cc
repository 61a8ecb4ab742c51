#include "stages/emit_map/command.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_rows.h"
#include "core/colmap/colmap_database.h"
#include "core/files/file.h"
#include "core/line/memory.h"
#include "core/plan/views_database.h"
#include "core/world/dropped_items.h"
#include "stages/emit_map/choose/leave_out_images.h"
#include "tests/core/map/example.h"
#include "tests/ran_command.h"

namespace cairn::emit_map {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Pair;

class EmitMapCommandTest : public CommandTest {
 protected:
  void SetUp() override {
    Write({});
    ASSERT_TRUE(WriteDecomposition(example_.decomposition, Path("regions.db")).ok());
    ASSERT_TRUE(WriteVocabulary(example_.vocabulary, Path("vocabulary.db")).ok());
    ASSERT_TRUE(WriteAppearance(example_.appearance, Path("appearance.db")).ok());
  }
  // classes.db and world.db, with what the stages before dropped.
  void Write(const std::vector<DroppedItem>& of_classes,
             const std::vector<DroppedItem>& of_world = {}) const {
    ASSERT_TRUE(WriteClasses(example_.classes, Path("classes.db"), of_classes).ok());
    ASSERT_TRUE(WriteWorldDatabase(example_.world, Path("world.db"), of_world).ok());
  }
  // emit-map --classes classes.db ... --name hall -o hall.cairn WORDS...
  Ran Run(const std::vector<std::string>& more, int64_t memory_mib = 1 << 20) const {
    return RunWords(
        EmitMapCommand(),
        {"--classes", Path("classes.db"), "--world", Path("world.db"), "--regions", Path("regions.db"),
         "--name", "hall", "--vocabulary", Path("vocabulary.db"), "-o", Path("hall.cairn")},
        more, memory_mib);
  }
  MapRows Rows() const {
    const Result<MapRows> rows = ReadMapRows(Path("hall.cairn"));
    EXPECT_TRUE(rows.ok()) << rows.error().message;
    return *rows;
  }

  const EmitExample example_ = MakeEmitExample();
};

TEST_F(EmitMapCommandTest, SaysWhatIsInTheMap) {
  const Ran ran = Run({"--landmarks", "all"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  const auto num_bytes = static_cast<int64_t>(std::filesystem::file_size(Path("hall.cairn")));
  const MapRows rows = Rows();
  EXPECT_EQ(ran.out,
            fmt::format("emit_map: 4 landmarks of 4 classes in 2 regions, 3 images, {} words, {:.2f} MB\n"
                        "emit_map: too few survey images to leave runs of them out: how far fixes are off is "
                        "taken from how keypoints err\n",
                        rows.vocabulary.num_words(), static_cast<double>(num_bytes) * 1e-6));
  EXPECT_THAT(ran.report.in, ElementsAre(Pair("classes", 4)));
  EXPECT_THAT(ran.report.out,
              ElementsAre(Pair("landmarks", 4), Pair("regions", 2), Pair("bytes", num_bytes)));
  ASSERT_TRUE(Run({"--landmarks", "regions"}).status.ok());
  EXPECT_EQ(Rows().landmarks.size(), 3U);
}

TEST_F(EmitMapCommandTest, TheMapKnowsWhatItWasMadeFrom) {
  CaptureFrame frame;
  frame.unit = "arbitrary";
  ASSERT_TRUE(WriteFileAtomically(Path("frame.json"), CaptureFrameJson(frame)).ok());
  ASSERT_TRUE(WriteFileAtomically(Path("sessions.txt"), "a\nb\n").ok());
  ASSERT_TRUE(WriteFileAtomically(Path("match.toml"), "x = 1\n").ok());
  ASSERT_TRUE(
      Run({"--landmarks", "all", "--appearance", Path("appearance.db"), "--frame", Path("frame.json"),
           "--sessions", Path("sessions.txt"), "--stage-options", "match_features=" + Path("match.toml")})
          .status.ok());
  const MapRows rows = Rows();
  EXPECT_EQ(rows.name, "hall");
  EXPECT_EQ(rows.seed, 5U);
  EXPECT_FALSE(rows.sealed);
  EXPECT_EQ(rows.frame.unit, "arbitrary");
  EXPECT_EQ(rows.sessions, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(rows.stage_options.at("match_features"), "x = 1\n");
  EXPECT_THAT(rows.stage_options.at("emit_map"), HasSubstr("landmarks = 'all'"));
  EXPECT_EQ(rows.input_hashes.size(), 5U);
  for (const auto& [name, hash] : rows.input_hashes) EXPECT_EQ(hash, *HashFile(Path(name))) << name;
  EXPECT_FALSE(rows.appearance.empty());
}

TEST_F(EmitMapCommandTest, AStagesOptionsAreNamedByTheStage) {
  ASSERT_TRUE(WriteFileAtomically(Path("match.toml"), "x = 1\n").ok());
  for (const std::string& text : {"=" + Path("match.toml"), Path("match.toml")}) {
    const Ran ran = Run({"--landmarks", "all", "--stage-options", text});
    ASSERT_FALSE(ran.status.ok()) << text;
    EXPECT_THAT(ran.status.error().message, HasSubstr("expected STAGE=FILE.toml"));
  }
}

TEST_F(EmitMapCommandTest, CountsWhatTheStagesBeforeDropped) {
  Write({{.reason = DropReason::kNoPose, .item_id = 3}},
        {{.reason = DropReason::kFewStations, .item_id = 11, .found = 1}});
  {
    SQLite::Database matches(Path("matches.db"), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    matches.exec(kColmapSchema);
    matches.exec("CREATE TABLE cairn_rejects (name TEXT, reason TEXT)");
    matches.exec("INSERT INTO cairn_rejects VALUES ('a', 'x'), ('b', 'y')");
  }
  const auto counts = [&](const std::vector<std::string>& words) {
    const Ran ran = Run(words);
    EXPECT_TRUE(ran.status.ok()) << ran.status.error().message;
    std::map<std::string, int64_t> found;
    for (const DropCount& drop : Rows().findings.drops) found[drop.name] = drop.num_dropped;
    return found;
  };
  const std::map<std::string, int64_t> of_stages = {{"no_pose", 1}, {"few_stations", 1}};
  EXPECT_EQ(counts({"--landmarks", "all"}), of_stages);
  std::map<std::string, int64_t> with_images = of_stages;
  with_images["unreadable"] = 2;
  EXPECT_EQ(counts({"--landmarks", "all", "--matches", Path("matches.db")}), with_images);
}

TEST_F(EmitMapCommandTest, TheFewestLandmarksNeedTheSurveysFeatures) {
  for (const auto& [words, name] :
       {std::pair(std::vector<std::string>{"--landmarks", "fewest"},
                  "landmarks = \"fewest\" needs --matches"),
        std::pair(std::vector<std::string>{"--landmarks", "all", "--max-bytes", "100000"},
                  "max_bytes needs --matches")}) {
    const Ran ran = Run(words);
    ASSERT_FALSE(ran.status.ok()) << name;
    EXPECT_THAT(ran.status.error().message, HasSubstr(name));
  }
  const Ran refused = Run({"--landmarks", "all", "--promise-matches", "12"});
  ASSERT_FALSE(refused.status.ok());
  EXPECT_THAT(refused.status.error().message, HasSubstr("is only read where landmarks is fewest"));
  EXPECT_THAT(Run({"--landmarks", "fewest", "--promise-matches", "12"}).status.error().message,
              HasSubstr("needs --matches"));
}

TEST_F(EmitMapCommandTest, NeedsMemoryByTheClassesAndMoreToChooseLandmarks) {
  std::filesystem::resize_file(Path("classes.db"), 100 << 20);
  const int64_t program_mib = kProgramBytes >> 20;
  EXPECT_TRUE(Run({"--landmarks", "all"}, 200 + program_mib).status.ok());
  const Ran few = Run({"--landmarks", "all"}, 199 + program_mib);
  EXPECT_THAT(few.status.error().message, HasSubstr("making a map of "));
  const Ran trial = Run({"--landmarks", "fewest"}, 1249 + program_mib);
  EXPECT_THAT(trial.status.error().message, HasSubstr("choosing the landmarks of "));
  EXPECT_EQ(Run({"--landmarks", "fewest"}, 1250 + program_mib).status.error().code,
            ErrorCode::kInvalidArgument);
}

// The example's keypoints are not where its landmarks would be seen.
TEST_F(EmitMapCommandTest, APreviousMapOfOtherLandmarksIsWarnedOf) {
  ASSERT_TRUE(Run({"--landmarks", "all"}).status.ok());
  std::filesystem::rename(Path("hall.cairn"), Path("before.cairn"));
  const Ran ran = Run({"--landmarks", "all", "--previous", Path("before.cairn")});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.said, HasSubstr("before.cairn: none of its 4 landmarks is among the 4 classes"));
  EXPECT_THAT(ran.said, HasSubstr("the map is made anew"));
  EXPECT_EQ(Rows().input_hashes.at("previous.cairn"), *HashFile(Path("before.cairn")));
  EXPECT_THAT(Rows().stage_options.at("emit_map"), Not(HasSubstr("before.cairn")));
}

TEST_F(EmitMapCommandTest, HasTheFloorPlansRegions) {
  NoProgress progress;
  ASSERT_TRUE(WriteViews(MakeExampleViews(), Path("views.db"), progress, [](SQLite::Database&) {
                return Ok();
              }).ok());
  ASSERT_TRUE(Run({"--landmarks", "all", "--views", Path("views.db")}).status.ok());
  EXPECT_FALSE(Rows().views.plan.walls.empty());
  EXPECT_EQ(Rows().input_hashes.at("views.db"), *HashFile(Path("views.db")));
}

}  // namespace
}  // namespace cairn::emit_map
