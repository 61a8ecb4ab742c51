#include "stages/decompose_views/picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace cairn::decompose_views
