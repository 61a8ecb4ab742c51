#include "core/picture/svg.h"

#include <algorithm>
#include <cmath>

#include "core/base/printable.h"

namespace cairn {
namespace {

// [XML 1.0 production 2]
bool IsXmlCharacter(const Utf8Character& character) {
  if (character.num_bytes == 0 || character.code == 0xfffe || character.code == 0xffff) return false;
  return character.code >= 0x20 || character.code == '\t' || character.code == '\n' || character.code == '\r';
}

}  // namespace

std::string SvgRamp(std::span<const Rgb> stops, double share) {
  const double at = std::clamp(share, 0.0, 1.0) * static_cast<double>(stops.size() - 1);
  const size_t stop = std::min(static_cast<size_t>(at), stops.size() - 2);
  const double part = at - static_cast<double>(stop);
  std::array<int, 3> rgb{};
  for (size_t i = 0; i < 3; ++i)
    rgb[i] = static_cast<int>(std::lround((1 - part) * stops[stop][i] + part * stops[stop + 1][i]));
  return fmt::format("#{:02x}{:02x}{:02x}", rgb[0], rgb[1], rgb[2]);
}

std::string SvgViridis(double share) {
  static constexpr std::array<Rgb, 9> kEveryEighth = {{{68, 1, 84},
                                                       {71, 45, 123},
                                                       {59, 82, 139},
                                                       {44, 114, 142},
                                                       {33, 145, 140},
                                                       {40, 174, 128},
                                                       {94, 201, 98},
                                                       {173, 220, 48},
                                                       {253, 231, 37}}};
  return SvgRamp(kEveryEighth, share);
}

std::string BeginSvg(double width_px, double height_px, int font_size_px) {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" font-family=\"sans-serif\" font-size=\"{2}\">\n"
      "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
      width_px, height_px, font_size_px);
}

std::string SvgWriter::End() {
  Append("</svg>\n");
  return fmt::to_string(text_);
}

std::string EscapeXml(std::string_view text) {
  std::string escaped;
  while (!text.empty()) {
    const Utf8Character character = FirstCharacter(text);
    const size_t num_bytes = std::max(character.num_bytes, 1);
    if (!IsXmlCharacter(character)) {
      escaped += "\ufffd";
    } else if (text[0] == '&') {
      escaped += "&amp;";
    } else if (text[0] == '<') {
      escaped += "&lt;";
    } else if (text[0] == '>') {
      escaped += "&gt;";
    } else if (text[0] == '"') {
      escaped += "&quot;";
    } else if (text[0] == '\'') {
      escaped += "&#39;";
    } else {
      escaped += text.substr(0, num_bytes);
    }
    text.remove_prefix(num_bytes);
  }
  return escaped;
}

}  // namespace cairn
