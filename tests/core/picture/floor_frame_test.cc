#include "core/picture/floor_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using testing::HasSubstr;

TEST(FloorFrame, TheFloorsUpperLeftCornerIsThePictures) {
  const FloorFrame frame{.low = {-2, 1}, .high = {4, 5}, .px_per_m = 30, .left_px = 10, .top_px = 50};
  EXPECT_EQ(frame.Pixel({-2, 5}), Eigen::Vector2d(10, 50));
  EXPECT_EQ(frame.Pixel({4, 1}), Eigen::Vector2d(190, 170));
  EXPECT_EQ(frame.Pixel({-1, 4.5}), Eigen::Vector2d(40, 65));
  EXPECT_EQ(frame.WidthPx(), 180);
  EXPECT_EQ(frame.HeightPx(), 120);
}

TEST(FloorFrame, AnArrowPointsWhereTheHeadingSaysWithYUp) {
  EXPECT_EQ(ArrowPoints({100, 200}, 0, 10), "110.0,200.0 102.5,196.6 102.5,203.4");
  EXPECT_EQ(ArrowPoints({100, 200}, 90, 10), "100.0,190.0 96.6,197.5 103.4,197.5");
  EXPECT_EQ(ArrowPoints({0, 0}, 210, 100), "-86.6,50.0 -4.7,41.9 -38.7,-16.9");
}

TEST(FloorFrame, AScaleBarIsTheLongestRoundLengthThatFits) {
  EXPECT_EQ(ScaleBar(20, 40, 30, 100),  // 3.33 m at most
            "<path d=\"M20.0 40.0v8h60.0v-8\" fill=\"none\" stroke=\"#000000\" stroke-width=\"2\"/>\n"
            "<text x=\"88.0\" y=\"49.0\">2 m</text>\n");
  EXPECT_THAT(ScaleBar(0, 0, 10, 100), HasSubstr(">10 m<"));
  EXPECT_THAT(ScaleBar(0, 0, 10, 99), HasSubstr(">5 m<"));
  EXPECT_THAT(ScaleBar(0, 0, 10, 50), HasSubstr(">5 m<"));
  EXPECT_THAT(ScaleBar(0, 0, 10, 49), HasSubstr(">2 m<"));
  EXPECT_THAT(ScaleBar(0, 0, 10, 20), HasSubstr(">2 m<"));
  EXPECT_THAT(ScaleBar(0, 0, 10, 19), HasSubstr(">1 m<"));
  EXPECT_THAT(ScaleBar(0, 0, 400, 100), HasSubstr(">0.2 m<"));
  EXPECT_THAT(ScaleBar(0, 0, 0.1, 100), HasSubstr(">1000 m<"));
}

}  // namespace
}  // namespace cairn
