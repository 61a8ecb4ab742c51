#include <filesystem>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

// One small survey as a whole map and within a number of bytes, and what is said of and made from the two.
class MapSize : public testing::Test {
 protected:
  static constexpr int kMaxBytes = 60000;

  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("map_size_test");
    WriteTinyRecipe(*folder_ / "tiny.toml");
    WriteTinyRecipe(*folder_ / "small.toml", fmt::format("max_bytes = {}\n", kMaxBytes));
    const ProgramRun whole = Run("cairn compile tiny.toml -o tiny.cairn");
    ASSERT_EQ(whole.exit_code, 0) << whole.err;
    const ProgramRun small = Run("cairn compile small.toml -o small.cairn && cat small.report.json");
    ASSERT_EQ(small.exit_code, 0) << small.err;
    small_output_ = small.out;
  }
  static void TearDownTestSuite() { delete folder_; }

  static ProgramRun Run(const std::string& command) {
    return RunShell("cd " + folder_->string() + " && " + command);
  }
  static std::string Path(const std::string& name) { return *folder_ / name; }

  static inline TemporaryFolder* folder_ = nullptr;
  static inline std::string small_output_;
};

TEST_F(MapSize, SealedMapKeepsToItsBytesAndSaysWhatItPromises) {
  ASSERT_GT(fs::file_size(Path("tiny.cairn")), size_t{kMaxBytes});
  EXPECT_LE(fs::file_size(Path("small.cairn")), size_t{kMaxBytes});
  EXPECT_GE(fs::file_size(Path("small.cairn")), size_t{kMaxBytes} * 8 / 10);
  EXPECT_THAT(small_output_, HasSubstr("at most 60000 bytes: "));
  EXPECT_THAT(small_output_, HasSubstr("left-out survey images"));
  const json inspected = json::parse(Run("cairn inspect small.cairn --json").out);
  bool is_told = false;
  for (const json& drop : inspected["dropped"])
    is_told |= drop["name"] == "over_budget" && drop["num_dropped"] > 0;
  EXPECT_TRUE(is_told) << inspected["dropped"].dump(1);
  EXPECT_EQ(Run("cairn verify small.cairn").exit_code, 0);
}

TEST_F(MapSize, SameBytesForAnyNumberOfThreads) {
  const ProgramRun again = Run("cairn compile small.toml -o again.cairn --threads 1 --progress none");
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(*ReadFile(Path("again.build/unsealed.cairn")), *ReadFile(Path("small.build/unsealed.cairn")));
}

// Where no station has enough common features, or no class is seen widely enough, stage 5 finds no region: a
// map of all landmarks does without, and one of the fewest has those that keep its promise.
TEST_F(MapSize, SurveyWithoutRegionsMakesAMapAllTheSame) {
  const auto compile = [&](const std::string& name, const std::string& from, const std::string& to,
                           const std::string& landmarks) {
    const std::string recipe = Path(name + ".toml");
    WriteTinyRecipe(recipe);
    ReplaceInFile(recipe, from, to);
    ReplaceInFile(recipe, "landmarks = \"all\"", "landmarks = \"" + landmarks + "\"");
    fs::copy(Path("tiny.build"), Path(name + ".build"), fs::copy_options::recursive);
    return Run(fmt::format("cairn compile {0}.toml -o {0}.cairn --progress none", name));
  };
  const ProgramRun few_common = compile("few_common", "k = 4", "k = 100000", "fewest");
  ASSERT_EQ(few_common.exit_code, 0) << few_common.err;
  EXPECT_THAT(few_common.err, HasSubstr("there is no region, as no station is coverable: k = 100000"));
  const ProgramRun few_stations =
      compile("few_stations", "min_num_stations_driven = 2", "min_num_stations_driven = 1000", "all");
  ASSERT_EQ(few_stations.exit_code, 0) << few_stations.err;
  EXPECT_THAT(few_stations.err, HasSubstr("classes is visible enough from the"));
  EXPECT_THAT(few_stations.err, HasSubstr("there is no region, as no station is coverable"));
  for (const std::string name : {"few_common", "few_stations"}) {
    const json inspected = json::parse(Run("cairn inspect " + name + ".cairn --json").out);
    EXPECT_GT(inspected["num_landmarks"], 0) << name;
    const json check = json::parse(Run("cat " + name + ".build/check.json").out);
    const json whole = json::parse(Run("cat tiny.build/check.json").out);
    EXPECT_GE(check["num_localized"].get<double>(), whole["num_localized"].get<double>() - 1) << name;
    EXPECT_EQ(Run("cairn verify " + name + ".cairn").exit_code, 0);
    const std::string here = Run("cairn inspect " + name + ".cairn --at 2,2").out;
    if (inspected["landmarks"] == "all") {
      EXPECT_EQ(inspected["num_regions"], 0);
      EXPECT_THAT(here, HasSubstr("in no region"));
    } else {
      EXPECT_GT(inspected["num_regions"], 0);
      EXPECT_THAT(here, HasSubstr("promise"));
    }
    const ProgramRun report = Run("cairn report " + name + ".cairn -o " + name + ".html");
    EXPECT_EQ(report.exit_code, 0) << report.err;
  }

  const ProgramRun by_regions = compile("by_regions", "k = 4", "k = 100000", "regions");
  EXPECT_EQ(by_regions.exit_code, static_cast<int>(ErrorCode::kNoData)) << by_regions.err;
  EXPECT_THAT(by_regions.err, HasSubstr("0 regions keep none of"));
  EXPECT_FALSE(fs::exists(Path("by_regions.cairn")));
}

