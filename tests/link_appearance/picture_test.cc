#include "stages/link_appearance/picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/link_appearance/graphs.h"

namespace cairn::link_appearance {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr NodeRole kDropped = NodeRole::kDropped, kDominating = NodeRole::kDominating,
                   kRestored = NodeRole::kRestored;

Appearance AppearanceOf(AppearanceGraph graph, const std::vector<NodeRole>& roles,
                        const std::vector<int>& lower_bounds) {
  Appearance appearance;
  appearance.graph = std::move(graph);
  for (const NodeRole role : roles) appearance.nodes.push_back({.images = {1}, .role = role});
  appearance.lower_bounds = lower_bounds;
  return appearance;
}

std::vector<std::optional<FloorPose>> PlacesAt(const std::vector<Eigen::Vector2d>& positions) {
  std::vector<std::optional<FloorPose>> places;
  for (const Eigen::Vector2d& position : positions) places.push_back(FloorPose{position, 0});
  return places;
}

//        2       a metre apart, and two; drawn with 460 pixels a metre, which is the picture's
//        |       longer side but for margins of 40
//   0 -- 1
TEST(DrawAppearance, PlacesNodesOnTheFloorAndLinksToThoseThatAreKept) {
  const Appearance appearance =
      AppearanceOf(GraphOf(3, {{0, 1}, {1, 2}}), {kDropped, kDominating, kDropped}, {1});
  const std::string svg = DrawAppearance(appearance, {}, PlacesAt({{5, -3}, {7, -3}, {7, -2}}));
  EXPECT_THAT(svg, AllOf(HasSubstr("width=\"1000\""), HasSubstr("height=\"616\"")));
  EXPECT_THAT(svg,
              HasSubstr("<text x=\"40\" y=\"32\" font-size=\"18\"><tspan font-weight=\"bold\">1 of 3 nodes "
                        "kept</tspan>, at least 1 needed; 2 links, 1 component</text>\n"));
  EXPECT_THAT(
      svg,
      HasSubstr(
          "stroke-width=\"0.5\" stroke-opacity=\"0.40\">\n</g>\n"
          "<g id=\"dominating_links\" stroke=\"#0072B2\" stroke-width=\"0.8\" stroke-opacity=\"0.45\">\n"
          "<path d=\"M40.0 536.0L960.0 536.0\"/>\n<path d=\"M960.0 536.0L960.0 76.0\"/>\n</g>\n"
          "<g id=\"kept_links\" stroke=\"#0072B2\" stroke-width=\"2.2\" stroke-opacity=\"0.90\">\n</g>\n"));
  // Marks are 9 pixels at most; those of dropped nodes are smaller and lie below.
  EXPECT_THAT(svg, HasSubstr("<g id=\"nodes\">\n<circle cx=\"40.0\" cy=\"536.0\" r=\"6.3\" fill=\"#ffffff\" "
                             "stroke=\"#555555\" stroke-width=\"1\"/>\n"
                             "<circle cx=\"960.0\" cy=\"76.0\" r=\"6.3\" fill=\"#ffffff\" stroke=\"#555555\" "
                             "stroke-width=\"1\"/>\n"
                             "<circle cx=\"960.0\" cy=\"536.0\" r=\"11.7\" fill=\"#0072B2\"/>\n</g>\n"));
  // The legend stands 24 pixels above the lower edge; 0.2 m are less than 140 pixels.
  EXPECT_THAT(svg, HasSubstr("</g>\n<path d=\"M40.0 586.0v8h92.0v-8\""));
  EXPECT_THAT(svg,
              HasSubstr("<circle cx=\"270.0\" cy=\"592.0\" r=\"6.5\" fill=\"#0072B2\"/>\n"
                        "<text x=\"282.0\" y=\"597.0\">kept</text>\n"
                        "<circle cx=\"365.0\" cy=\"592.0\" r=\"3.5\" fill=\"#ffffff\" stroke=\"#555555\" "
                        "stroke-width=\"1\"/>\n<text x=\"377.0\" y=\"597.0\">dropped</text>\n"
                        "<path d=\"M454.0 592.0h24\""));
  EXPECT_THAT(svg, HasSubstr("<text x=\"484.0\" y=\"597.0\">located from there</text>\n"));
}

TEST(DrawAppearance, ADroppedNodeIsLocatedByTheKeptOneOfMostInliers) {
  const AppearanceGraph graph(4, {{0, 1, 20}, {0, 2, 40}, {0, 3, 30}, {1, 2, 25}});
  const Appearance appearance =
      AppearanceOf(graph, {kDropped, kDominating, kDominating, kDominating}, {0, 0});
  const std::string svg = DrawAppearance(appearance, {}, PlacesAt({{0, 0}, {1, 0}, {2, 0}, {3, 0}}));
  // Three metres are 920 pixels; a line is as high as ten centimetres.
  EXPECT_THAT(svg, HasSubstr("height=\"187\""));
  EXPECT_THAT(svg,
              HasSubstr("<g id=\"links\" stroke=\"#888888\" stroke-width=\"0.5\" stroke-opacity=\"0.40\">\n"
                        "<path d=\"M40.0 76.0L346.7 76.0\"/>\n<path d=\"M40.0 76.0L960.0 76.0\"/>\n</g>\n"));
  EXPECT_THAT(svg, HasSubstr("stroke-opacity=\"0.45\">\n<path d=\"M40.0 76.0L653.3 76.0\"/>\n</g>\n"));
  EXPECT_THAT(svg, HasSubstr("stroke-opacity=\"0.90\">\n<path d=\"M346.7 76.0L653.3 76.0\"/>\n</g>\n"));
  EXPECT_THAT(svg, HasSubstr("3 of 4 nodes kept</tspan>; 4 links, 2 components<"));
}

//   0 ............. 1      10 metres, 92 pixels each; 2 and 3 stand at one place, 0.3 m from 1, and look
//                  2,3     along x and along y: they are drawn 0.3 times the 27.6 pixels apart from it
TEST(DrawAppearance, NodesAtOnePlaceMoveApartAlongTheirHeadings) {
  std::vector<std::optional<FloorPose>> places = PlacesAt({{0, 0.3}, {10, 0.3}, {10, 0}, {10, 0.04}});
  places[3]->heading_deg = 90;
  places.push_back(std::nullopt);
  const Appearance appearance = AppearanceOf(
      GraphOf(5, {{0, 1}, {3, 4}}), {kDominating, kDominating, kDropped, kRestored, kDominating}, {1, 1, 1});
  const std::string svg = DrawAppearance(appearance, {}, places);
  EXPECT_THAT(svg, HasSubstr("height=\"184\""));
  EXPECT_THAT(svg, HasSubstr("<path d=\"M40.0 76.0L960.0 76.0\"/>\n</g>\n<g id=\"nodes\">\n"));
  // Places are told apart by their decimetres: the nearest other one is 0.3 m away.
  EXPECT_THAT(svg, HasSubstr("<circle cx=\"968.3\" cy=\"103.6\" r=\"2.9\""));
  EXPECT_THAT(svg,
              HasSubstr("<rect x=\"955.9\" y=\"87.5\" width=\"8.3\" height=\"8.3\" fill=\"#D55E00\"/>\n"));
  // The node without a place is missing; the legend has the square.
  EXPECT_THAT(
      svg, HasSubstr("<text x=\"472.0\" y=\"164.6\">kept for a cycle</text>\n<path d=\"M609.0 159.6h24\""));
}

TEST(DrawAppearance, MarksAreNeverSmallerThanCanBeSeen) {
  std::vector<std::optional<FloorPose>> places = PlacesAt({{0, 0}, {100, 0}, {100, 0.1}, {100, 0.1}});
  const Appearance appearance =
      AppearanceOf(GraphOf(4, {{0, 1}}), std::vector<NodeRole>(4, kDominating), {1, 1, 1});
  const std::string svg = DrawAppearance(appearance, {}, places);
  EXPECT_THAT(svg, HasSubstr("<circle cx=\"40.0\" cy=\"76.9\" r=\"3.2\""));
  EXPECT_THAT(svg, HasSubstr("<circle cx=\"963.0\" cy=\"76.0\" r=\"3.2\""));
}

//   rows    a    b9   b10  c      the numbers in names are compared as such
//   nodes   2    1    0    3      12 pixels a row
TEST(DrawAppearance, TheMatrixHasTheLinksOfNodesInTheOrderOfTheirNames) {
  const AppearanceGraph graph(4, {{0, 1, 10}, {1, 2, 20}, {1, 3, 30}, {2, 3, 5}});
  const Appearance appearance = AppearanceOf(graph, {kDropped, kDropped, kDominating, kRestored}, {0});
  const std::string svg = DrawAppearance(appearance, {"b10", "b9", "a", "c"}, {});
  EXPECT_THAT(svg, AllOf(HasSubstr("width=\"520\""), HasSubstr("height=\"204\"")));
  EXPECT_THAT(svg, HasSubstr("<rect x=\"40.0\" y=\"76.0\" width=\"48.0\" height=\"48.0\" fill=\"none\""));
  const auto cell = [](int row, int column, const std::string& colour) {
    return fmt::format("<rect x=\"{}.00\" y=\"{}.00\" width=\"12.00\" height=\"12.00\" fill=\"{}\"/>\n",
                       40 + 12 * column, 76 + 12 * row, colour);
  };
  // The darker, the more links have fewer inliers: 190 less a fourth of it for each.
  EXPECT_THAT(svg, HasSubstr(cell(2, 1, "#8f8f8f") + cell(1, 2, "#8f8f8f") + cell(1, 0, "#5f5f5f") +
                             cell(0, 1, "#5f5f5f") + cell(1, 3, "#303030") + cell(3, 1, "#303030") +
                             cell(0, 3, "#D55E00") + cell(3, 0, "#D55E00") + "</g>\n"));
  EXPECT_THAT(
      svg,
      HasSubstr("<g id=\"kept\">\n"
                "<rect x=\"40.00\" y=\"62.00\" width=\"12.00\" height=\"10\" fill=\"#0072B2\"/>\n"
                "<rect x=\"26.00\" y=\"76.00\" width=\"10\" height=\"12.00\" fill=\"#0072B2\"/>\n"
                "<rect x=\"76.00\" y=\"62.00\" width=\"12.00\" height=\"10\" fill=\"#D55E00\"/>\n"
                "<rect x=\"26.00\" y=\"112.00\" width=\"10\" height=\"12.00\" fill=\"#D55E00\"/>\n</g>\n"));
  for (const auto& [x, label] : {std::pair(40, "linked (lighter: fewer inliers)"),
                                 std::pair(280, "both kept"), std::pair(390, "kept")}) {
    EXPECT_THAT(svg, HasSubstr(fmt::format("<rect x=\"{}\" y=\"172\" width=\"12\"", x)));
    EXPECT_THAT(svg, HasSubstr(fmt::format("<text x=\"{}\" y=\"182\">{}</text>\n", x + 18, label)));
  }
}

TEST(DrawAppearance, AMatrixOfManyNodesIsAThousandPixelsWide) {
  std::vector<std::string> names;
  for (int i = 0; i < 2000; ++i) names.push_back(fmt::format("{}.jpg", i));
  const Appearance appearance = AppearanceOf(
      GraphOf(2000, {{0, 1}}), std::vector<NodeRole>(2000, kDominating), std::vector<int>(1999, 1));
  const std::string svg = DrawAppearance(appearance, names, {});
  EXPECT_THAT(svg, AllOf(HasSubstr("width=\"1080\""), HasSubstr("height=\"1156\"")));
  // A cell of half a pixel is drawn as one, and a mark as two.
  EXPECT_THAT(svg, HasSubstr("<rect x=\"40.50\" y=\"76.00\" width=\"1.00\" height=\"1.00\""));
  EXPECT_THAT(svg, HasSubstr("<rect x=\"40.50\" y=\"62.00\" width=\"2.00\" height=\"10\""));
}

TEST(NodePlaces, AreTheMeanOfTheirImagesAndNoneWithoutAPose) {
  Capture capture;
  Appearance appearance;
  std::vector<DatabaseImage> images;
  // Level cameras, y down, at (x, 0, 2 x): up is against y, and on the floor they look along y.
  for (const double x : {1.0, 2.0, 6.0}) {
    const std::string name = fmt::format("{}.jpg", x);
    images.push_back({static_cast<ImageId>(images.size() + 1), name, 1});
    capture.images.push_back({name, 1, Pose{Eigen::Quaterniond::Identity(), Eigen::Vector3d(-x, 0, -2 * x)}});
  }
  images.push_back({4, "without.jpg", 1});
  capture.images.push_back({"without.jpg", 1, std::nullopt});
  appearance.nodes = {{.images = {1, 2, 4}}, {.images = {3}}, {.images = {4}}};
  const auto places = NodePlaces(appearance, images, capture);
  ASSERT_EQ(places.size(), 3U);
  EXPECT_FALSE(places[2]);
  EXPECT_TRUE(places[0]->position.isApprox(Eigen::Vector2d(1.5, 3)));
  EXPECT_TRUE(places[1]->position.isApprox(Eigen::Vector2d(6, 12)));
  EXPECT_NEAR(places[1]->heading_deg, 90, 1e-9);
  EXPECT_EQ(NodeNames(appearance, images), (std::vector<std::string>{"1.jpg", "6.jpg", "without.jpg"}));
}

}  // namespace
}  // namespace cairn::link_appearance
