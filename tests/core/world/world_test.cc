#include "core/world/world.h"

#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/world/decomposition.h"
#include "tests/core/world/edited_database.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string TemporaryFile(const std::string& name, const std::string& contents) {
  const std::string path = testing::TempDir() + "/" + name;
  EXPECT_TRUE(WriteFileAtomically(path, contents).ok());
  return path;
}

Error ReadError(const std::string& json) {
  const Result<World> world = ReadWorldJson(TemporaryFile("bad_world.json", json));
  EXPECT_FALSE(world.ok()) << json;
  return world.ok() ? Error{} : world.error();
}

//  0 - 1 - 2      feature 0 is seen from 0 and 1, feature 1 from 2, feature 2 from nowhere
World ThreeStations() {
  World world;
  world.positions = {{0, 0}, {0.5, 0}, {1, -0.25}};
  world.edges = {{0, 1}, {1, 2}};
  world.areas = {{0, 1}, {2}, {}};
  return world;
}

World FullWorld() {
  World world = ThreeStations();
  world.headings_deg = {0, 45, 315};
  world.class_ids = {7, 9, 4000000000};
  world.station_images = {{1, 2}, {}, {2147483646}};
  world.lattice_spacing_m = 0.5;
  world.floor_from_world.rotation = Eigen::Quaterniond(0.5, -0.1, 0.7, 0.5);
  world.floor_from_world.translation = {1, 2, 3};
  return world;
}

void ExpectEqual(const World& a, const World& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.headings_deg, b.headings_deg);
  EXPECT_EQ(a.edges, b.edges);
  EXPECT_EQ(a.areas, b.areas);
  EXPECT_EQ(a.class_ids, b.class_ids);
  EXPECT_EQ(a.station_images, b.station_images);
  EXPECT_EQ(a.lattice_spacing_m, b.lattice_spacing_m);
  EXPECT_EQ(a.floor_from_world.Matrix(), b.floor_from_world.Matrix());
}

TEST(World, ListsFollowFromAreasAndEdges) {
  EXPECT_THAT(VisibilitySets(ThreeStations()), ElementsAre(ElementsAre(0), ElementsAre(0), ElementsAre(1)));
  EXPECT_THAT(AdjacencyLists(ThreeStations()),
              ElementsAre(ElementsAre(1), ElementsAre(0, 2), ElementsAre(1)));
}

TEST(World, SurvivesBothFormats) {
  for (const World& world : {ThreeStations(), FullWorld(), World()}) {
    for (const char* name : {"world.json", "world.db"}) {
      const std::string path = testing::TempDir() + "/" + name;
      const bool json = std::string(name) == "world.json";
      ASSERT_TRUE((json ? WriteWorldJson(world, path) : WriteWorldDatabase(world, path)).ok());
      const Result<World> read = ReadWorld(path);
      ASSERT_TRUE(read.ok()) << read.error().message;
      ExpectEqual(*read, world);
    }
  }
}

TEST(World, SameWorldGivesTheSameBytes) {
  const std::string a = testing::TempDir() + "/a.db", b = testing::TempDir() + "/b.db";
  ASSERT_TRUE(WriteWorldDatabase(FullWorld(), a).ok());
  ASSERT_TRUE(WriteWorldDatabase(FullWorld(), b).ok());
  EXPECT_EQ(*ReadFile(a), *ReadFile(b));
}

TEST(WorldJson, AcceptsAnyOrderAndUnknownMembers) {
  const Result<World> world = ReadWorldJson(TemporaryFile("world_order.json", R"({
    "features": [[1, 0], [2], []], "comment": {"by": [["hand", null, true]]}, "edges": [[2, 1], [1, 0]],
    "history": [{"poses": [[7, 7]], "by": {"name": {"first": "Ada"}}, "version": 9}, [[[{"edges": "none"}]]]],
    "more": {"format": null, "features": [[9]], "in": [{"class_ids": -1}, {}]},
    "poses": [[0, 0], [5e-1, 0], [1, -0.25]], "version": 1, "format": "cairn-world"})"));
  ASSERT_TRUE(world.ok()) << world.error().message;
  ExpectEqual(*world, ThreeStations());
}

