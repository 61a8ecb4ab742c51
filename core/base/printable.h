#pragma once

#include <string>
#include <string_view>

namespace cairn {

// Text that comes from a file or from a name may hold what a terminal, a list or an XML reader takes for a
// command.

// The first character of a text.
struct Utf8Character {
  char32_t code = 0;
  int num_bytes = 0;  // 0 where the text does not begin with a character of valid UTF-8
};
// REQUIRES: !text.empty()
Utf8Character FirstCharacter(std::string_view text);

// The text as a terminal may show it: control characters (but '\n' and '\t') and those that turn the
// direction of writing are shown as \u001b, which in a string of JSON is the same character; bytes that are
// no UTF-8 as \xff.
std::string Printable(std::string_view text);

// Whether any of its bytes is an ASCII control character, a line's end among them.  Names that have one are
// no names for a list of one name per line, nor for a person.
bool HasControlCharacter(std::string_view text);

}  // namespace cairn
