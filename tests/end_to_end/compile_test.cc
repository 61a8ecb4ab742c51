#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/blocks/map_rows.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "core/world/decomposition.h"
#include "core/world/dropped_items.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::ContainsRegex;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr char kRegionsLine[] = "[0-9]+ regions?, at least [0-9]+ (is|are) needed";

// One map, compiled with two threads, that all tests of the suite look at; each leaves it as it was.
class Compile : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("compile_test");
    WriteTinyRecipe(*folder_ / "tiny.toml");
    const ProgramRun run = CompileTiny();
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("tiny.cairn: compiled\n"));
    EXPECT_THAT(run.out, ContainsRegex(kRegionsLine));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string Path(const std::string& name) { return *folder_ / name; }

  static ProgramRun CompileTiny(const std::string& arguments = "--threads 2") {
    return RunShell("cairn compile " + Path("tiny.toml") + " -o " + Path("tiny.cairn") + " --progress none " +
                    arguments);
  }

  using Dates = std::map<std::string, fs::file_time_type>;
  static Dates StampDates() {
    Dates dates;
    for (const auto& entry : fs::directory_iterator(Path("tiny.build"))) {
      if (entry.path().extension() == ".stamp") dates[entry.path().stem().string()] = entry.last_write_time();
    }
    return dates;
  }
  // The rules that have run since.
  static std::vector<std::string> RanSince(const Dates& before) {
    std::vector<std::string> ran;
    for (const auto& [name, date] : StampDates()) {
      if (!before.contains(name) || before.at(name) != date) ran.push_back(name);
    }
    return ran;
  }

  static std::string Hash(const std::string& name) { return HashFile(Path(name)).value(); }

  static TemporaryFolder* folder_;
};
TemporaryFolder* Compile::folder_ = nullptr;

TEST_F(Compile, SecondRunDoesNothing) {
  const Dates before = StampDates();
  const ProgramRun run = CompileTiny();
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(run.out, Path("tiny.cairn") + ": up to date\n");
  EXPECT_EQ(run.err, "");
  EXPECT_THAT(RanSince(before), IsEmpty());
}

TEST_F(Compile, TouchedImageRunsTheFirstStageOnly) {
  const std::string map = Hash("tiny.cairn");
  const Dates before = StampDates();
  fs::path image;
  for (const auto& entry : fs::recursive_directory_iterator(Path("tiny.build/capture/images"))) {
    if (entry.is_regular_file()) image = entry.path();
  }
  fs::last_write_time(image, fs::file_time_type::clock::now());
  const ProgramRun run = CompileTiny();
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(RanSince(before), ElementsAre("features.db"));
  EXPECT_EQ(Hash("tiny.cairn"), map);
  EXPECT_THAT(CompileTiny().out, HasSubstr("up to date"));
}

TEST_F(Compile, OptionOfOneStageRunsThatStageAndWhatFollows) {
  const std::string map = Hash("tiny.cairn");
  const Dates before = StampDates();
  ReplaceInFile(Path("tiny.toml"), "\nk = 4\n", "\nk = 5\n");
  ASSERT_EQ(CompileTiny().exit_code, 0);
  EXPECT_THAT(RanSince(before), ElementsAre("map", "regions.db", "unsealed.cairn"));
  EXPECT_NE(Hash("tiny.cairn"), map);

  ReplaceInFile(Path("tiny.toml"), "\nk = 5\n", "\nk = 4\n");
  ASSERT_EQ(CompileTiny().exit_code, 0);
  EXPECT_EQ(Hash("tiny.cairn"), map);
}

TEST_F(Compile, CommentInTheRecipeRunsNothing) {
  const Dates before = StampDates();
  ReplaceInFile(Path("tiny.toml"), "name =", "# a comment\nname =");
  ASSERT_EQ(CompileTiny().exit_code, 0);
  EXPECT_THAT(RanSince(before), IsEmpty());
}

TEST_F(Compile, MissingStageFileIsMadeAgain) {
  const std::string world = Hash("tiny.build/world.db");
  const Dates before = StampDates();
  fs::remove(Path("tiny.build/world.db"));
  ASSERT_EQ(CompileTiny().exit_code, 0);
  EXPECT_EQ(Hash("tiny.build/world.db"), world);
  EXPECT_THAT(RanSince(before), testing::Contains("world.db"));
  EXPECT_THAT(RanSince(before), testing::Not(testing::Contains("classes.db")));
}

