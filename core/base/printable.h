#pragma once

#include <string>
#include <string_view>

namespace cairn {

// Text that comes from a file or from a name may hold what a terminal, a list or an XML reader takes for
// a command.

// The first character of a text.
struct Utf8Character {
  char32_t code = 0;
  int num_bytes = 0;  // 0 where the text does not begin with a character of valid UTF-8
};
// REQUIRES: !text.empty()
Utf8Character FirstCharacter(std::string_view text);

// The text as a terminal may show it.  Control characters (except '\n' and '\t') and those that change the
// direction of writing become escapes such as \u001b, which is the same character in a JSON string; bytes
// that are not UTF-8 become escapes such as \xff.
std::string Printable(std::string_view text);

// Whether any of its bytes is an ASCII control character, such as a line end.  A name that has one breaks a
// list of one name per line and misleads a reader.
bool HasControlCharacter(std::string_view text);

}  // namespace cairn
