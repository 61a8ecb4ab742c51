#include "core/base/text.h"

#include <string>
#include <string_view>
#include <vector>

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

TEST(NaturalOrder, ZerosBeforeANumberDoNotCountAndTheRestDecides) {
  using testing::ElementsAre;
  EXPECT_THAT(NaturalOrder({"a2b", "a10", "a2a", "a02", "a"}), ElementsAre(4, 3, 2, 0, 1));
  EXPECT_THAT(NaturalOrder({"a0", "a00", "a000"}), ElementsAre(0, 1, 2));  // all the same: as they stood
  EXPECT_THAT(NaturalOrder({"a100", "a99", "a1x", "a1"}), ElementsAre(3, 2, 1, 0));
  EXPECT_THAT(NaturalOrder({"a21", "a12", "a13", "a20"}), ElementsAre(1, 2, 3, 0));
  EXPECT_THAT(NaturalOrder({"b", "\xc3\xa4", "7", "a"}), ElementsAre(2, 3, 0, 1));  // by bytes, none negative
  EXPECT_THAT(NaturalOrder({"1b2", "1b1", "1b"}), ElementsAre(2, 1, 0));
}

TEST(Text, WordsStandBetweenWhiteSpace) {
  EXPECT_EQ(SplitWords(" one\ttwo \r\n three"), (std::vector<std::string>{"one", "two", "three"}));
  EXPECT_EQ(SplitWords("one"), std::vector<std::string>{"one"});
  EXPECT_EQ(SplitWords("one "), std::vector<std::string>{"one"});
  EXPECT_TRUE(SplitWords(" \t").empty());
  EXPECT_TRUE(SplitWords("").empty());
}

TEST(Text, FieldsStandBetweenSeparators) {
  EXPECT_EQ(SplitFields("a, ,b c ", ','), (std::vector<std::string>{"a", "", "b c"}));
  EXPECT_EQ(SplitFields("a;", ';'), (std::vector<std::string>{"a", ""}));
  EXPECT_EQ(SplitFields("", ','), std::vector<std::string>{""});
}

TEST(Text, EndsAreTrimmed) {
  EXPECT_EQ(Trim(" \ta b\n"), "a b");
  EXPECT_EQ(Trim("a"), "a");
  EXPECT_EQ(Trim(" \v\f "), "");
  EXPECT_EQ(Trim(""), "");
}

TEST(Text, LinesEndAsInUnixOrInWindows) {
  EXPECT_EQ(SplitLines("a\n\nb\r\nc"), (std::vector<std::string_view>{"a", "", "b", "c"}));
  EXPECT_EQ(SplitLines("a\n"), std::vector<std::string_view>{"a"});
  EXPECT_EQ(SplitLines("\r"), std::vector<std::string_view>{""});
  EXPECT_TRUE(SplitLines("").empty());
}

}  // namespace
}  // namespace cairn