TEST_F(Compile, CleanBuildWithOneThreadElsewhereGivesTheSameBytes) {
  fs::create_directories(Path("elsewhere"));
  WriteTinyRecipe(Path("elsewhere/other.toml"));
  const ProgramRun run = RunShell("cd " + Path("elsewhere") +
                                  " && cairn compile other.toml -o map.cairn --build-dir b --threads 1 -j 2");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  for (const char* file : {"features.db", "matches.db", "classes.db", "world.db", "regions.db",
                           "vocabulary.db", "appearance.db", "unsealed.cairn"}) {
    EXPECT_EQ(Hash(std::string("elsewhere/b/") + file), Hash(std::string("tiny.build/") + file)) << file;
  }
  EXPECT_EQ(Hash("elsewhere/map.cairn"), Hash("tiny.cairn"));
}

TEST_F(Compile, InterruptEndsWithItsCodeAndTheNextRunFinishes) {
  fs::create_directories(Path("interrupted"));
  const std::string command =
      "cairn compile " + Path("tiny.toml") + " -o " + Path("interrupted/tiny.cairn") + " --progress none";
  EXPECT_EQ(RunShell("timeout --preserve-status -s INT 2 " + command).exit_code, 10);
  EXPECT_FALSE(fs::exists(Path("interrupted/tiny.cairn")));
  const ProgramRun run = RunShell(command);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(Hash("interrupted/tiny.cairn"), Hash("tiny.cairn"));
}

TEST_F(Compile, UntilStopsAfterAStage) {
  const std::string target = " -o " + Path("until.cairn") + " --progress none --until ";
  const ProgramRun run = RunShell("cairn compile " + Path("tiny.toml") + target + "extract-features");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(fs::exists(Path("until.build/features.db")));
  EXPECT_FALSE(fs::exists(Path("until.build/matches.db")));
  const ProgramRun wrong = RunShell("cairn compile " + Path("tiny.toml") + target + "extract-feature");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("did you mean extract_features?"));
}

TEST_F(Compile, OneMakefileCanIncludeTheRulesOfManyMaps) {
  fs::create_directories(Path("many"));
  ASSERT_TRUE(WriteFileAtomically(Path("many/Makefile"),
                                  "all: first second\n"
                                  "CAIRN := " CAIRN_PROGRAM "\nRECIPE := ../tiny.toml\n"
                                  "MAP := a.cairn\nBUILD := a.build\ninclude " CAIRN_MAP_RULES "\n"
                                  "MAP := b.cairn\nBUILD := b.build\ninclude " CAIRN_MAP_RULES "\n"
                                  "first: a.build/features.db\nsecond: b.build/features.db\n")
                  .ok());
  const std::string make =
      "unset MAKEFLAGS MAKELEVEL; make --no-print-directory PROGRESS=none -C " + Path("many");
  const ProgramRun plan = RunShell(make + " a.build/config.mk b.build/config.mk && " + make + " -n");
  EXPECT_THAT(plan.out, HasSubstr("extract-features"));
  EXPECT_FALSE(fs::exists(Path("many/a.build/features.db")));
  const ProgramRun run = RunShell(make);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(Hash("many/a.build/features.db"), Hash("tiny.build/features.db"));
  EXPECT_EQ(Hash("many/b.build/features.db"), Hash("tiny.build/features.db"));
  EXPECT_EQ(RunShell(make).out, "make: Nothing to be done for 'all'.\n");
}

TEST_F(Compile, MapLocalizesItsQueries) {
  const ProgramRun inspect = RunShell("cairn inspect " + Path("tiny.cairn"));
  ASSERT_EQ(inspect.exit_code, 0) << inspect.err;
  EXPECT_THAT(inspect.out, HasSubstr("tiny"));
  EXPECT_THAT(inspect.out, ContainsRegex(kRegionsLine));
  const std::string images = Path("tiny.build/capture/images/");
  const std::string names =
      RunShell("awk 'NF == 10 && !/^#/ {print $10}' " + Path("tiny.build/capture/queries.txt")).out;
  const std::string query = names.substr(0, names.find('\n'));
  const ProgramRun localize =
      RunShell("cairn localize " + Path("tiny.cairn") + " " + images + query + " -o " + Path("poses.txt"));
  ASSERT_EQ(localize.exit_code, 0) << localize.err;
  EXPECT_THAT(localize.out, HasSubstr(query));
  EXPECT_TRUE(fs::exists(Path("poses.txt")));
}

// Number of dropped items of a kind.
int64_t NumDropped(const std::vector<DroppedItem>& items, DropKind kind) {
  return std::count_if(items.begin(), items.end(),
                       [&](const DroppedItem& item) { return DescribeDropReason(item.reason).kind == kind; });
}

