#include "core/plan/visible_walls.h"

#include <gtest/gtest.h>

#include "tests/decompose_views/plan_fixture.h"

namespace cairn::decompose_views {
namespace {

using Vec2 = Eigen::Vector2d;

TEST(VisibleStretches, HideWhatIsBehindAndAreInOrder) {
  // A screen before the upper wall of a room.
  const auto result = Decomposed("0,0,4,0\n4,0,4,4\n4,4,0,4\n0,4,0,0\n1,3,3,3");
  const Views& views = result.views;
  const Vec2 place(2, 1);
  const auto stretches = VisibleStretches(views.plan, views.LabelSet(FaceLocator(views).Find(place)), place);
  double upper = 0, screen = 0;
  for (const VisibleStretch& stretch : stretches) {
    if (std::abs(stretch.start.y() - 4) < 1e-6 && std::abs(stretch.end.y() - 4) < 1e-6)
      upper += stretch.Length();
    if (std::abs(stretch.start.y() - 3) < 1e-6 && std::abs(stretch.end.y() - 3) < 1e-6)
      screen += stretch.Length();
  }
  // Rays through the screen's ends reach y = 4 at x = 2 -+ 1.5.
  EXPECT_NEAR(upper, 2 * 0.5, 1e-6);
  EXPECT_NEAR(screen, 2, 1e-6);
}

}  // namespace
}  // namespace cairn::decompose_views
