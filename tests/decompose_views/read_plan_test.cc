#include "stages/decompose_views/plan/read_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::decompose_views {
namespace {

using testing::HasSubstr;

Error ErrorOfText(const std::string& text) {
  const auto input = ParsePlan(text, "plan");
  EXPECT_FALSE(input.ok());
  return input.ok() ? Error{} : input.error();
}

TEST(ReadPlan, ReadsSegmentsWithBlanksAndComments) {
  const auto input = ParsePlan("# walls\n  0, 1.5,2 ,-3e0\n\n1,1,1,1", "plan");
  ASSERT_TRUE(input.ok());
  EXPECT_FALSE(input->closed());
  ASSERT_EQ(input->segments.size(), 2u);
  EXPECT_EQ(input->segments[0].start, Eigen::Vector2d(0, 1.5));
  EXPECT_EQ(input->segments[0].end, Eigen::Vector2d(2, -3));
  EXPECT_EQ(input->segments[1].line, 4);
}

TEST(ReadPlan, NamesTheLineThatIsNoSegment) {
  for (const char* line : {"1,2,3", "1,2,3,x", "1,2,3,nan", "1,2,3,inf", "1,2,3,4,5", "1 2 3 4"}) {
    const Error error = ErrorOfText(std::string("0,0,1,1\n") + line);
    EXPECT_EQ(error.code, ErrorCode::kCorrupt);
    EXPECT_THAT(error.message, HasSubstr("plan: line 2: "));
  }
}

TEST(ReadPlan, QuotesNoBytesThatAreNoText) {
  EXPECT_THAT(ErrorOfText("\x01\xff\x1b[2J").message, HasSubstr("line 1: \"\\x01\\xff\\x1b[2J\""));
}

TEST(ReadPlan, SaysWhereJsonGoesWrong) {
  EXPECT_THAT(ErrorOfText("{\"type\": \"Polygon\", ").message, HasSubstr("after 20 bytes"));
  EXPECT_THAT(ErrorOfText("{\"type\": Polygon}").message, HasSubstr("byte 10 of 17"));
  EXPECT_THAT(
      ErrorOfText("{\"type\": \"Polygon\", \"coordinates\": [[[0,0],[1e400,0],[0,1],[0,0]]]}").message,
      HasSubstr("too large"));
}

TEST(ReadPlan, AFileWithoutWallsIsNoPlan) {
  EXPECT_EQ(ErrorOfText("").code, ErrorCode::kNoData);
  EXPECT_EQ(ErrorOfText("# nothing\n").code, ErrorCode::kNoData);
  EXPECT_EQ(ErrorOfText("{\"type\": \"FeatureCollection\", \"features\": []}").code, ErrorCode::kNoData);
}

TEST(ReadPlan, TurnsRingsSoThatTheInteriorIsToTheirLeft) {
  // The outer ring is clockwise, the hole counter-clockwise.
  const auto input = ParsePlan(
      "{\"type\": \"Feature\", \"geometry\": {\"type\": \"MultiPolygon\", \"coordinates\": "
      "[[[[0,0],[0,9],[9,9],[9,0],[0,0]], [[1,1],[2,1],[2,2],[1,1]]]]}}",
      "plan");
  ASSERT_TRUE(input.ok());
  ASSERT_EQ(input->rings.size(), 2u);
  EXPECT_EQ(input->rings[0][1], Eigen::Vector2d(9, 9));
  EXPECT_EQ(input->rings[1][1], Eigen::Vector2d(2, 1));
  EXPECT_EQ(input->rings[1][2], Eigen::Vector2d(1, 1));
}

TEST(ReadPlan, OfAPlanWithFreeSpaceNothingElseCounts) {
  const std::string square = "{\"type\": \"Polygon\", \"coordinates\": [[[0,0],[1,0],[1,1],[0,0]]]}";
  const auto feature = [&](const std::string& properties) {
    return "{\"type\": \"Feature\", \"properties\": " + properties + ", \"geometry\": " + square + "}";
  };
  const auto num_rings = [&](const std::string& features) {
    const auto input =
        ParsePlan("{\"type\": \"FeatureCollection\", \"features\": [" + features + "]}", "plan");
    return input.ok() ? input->rings.size() : 0;
  };
  const std::string room = feature("{\"kind\": \"room\"}"), other = feature("null"),
                    kind = feature("{\"kind\": 1}");
  EXPECT_EQ(num_rings(room + "," + feature("{\"kind\": \"free_space\"}") + "," + other + "," + kind), 1u);
  EXPECT_EQ(num_rings(room + "," + other + "," + kind), 3u);
}

TEST(ReadPlan, LinesOfGeoJsonAreWalls) {
  const auto open = ParsePlan(
      "{\"type\": \"GeometryCollection\", \"geometries\": [{\"type\": \"LineString\", \"coordinates\": "
      "[[0,0],[4,0,7],[4,3]]}, {\"type\": \"MultiLineString\", \"coordinates\": [[[1,1],[2,1]], "
      "[[1,2],[2,2]]]}]}",
      "plan");
  ASSERT_TRUE(open.ok()) << open.error().message;
  EXPECT_FALSE(open->closed());
  ASSERT_EQ(open->segments.size(), 4u);
  EXPECT_EQ(open->segments[1].start, Eigen::Vector2d(4, 0));
  EXPECT_EQ(open->segments[1].end, Eigen::Vector2d(4, 3));
  EXPECT_EQ(open->segments[1].line, 1);
  EXPECT_EQ(open->segments[3].line, 3);
  // With lines besides, a polygon's rings are walls.
  const std::string square = "{\"type\": \"Polygon\", \"coordinates\": [[[0,0],[4,0],[4,4],[0,0]]]}",
                    line = "{\"type\": \"LineString\", \"coordinates\": [[3,1],[3,2]]}";
  const auto mixed =
      ParsePlan("{\"type\": \"GeometryCollection\", \"geometries\": [" + square + "," + line + "]}", "plan");
  ASSERT_TRUE(mixed.ok());
  EXPECT_FALSE(mixed->closed());
  ASSERT_EQ(mixed->segments.size(), 4u);
  EXPECT_EQ(mixed->segments[2].end, Eigen::Vector2d(0, 0));
  EXPECT_EQ(mixed->segments[3].line, 2);
  EXPECT_EQ(mixed->notes.size(), 1u);
  // Not where the free space is told from the rest.
  const auto free_space = ParsePlan(
      "{\"type\": \"FeatureCollection\", \"features\": [{\"type\": \"Feature\", \"properties\": {\"kind\": "
      "\"free_space\"}, \"geometry\": " +
          square + "}, {\"type\": \"Feature\", \"geometry\": " + line + "}]}",
      "plan");
  ASSERT_TRUE(free_space.ok());
  EXPECT_TRUE(free_space->closed());
  EXPECT_THAT(ErrorOfText("{\"type\": \"LineString\", \"coordinates\": [[0,0]]}").message,
              HasSubstr("line 1 has 1 points"));
  EXPECT_THAT(ErrorOfText("{\"type\": \"LineString\", \"coordinates\": [[0,0],[1]]}").message,
              HasSubstr("line 1: point 2"));
  EXPECT_EQ(ErrorOfText("{\"type\": \"MultiLineString\", \"coordinates\": 1}").code, ErrorCode::kCorrupt);
}

TEST(ReadPlan, LayersAreForDrawings) {
  EXPECT_THAT(ParsePlan("0,0,1,0", "plan", {.layers = "A"}).error().message, HasSubstr("layers"));
  EXPECT_THAT(ParsePlan("{}", "plan", {.layers = "A"}).error().message, HasSubstr("layers"));
}

TEST(ReadPlan, RefusesWhatIsNoPolygon) {
  EXPECT_EQ(ErrorOfText("{\"type\": \"Point\", \"coordinates\": [0, 0]}").code, ErrorCode::kUnsupported);
  EXPECT_EQ(ErrorOfText("{ not json").code, ErrorCode::kCorrupt);
  EXPECT_EQ(ErrorOfText("{}").code, ErrorCode::kUnsupported);
  EXPECT_EQ(ErrorOfText("{\"type\": \"Polygon\"}").code, ErrorCode::kCorrupt);
  EXPECT_EQ(ErrorOfText("{\"type\": \"Polygon\", \"coordinates\": [[[0,0],[1],[1,1],[0,0]]]}").code,
            ErrorCode::kCorrupt);
  EXPECT_THAT(ErrorOfText("{\"type\": \"Polygon\", \"coordinates\": [[[0,0],[1,0],[1,1],[0,1]]]}").message,
              HasSubstr("ring 1 is open"));
  std::string nested = "{\"type\": \"Polygon\", \"coordinates\": []}";
  for (int i = 0; i < 1000; ++i)
    nested = "{\"type\": \"GeometryCollection\", \"geometries\": [" + nested + "]}";
  EXPECT_EQ(ErrorOfText(nested).code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace cairn::decompose_views
