#include "stages/decompose_regions/picture.h"

#include <cmath>
#include <set>
#include <sstream>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/decompose_regions/ascii_world.h"

namespace cairn::decompose_regions {
namespace {

using testing::ElementsAre;
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
  const std::string svg = DrawDecomposition(world, decomposition);
  EXPECT_THAT(svg, HasSubstr(">1 region</text>"));
  // Cells of 56 px and 1 m, a margin of one and a half: the station's middle is at 84 px, its square has 0.94
  // of the cell.
  EXPECT_THAT(svg, HasSubstr("width=\"468\" height=\"228\""));
  EXPECT_THAT(svg, HasSubstr("<path d=\"M57.7 110.3L110.3 110.3L110.3 57.7L57.7 57.7Z\" fill=\"#0072B2\""));
  EXPECT_THAT(svg, HasSubstr("<text x=\"84.0\" y=\"88.0\">0</text>"));
  EXPECT_THAT(svg, HasSubstr(">1 m</text>"));
}

// The fills of the shapes of a picture's stations, in the order of stations.
std::vector<std::string> Fills(const std::string& svg) {
  const size_t begin = svg.find("<g id=\"stations\">");
  std::istringstream body(svg.substr(begin, svg.find("</g>", begin) - begin));
  std::vector<std::string> fills;
  for (std::string line; std::getline(body, line);) {
    const size_t at = line.find(" fill=\"");
    if (at != std::string::npos) fills.push_back(line.substr(at + 7, line.find('"', at + 7) - at - 7));
  }
  return fills;
}

// Sides of outlines, each by its two ends in hundredths of a cell.
using GridPoint = std::pair<int64_t, int64_t>;
using Sides = std::multiset<std::set<GridPoint>>;

// Where the cells of a lattice lie on the floor, and the floor in a picture: cells of 56 px, one and a half
// around all stations.
struct DrawnLattice {
  double side_m = 1;
  Eigen::Rotation2Dd turn{0};
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();

