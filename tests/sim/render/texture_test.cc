#include "sim/render/texture.h"

#include <gtest/gtest.h>

namespace cairn::sim {
namespace {

const Eigen::Vector2f kNone(0, 0);

TEST(Texture, GivesATexelsValueAtItsCentreAndBlendsBetween) {
  const Texture texture((cv::Mat_<uint8_t>(2, 2) << 0, 100, 200, 40));
  EXPECT_FLOAT_EQ(texture.Sample({0.5f, 0.5f}, kNone, kNone), 0);
  EXPECT_FLOAT_EQ(texture.Sample({1.5f, 0.5f}, kNone, kNone), 100);
  EXPECT_FLOAT_EQ(texture.Sample({1.0f, 0.5f}, kNone, kNone), 50);
  EXPECT_FLOAT_EQ(texture.Sample({1.0f, 1.0f}, kNone, kNone), 85);
}

TEST(Texture, RepeatsItsBorder) {
  const Texture texture((cv::Mat_<uint8_t>(1, 2) << 10, 30));
  EXPECT_FLOAT_EQ(texture.Sample({-5, 0.5f}, kNone, kNone), 10);
  EXPECT_FLOAT_EQ(texture.Sample({9, 7}, kNone, kNone), 30);
}

// A chessboard of single texels and stripes, seen from so far that a pixel covers many texels, are grey:
// no moire.
TEST(Texture, AveragesWhatIsFinerThanAPixel) {
  cv::Mat board(256, 256, CV_8UC1), stripes(256, 256, CV_8UC1);
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 256; ++x) {
      board.at<uint8_t>(y, x) = (x + y) % 2 ? 255 : 0;
      stripes.at<uint8_t>(y, x) = x % 2 ? 255 : 0;
    }
  }
  for (const float x : {100.0f, 113.3f, 127.9f}) {
    EXPECT_NEAR(Texture(board).Sample({x, 120}, {5, 0}, {0, 5}), 127.5, 1.5);
    EXPECT_NEAR(Texture(stripes).Sample({x, 120}, {5.7f, 0}, {0, 5.7f}), 127.5, 1.5);
  }
}

// Seen at a grazing angle a pixel is long and thin: stripes along its length stay sharp.
TEST(Texture, KeepsDetailAcrossALongFootprint) {
  cv::Mat stripes(256, 256, CV_8UC1);
  for (int y = 0; y < 256; ++y) stripes.row(y).setTo((y / 4) % 2 ? 255 : 0);
  const Texture texture(stripes);
  EXPECT_GT(texture.Sample({128, 126}, {8, 0}, {0, 1}), 250);
  EXPECT_LT(texture.Sample({128, 130}, {8, 0}, {0, 1}), 5);
}

}  // namespace
}  // namespace cairn::sim
