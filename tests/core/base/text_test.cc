#include "core/base/text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using Numbers = std::vector<double>;

TEST(Text, NumbersStandBetweenCommas) {
  EXPECT_EQ(ParseNumbers("1, 2.5,-3e2"), (Numbers{1, 2.5, -300}));
  EXPECT_EQ(ParseNumbers(" 7 "), Numbers{7});
}

TEST(Text, NothingWhereAFieldIsNoFiniteNumber) {
  for (const char* text : {"", "1,", ",1", "1,,2", "1 2", "1,x", "1,2x", "nan,1", "1,inf", "0x10", "1e999"})
    EXPECT_EQ(ParseNumbers(text), std::nullopt) << text;
}

TEST(NaturalOrder, NumbersInNamesCountAsSuch) {
  using testing::ElementsAre;
  EXPECT_THAT(NaturalOrder({"1.jpg", "10.jpg", "2.jpg"}), ElementsAre(0, 2, 1));
  EXPECT_THAT(NaturalOrder({"b/1.png", "a/12.png", "a/012.png", "a/3.png", "a"}), ElementsAre(4, 3, 1, 2, 0));
}

}  // namespace
}  // namespace cairn