TEST(WorldJson, ErrorsNameTheElement) {
  const auto world = [](const std::string& poses, const std::string& edges, const std::string& features) {
    return R"({"format":"cairn-world","version":1,"poses":)" + poses + R"(,"edges":)" + edges +
           R"(,"features":)" + features + "}";
  };
  EXPECT_THAT(ReadError(world("[[0,0],[1,0]]", "[[0,2]]", "[]")).message, HasSubstr("edge 0: [0, 2]"));
  EXPECT_THAT(ReadError(world("[[0,0],[1,0]]", "[[1,1]]", "[]")).message,
              HasSubstr("joins station 1 to itself"));
  EXPECT_THAT(ReadError(world("[[0,0],[1,0]]", "[[0,1],[1,0]]", "[]")).message,
              HasSubstr("edge 1: [0, 1] is a dup"));
  EXPECT_THAT(ReadError(world("[[0,0],[1,0]]", "[]", "[[],[0,5]]")).message,
              HasSubstr("feature 1: station 5"));
  EXPECT_THAT(ReadError(world("[[0,0],[1,0]]", "[]", "[[0,-1]]")).message, HasSubstr("features[0]: -1"));
  EXPECT_THAT(ReadError(world("[[0,0],[1,0]]", "[]", "[[0,0.5]]")).message, HasSubstr("features[0]: 0.5"));
  EXPECT_THAT(ReadError(world("[[0,0],[1,0]]", "[]", "[[0],[1,1]]")).message,
              HasSubstr("feature 1: station 1 is a dup"));
  EXPECT_THAT(ReadError(world("[[0,0],[0,0]]", "[]", "[]")).message,
              HasSubstr("stations 0 and 1 are at the same place"));
  EXPECT_THAT(ReadError(world("[[0,0,1]]", "[]", "[]")).message, HasSubstr("poses[0]: found 3 numbers"));
  EXPECT_THAT(ReadError(world("[[0,0]]", "[]", "[4]")).message, HasSubstr("features[0]: found a number"));
  EXPECT_THAT(ReadError(world("[[0,\"0\"]]", "[]", "[]")).message, HasSubstr("poses[0]: found a text"));
  EXPECT_THAT(ReadError(world("[[0,0]]", "[]", "[[99999999999]]")).message, HasSubstr("features[0]"));
  EXPECT_THAT(ReadError(world("{}", "[]", "[]")).message, HasSubstr("poses: found an object"));
  EXPECT_THAT(ReadError(world("null", "[]", "[]")).message, HasSubstr("poses: found null"));
  EXPECT_THAT(ReadError("[1]").message, HasSubstr("found an array"));
  EXPECT_THAT(ReadError("{}").message, HasSubstr("\"format\" is ''"));
  EXPECT_THAT(ReadError(R"({"format":"cairn-world","version":2})").message, HasSubstr("version 2"));
  EXPECT_THAT(ReadError(R"({"format":"cairn-world","version":1,"poses":[],"edges":[]})").message,
              HasSubstr("'features' is missing"));
}

TEST(WorldJson, NumbersThatAreNoneAndFilesThatAreNoneAreErrors) {
  const auto message = [](const std::string& text) {
    return ReadError(R"({"format":"cairn-world","version":1,"edges":[],"features":[],"poses":)" + text + "}")
        .message;
  };
  EXPECT_THAT(message("[[0,NaN]]"), HasSubstr("invalid literal"));
  EXPECT_THAT(message("[[0,1e999]]"), HasSubstr("1e999"));
  EXPECT_THAT(message("[[0,true]]"), HasSubstr("poses[0]: found a boolean"));
  EXPECT_EQ(ReadError("").code, ErrorCode::kCorrupt);
  EXPECT_THAT(ReadError("7").message, HasSubstr("\"format\" is ''"));
  EXPECT_EQ(ReadWorld(testing::TempDir()).error().code, ErrorCode::kNotFound);
}

