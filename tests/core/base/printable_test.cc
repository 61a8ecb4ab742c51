#include "core/base/printable.h"

#include <cstdint>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(Printable, ShowsWhatWouldCommandATerminal) {
  EXPECT_EQ(Printable("a\x1b[31mb"), "a\\u001b[31mb");
  EXPECT_EQ(Printable(std::string_view("a\0b", 3)), "a\\u0000b");
  EXPECT_EQ(Printable("a\rb\bc\x7f"), "a\\u000db\\u0008c\\u007f");
  EXPECT_EQ(Printable("\xc2\x80 \xc2\x9b"
                      "31m \xc2\x9f"),
            "\\u0080 \\u009b31m \\u009f");                             // C1: CSI without ESC
  EXPECT_EQ(Printable("\xe2\x80\xaa\xe2\x80\xae"), "\\u202a\\u202e");  // embedding, override
  EXPECT_EQ(Printable("\xe2\x81\xa6\xe2\x81\xa9"), "\\u2066\\u2069");  // isolates
}

TEST(Printable, LeavesTextAsItIs) {
  for (const char* text : {"", "a b\n\tc \\ ~ !", "Küche", "\xc2\xa0", "日本語", "\xf0\x9f\xa4\x96",
                           "\xe2\x80\xa9", "\xe2\x80\xaf", "\xe2\x81\xa5", "\xe2\x81\xaa"}) {
    EXPECT_EQ(Printable(text), text);
  }
}

// As RFC 3629 has it: nothing longer than needed, no surrogates, nothing past U+10FFFF.
TEST(Printable, ShowsBytesThatAreNoUtf8) {
  EXPECT_EQ(Printable("K\xfc"
                      "che"),
            "K\\xfcche");
  EXPECT_EQ(Printable("\xc3"), "\\xc3");  // cut off
  EXPECT_EQ(Printable("\xe2\x80"), "\\xe2\\x80");
  EXPECT_EQ(Printable("\x9b"
                      "31m"),
            "\\x9b31m");                           // C1 of eight bits
  EXPECT_EQ(Printable("\xc0\x9b"), "\\xc0\\x9b");  // ESC, too long
  EXPECT_EQ(Printable("\xe0\x80\x9b"), "\\xe0\\x80\\x9b");
  EXPECT_EQ(Printable("\xf0\x80\x80\x9b"), "\\xf0\\x80\\x80\\x9b");
  EXPECT_EQ(Printable("\xed\xa0\x80"), "\\xed\\xa0\\x80");  // a surrogate
  EXPECT_EQ(Printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");
  EXPECT_EQ(Printable("\xf8\x88\x80\x80\x80"), "\\xf8\\x88\\x80\\x80\\x80");
  EXPECT_EQ(Printable("\xf8\x90\x80\x80"), "\\xf8\\x90\\x80\\x80");  // in a byte too many
  EXPECT_EQ(Printable("\xf4\x8f\xbf\xbf"), "\xf4\x8f\xbf\xbf");      // the last one
  EXPECT_EQ(Printable("\xc3\xc3\xbc"), "\\xc3\xc3\xbc");             // only what is wrong
}

TEST(Printable, ControlCharactersOfNamesAreSeen) {
  EXPECT_FALSE(HasControlCharacter("a b/Küche \xfc.jpg"));
  EXPECT_FALSE(HasControlCharacter(""));
  for (const char c : {'\0', '\n', '\r', '\t', '\x1b', '\x1f', '\x7f'})
    EXPECT_TRUE(HasControlCharacter(std::string("a") + c + "b")) << int{c};
}

TEST(FirstCharacter, IsTheFirstAndTheLastOfEachLength) {
  struct Character {
    std::string_view bytes;
    char32_t code;
  };
  for (const Character& character :
       {Character{std::string_view("\0", 1), 0}, Character{"\x7f", 0x7f}, Character{"\xc2\x80", 0x80},
        Character{"\xdf\xbf", 0x7ff}, Character{"\xe0\xa0\x80", 0x800}, Character{"\xed\x9f\xbf", 0xd7ff},
        Character{"\xee\x80\x80", 0xe000}, Character{"\xef\xbf\xbf", 0xffff},
        Character{"\xf0\x90\x80\x80", 0x10000}, Character{"\xf4\x8f\xbf\xbf", 0x10ffff}}) {
    const Utf8Character found = FirstCharacter(std::string(character.bytes) + "x");
    EXPECT_EQ(found.code, character.code);
    EXPECT_EQ(found.num_bytes, std::ssize(character.bytes)) << uint32_t{character.code};
  }
  for (const char* bytes : {"\xc1\xbf", "\xe0\x9f\xbf", "\xed\xbf\xbf", "\xf0\x8f\xbf\xbf",
                            "\xf7\xbf\xbf\xbf", "\xbf\xbf\xbf\xbf", "\xc2\xc0", "\xe2\x80\x7f"})
    EXPECT_EQ(FirstCharacter(bytes).num_bytes, 0);
}

TEST(Printable, ShowsNoMoreThanTheseCommands) {
  EXPECT_EQ(Printable("\xc2\xa0~\x20"), "\xc2\xa0~ ");
  EXPECT_EQ(Printable("\x1f"), "\\u001f");
  EXPECT_EQ(Printable("\xe2\x80\xa8\xe2\x80\xad"), "\xe2\x80\xa8\\u202d");
  EXPECT_EQ(Printable("\xe2\x81\xa7\xe2\x81\xa8"), "\\u2067\\u2068");
}

}  // namespace
}  // namespace cairn
