#include "core/world/world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/world/decomposition.h"

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
  world.floor_from_world.rotation = Eigen::Quaterniond(0.6, 0.8, 0, 0);
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
}

TEST(DecompositionJson, TruncationIsCorrupt) {
  const Result<Decomposition> read =
      ReadDecomposition(TemporaryFile("cut.json", R"({"format":"cairn-regions","ver)"));
  ASSERT_FALSE(read.ok());
  EXPECT_EQ(read.error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace cairn