TEST(WorldJson, TruncationAnywhereIsCorruptAndNothingElse) {
  const std::string path = testing::TempDir() + "/whole.json";
  ASSERT_TRUE(WriteWorldJson(FullWorld(), path).ok());
  const std::string whole = *ReadFile(path);
  for (size_t size = 0; size + 2 < whole.size(); size += 5) {
    EXPECT_EQ(ReadError(whole.substr(0, size)).code, ErrorCode::kCorrupt) << size;
  }
}

TEST(WorldDatabase, DamageIsAnErrorThatNamesTheFile) {
  const std::string path = testing::TempDir() + "/damaged.db";
  ASSERT_TRUE(WriteWorldDatabase(FullWorld(), path).ok());
  const std::string whole = *ReadFile(path);
  for (const size_t size : {whole.size() / 2, size_t{4096}, size_t{100}, size_t{20}}) {
    const Result<World> world = ReadWorld(TemporaryFile("cut.db", whole.substr(0, size)));
    ASSERT_FALSE(world.ok()) << size;
    EXPECT_THAT(world.error().message, HasSubstr("cut.db"));
  }
}

TEST(WorldDatabase, ErrorsNameTheTableAndTheRow) {
  const std::string path = testing::TempDir() + "/whole_world.db";
  ASSERT_TRUE(WriteWorldDatabase(FullWorld(), path).ok());
  const auto error = [whole = *ReadFile(path)](const std::string& sql) {
    const Result<World> world = ReadWorld(EditedDatabase("edited_world.db", whole, sql));
    EXPECT_FALSE(world.ok()) << sql;
    return world.ok() ? Error{} : world.error();
  };
  const auto message = [&](const std::string& sql) { return error(sql).message; };
  EXPECT_THAT(message("PRAGMA application_id = 7"), HasSubstr("not a world database"));
  EXPECT_THAT(message("DROP TABLE world"), HasSubstr("not a world database"));
  EXPECT_THAT(message("PRAGMA user_version = 2"), HasSubstr("world version 2, this program reads 1"));
  EXPECT_EQ(error("PRAGMA user_version = 2").code, ErrorCode::kUnsupported);
  EXPECT_THAT(message("DELETE FROM world"), HasSubstr("table world is empty"));
  EXPECT_THAT(message("UPDATE world SET num_stations = 4"),
              HasSubstr("3 stations, 2 edges, 3 features; its header says 4, 2, 3"));
  EXPECT_THAT(message("UPDATE world SET num_edges = 1"), HasSubstr("its header says 3, 1, 3"));
  EXPECT_THAT(message("UPDATE world SET num_features = 2"), HasSubstr("its header says 3, 2, 2"));
  EXPECT_THAT(message("DELETE FROM stations WHERE station_idx = 1"),
              HasSubstr("table stations, station 1: missing"));
  EXPECT_THAT(message("DELETE FROM features WHERE feature_idx = 0"),
              HasSubstr("table features, feature 0: missing"));
  EXPECT_THAT(message("UPDATE stations SET neighbours = x'010203' WHERE station_idx = 2"),
              HasSubstr("station 2: a blob of 3 bytes"));
  EXPECT_THAT(message("UPDATE stations SET images = x'0102' WHERE station_idx = 1"),
              HasSubstr("station 1: a blob of 2 bytes"));
  EXPECT_THAT(message("UPDATE features SET stations = x'01' WHERE feature_idx = 2"),
              HasSubstr("feature 2: a blob of 1 bytes"));
  EXPECT_THAT(message("UPDATE features SET stations = x'09000000' WHERE feature_idx = 1"),
              HasSubstr("edited_world.db: feature 1: station 9 is outside of 0 to 2"));
}