TEST_F(MapSize, FewestLandmarksLocalizeLeftOutImagesAsAllDo) {
  // Of the smaller survey all landmarks are needed.
  WriteTinyRecipe(Path("fewest.toml"));
  ReplaceInFile(Path("fewest.toml"), "spacing_m = 0.7", "spacing_m = 0.5");
  ReplaceInFile(Path("fewest.toml"), "landmarks = \"all\"", "landmarks = \"fewest\"");
  const ProgramRun run = Run("cairn compile fewest.toml -o fewest.cairn && cat fewest.report.json");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("the fewest landmarks: "));
  EXPECT_THAT(run.out, HasSubstr("left-out survey images"));
  const json fewest = json::parse(Run("cairn inspect fewest.cairn --json").out);
  ASSERT_EQ(Run("cd fewest.build && cairn stage emit-map --classes classes.db --world world.db --regions "
                "regions.db "
                "--vocabulary vocabulary.db --name t --landmarks all -o ../whole.cairn")
                .exit_code,
            0);
  const json whole = json::parse(Run("cairn inspect whole.cairn --json").out);
  EXPECT_EQ(fewest["landmarks"], "fewest");
  EXPECT_LT(fewest["num_landmarks"], whole["num_landmarks"]);
  int64_t num_not_needed = 0;
  for (const json& drop : fewest["dropped"]) {
    if (drop["name"] == "not_needed") num_not_needed = drop["num_dropped"];
  }
  EXPECT_EQ(num_not_needed, whole["num_landmarks"].get<int64_t>() - fewest["num_landmarks"].get<int64_t>());
  EXPECT_THAT(Run("cairn inspect fewest.cairn").out, HasSubstr("landmarks = fewest"));

  // Stricter: all that all landmarks localize, and no larger error.
  std::ofstream(Path("fewest.toml"), std::ios::app) << "max_error_ratio = 1\nmin_recall_ratio = 1\n";
  const ProgramRun strict = Run("cairn compile fewest.toml -o strict.cairn --build-dir fewest.build");
  ASSERT_EQ(strict.exit_code, 0) << strict.err;
  EXPECT_GE(json::parse(Run("cairn inspect strict.cairn --json").out)["num_landmarks"],
            fewest["num_landmarks"]);
}

TEST_F(MapSize, FewestLandmarksAreTheSameForAnyNumberOfThreads) {
  const std::string emit =
      "cd tiny.build && cairn stage emit-map --matches matches.db --classes classes.db --world world.db "
      "--regions regions.db --vocabulary vocabulary.db --name t --landmarks fewest --progress none";
  ASSERT_EQ(Run(emit + " --threads 1 -o ../one.cairn").exit_code, 0);
  ASSERT_EQ(Run(emit + " --threads 3 -o ../three.cairn").exit_code, 0);
  EXPECT_EQ(*ReadFile(Path("one.cairn")), *ReadFile(Path("three.cairn")));
}

TEST_F(MapSize, LandmarksCannotBeChosenWithoutTheSurveysFeatures) {
  const std::string emit =
      "cd tiny.build && cairn stage emit-map --classes classes.db --world world.db --regions regions.db "
      "--vocabulary vocabulary.db --name t -o ../unmade.cairn ";
  const ProgramRun run = Run(emit);
  EXPECT_EQ(run.exit_code, static_cast<int>(ErrorCode::kInvalidArgument));
  EXPECT_THAT(run.err, HasSubstr("landmarks = \"fewest\" needs --matches"));
  EXPECT_THAT(Run(emit + "--landmarks all --max-bytes 90000").err, HasSubstr("max_bytes needs --matches"));
  EXPECT_EQ(Run(emit + "--landmarks regions").exit_code, 0);
}

