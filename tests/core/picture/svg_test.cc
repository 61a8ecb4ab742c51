#include "core/picture/svg.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(Svg, ARampHasItsStopsAndRoundsBetweenThem) {
  constexpr std::array<Rgb, 3> kStops = {{{0, 10, 255}, {101, 10, 0}, {1, 255, 16}}};
  EXPECT_EQ(SvgRamp(kStops, 0), "#000aff");
  EXPECT_EQ(SvgRamp(kStops, 0.5), "#650a00");
  EXPECT_EQ(SvgRamp(kStops, 1), "#01ff10");
  EXPECT_EQ(SvgRamp(kStops, 0.25), "#330a80");   // 50.5 and 127.5 are rounded up
  EXPECT_EQ(SvgRamp(kStops, 0.75), "#338508");   // 51, 132.5, 8
  EXPECT_EQ(SvgRamp(kStops, 0.875), "#1ac20c");  // 26, 193.75, 12
  EXPECT_EQ(SvgRamp(kStops, -3), SvgRamp(kStops, 0));
  EXPECT_EQ(SvgRamp(kStops, 7), SvgRamp(kStops, 1));
}

// Every eighth of Matplotlib's table.
TEST(Svg, ViridisIsThatOfMatplotlib) {
  const std::vector<std::string> eighths = {"#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c",
                                            "#28ae80", "#5ec962", "#addc30", "#fde725"};
  for (size_t i = 0; i < eighths.size(); ++i)
    EXPECT_EQ(SvgViridis(static_cast<double>(i) / 8), eighths[i]) << i;
}

TEST(Svg, TextIsEscapedAndWhatXmlCannotHoldIsReplaced) {
  EXPECT_EQ(EscapeXml("a<b> & \"c\" 'd'"), "a&lt;b&gt; &amp; &quot;c&quot; &#39;d&#39;");
  EXPECT_EQ(EscapeXml("tab\tline\nreturn\r"), "tab\tline\nreturn\r");
  EXPECT_EQ(EscapeXml("K\u00fcche \u5eca\u4e0b \U0001f5fa"), "K\u00fcche \u5eca\u4e0b \U0001f5fa");
  EXPECT_EQ(EscapeXml(std::string_view("\0\x01\x1b\x1f \x20", 6)), "\ufffd\ufffd\ufffd\ufffd  ");
  EXPECT_EQ(EscapeXml("\xff-\xc3"), "\ufffd-\ufffd");  // no UTF-8, and cut off
  EXPECT_EQ(EscapeXml("\xef\xbf\xbd\xef\xbf\xbe\xef\xbf\xbf"),
            "\ufffd\ufffd\ufffd");  // U+FFFD, then U+FFFE and U+FFFF
  EXPECT_EQ(EscapeXml(""), "");
}

TEST(Svg, APictureHasItsSizeAndABackground) {
  SvgWriter svg;
  svg.Begin(320.4, 199.6, 12);
  svg.Write("<text>{:.1f}</text>\n", 0.25);
  svg.Append("<path/>\n");
  EXPECT_EQ(svg.End(),
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 320 200\" width=\"320\" height=\"200\" "
            "font-family=\"sans-serif\" font-size=\"12\">\n"
            "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
            "<text>0.2</text>\n<path/>\n</svg>\n");
}

}  // namespace
}  // namespace cairn