TEST(CheckWorld, NamesTheElement) {
  const auto message = [](const std::function<void(World*)>& spoil) {
    World world = FullWorld();
    spoil(&world);
    const Status status = CheckWorld(world);
    EXPECT_TRUE(status.ok() || status.error().code == ErrorCode::kInvalidArgument);
    return status.ok() ? "" : status.error().message;
  };
  EXPECT_EQ(message([](World*) {}), "");
  EXPECT_EQ(message([](World* w) { w->headings_deg = {}; }), "");
  EXPECT_EQ(message([](World* w) {
              w->headings_deg = {1, 2};
            }),
            "headings_deg: 2 entries, expected none or 3");
  EXPECT_EQ(message([](World* w) { w->class_ids.pop_back(); }), "class_ids: 2 entries, expected none or 3");
  EXPECT_EQ(message([](World* w) { w->station_images.resize(4); }),
            "station_images: 4 entries, expected none or 3");
  EXPECT_EQ(message([](World* w) {
              w->edges = {{-1, 2}};
            }),
            "edge 0: [-1, 2] names a station outside of 0 to 2");
  EXPECT_EQ(message([](World* w) {
              w->edges = {{0, 1}, {1, 3}};
            }),
            "edge 1: [1, 3] names a station outside of 0 to 2");
  EXPECT_EQ(message([](World* w) {
              w->edges = {{3, 1}};
            }),
            "edge 0: [3, 1] names a station outside of 0 to 2");
  EXPECT_EQ(message([](World* w) {
              w->edges = {{1, -1}};
            }),
            "edge 0: [1, -1] names a station outside of 0 to 2");
  EXPECT_EQ(message([](World* w) { w->edges = {{0, 0}}; }), "edge 0: joins station 0 to itself");
  EXPECT_EQ(message([](World* w) { w->edges = {{1, 0}}; }), "edge 0: [1, 0] is a duplicate or out of order");
  EXPECT_EQ(message([](World* w) {
              w->edges = {{0, 2}, {0, 1}};
            }),
            "edge 1: [0, 1] is a duplicate or out of order");
  EXPECT_EQ(message([](World* w) {
              w->edges = {{0, 1}, {0, 1}};
            }),
            "edge 1: [0, 1] is a duplicate or out of order");
  EXPECT_EQ(message([](World* w) { w->areas[1] = {-1}; }), "feature 1: station -1 is outside of 0 to 2");
  EXPECT_EQ(message([](World* w) { w->areas[2] = {0, 3}; }), "feature 2: station 3 is outside of 0 to 2");
  EXPECT_EQ(message([](World* w) {
              w->areas[0] = {2, 2};
            }),
            "feature 0: station 2 is a duplicate or out of order");
  EXPECT_EQ(message([](World* w) {
              w->areas[0] = {2, 0};
            }),
            "feature 0: station 0 is a duplicate or out of order");
  const double nan = std::nan("");
  EXPECT_EQ(message([&](World* w) { w->positions[1].y() = nan; }),
            "station 1: its place is not a finite number");
  EXPECT_EQ(message([&](World* w) { w->headings_deg[2] = nan; }),
            "station 2: its place is not a finite number");
}

TEST(CheckWorld, NoTwoStationsAreAtOnePlaceWithOneHeading) {
  const auto message = [](const std::vector<Eigen::Vector2d>& positions,
                          const std::vector<double>& headings_deg) {
    World world;
    world.positions = positions;
    world.headings_deg = headings_deg;
    const Status status = CheckWorld(world);
    return status.ok() ? "" : status.error().message;
  };
  EXPECT_EQ(message({{1, 2}, {0, 0}, {1, 2}}, {}), "stations 0 and 2 are at the same place (1, 2)");
  EXPECT_EQ(message({{1, 2}, {0, 0}, {1, 2}}, {90, 0, 90}), "stations 0 and 2 are at the same place (1, 2)");
  EXPECT_EQ(message({{1, 2}, {1, 2}}, {90, 0}), "");
  EXPECT_EQ(message({{1, 2}, {1, 3}, {2, 2}}, {}), "");
}

