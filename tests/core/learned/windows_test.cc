#include "core/learned/windows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using testing::ElementsAre;

TEST(CutWindows, OneWindowCoversAnImageOfItsSize) {
  EXPECT_THAT(CutWindows(640, 640), ElementsAre(Window{0, 0, 640}));
}

TEST(CutWindows, NeighboursMeetInTheMiddleOfWhatTheyShare) {
  //   0                     640
  //   |-----------------------|
  //              |-----------------------|
  //             320     480             960
  EXPECT_THAT(CutWindows(960, 640), ElementsAre(Window{0, 0, 480}, Window{320, 480, 960}));
  // 640 - 128 px further; the last ends with the image.
  EXPECT_THAT(CutWindows(1600, 640),
              ElementsAre(Window{0, 0, 576}, Window{512, 576, 1056}, Window{960, 1056, 1600}));
}

TEST(CutWindows, WindowsTooShortToShareMuchShareLess) {
  EXPECT_THAT(CutWindows(96, 32), ElementsAre(Window{0, 0, 32}, Window{32, 32, 64}, Window{64, 64, 96}));
  EXPECT_THAT(CutWindows(128, 64), ElementsAre(Window{0, 0, 48}, Window{32, 48, 80}, Window{64, 80, 128}));
}

TEST(CutWindows, InnerPartsCoverEachPixelOnceInWholeCellsOfTheirWindow) {
  for (int window_px = 32; window_px <= 640; window_px += 32) {
    for (int length_px = window_px; length_px <= 2000; length_px += 32) {
      int end_px = 0;
      for (const Window& window : CutWindows(length_px, window_px)) {
        EXPECT_EQ(window.inner_begin_px, end_px);
        EXPECT_LT(window.inner_begin_px, window.inner_end_px);
        EXPECT_GE(window.inner_begin_px, window.begin_px);
        EXPECT_LE(window.inner_end_px, window.begin_px + window_px);
        EXPECT_EQ(window.begin_px % 32, 0);
        EXPECT_EQ(window.inner_end_px % 8, 0);
        end_px = window.inner_end_px;
      }
      EXPECT_EQ(end_px, length_px);
    }
  }
}

}  // namespace
}  // namespace cairn
