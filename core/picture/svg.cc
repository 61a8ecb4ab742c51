#include "core/picture/svg.h"

#include <algorithm>

#include <fmt/format.h>

#include "core/base/printable.h"

namespace cairn {
namespace {

// [XML 1.0 production 2]
bool IsXmlCharacter(const Utf8Character& character) {
  if (character.num_bytes == 0 || character.code == 0xfffe || character.code == 0xffff) return false;
  return character.code >= 0x20 || character.code == '\t' || character.code == '\n' || character.code == '\r';
}

}  // namespace

std::string BeginSvg(double width_px, double height_px, int font_size_px) {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" font-family=\"sans-serif\" font-size=\"{2}\">\n<rect width=\"100%\" "
      "height=\"100%\" "
      "fill=\"#ffffff\"/>\n",
      width_px, height_px, font_size_px);
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