TEST(WorldJson, MembersThatAreNotWhatTheyShouldBeAreErrors) {
  const auto message = [](const std::string& members) {
    return ReadError(R"({"format":"cairn-world","version":1,)" + members + "}").message;
  };
  EXPECT_THAT(message(R"("poses":[],"poses":[])"), HasSubstr("member 'poses' occurs twice"));
  EXPECT_THAT(message(R"("edges":[],"edges":[])"), HasSubstr("member 'edges' occurs twice"));
  EXPECT_THAT(message(R"("features":[],"features":[])"), HasSubstr("member 'features' occurs twice"));
  EXPECT_THAT(message(R"("format":["cairn-world"])"),
              HasSubstr("format[0]: found an array, expected a text"));
  EXPECT_THAT(message(R"("version":[1])"), HasSubstr("version[0]: found an array, expected a number"));
  EXPECT_THAT(message(R"("version":"1")"), HasSubstr("version: found a text, expected a number"));
  EXPECT_THAT(message(R"("format":1)"), HasSubstr("format: found a number, expected a text"));
  EXPECT_THAT(message(R"("lattice_spacing_m":[1])"), HasSubstr("lattice_spacing_m[0]: found an array"));
  EXPECT_THAT(message(R"("poses":3)"), HasSubstr("poses: found a number, expected [x, y]"));
  EXPECT_THAT(message(R"("poses":[[0,0],[[1]]])"), HasSubstr("poses[1]: found an array"));
  EXPECT_THAT(message(R"("poses":[[0,0],[1]])"), HasSubstr("poses[1]: found 1 numbers"));
  EXPECT_THAT(message(R"("poses":[[0,0],["format"]])"), HasSubstr("poses[1]: found a text"));
  EXPECT_THAT(message(R"("poses":[{}])"), HasSubstr("poses[0]: found an object"));
  EXPECT_THAT(message(R"("edges":[[0,1],[1,2],[2]])"),
              HasSubstr("edges[2]: found 1 indices, expected [station"));
  EXPECT_THAT(message(R"("edges":[[0,1,2]])"), HasSubstr("edges[0]: found 3 indices"));
  EXPECT_THAT(message(R"("features":[[0],[2147483648]])"),
              HasSubstr("features[1]: 2.14748e+09 is not an index (an integer from 0 to 2147483647)"));
  EXPECT_THAT(message(R"("features":[[18446744073709551615]])"),
              HasSubstr("features[0]: 1.84467e+19 is not an index"));
  EXPECT_THAT(message(R"("station_images":[[1],[],[-1]])"),
              HasSubstr("station_images[2]: -1 is not an index"));
  EXPECT_THAT(message(R"("station_images":[4])"), HasSubstr("expected a list of image ids"));
  EXPECT_THAT(message(R"("class_ids":[[1]])"),
              HasSubstr("class_ids[0]: found an array, expected a list of class ids"));
  EXPECT_THAT(message(R"("class_ids":[5,4294967295])"),
              HasSubstr("class_ids[1]: 4.29497e+09 is not an index (an integer from 0 to 4294967294)"));
  EXPECT_THAT(message(R"("headings_deg":[1,2,"x"])"),
              HasSubstr("headings_deg[2]: found a text, expected a list of numbers"));
  EXPECT_THAT(message(R"("floor_from_world":[1,0,0,0,0,0])"),
              HasSubstr("floor_from_world: found 6 numbers, expected [qw, qx, qy, qz, tx, ty, tz]"));
}

TEST(WorldJson, LargestIndicesAndIdsAreRead) {
  World world;
  world.positions = {{0, 0}};
  world.areas = {{0}};
  world.class_ids = {4294967294};
  world.station_images = {{2147483647}};
  const std::string path = testing::TempDir() + "/largest.json";
  ASSERT_TRUE(WriteWorldJson(world, path).ok());
  const Result<World> read = ReadWorldJson(path);
  ASSERT_TRUE(read.ok()) << read.error().message;
  ExpectEqual(*read, world);
}

