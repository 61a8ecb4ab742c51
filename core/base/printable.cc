#include "core/base/printable.h"

#include <algorithm>

#include <fmt/format.h>

namespace cairn {
namespace {

bool IsBetween(char32_t code, char32_t first, char32_t last) { return code >= first && code <= last; }

// C0, DEL and C1; Unicode's embeddings, overrides and isolates, which change the direction of writing.
bool IsCommand(char32_t code) {
  if (code == '\n' || code == '\t') return false;
  return code < 0x20 || IsBetween(code, 0x7f, 0x9f) || IsBetween(code, 0x202a, 0x202e) ||
         IsBetween(code, 0x2066, 0x2069);
}

}  // namespace

// [RFC 3629 section 3]
Utf8Character FirstCharacter(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
  if (byte(0) < 0x80) return {byte(0), 1};
  const int num_bytes = IsBetween(byte(0), 0xc0, 0xdf) ? 2 : IsBetween(byte(0), 0xe0, 0xef) ? 3 : 4;
  if (byte(0) < 0xc0 || byte(0) > 0xf7 || text.size() < static_cast<size_t>(num_bytes)) return {};
  char32_t code = byte(0) & (0x7f >> num_bytes);
  for (int i = 1; i < num_bytes; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return {};
    code = code << 6 | (byte(i) & 0x3f);
  }
  static constexpr char32_t kLeastCode[] = {0, 0, 0x80, 0x800, 0x10000};
  if (code < kLeastCode[num_bytes] || code > 0x10ffff || IsBetween(code, 0xd800, 0xdfff)) return {};
  return {code, num_bytes};
}

std::string Printable(std::string_view text) {
  std::string printable;
  printable.reserve(text.size());
  while (!text.empty()) {
    const Utf8Character character = FirstCharacter(text);
    if (character.num_bytes == 0) {
      printable += fmt::format("\\x{:02x}", static_cast<uint8_t>(text[0]));
    } else if (IsCommand(character.code)) {
      printable += fmt::format("\\u{:04x}", static_cast<uint32_t>(character.code));
    } else {
      printable += text.substr(0, character.num_bytes);
    }
    text.remove_prefix(std::max(character.num_bytes, 1));
  }
  return printable;
}

bool HasControlCharacter(std::string_view text) {
  return std::any_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
}

}  // namespace cairn
