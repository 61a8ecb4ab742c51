#include "stages/decompose_regions/command.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/world/dropped_items.h"
#include "tests/decompose_regions/ascii_world.h"
#include "tests/ran_command.h"

namespace cairn::decompose_regions {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;
using testing::SizeIs;

class DecomposeRegionsCommandTest : public CommandTest {
 protected:
  std::string Written(const World& world) const {
    EXPECT_TRUE(WriteWorldJson(world, Path("world.json")).ok());
    return Path("world.json");
  }
  // decompose-regions WORLD -o regions.db WORDS...
  Ran Run(const World& world, const std::vector<std::string>& more, int64_t memory_mib = 1 << 20) const {
    return RunWords(DecomposeRegionsCommand(), {Written(world), "-o", Path("regions.db")}, more, memory_mib);
  }
};

// Two regions of three stations, and in between one that sees neither:   o o o o o o o
// feature 0                                                              # # # . . . .
// feature 1                                                              . . . . # # #
World TwoEnds() { return AsciiWorld({"ooooooo"}, {{"###...."}, {"....###"}}); }

TEST_F(DecomposeRegionsCommandTest, WritesRegionsAndWhatItDroppedAndSaysHowMany) {
  const Ran ran = Run(TwoEnds(), {"--k", "1", "--tau", "0", "--svg", Path("regions.svg")});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_EQ(ran.out, "decompose_regions: 7 stations, 2 features; 2 regions, at least 2 are needed\n");
  EXPECT_EQ(ran.said, "");
  EXPECT_THAT(ran.report.in, ElementsAre(Pair("stations", 7), Pair("classes", 2)));
  EXPECT_THAT(ran.report.out, ElementsAre(Pair("regions", 2)));
  const Result<Decomposition> regions = ReadDecomposition(Path("regions.db"));
  ASSERT_TRUE(regions.ok());
  EXPECT_THAT(regions->regions, SizeIs(2));
  EXPECT_EQ(regions->seed, 5);
  const auto dropped = ReadDroppedItems(Path("regions.db"), kDroppedItemsTable);
  ASSERT_TRUE(dropped.ok());
  ASSERT_THAT(*dropped, SizeIs(1));
  EXPECT_EQ(dropped->front().item_id, 3);
  EXPECT_THAT(*ReadFile(Path("regions.svg")), HasSubstr(">2 regions, at least 2 are needed</text>"));
}

TEST_F(DecomposeRegionsCommandTest, WarnsOfPartsThatNothingJoins) {
  World parts = AsciiWorld({"oo.oo.o"}, {{"##.##.#"}});
  EXPECT_THAT(Run(parts, {"--k", "1", "--tau", "0"}).said,
              AllOf(HasSubstr("has 3 unconnected parts"), HasSubstr("(station 2 is not connected to 0)")));
  parts.edges = {{0, 1}, {1, 2}, {2, 3}, {3, 4}};
  EXPECT_EQ(Run(parts, {"--k", "1", "--tau", "0"}).said, "");
}

TEST_F(DecomposeRegionsCommandTest, WarnsOfStationsThatRhoLeaves) {
  World world = AsciiWorld({"ooooo"}, {{"###.."}, {"...##"}});
  const Ran ran = Run(world, {"--k", "1", "--tau", "0", "--rho", "2"});
  EXPECT_THAT(ran.said,
              HasSubstr("2 coverable stations are in no region (rho = 2 lets small remainders go); first: "
                        "station 3"));
  ASSERT_THAT(ran.report.rejected, SizeIs(1));
  EXPECT_EQ(ran.report.rejected[0].reason, "in no region");
  EXPECT_EQ(ran.report.rejected[0].count, 2);
}

TEST_F(DecomposeRegionsCommandTest, AWorldWithoutACoverableStationHasNoRegionAndAnyOtherErrorIsOne) {
  const Ran none = Run(TwoEnds(), {"--k", "2", "--tau", "1", "--rho", "3"});
  ASSERT_TRUE(none.status.ok()) << none.status.error().message;
  EXPECT_THAT(none.said, AllOf(HasSubstr("there is no region, as"), HasSubstr("choose k <= 1")));
  EXPECT_EQ(none.out, "decompose_regions: 7 stations, 2 features; 0 regions\n");
  const Result<Decomposition> regions = ReadDecomposition(Path("regions.db"));
  ASSERT_TRUE(regions.ok());
  EXPECT_THAT(regions->regions, IsEmpty());
  EXPECT_EQ(regions->algorithm, "best");
  EXPECT_EQ(regions->k, 2);
  EXPECT_EQ(regions->tau, 1);
  EXPECT_EQ(regions->rho, 3);
  EXPECT_EQ(regions->seed, 5);

  // Stations could be covered, but rho lets all go.
  const Ran small = Run(TwoEnds(), {"--k", "1", "--tau", "0", "--rho", "3"});
  ASSERT_FALSE(small.status.ok());
  EXPECT_EQ(small.status.error().code, ErrorCode::kNoData);
  EXPECT_THAT(small.status.error().message, AllOf(HasSubstr("world.json: "), HasSubstr("rho = 3")));
  const Ran empty = Run(World(), {});
  ASSERT_FALSE(empty.status.ok());
  EXPECT_EQ(empty.status.error().code, ErrorCode::kNoData);
}

TEST_F(DecomposeRegionsCommandTest, SaysWhatLargeWorldsGetInstead) {
  const std::string seven = "7 stations are more than best_max_stations = 6";
  const std::vector<std::string> small = {"--k", "1", "--tau", "0", "--best-max-stations", "6"};
  const auto said = [&](std::vector<std::string> words, const char* limit) {
    words.insert(words.end(), {"--k", "1", "--tau", "0", "--best-max-stations", limit});
    return Run(TwoEnds(), words).said;
  };
  EXPECT_THAT(said({}, "6"), HasSubstr(seven + ": the regions are those of b2, the lower bound is counted"));
  EXPECT_EQ(said({}, "7"), "");
  const std::vector<std::string> certified = {"--algorithm", "b2", "--lower-bound", "certified"};
  EXPECT_THAT(said(certified, "6"), HasSubstr(seven + ": the lower bound is counted, not certified"));
  EXPECT_EQ(said(certified, "7"), "");
  EXPECT_EQ(said({"--algorithm", "b2"}, "6"), "");
}

TEST_F(DecomposeRegionsCommandTest, OptionsOfTheChoiceNeedClasses) {
  const Ran ran = Run(TwoEnds(), {"--k", "1", "--min-kept-ratio", "0.2"});
  ASSERT_FALSE(ran.status.ok());
  EXPECT_EQ(ran.status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(ran.status.error().message, AllOf(HasSubstr("--min-kept-ratio"), HasSubstr("give --classes")));
}

// Class 100 + i is feature i, at one place in all images; each station has an image.
Classes ClassesOf(World* world) {
  Classes classes;
  classes.cameras = {{.camera_id = 1, .width = 640, .height = 480, .params = {500, 320, 240}}};
  for (StationIdx station = 0; station < world->num_stations(); ++station) {
    classes.images.push_back({.image_id = 10 + static_cast<ImageId>(station), .camera_id = 1});
    world->station_images.push_back({classes.images.back().image_id});
  }
  for (FeatureIdx feature = 0; feature < world->num_features(); ++feature) {
    FeatureClass& added = classes.classes.emplace_back();
    added.class_id = 100 + static_cast<ClassId>(feature);
    added.position = {0.1, 0.2, 3};
    added.covariance = 1e-6 * Eigen::Matrix3d::Identity();
    added.descriptor[feature] = 255;
    for (const StationIdx station : world->areas[feature])
      added.observations.push_back(
          {.image_id = 10 + static_cast<ImageId>(station), .keypoint = {.scale = 2}});
    world->class_ids.push_back(added.class_id);
  }
  return classes;
}

TEST_F(DecomposeRegionsCommandTest, ChoosesLandmarksByTheClasses) {
  // All stations see both; the first, which the algorithm takes as well as the second, tells next to nothing.
  World world = AsciiWorld({"ooo"}, {{"###"}, {"###"}});
  Classes classes = ClassesOf(&world);
  const auto chosen = [&](FeatureIdx poor, const std::vector<std::string>& more = {}) {
    for (FeatureClass& feature_class : classes.classes) feature_class.covariance.setIdentity();
    classes.classes[1 - poor].covariance *= 1e-6;
    EXPECT_TRUE(WriteClasses(classes, Path("classes.db")).ok());
    std::vector<std::string> words = {"--k", "1", "--tau", "0", "--classes", Path("classes.db")};
    words.insert(words.end(), more.begin(), more.end());
    const Ran ran = Run(world, words);
    EXPECT_TRUE(ran.status.ok()) << (ran.status.ok() ? "" : ran.status.error().message);
    const Result<Decomposition> regions = ReadDecomposition(Path("regions.db"));
    EXPECT_TRUE(regions.ok() && regions->regions.size() == 1);
    return regions.ok() && regions->regions.size() == 1 ? regions->regions[0].features
                                                        : std::vector<FeatureIdx>();
  };
  EXPECT_THAT(chosen(0), ElementsAre(1));
  EXPECT_THAT(chosen(1), ElementsAre(0));
  EXPECT_EQ(chosen(0, {"--feature-choice", "cover"}), chosen(1, {"--feature-choice", "cover"}));

  classes.classes[0].class_id = 99;
  ASSERT_TRUE(WriteClasses(classes, Path("classes.db")).ok());
  const Ran other = Run(world, {"--k", "1", "--tau", "0", "--classes", Path("classes.db")});
  ASSERT_FALSE(other.status.ok());
  EXPECT_THAT(other.status.error().message,
              AllOf(HasSubstr("world.json, "), HasSubstr("classes.db: feature 0")));
  // Without a region nothing is chosen.
  EXPECT_TRUE(Run(world, {"--k", "3", "--tau", "0", "--classes", Path("classes.db")}).status.ok());
}

TEST_F(DecomposeRegionsCommandTest, RefusesWorldsAndClassesThatDoNotFitIntoMemory) {
  // The program takes 64 MiB, and 8 bytes for each byte of the world's file, 1.5 for each of the classes'.
  const std::string world = Written(TwoEnds()), classes = Path("classes.db");
  const auto code = [&](int64_t world_bytes, int64_t classes_bytes) {
    std::ofstream(classes) << "no classes";
    std::filesystem::resize_file(classes, classes_bytes);
    const std::string text = *ReadFile(world);
    std::ofstream(world) << text << std::string(world_bytes - text.size(), ' ');
    const Ran ran =
        RunWords(DecomposeRegionsCommand(), {world, "-o", Path("regions.db"), "--classes", classes},
                 {"--k", "1", "--tau", "0"}, 66);
    EXPECT_FALSE(ran.status.ok());
    std::filesystem::resize_file(world, text.size());
    return ran.status.error().code;
  };
  constexpr int64_t kTwoMib = 2 << 20;
  EXPECT_EQ(code(kTwoMib / 8 + 1, 100), ErrorCode::kNoMemory);
  EXPECT_NE(code(kTwoMib / 8, 100), ErrorCode::kNoMemory);
  EXPECT_EQ(code(1000, kTwoMib / 3 * 2 + 100), ErrorCode::kNoMemory);
  EXPECT_NE(code(1000, kTwoMib / 3 * 2 - 100), ErrorCode::kNoMemory);
}

TEST_F(DecomposeRegionsCommandTest, CheckSaysWhatTheRegionsAreAndThatTheyAreValid) {
  ASSERT_TRUE(Run(TwoEnds(), {"--k", "1", "--tau", "0"}).status.ok());
  const Ran ran = RunWords(CheckRegionsCommand(), {Path("world.json"), Path("regions.db")});
  EXPECT_TRUE(ran.status.ok());
  EXPECT_EQ(ran.out,
            "algorithm best, k = 1, tau = 0, rho = 0: 2 regions, at least 2 are needed\n"
            "0 of 6 coverable stations uncovered, largest connected hole 0\nvalid\n");
}

TEST_F(DecomposeRegionsCommandTest, CheckListsTwentyPropertiesThatFailAndCountsAll) {
  const auto check = [&](int num_bad) {
    Decomposition decomposition{.algorithm = "b2", .k = 1, .regions = {{{0}, {0, 1, 2}}}};
    decomposition.uncovered.assign(num_bad, 7);
    EXPECT_TRUE(WriteDecomposition(decomposition, Path("bad.json")).ok());
    return RunWords(CheckRegionsCommand(), {Written(TwoEnds()), Path("bad.json")});
  };
  const auto num_lines = [](const Ran& ran) { return std::count(ran.out.begin(), ran.out.end(), '\n'); };
  EXPECT_EQ(num_lines(check(3)), 2 + 3);
  const Ran ran = check(30);
  EXPECT_EQ(num_lines(ran), 2 + 20);
  ASSERT_FALSE(ran.status.ok());
  EXPECT_EQ(ran.status.error().code, ErrorCode::kFailed);
  EXPECT_THAT(
      ran.status.error().message,
      HasSubstr("bad.json: 30 properties fail, the first: uncovered station: 7 is outside of 0 to 6"));
}

TEST_F(DecomposeRegionsCommandTest, CheckAllowsHolesOfAnySizeUnlessItIsTold) {
  const Decomposition left{
      .algorithm = "b2", .k = 1, .rho = 3, .regions = {{{0}, {0, 1, 2}}}, .uncovered = {4, 5, 6}};
  ASSERT_TRUE(WriteDecomposition(left, Path("left.json")).ok());
  const std::string world = Written(TwoEnds());
  EXPECT_TRUE(RunWords(CheckRegionsCommand(), {world, Path("left.json")}).status.ok());
  EXPECT_TRUE(RunWords(CheckRegionsCommand(), {world, Path("left.json"), "--max-hole", "3"}).status.ok());
  EXPECT_FALSE(RunWords(CheckRegionsCommand(), {world, Path("left.json"), "--max-hole", "2"}).status.ok());
  EXPECT_FALSE(RunWords(CheckRegionsCommand(), {world, Path("left.json"), "--max-hole", "0"}).status.ok());
}

}  // namespace
}  // namespace cairn::decompose_regions