TEST(WorldJson, AnOtherFormatIsCorruptAndAnOtherVersionUnsupported) {
  EXPECT_EQ(ReadError(R"({"format":"cairn-regions","version":1})").code, ErrorCode::kCorrupt);
  EXPECT_EQ(ReadError(R"({"format":"cairn-world","version":2})").code, ErrorCode::kUnsupported);
  EXPECT_THAT(ReadError(R"({"format":"cairn-world"})").message,
              HasSubstr("world version 0, this program reads 1"));
}

TEST(RegionsDatabase, ErrorsNameTheRow) {
  const std::string path = testing::TempDir() + "/whole_regions.db";
  const Decomposition decomposition{.algorithm = "b2", .k = 1, .regions = {{{0}, {0, 1}}, {{1}, {2}}}};
  ASSERT_TRUE(WriteDecompositionDatabase(decomposition, path).ok());
  const auto error = [whole = *ReadFile(path)](const std::string& sql) {
    const Result<Decomposition> read = ReadDecomposition(EditedDatabase("edited_regions.db", whole, sql));
    EXPECT_FALSE(read.ok()) << sql;
    return read.ok() ? Error{} : read.error();
  };
  const auto message = [&](const std::string& sql) { return error(sql).message; };
  EXPECT_THAT(message("PRAGMA application_id = 7"), HasSubstr("not a database of regions"));
  EXPECT_THAT(message("DROP TABLE decomposition"), HasSubstr("not a database of regions"));
  EXPECT_THAT(message("PRAGMA user_version = 2"), HasSubstr("regions version 2, this program reads 1"));
  EXPECT_EQ(error("PRAGMA user_version = 2").code, ErrorCode::kUnsupported);
  EXPECT_THAT(message("DELETE FROM decomposition"), HasSubstr("table decomposition is empty"));
  EXPECT_THAT(message("UPDATE decomposition SET uncovered = x'01'"),
              HasSubstr("uncovered stations: a blob of 1"));
  EXPECT_THAT(message("DELETE FROM regions WHERE region_idx = 0"), HasSubstr("region 0: missing"));
  EXPECT_THAT(message("UPDATE regions SET features = x'0102' WHERE region_idx = 1"),
              HasSubstr("region 1: a blob of 2"));
  EXPECT_THAT(message("UPDATE regions SET stations = x'010203' WHERE region_idx = 1"),
              HasSubstr("region 1: a blob of 3"));
}

TEST(NumRegionsText, CountsInWords) {
  EXPECT_EQ(NumRegionsText(9, 8), "9 regions, at least 8 are needed");
  EXPECT_EQ(NumRegionsText(1, 1), "1 region, at least 1 is needed");
  EXPECT_EQ(NumRegionsText(0, std::nullopt), "0 regions");
}

TEST(Decomposition, OnlyANameWithTheSuffixIsJson) {
  const Decomposition decomposition{.algorithm = "b2", .k = 1};
  for (const auto& [name, is_json] :
       {std::pair("r.json", true), std::pair("json", false), std::pair("r.jsonl", false)}) {
    const std::string path = testing::TempDir() + "/" + name;
    ASSERT_TRUE(WriteDecomposition(decomposition, path).ok());
    EXPECT_EQ(IsSqliteFile(path), !is_json) << name;
  }
}

