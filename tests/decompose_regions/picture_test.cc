#include "stages/decompose_regions/picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/decompose_regions/ascii_world.h"

namespace cairn::decompose_regions {
namespace {

using testing::HasSubstr;
using testing::Not;

int Count(const std::string& text, const std::string& part) {
  int count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

// Eight stations in two rows; region 0 has the left four, region 1 the next two of the upper row; the lower
// row's last is in no region, the upper row's last not coverable:
//   0 0 1 1
//   0 0 x .
struct Example {
  World world = AsciiWorld({"oooo", "oooo"}, {{"##..", "##.."}, {"..##", "...."}, {"....", "..#."}});
  Decomposition decomposition{.algorithm = "best",
                              .k = 1,
                              .rho = 1,
                              .lower_bound = 2,
                              .uncovered_limit = 1,
                              .regions = {{{0}, {0, 1, 4, 5}}, {{1}, {2, 3}}},
                              .uncovered = {6}};
};

TEST(Picture, StatesTheNumberOfRegionsAndTheLeastThatIsNeeded) {
  Example example;
  EXPECT_THAT(DrawDecomposition(example.world, example.decomposition),
              HasSubstr(">2 regions, at least 2 are needed</text>"));
  example.decomposition.lower_bound.reset();
  EXPECT_THAT(DrawDecomposition(example.world, example.decomposition), HasSubstr(">2 regions</text>"));
}

TEST(Picture, ShowsStationsByRegionHolesAndWhatIsNotCoverable) {
  const Example example;
  const std::string svg = DrawDecomposition(example.world, example.decomposition);
  const std::string stations = svg.substr(svg.find("<g id=\"stations\">"));
  const std::string body = stations.substr(0, stations.find("</g>"));
  EXPECT_EQ(Count(body, "fill-opacity"), 6);           // in a region
  EXPECT_EQ(Count(body, "fill=\"white\" stroke"), 1);  // a hole
  EXPECT_EQ(Count(body, "<circle"), 1);                // not coverable
  EXPECT_EQ(Count(body, "fill=\"#0072B2\""), 4);       // region 0
  EXPECT_EQ(Count(body, "fill=\"#E69F00\""), 2);       // region 1, which touches it
  const std::string outlines = svg.substr(svg.find("<g id=\"outlines\""));
  // Sides of the outlines: 8 around 2 x 2 cells, 6 around 2 x 1.
  EXPECT_EQ(Count(outlines.substr(0, outlines.find("</g>")), "M"), 8 + 6);
  EXPECT_THAT(svg, HasSubstr("0: 4 stations, 1 landmarks"));
  EXPECT_THAT(svg, HasSubstr("in no region: 1 coverable stations"));
}

TEST(Picture, HeadingsAreSectors) {
  Example example;
  example.world.headings_deg = {0, 90, 180, 270, 0, 90, 180, 270};
  const std::string svg = DrawDecomposition(example.world, example.decomposition);
  EXPECT_EQ(Count(svg, "A"), 7);  // arcs of the six stations in a region and of the hole
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(Picture, OneStationIsDrawn) {
  const World world = AsciiWorld({"o"}, {{"#"}});
  const Decomposition decomposition{.algorithm = "b2", .k = 1, .regions = {{{0}, {0}}}};
  EXPECT_THAT(DrawDecomposition(world, decomposition), HasSubstr(">1 region</text>"));
}

}  // namespace
}  // namespace cairn::decompose_regions