TEST_F(MapSize, BudgetThatNothingMeetsSaysTheLeastPossible) {
  WriteTinyRecipe(Path("none.toml"), "max_bytes = 3000\n");
  fs::copy(Path("small.build"), Path("none.build"), fs::copy_options::recursive);
  const ProgramRun run = Run("cairn compile none.toml -o none.cairn");
  EXPECT_EQ(run.exit_code, static_cast<int>(ErrorCode::kInvalidArgument));
  EXPECT_THAT(run.err, HasSubstr("the least possible is"));
  EXPECT_FALSE(fs::exists(Path("none.cairn")));
}

TEST_F(MapSize, ParetoWritesTableAndPictureAndStopsWhereNothingFits) {
  const ProgramRun run =
      Run("cairn pareto tiny.toml -o tiny.cairn --sizes 60000,80000 --peer 'Other <1>,2e6,0.9,0.05' "
          "--progress none");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  std::istringstream csv(*ReadFile(Path("tiny.pareto.csv")));
  std::vector<std::string> lines;
  for (std::string line; std::getline(csv, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 4U) << run.out;
  EXPECT_EQ(lines[1].substr(0, 2), "0,");
  EXPECT_EQ(lines[2].substr(0, 6), "80000,");
  EXPECT_EQ(lines[3].substr(0, 6), "60000,");
  const std::string svg = *ReadFile(Path("tiny.pareto.svg"));
  EXPECT_THAT(svg, HasSubstr("Other &lt;1&gt;"));
  EXPECT_THAT(svg, HasSubstr("bytes of the map"));
  const ProgramRun again = Run("cairn pareto tiny.toml -o tiny.cairn --sizes 60000,80000 --progress none");
  EXPECT_THAT(run.out, HasSubstr("emit_map:"));
  EXPECT_THAT(again.out, testing::Not(HasSubstr("emit_map:")));  // nothing is done again
  EXPECT_EQ(again.out.substr(again.out.rfind("at most      bytes")),
            run.out.substr(run.out.rfind("at most      bytes")));
  EXPECT_EQ(Run("cairn pareto tiny.toml -o tiny.cairn --sizes 60000,x").exit_code, 2);
  EXPECT_EQ(Run("cairn pareto tiny.toml -o tiny.cairn --sizes ''").exit_code, 2);
  EXPECT_EQ(Run("cairn pareto tiny.toml -o tiny.cairn --peer a,b").exit_code, 2);
  EXPECT_EQ(Run("cairn pareto none.here -o none.cairn").exit_code, static_cast<int>(ErrorCode::kNotFound));
}

// A drive on which places are seen two or three times: with the images that are left out to try a size on,
// classes vanish that the world and its regions name.
// A lattice of many places and headings, whose promises take more than the last half per cent of the map.
TEST_F(MapSize, WhatIsPromisedCountsToo) {
  WriteTinyRecipe(Path("many.toml"));
  ReplaceInFile(Path("many.toml"), "spacing_m = 0.7", "spacing_m = 0.5");
  const ProgramRun run = Run("cairn pareto many.toml -o many.cairn --sizes 80000,60000 --progress none");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  std::ifstream rows(Path("many.pareto.csv"));
  std::string line;
  std::getline(rows, line);
  ASSERT_THAT(line, testing::StartsWith("max_bytes,bytes,"));
  std::getline(rows, line);  // without a limit
  for (const int max_bytes : {80000, 60000}) {
    ASSERT_TRUE(std::getline(rows, line));
    int at_most = 0, num_bytes = 0;
    char comma = 0;
    std::istringstream(line) >> at_most >> comma >> num_bytes;
    EXPECT_EQ(at_most, max_bytes);
    EXPECT_LE(num_bytes, max_bytes);
    EXPECT_GE(num_bytes, max_bytes * 9 / 10);
  }
}

TEST_F(MapSize, SurveyOfFewObservationsFitsItsBytesToo) {
  std::string recipe =
      "name = \"few\"\n[simulate]\nsurvey = \"driven\"\nwidth_m = 5.5\ndepth_m = 6\nnum_rooms = 2\n"
      "step_m = 0.7\nimage_width_px = 320\nimage_height_px = 240\nhorizontal_fov_deg = 65\n"
      "texel_m = 0.008\nnum_queries = 6\n" +
      TinyStageOptions();
  std::ofstream(Path("few.toml")) << recipe;
  ReplaceInFile(Path("few.toml"), "max_num_features = 300",
                "max_num_features = 600\ncontrast_threshold = 0.01");
  ReplaceInFile(Path("few.toml"), "cell_size_m = 0.7", "cell_size_m = 0.3");
  ReplaceInFile(Path("few.toml"), "heading_bin_deg = 90", "heading_bin_deg = 45");
  std::ofstream(Path("few.toml"), std::ios::app) << "max_bytes = 60000\n";
  // With the words of the whole survey its images and their words alone take 1.4 MB.
  for (const auto& [more, max_bytes] :
       std::vector<std::pair<std::string, size_t>>{{"", 60000},
                                                   {"documents = \"kept\"\n", 60000},
                                                   {"words = \"survey\"\n", 1'500'000},
                                                   {"visual_map = true\n", 60000}}) {
    const std::string recipe_of_all = ReadFile(Path("few.toml")).value();
    std::ofstream(Path("few.toml"), std::ios::app) << more;
    ReplaceInFile(Path("few.toml"), "max_bytes = 60000", fmt::format("max_bytes = {}", max_bytes));
    const ProgramRun run = Run("cairn compile few.toml -o few.cairn --progress none");
    ASSERT_EQ(run.exit_code, 0) << more << run.err;
    EXPECT_THAT(ReadFile(Path("few.report.json")).value(), HasSubstr("left-out survey images"));
    EXPECT_LE(fs::file_size(Path("few.cairn")), max_bytes);
    std::ofstream(Path("few.toml")) << recipe_of_all;
  }
  const ProgramRun pareto = Run("cairn pareto few.toml -o few.cairn --sizes 50000 --progress none");
  EXPECT_EQ(pareto.exit_code, 0) << pareto.err;
  EXPECT_THAT(ReadFile(Path("few.pareto.csv")).value(), HasSubstr("\n50000,"));
}

TEST_F(MapSize, DeltaMakesTheSmallMapFromTheWholeOneAndRollsBack) {
  const std::string deploy =
      "cp tiny.cairn robot.cairn && cairn keygen k && cairn sign small.cairn --key k -o s.cairn && "
      "cairn update delta robot.cairn s.cairn -o d --key k && cairn update apply robot.cairn d --in-place "
      "--public-key "
      "k.pub && "
      "cmp robot.cairn s.cairn && cmp robot.cairn.previous tiny.cairn";
  const ProgramRun run = Run(deploy);
  ASSERT_EQ(run.exit_code, 0) << run.err << run.out;
  EXPECT_EQ(Run("cairn update apply robot.cairn d --in-place").exit_code, 0);  // sent twice
  EXPECT_EQ(Run("cairn update apply small.cairn d -o x.cairn").exit_code,
            static_cast<int>(ErrorCode::kInvalidArgument));
  EXPECT_EQ(Run("head -c 1000 d > half; cairn update apply tiny.cairn half -o x.cairn").exit_code,
            static_cast<int>(ErrorCode::kCorrupt));
  EXPECT_EQ(Run("cairn update apply tiny.cairn d").exit_code, 2);
  EXPECT_EQ(Run("cairn update delta tiny.cairn s.cairn -o s.cairn").exit_code, 2);
  EXPECT_EQ(Run("cairn verify s.cairn").exit_code, 0);
  EXPECT_FALSE(fs::exists(Path("x.cairn")));
  // The map before is not signed: a robot that requires it does not go back.
  EXPECT_EQ(Run("cairn update rollback robot.cairn --public-key k.pub").exit_code,
            static_cast<int>(ErrorCode::kNotSigned));
  EXPECT_EQ(Run("cairn update rollback robot.cairn && cmp robot.cairn tiny.cairn").exit_code, 0);
}

TEST_F(MapSize, DiffNamesTheOptionAndExplainTheLosses) {
  const ProgramRun diff = Run("cairn diff tiny.cairn small.cairn");
  EXPECT_EQ(diff.exit_code, 0) << diff.err;
  EXPECT_THAT(diff.out, HasSubstr("[emit_map] max_bytes"));
  const json changes = json::parse(Run("cairn diff tiny.cairn small.cairn --json").out);
  EXPECT_EQ(changes["num_landmarks_shared"], changes["landmarks"][1]);  // all of the small map's
  const json stations = json::parse(Run("cairn inspect small.cairn --at 1,1 --json").out)["stations"];
  ASSERT_FALSE(stations.empty());
  bool lost = false;
  for (const json& drop : stations[0]["dropped"]) lost |= drop["name"] == "over_budget";
  EXPECT_TRUE(lost) << stations.dump(1);
  EXPECT_EQ(Run("cairn inspect small.cairn --at 100,100").exit_code, static_cast<int>(ErrorCode::kNotFound));
  for (const char* place : {"nowhere", "''", "1", "1,2,3,4", "nan,1", "1e300,0"})
    EXPECT_EQ(Run(std::string("cairn inspect small.cairn --at ") + place).exit_code, 2) << place;
  EXPECT_EQ(Run("cairn inspect small.cairn --image ''").exit_code, static_cast<int>(ErrorCode::kNotFound));
  EXPECT_EQ(Run("cairn inspect small.cairn --image none.jpg").exit_code,
            static_cast<int>(ErrorCode::kNotFound));
  const std::string image = stations[0]["images"][0];
  EXPECT_THAT(Run("cairn inspect small.cairn --image " + image).out, HasSubstr("taken at"));
}

}  // namespace
}  // namespace cairn