TEST(Decomposition, SurvivesBothFormats) {
  Decomposition decomposition{.algorithm = "best", .k = 4, .tau = 1, .rho = 9, .seed = 0xfedcba9876543210};
  decomposition.regions = {{{1, 2, 3, 8}, {0, 5, 9}}, {{4}, {}}};
  decomposition.uncovered = {3, 4};
  decomposition.uncovered_limit = 2;
  for (const std::optional<int> lower_bound : {std::optional<int>(), std::optional<int>(1)}) {
    decomposition.lower_bound = lower_bound;
    for (const char* name : {"regions.json", "regions.db"}) {
      const std::string path = testing::TempDir() + "/" + name;
      ASSERT_TRUE(WriteDecomposition(decomposition, path).ok());
      const Result<Decomposition> read = ReadDecomposition(path);
      ASSERT_TRUE(read.ok()) << read.error().message;
      EXPECT_EQ(read->algorithm, "best");
      EXPECT_EQ(read->seed, decomposition.seed);
      EXPECT_EQ(read->lower_bound, lower_bound);
      EXPECT_EQ(read->uncovered_limit, 2);
      EXPECT_EQ(read->uncovered, decomposition.uncovered);
      ASSERT_EQ(read->regions.size(), 2);
      EXPECT_EQ(read->regions[0].features, decomposition.regions[0].features);
      EXPECT_EQ(read->regions[0].stations, decomposition.regions[0].stations);
      EXPECT_TRUE(read->regions[1].stations.empty());
    }
  }
}

TEST(DecompositionJson, ErrorsNameTheElement) {
  const auto message = [](const std::string& k, const std::string& regions, const std::string& uncovered) {
    const Result<Decomposition> result = ReadDecompositionJson(TemporaryFile(
        "regions_bad.json",
        R"({"format":"cairn-regions","version":1,"algorithm":"b2","tau":0,"rho":0,"seed":0,"k":)" + k +
            R"(,"regions":)" + regions + R"(,"uncovered":)" + uncovered + "}"));
    EXPECT_FALSE(result.ok());
    return result.ok() ? "" : result.error().message;
  };
  EXPECT_THAT(message("99999999999", "[]", "[]"), HasSubstr("k: 99999999999 is not an integer"));
  EXPECT_THAT(message("1.5", "[]", "[]"), HasSubstr("k: 1.5 is not an integer"));
  EXPECT_THAT(message("\"4\"", "[]", "[]"), HasSubstr("k: \"4\" is not an integer"));
  EXPECT_THAT(message("4", "[]", "[0, -99999999999]"),
              HasSubstr("uncovered: -99999999999 is not an integer"));
  EXPECT_THAT(message("4", "[]", "7"), HasSubstr("uncovered: found number, expected a list"));
  EXPECT_THAT(message("4", R"([{"features":[],"poses":[]},{"features":[4294967296],"poses":[0]}])", "[]"),
              HasSubstr("regions[1]: 4294967296 is not an integer"));
  EXPECT_THAT(message("4", R"([{"features":[1]}])", "[]"), HasSubstr("regions[0]"));
  EXPECT_THAT(message("NaN", "[]", "[]"), HasSubstr("not JSON"));
  EXPECT_THAT(message("2147483648", "[]", "[]"), HasSubstr("k: 2147483648 is not an integer"));
  EXPECT_THAT(message("-2147483649", "[]", "[]"), HasSubstr("k: -2147483649 is not an integer"));
}

TEST(DecompositionJson, TheSmallestAndTheLargestNumbersAreRead) {
  const Result<Decomposition> read = ReadDecompositionJson(TemporaryFile(
      "regions_limits.json",
      R"({"format":"cairn-regions","version":1,"algorithm":"b2","k":2147483647,"tau":-2147483648,"rho":0,"seed":0,
          "regions":[],"uncovered":[]})"));
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->k, 2147483647);
  EXPECT_EQ(read->tau, -2147483648);
}

TEST(DecompositionJson, AnotherFormatIsCorruptAndAnotherVersionUnsupported) {
  const auto error = [](const std::string& text) {
    return ReadDecompositionJson(TemporaryFile("other.json", text)).error();
  };
  EXPECT_EQ(error(R"({"format":"cairn-world","version":1})").code, ErrorCode::kCorrupt);
  EXPECT_EQ(error(R"({"format":"cairn-regions","version":2})").code, ErrorCode::kUnsupported);
}

TEST(DecompositionJson, TruncationIsCorrupt) {
  const Result<Decomposition> read =
      ReadDecomposition(TemporaryFile("cut.json", R"({"format":"cairn-regions","ver)"));
  ASSERT_FALSE(read.ok());
  EXPECT_EQ(read.error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace cairn
