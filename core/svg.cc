#include "core/svg.h"

#include <fmt/format.h>

namespace cairn {

std::string BeginSvg(double width_px, double height_px, int font_size_px) {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" font-family=\"sans-serif\" font-size=\"{2}\">\n<rect width=\"100%\" "
      "height=\"100%\" "
      "fill=\"#ffffff\"/>\n",
      width_px, height_px, font_size_px);
}

std::string EscapeXml(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

}  // namespace cairn
