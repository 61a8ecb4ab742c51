#pragma once

#include <array>
#include <string>

namespace cairn {

// What pictures have in common.

// Okabe and Ito's colours, which people who see colours differently tell apart, without black and with a
// darker yellow.
inline constexpr std::array<const char*, 7> kSvgColours = {"#0072B2", "#E69F00", "#009E73", "#D55E00",
                                                           "#CC79A7", "#56B4E9", "#B8A800"};

// The first lines of a picture: its size, its font, white ground.
std::string BeginSvg(double width_px, double height_px, int font_size_px);

std::string EscapeXml(const std::string& text);

}  // namespace cairn