  World Placed(World world) const {
    for (Eigen::Vector2d& position : world.positions) position = offset + turn * position * side_m;
    return world;
  }
  GridPoint PointOf(const World& placed, double x_px, double y_px) const {
    Eigen::Vector2d low = placed.positions[0], high = low;
    for (const Eigen::Vector2d& position : placed.positions) {
      low = low.cwiseMin(position);
      high = high.cwiseMax(position);
    }
    const double m_per_px = side_m / 56, margin_m = 1.5 * side_m;
    const Eigen::Vector2d floor(low.x() - margin_m + x_px * m_per_px, high.y() + margin_m - y_px * m_per_px);
    const Eigen::Vector2d cell = turn.inverse() * (floor - offset) / side_m;
    return {std::llround(100 * cell.x()), std::llround(100 * cell.y())};
  }
  // Of each region.
  std::vector<Sides> SidesOf(const World& placed, const Decomposition& decomposition) const {
    const std::string svg = DrawDecomposition(placed, decomposition);
    const size_t begin = svg.find("<g id=\"outlines\"");
    std::istringstream body(svg.substr(begin, svg.find("</g>", begin) - begin));
    std::vector<Sides> sides;
    for (std::string line; std::getline(body, line);) {
      if (line.find("<path d=\"") != 0) continue;
      std::istringstream path(line.substr(9, line.find('"', 9) - 9));
      sides.emplace_back();
      char move = 0, to = 0;
      for (double x0 = 0, y0 = 0, x1 = 0, y1 = 0; path >> move >> x0 >> y0 >> to >> x1 >> y1;) {
        EXPECT_EQ(std::string({move, to}), "ML");
        sides.back().insert({PointOf(placed, x0, y0), PointOf(placed, x1, y1)});
      }
    }
    return sides;
  }
};

// The sides of an L of three cells, the corner at (0, 0), whose outline lies `d` hundredths inside of its
// border: shorter at the five corners that point outwards, longer at the one that points inwards.
//   +---+---+
//   |       |
//   +   +---+
//   |   |
//   +---+
Sides SidesOfL(int64_t d) {
  const int64_t low = d - 50, high = 50 - d;
  return {{{low, high}, {50, high}},
          {{50, high}, {100 + high, high}},
          {{100 + high, high}, {100 + high, low}},
          {{100 + high, low}, {high, low}},
          {{high, low}, {high, low - 100}},
          {{high, low - 100}, {low, low - 100}},
          {{low, low - 100}, {low, -50}},
          {{low, -50}, {low, high}}};
}

TEST(Picture, OutlinesLieInsideOfRegionsEachALittleFurther) {
  const World world = AsciiWorld({"oo", "o."}, {{"##", "#."}});
  const Region all{{0}, {0, 1, 2}};
  const Decomposition decomposition{.algorithm = "b2", .k = 1, .regions = {all, all, all, all, all}};
  // The fifth begins again.
  EXPECT_THAT(DrawnLattice().SidesOf(world, decomposition),
              ElementsAre(SidesOfL(6), SidesOfL(14), SidesOfL(22), SidesOfL(30), SidesOfL(6)));
}

TEST(Picture, OfALatticeThatIsTurnedIsTurnedToo) {
  const World world = AsciiWorld({"oo", "o."}, {{"##", "#."}});
  const Decomposition decomposition{.algorithm = "b2", .k = 1, .regions = {{{0}, {0, 1, 2}}}};
  for (const double angle_rad : {0.0, 0.3, -0.6}) {
    const DrawnLattice lattice{.side_m = 0.5, .turn = Eigen::Rotation2Dd(angle_rad), .offset = {10, 20}};
    EXPECT_THAT(lattice.SidesOf(lattice.Placed(world), decomposition), ElementsAre(SidesOfL(6))) << angle_rad;
  }
}

TEST(Picture, CellsHaveTheSpacingOfTheLatticeOrElseOfTheEdges) {
  // Two places 0.5 m apart, of two headings each; edges between headings have no length.
  World world;
  world.positions = {{0, 0}, {0, 0}, {0.5, 0}, {0.5, 0}};
  world.headings_deg = {0, 180, 0, 180};
  world.edges = {{0, 1}, {0, 2}, {1, 3}, {2, 3}};
  // 0.5 m and three cells of 56 px; 300 px for the legend.
  EXPECT_THAT(DrawDecomposition(world, {}), HasSubstr("width=\"524\""));
  world.lattice_spacing_m = 0.25;
  EXPECT_THAT(DrawDecomposition(world, {}), HasSubstr("width=\"580\""));
}

TEST(Picture, CellsShrinkSoThatTheLongerSideFitsButNotToNothing) {
  const auto row = [](int num_stations) {
    const DrawnLattice there{.offset = {10, -10}};
    return DrawDecomposition(there.Placed(AsciiWorld({std::string(num_stations, 'o')}, {})), {});
  };
  EXPECT_THAT(row(1), HasSubstr("width=\"468\""));     // 3 cells of 56 px
  EXPECT_THAT(row(3), HasSubstr("width=\"580\""));     // 5 cells of 56 px
  EXPECT_THAT(row(38), HasSubstr("width=\"1300\""));   // 40 cells of 25 px
  EXPECT_THAT(row(198), HasSubstr("width=\"1900\""));  // 200 cells of 8 px
}

TEST(Picture, StationsHaveTheColourOfTheRegionWhoseCentreIsNearest) {
  //            0 1 2 3 4 5
  // region 0   # # # # . .    centre 1.5
  //        1   . . . # # #           4
  //        2   . . # # # #           3.5: nearest for station 3 alone
  const World row = AsciiWorld({"oooooo"}, {{"######"}});
  const Decomposition three{
      .algorithm = "b2", .k = 1, .regions = {{{0}, {0, 1, 2, 3}}, {{0}, {3, 4, 5}}, {{0}, {2, 3, 4, 5}}}};
  const char *blue = "#0072B2", *orange = "#E69F00", *green = "#009E73";
  EXPECT_THAT(Fills(DrawDecomposition(row, three)), ElementsAre(blue, blue, blue, green, orange, orange));
  // Station 2 is as near to both: it is drawn as the first one's.
  const Decomposition two{.algorithm = "b2", .k = 1, .regions = {{{0}, {0, 1, 2}}, {{0}, {2, 3, 4}}}};
  EXPECT_THAT(Fills(DrawDecomposition(AsciiWorld({"ooooo"}, {}), two)),
              ElementsAre(blue, blue, blue, orange, orange));
}

TEST(Picture, RegionsThatTouchHaveDifferentColoursWhereTheListBeginsAgain) {
  // Thirteen regions of a station each, in a row that goes to any side; there are twelve colours.  The last
  // one stands a cell apart from the first, or beside it, or at its place, where it touches the second, too.
  for (const auto& [x, y] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
    for (const auto& [at, same_as] : {std::pair(-2, 0), std::pair(-1, 1), std::pair(0, 2)}) {
      World world;
      Decomposition decomposition{.algorithm = "b2", .k = 1};
      for (int i = 0; i < 13; ++i) {
        const int along = i < 12 ? i : at;
        world.positions.emplace_back(x * along, y * along);
        decomposition.regions.push_back({{}, {i}});
      }
      const std::vector<std::string> fills = Fills(DrawDecomposition(world, decomposition));
      EXPECT_EQ(std::set<std::string>(fills.begin(), fills.begin() + 12).size(), 12);
      EXPECT_EQ(fills[12], fills[same_as]) << x << " " << y << " " << at;
    }
  }
}

TEST(Picture, SectorsPointToTheirHeadingAndAreAsWideAsHeadingsLieApart) {
  // Four headings: sectors of 90 degrees and 26.3 px around 84 px and 140 px; y goes down.
  World world = AsciiWorld({"oo"}, {{"##"}});
  const Decomposition decomposition{.algorithm = "b2", .k = 1, .regions = {{{0}, {0, 1}}}};
  world.headings_deg = {0, 90};
  const std::string svg = DrawDecomposition(world, decomposition);
  EXPECT_THAT(svg, HasSubstr("\"M84.0 84.0L102.6 102.6A26.3 26.3 0 0 0 102.6 65.4Z\""));
  EXPECT_THAT(svg, HasSubstr("\"M140.0 84.0L158.6 65.4A26.3 26.3 0 0 0 121.4 65.4Z\""));
  // One heading alone: 170 degrees, 26.32 (cos 85, sin 85) = (2.3, 26.2).
  world.headings_deg = {0, 0};
  EXPECT_THAT(DrawDecomposition(world, decomposition),
              HasSubstr("\"M84.0 84.0L86.3 110.2A26.3 26.3 0 0 0 86.3 57.8Z\""));
  // The smallest step counts, here the last one: 60 degrees, 26.32 (cos 30, sin 30) = (22.8, 13.2).
  world = AsciiWorld({"ooo"}, {});
  world.headings_deg = {0, 80, 140};
  EXPECT_THAT(DrawDecomposition(world, {.regions = {{{}, {0}}}}),
              HasSubstr("\"M84.0 84.0L106.8 97.2A26.3 26.3 0 0 0 106.8 70.8Z\""));
}

TEST(Picture, SectorsGrowWithTheLattice) {
  // Two stations half a metre or four metres apart are drawn as those at one metre.
  const Decomposition decomposition{.algorithm = "b2", .k = 1, .regions = {{{0}, {0, 1}}}};
  for (const double side_m : {0.5, 1.0, 4.0}) {
    World world = DrawnLattice{.side_m = side_m}.Placed(AsciiWorld({"oo"}, {{"##"}}));
    world.headings_deg = {0, 90};
    EXPECT_THAT(DrawDecomposition(world, decomposition),
                HasSubstr("\"M140.0 84.0L158.6 65.4A26.3 26.3 0 0 0 121.4 65.4Z\""));
  }
}

TEST(Picture, HolesAndWhatIsNotCoverableStandWhereTheirStationsDo) {
  const Example example;
  const std::string svg = DrawDecomposition(example.world, example.decomposition);
  EXPECT_THAT(svg, HasSubstr("width=\"636\" height=\"284\""));
  EXPECT_THAT(svg, HasSubstr("<path d=\"M179.2 156.8L212.8 156.8L212.8 123.2L179.2 123.2Z\" fill=\"white\""));
  EXPECT_THAT(svg, HasSubstr("<circle cx=\"252.0\" cy=\"140.0\" r=\"1.3\""));
  EXPECT_THAT(svg, HasSubstr("<text x=\"112.0\" y=\"116.0\">0</text>"));  // the middle of region 0
  EXPECT_THAT(svg, HasSubstr("<text x=\"224.0\" y=\"88.0\">1</text>"));
}

TEST(Picture, LegendAndScaleStandBesideAndBelowTheStations) {
  // Eight cells by three, 448 x 168 px.  The scale has at most two fifths of the width, 3.2 m.
  const World world = AsciiWorld({"oooooo"}, {{"######"}});
  const Decomposition decomposition{
      .algorithm = "a<b", .k = 1, .tau = 2, .rho = 3, .regions = {{{0}, {0, 1, 2}}, {{0}, {3, 4, 5}}}};
  const std::string svg = DrawDecomposition(world, decomposition);
  EXPECT_THAT(svg, HasSubstr("width=\"748\" height=\"228\" font-family=\"sans-serif\" font-size=\"12\""));
  EXPECT_THAT(svg, HasSubstr("\"M84.0 188.0v8h112.0v-8\""));
  EXPECT_THAT(svg, HasSubstr(">2 m</text>"));
  EXPECT_THAT(svg, HasSubstr("<text x=\"458\" y=\"24\" font-weight=\"bold\">2 regions<"));
  EXPECT_THAT(svg, HasSubstr("<text x=\"458\" y=\"42\">algorithm a&lt;b, k = 1, tau = 2, rho = 3<"));
  EXPECT_THAT(svg, HasSubstr("<rect x=\"458\" y=\"56\" width=\"12\" height=\"12\" fill=\"#0072B2\""));
  EXPECT_THAT(svg, HasSubstr("<text x=\"478\" y=\"66\">0: 3 stations, 1 landmarks<"));
  EXPECT_THAT(svg, HasSubstr("<text x=\"478\" y=\"84\">1: 3 stations, 1 landmarks<"));
  EXPECT_THAT(svg, HasSubstr("<rect x=\"459\" y=\"93\" width=\"10\" height=\"10\" fill=\"white\""));
  EXPECT_THAT(svg, HasSubstr("<text x=\"478\" y=\"102\">in no region: 0 coverable stations<"));
  EXPECT_THAT(svg, HasSubstr("<circle cx=\"464\" cy=\"116\" r=\"1.5\""));
  EXPECT_THAT(svg, HasSubstr("<text x=\"478\" y=\"120\">sees fewer than k all around<"));
}

TEST(Picture, LegendListsThirtyRegionsAndCountsTheOthers) {
  const auto draw = [](int num_regions) {
    Decomposition decomposition{.algorithm = "b2", .k = 1};
    for (int i = 0; i < num_regions; ++i) decomposition.regions.push_back({{}, {i}});
    return DrawDecomposition(AsciiWorld({std::string(40, 'o')}, {}), decomposition);
  };
  EXPECT_EQ(Count(draw(30), "landmarks</text>"), 30);
  EXPECT_THAT(draw(30), Not(HasSubstr(" more</text>")));
  const std::string svg = draw(40);
  EXPECT_EQ(Count(svg, "landmarks</text>"), 30);
  // 42 cells of 23.8 px; thirty lines of 18 px below the one at 48 px.
  EXPECT_THAT(svg, HasSubstr("<text x=\"1030\" y=\"606\">and 10 more</text>"));
  EXPECT_THAT(svg, HasSubstr("height=\"668\""));  // 36 lines and a little
  EXPECT_THAT(draw(20), HasSubstr("height=\"488\""));
}

}  // namespace
}  // namespace cairn::decompose_regions
