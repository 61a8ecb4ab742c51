#include "core/base/text.h"

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

}  // namespace
}  // namespace cairn
