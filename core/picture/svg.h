#pragma once

#include <array>
#include <cstdint>
#include <iterator>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace cairn {

// What pictures have in common: colours, text, the file's frame.

// Okabe and Ito's colours, which colour-blind people can tell apart, without black and with a darker yellow.
inline constexpr char kSvgBlue[] = "#0072B2", kSvgOrange[] = "#E69F00", kSvgGreen[] = "#009E73",
                      kSvgVermilion[] = "#D55E00", kSvgPurple[] = "#CC79A7", kSvgSky[] = "#56B4E9",
                      kSvgYellow[] = "#B8A800";
inline constexpr std::array<const char*, 7> kSvgColours = {kSvgBlue,   kSvgOrange, kSvgGreen, kSvgVermilion,
                                                           kSvgPurple, kSvgSky,    kSvgYellow};
// For many things side by side: those without the yellow, then Paul Tol's muted ones.
inline constexpr std::array<const char*, 12> kSvgManyColours = {
    kSvgBlue,  kSvgOrange, kSvgGreen, kSvgPurple, kSvgSky,   kSvgVermilion,
    "#332288", "#999933",  "#882255", "#44AA99",  "#DDCC77", "#117733"};

// A colour between stops at equal distances, "#rrggbb".  `share` in [0, 1].
using Rgb = std::array<uint8_t, 3>;
std::string SvgRamp(std::span<const Rgb> stops, double share);
// Matplotlib's viridis, in which lightness grows with the value.
std::string SvgViridis(double share);

// Text for an element or for an attribute between quotes; what XML cannot hold (control characters, bytes
// that are not UTF-8) becomes U+FFFD.
std::string EscapeXml(std::string_view text);

// The first lines of a picture: its size, its font, a white background.
std::string BeginSvg(double width_px, double height_px, int font_size_px);

// A picture while it is written.
class SvgWriter {
 public:
  void Begin(double width_px, double height_px, int font_size_px) {
    Append(BeginSvg(width_px, height_px, font_size_px));
  }

  template <typename... Args>
  void Write(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Args>(args)...);
  }
  void Append(std::string_view elements) { text_.append(elements.data(), elements.data() + elements.size()); }

  // Ends the picture and returns it.
  std::string End();

 private:
  fmt::memory_buffer text_;
};

}  // namespace cairn