// The counts that a stage reports for its input ("in") or its output ("out").
int64_t NumReported(const std::string& output, const std::string& side, const std::string& what) {
  return nlohmann::json::parse(ReadFile(output + ".report.json").value())[side].at(what).get<int64_t>();
}

TEST_F(Compile, WhatEveryStageKeepsAndDropsAddsUp) {
  const std::string build = Path("tiny.build/");
  const auto matches = ReadDroppedItems(build + "matches.db", kColmapDroppedItemsTable);
  ASSERT_TRUE(matches.ok()) << matches.error().message;
  EXPECT_EQ(
      NumDropped(*matches, DropKind::kPair) + NumReported(build + "matches.db", "out", "verified pairs"),
      NumReported(build + "matches.db", "in", "pairs"));

  const Classes classes = *ReadClasses(build + "classes.db");
  const auto tracks = *ReadDroppedItems(build + "classes.db", kDroppedItemsTable);
  const auto num_classes = static_cast<int64_t>(classes.classes.size());
  EXPECT_EQ(NumDropped(tracks, DropKind::kFeature) + num_classes,
            NumReported(build + "classes.db", "in", "tracks"));

  const World world = *ReadWorld(build + "world.db");
  const auto views = *ReadDroppedItems(build + "world.db", kDroppedItemsTable);
  EXPECT_EQ(NumDropped(views, DropKind::kFeature) + world.num_features(), num_classes);

  const Decomposition decomposition = *ReadDecomposition(build + "regions.db");
  std::set<FeatureIdx> kept;
  for (const Region& region : decomposition.regions)
    kept.insert(region.features.begin(), region.features.end());
  const auto features = *ReadDroppedItems(build + "regions.db", kDroppedItemsTable);
  EXPECT_EQ(NumDropped(features, DropKind::kFeature) + static_cast<int64_t>(kept.size()),
            world.num_features());

  // The map counts the same things.  tau = 0: stations of regions are covered, the others dropped.
  const MapRows rows = *ReadMapRows(Path("tiny.cairn"));
  std::map<std::string, int64_t> counted, listed;
  for (const DropCount& count : rows.findings.drops) counted[count.name] = count.num_dropped;
  for (const auto* items : {&*matches, &tracks, &views, &features}) {
    for (const DroppedItem& item : *items) {
      const DropReasonEntry& reason = DescribeDropReason(item.reason);
      listed[reason.name] += reason.kind == DropKind::kKeypoint
                                 ? static_cast<int64_t>(item.seen_at.size()) / 2
                             : reason.kind == DropKind::kView ? static_cast<int64_t>(item.seen_at.size())
                                                              : 1;
    }
  }
  EXPECT_EQ(counted, listed);
  std::set<StationIdx> covered;
  for (const MapRegion& region : rows.regions) covered.insert(region.stations.begin(), region.stations.end());
  for (StationIdx station = 0; station < world.num_stations(); ++station)
    EXPECT_EQ(rows.stations[station].is_covered, covered.contains(station)) << station;
}

TEST_F(Compile, ClassesSeenAtAStationAreVisibleThereOrDroppedForOneReason) {
  const std::string build = Path("tiny.build/");
  const Classes classes = *ReadClasses(build + "classes.db");
  const World world = *ReadWorld(build + "world.db");
  std::map<ImageId, StationIdx> station_of;
  for (size_t station = 0; station < world.station_images.size(); ++station) {
    for (const ImageId image : world.station_images[station])
      station_of[image] = static_cast<StationIdx>(station);
  }
  std::vector<int64_t> seen(world.num_stations(), 0), accounted(world.num_stations(), 0);
  for (const FeatureClass& feature_class : classes.classes) {
    std::set<StationIdx> stations;
    for (const Observation& observation : feature_class.observations)
      stations.insert(station_of.at(observation.image_id));
    for (const StationIdx station : stations) ++seen[station];
  }
  for (const std::vector<StationIdx>& area : world.areas) {
    for (const StationIdx station : area) ++accounted[station];
  }
  const MapRows rows = *ReadMapRows(Path("tiny.cairn"));
  for (const DropCount& count : rows.findings.drops) {
    for (size_t station = 0; count.stage == "filter_visibility" && station < count.at_stations.size();
         ++station)
      accounted[station] += count.at_stations[station];
  }
  EXPECT_EQ(seen, accounted);
}

