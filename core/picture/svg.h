#pragma once

#include <array>
#include <string>
#include <string_view>

namespace cairn {

// What pictures have in common.

// Okabe and Ito's colours, which people who see colours differently tell apart, without black and with a
// darker yellow.
inline constexpr std::array<const char*, 7> kSvgColours = {"#0072B2", "#E69F00", "#009E73", "#D55E00",
                                                           "#CC79A7", "#56B4E9", "#B8A800"};

// The first lines of a picture: its size, its font, white ground.
std::string BeginSvg(double width_px, double height_px, int font_size_px);

// Text for an element or for an attribute between quotes; what XML cannot hold (control characters, bytes
// that are no UTF-8) becomes U+FFFD.
std::string EscapeXml(std::string_view text);

}  // namespace cairn
