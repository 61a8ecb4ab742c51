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
  overlay.captions = {"a caption"};
  const std::string svg = DrawViews(result.views, overlay);
  EXPECT_THAT(svg, HasSubstr(fmt::format(">{} regions, 2 walls<", result.views.num_faces())));
  EXPECT_THAT(svg, HasSubstr("<path fill="));
  EXPECT_THAT(svg, HasSubstr("here"));
  EXPECT_THAT(svg, HasSubstr("<polyline"));
  EXPECT_THAT(svg, HasSubstr("a caption"));
  EXPECT_THAT(DrawViews(result.views, overlay, /*regions=*/false), testing::Not(HasSubstr("id=\"regions\"")));
}

}  // namespace
}  // namespace cairn::decompose_views