TEST_F(Compile, InspectPrintsWhatWasDroppedAndHowRegionsFared) {
  const ProgramRun text = RunShell("cairn inspect " + Path("tiny.cairn"));
  EXPECT_THAT(text.out, HasSubstr("few_observations"));
  EXPECT_THAT(text.out, HasSubstr("stations that see the fewest landmarks"));
  EXPECT_THAT(text.out, HasSubstr("by region, worst first"));
  const auto json = nlohmann::json::parse(RunShell("cairn inspect --json " + Path("tiny.cairn")).out);
  int num_held_out = 0;
  for (const auto& region : json["self_test_regions"]) num_held_out += region["num_held_out"].get<int>();
  EXPECT_GE(num_held_out, 6);  // every query counts in a region or outside
  for (const auto& reason : json["dropped"]) {
    const size_t num_counts = reason["at_stations"].size();
    EXPECT_TRUE(num_counts == 0 || num_counts == json["num_stations"].get<size_t>());
  }
}

TEST_F(Compile, RejectedImagesAreCountedInTheMap) {
  const std::string build = Path("tiny.build/");
  fs::copy_file(build + "matches.db", Path("rejects.db"));
  SQLite::Database(Path("rejects.db"), SQLite::OPEN_READWRITE)
      .exec("INSERT INTO cairn_rejects VALUES ('broken.png', 'truncated'), ('none.png', 'no such file')");
  const ProgramRun emit =
      RunShell("cairn stage emit-map --matches " + Path("rejects.db") + " --classes " + build +
               "classes.db --world " + build + "world.db --regions " + build + "regions.db --vocabulary " +
               build + "vocabulary.db --name rejects -o " + Path("rejects.cairn"));
  ASSERT_EQ(emit.exit_code, 0) << emit.err;
  const MapRows rows = *ReadMapRows(Path("rejects.cairn"));
  ASSERT_FALSE(rows.findings.drops.empty());
  EXPECT_EQ(rows.findings.drops[0].name, "unreadable");
  EXPECT_EQ(rows.findings.drops[0].num_dropped, 2);
  EXPECT_THAT(rows.findings.drops[0].at_stations, IsEmpty());
}

TEST_F(Compile, SparseMapIsComparedWithAllImagesAndLeadsFromOneToAnother) {
  const std::string build = Path("tiny.build/");
  const ProgramRun emit =
      RunShell("cairn stage emit-map --classes " + build + "classes.db --world " + build +
               "world.db --regions " + build + "regions.db --vocabulary " + build +
               "vocabulary.db --appearance " + build + "appearance.db --options " + build +
               "options/emit_map.toml --documents kept --name sparse -o " + Path("sparse.cairn"));
  ASSERT_EQ(emit.exit_code, 0) << emit.err;
  const ProgramRun check =
      RunShell("cairn check " + Path("sparse.cairn") + " --queries " + build + "capture/queries.txt --json");
  ASSERT_EQ(check.exit_code, 0) << check.err;
  const auto figures = nlohmann::json::parse(check.out);
  const auto full = nlohmann::json::parse(
      RunShell("cairn check " + Path("tiny.cairn") + " --queries " + build + "capture/queries.txt --json")
          .out);
  EXPECT_EQ(figures["all_images_num_localized"], full["num_localized"]);
  EXPECT_LE(figures["num_by_retrieval"], figures["num_localized"]);

  const MapRows rows = *ReadMapRows(Path("tiny.cairn"));
  const auto name = [&](bool is_kept) {
    const auto node =
        std::find_if(rows.appearance.begin(), rows.appearance.end(),
                     [&](const MapAppearanceNode& n) { return n.is_kept == is_kept && !n.links.empty(); });
    return node == rows.appearance.end() ? std::string() : rows.images[node->images[0]].name;
  };
  const std::string from = name(false), to = name(true);
  ASSERT_NE(from, "");
  ASSERT_NE(to, "");
  const ProgramRun route = RunShell("cairn route " + Path("tiny.cairn") + " " + from + " " + to + " --json");
  ASSERT_EQ(route.exit_code, 0) << route.err;
  const auto images = nlohmann::json::parse(route.out)["images"];
  EXPECT_EQ(images.front()["name"], from);
  EXPECT_EQ(images.back()["name"], to);
  const ProgramRun nowhere = RunShell("cairn route " + Path("tiny.cairn") + " " + from + " nobody.jpg");
  EXPECT_EQ(nowhere.exit_code, 3);
  EXPECT_THAT(nowhere.err, HasSubstr("has no survey image 'nobody.jpg'"));

  const ProgramRun left_out = RunShell("cairn stage check-appearance " + build + "matches.db --num-tries 20");
  ASSERT_EQ(left_out.exit_code, 0) << left_out.err;
  EXPECT_THAT(left_out.out, HasSubstr("left-out images"));
}

