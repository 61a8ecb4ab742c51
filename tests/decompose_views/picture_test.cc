#include "stages/decompose_views/picture.h"

#include <algorithm>
#include <numbers>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/picture/floor_frame.h"
#include "core/picture/svg.h"
#include "tests/decompose_views/plan_fixture.h"

namespace cairn::decompose_views {
namespace {

using testing::HasSubstr;

TEST(ViewsPicture, HasTheWallsTheRegionsAndWhatIsLaidOverThem) {
  const auto result = Decomposed("0,0,2,0\n1,1,3,2");
  ViewsOverlay overlay;
  overlay.robots = {{{1, 0.5}, 0, "here"}};
  overlay.paths = {{{0, 0.5}, {1, 0.5}}};
  overlay.beams = {{{2, 0.4}, true}, {{2, 0.6}, true}, {{9, 0.7}, false}};
  overlay.captions = {"a caption"};
  const std::string svg = DrawViews(result.views, overlay);
  EXPECT_THAT(svg, HasSubstr(fmt::format(">{} regions, 2 walls<", result.views.num_faces())));
  EXPECT_THAT(svg, HasSubstr("<path fill="));
  EXPECT_THAT(svg, HasSubstr("here"));
  EXPECT_THAT(svg, HasSubstr("<polyline"));
  const size_t begin = svg.find("id=\"beams\"");
  ASSERT_NE(begin, std::string::npos);
  const std::string beams = svg.substr(begin, svg.find("</g>", begin) - begin);
  EXPECT_THAT(beams, testing::ContainsRegex("points=\"[0-9., -]+\""));
  size_t num_ends = 0;
  for (size_t at = beams.find("<circle"); at != std::string::npos; at = beams.find("<circle", at + 1))
    ++num_ends;
  EXPECT_EQ(num_ends, 2u);  // the third met nothing
  EXPECT_THAT(svg, HasSubstr("a caption"));
  EXPECT_THAT(DrawViews(result.views, overlay, /*regions=*/false), testing::Not(HasSubstr("id=\"regions\"")));
}

// How often a text has another.
int NumOf(const std::string& what, const std::string& text) {
  int num = 0;
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++num;
  return num;
}

// The box from (-1, -1) to (4, 3) is 1400 px wide, 280 px a metre, with a margin of 24 px: (x, y) is at
// 24 + 280 (x + 1) px from the left and 24 + 280 (3 - y) px from above.
class PictureOfTwoWalls : public testing::Test {
 protected:
  const Views views_ = Decomposed("0,0,2,0\n1,1,3,2").views;
};

TEST_F(PictureOfTwoWalls, HasAllInItsPlace) {
  ViewsOverlay overlay;
  overlay.robots = {{{1, 0.5}, 0, "a < b"}, {{0, 0.5}, 0.5 * std::numbers::pi, "up"}};
  overlay.paths = {{{0, 0.5}, {1, 0.5}}, {{2, 2}, {2, 1.5}, {2, 1}}, {{3, 0}}};
  overlay.beams = {{{2, 0.4}, true}, {{2, 0.6}, true}, {{3, 0.7}, false}};
  overlay.segments = {{{0, 0}, {1, 0}, true}, {{1, 1}, {2, 1.5}, false}};
  overlay.areas = {{{0, 0}, {1, 0}, {1, 1}}, {{2, 2}, {3, 2}, {3, 3}}};
  const std::string svg = DrawViews(views_, overlay);
  for (const std::string& part : std::vector<std::string>{
           // 1400 px and 1120 px, the margins, 260 px for the legend and 40 px for the scale.
           "width=\"1708\" height=\"1208\" font-family=\"sans-serif\" font-size=\"13\"",
           ScaleBar(24, 1168 + 8, 280, 240), "<line x1=\"304.0\" y1=\"864.0\" x2=\"864.0\" y2=\"864.0\"/>",
           "<line x1=\"584.0\" y1=\"584.0\" x2=\"1144.0\" y2=\"304.0\"/>",
           "d=\"M304.0 864.0L584.0 864.0L584.0 584.0ZM864.0 304.0L1144.0 304.0L1144.0 24.0Z\"",
           fmt::format("<g id=\"beams\" fill=\"{}\">\n<polygon fill-opacity=\"0.1\" "
                       "points=\"584.0,724.0 864.0,752.0 864.0,696.0 1144.0,668.0\"/>",
                       kSvgVermilion),
           "<circle cx=\"864.0\" cy=\"752.0\" r=\"2\"/>\n<circle cx=\"864.0\" cy=\"696.0\" r=\"2\"/>\n</g>",
           // What matches is drawn through.
           fmt::format(
               "x1=\"304.0\" y1=\"864.0\" x2=\"584.0\" y2=\"864.0\" stroke=\"{}\" stroke-width=\"4\"/>",
               kSvgVermilion),
           fmt::format("x1=\"584.0\" y1=\"584.0\" x2=\"864.0\" y2=\"444.0\" stroke=\"{}\" stroke-width=\"3\" "
                       "stroke-dasharray=\"6 4\"/>",
                       kSvgPurple),
           // An arrow, 11 px long and 10 px wide, at the end of a path, to the right and downwards.
           fmt::format("<polyline stroke=\"{}\" points=\"304.0,724.0 584.0,724.0 \"/>", kSvgVermilion),
           fmt::format("<polyline stroke=\"{}\" points=\"864.0,304.0 864.0,444.0 864.0,584.0 \"/>", kSvgBlue),
           fmt::format(
               "<polygon fill=\"{}\" stroke=\"none\" points=\"584.0,724.0 573.0,729.0 573.0,719.0\"/>",
               kSvgVermilion),
           fmt::format(
               "<polygon fill=\"{}\" stroke=\"none\" points=\"864.0,584.0 859.0,573.0 869.0,573.0\"/>",
               kSvgBlue),
           fmt::format("<circle cx=\"1144.0\" cy=\"864.0\" r=\"2.5\" fill=\"{}\"/>\n</g>", kSvgGreen),
           // A robot looks 16 px ahead, and its name stands beside it.
           fmt::format("x1=\"584.0\" y1=\"724.0\" x2=\"600.0\" y2=\"724.0\" stroke=\"{}\"", kSvgVermilion),
           std::string("<text x=\"594.0\" y=\"715.0\" fill=\"#D55E00\" font-weight=\"bold\">a &lt; b</text>"),
           fmt::format("x1=\"304.0\" y1=\"724.0\" x2=\"304.0\" y2=\"708.0\" stroke=\"{}\"", kSvgBlue)})
    EXPECT_THAT(svg, HasSubstr(part));
  // The beams are those of the first robot.
  overlay.robots.clear();
  EXPECT_THAT(DrawViews(views_, overlay), testing::Not(HasSubstr("id=\"beams\"")));
  EXPECT_THAT(DrawViews(views_), testing::Not(HasSubstr("id=\"areas\"")));
}

TEST_F(PictureOfTwoWalls, ShadesRegionsByTheWallsThatTheySee) {
  const std::string svg = DrawViews(views_);
  const size_t begin = svg.find("<g id=\"regions\"");
  const std::string regions = svg.substr(begin, svg.find("</g>", begin) - begin);
  std::set<int> counts;
  for (const ViewIndex& index : views_.index) counts.insert(index.num_labels);
  ASSERT_GT(counts.size(), 1u);
  const int least = *counts.begin(), most = *counts.rbegin();
  EXPECT_EQ(NumOf("<path", regions), static_cast<int>(counts.size()));
  EXPECT_EQ(NumOf("Z", regions), views_.num_faces());
  EXPECT_EQ(NumOf("M", regions), views_.num_faces());
  // From nearly white to blue.
  EXPECT_EQ(NumOf("<path fill=\"#f7fbff\"", regions), 1);
  EXPECT_EQ(NumOf("<path fill=\"#2171b5\"", regions), 1);
  EXPECT_LT(regions.find("#f7fbff"), regions.find("#2171b5"));
  // The legend has five shades, below its heading.
  EXPECT_THAT(svg, HasSubstr("<text x=\"1452\" y=\"34\" font-weight=\"bold\">"));
  EXPECT_THAT(svg, HasSubstr("<text x=\"1452\" y=\"58\">walls seen from a region:</text>"));
  for (int i = 0; i < 5; ++i)
    EXPECT_THAT(svg, HasSubstr(fmt::format("<text x=\"1474\" y=\"{}\">{}</text>", 76 + 18 * i,
                                           least + (most - least) * i / 4)));
  EXPECT_THAT(svg, HasSubstr("<rect x=\"1452\" y=\"65\" width=\"14\" height=\"14\" fill=\"#f7fbff\""));
  EXPECT_THAT(svg, HasSubstr("<rect x=\"1452\" y=\"137\" width=\"14\" height=\"14\" fill=\"#2171b5\""));
}

TEST_F(PictureOfTwoWalls, GrowsWithTheLinesOfItsLegend) {
  ViewsOverlay overlay;
  overlay.captions = {"one", "two"};
  const std::string svg = DrawViews(views_, overlay);
  EXPECT_THAT(svg, HasSubstr("<text x=\"1452\" y=\"174\">one</text>\n<text x=\"1452\" y=\"192\">two</text>"));
  EXPECT_THAT(DrawViews(views_, overlay, /*regions=*/false),
              HasSubstr("<text x=\"1452\" y=\"60\">one</text>"));
  overlay.captions.resize(60);
  EXPECT_THAT(DrawViews(views_, overlay), HasSubstr("height=\"1240\""));
}

TEST(ViewsPicture, OfOneRegionHasOneShade) {
  Views views = Decomposed(PolygonText({{{0, 0}, {4, 0}, {4, 2}, {0, 2}}})).views;
  ASSERT_EQ(views.num_faces(), 1);
  const std::string svg = DrawViews(views);
  EXPECT_EQ(NumOf("<path fill=\"#f7fbff\"", svg), 1);
  // A plan without regions has no word about them.
  Views walls;
  walls.plan = views.plan;
  EXPECT_THAT(DrawViews(walls, {}, /*regions=*/false), HasSubstr("font-weight=\"bold\">4 walls</text>"));
}

}  // namespace
}  // namespace cairn::decompose_views