TEST_F(Compile, PlacesThatLookAlikeAreListedDrawnAndWeighed) {
  const ProgramRun text =
      RunShell("cairn inspect " + Path("tiny.cairn") + " --ambiguity-svg " + Path("places.svg"));
  ASSERT_EQ(text.exit_code, 0) << text.err;
  EXPECT_THAT(text.out, ContainsRegex("most ambiguous places .*\n  [0-9.]+  .*deg"));
  EXPECT_THAT(text.out, ContainsRegex("most ambiguous regions .*\n  [0-9.]+  region [0-9]+"));
  EXPECT_THAT(*ReadFile(Path("places.svg")), HasSubstr("where the robot can tell where it is"));
  const auto json = nlohmann::json::parse(RunShell("cairn inspect --json " + Path("tiny.cairn")).out);
  ASSERT_EQ(json["ambiguity"]["nodes"].size(), json["num_appearance_nodes"].get<size_t>());
  double most = 0;
  for (const auto& node : json["ambiguity"]["nodes"])
    most = std::max(most, node["entropy_nat"].get<double>());
  EXPECT_GT(most, 0);

  // A map of all features, in which every image is kept: ways over them by each weight.
  const auto emit = [&](const std::string& arguments) {
    return RunShell(
        "cd " + Path("tiny.build") +
        " && cairn stage emit-map --classes classes.db --world world.db --regions " +
        "regions.db --vocabulary vocabulary.db --name tiny --landmarks regions -o ../memory.cairn "
        "--progress none " +
        arguments);
  };
  const ProgramRun link =
      RunShell("cd " + Path("tiny.build") +
               " && cairn stage link-appearance matches.db vocabulary.db --capture capture --algorithm "
               "all -o ../all.db --progress none");
  ASSERT_EQ(link.exit_code, 0) << link.err;
  ASSERT_EQ(emit("--appearance ../all.db --words survey").exit_code, 0);
  const auto memory = nlohmann::json::parse(RunShell("cairn inspect --json " + Path("memory.cairn")).out);
  EXPECT_EQ(memory["num_kept_nodes"], memory["num_appearance_nodes"]);
  EXPECT_GT(memory["num_words"].get<int>(), 0);
  const std::string from = memory["ambiguity"]["nodes"].front()["image"],
                    to = memory["ambiguity"]["nodes"].back()["image"];
  for (const std::string weight : {"links", "matches", "entropy", "risk"}) {
    const ProgramRun route = RunShell("cairn route " + Path("memory.cairn") + " " + from + " " + to +
                                      " --json --weight " + weight);
    ASSERT_EQ(route.exit_code, 0) << route.err;
    EXPECT_GT(nlohmann::json::parse(route.out)["cost"].get<double>(), 0);
  }
  EXPECT_EQ(emit("--appearance ../all.db --words survey --documents kept").exit_code, 2);

  // Without the vocabulary nothing is known, and that is said.
  ASSERT_EQ(RunShell("cd " + Path("tiny.build") + " && cairn stage link-appearance matches.db -o ../all.db")
                .exit_code,
            0);
  ASSERT_EQ(emit("--appearance ../all.db").exit_code, 0);
  const ProgramRun none =
      RunShell("cairn inspect " + Path("memory.cairn") + " --ambiguity-svg " + Path("none.svg"));
  EXPECT_EQ(none.exit_code, static_cast<int>(ErrorCode::kNotFound));
  EXPECT_THAT(none.err, HasSubstr("give link-appearance the vocabulary"));
  EXPECT_FALSE(fs::exists(Path("none.svg")));
}

TEST_F(Compile, GateOfRegionsKeepsAMapFromBeingWritten) {
  // Nothing is localized to better than a nanometre: every fix is a gross error.
  const std::string check = "cairn check " + Path("tiny.build/unsealed.cairn") + " --queries " +
                            Path("tiny.build/capture/queries.txt") + " --gross-error-m 1e-6 -o " +
                            Path("gated.cairn") + " --min-region-held-out 1 --min-region-precision-ratio ";
  const ProgramRun gated = RunShell(check + "0.01");
  EXPECT_EQ(gated.exit_code, 8);
  EXPECT_THAT(gated.err, HasSubstr("precision_ratio of region"));
  EXPECT_FALSE(fs::exists(Path("gated.cairn")));
  EXPECT_EQ(RunShell(check + "0").exit_code, 0);
  const ProgramRun unasked = RunShell("cairn check " + Path("tiny.build/unsealed.cairn") +
                                      " --min-localized-ratio 0.5 -o " + Path("unasked.cairn"));
  EXPECT_EQ(unasked.exit_code, 8);
  EXPECT_THAT(unasked.err, HasSubstr("no held-out images"));
}

}  // namespace
}  // namespace cairn
