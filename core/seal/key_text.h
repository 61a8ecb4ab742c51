#pragma once

#include <sys/types.h>

#include <cstddef>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "core/seal/signing_key.h"

namespace cairn {

// The text of a file with keys or signatures; overwritten when it is destroyed, as it may be a secret key.
class KeyText {
 public:
  KeyText() = default;
  KeyText(const KeyText&) = delete;
  KeyText& operator=(const KeyText&) = delete;
  ~KeyText();

  std::string_view view() const { return {characters_.data(), size_}; }
  // Without white space at its end.
  std::string_view trimmed() const;

  // Reads a file as far as `max_num_bytes` and one byte more, and never waits for a pipe.  Files whose mode
  // has one of the bits `refused_mode` are refused; `remedy` ends that message.  Errors: NotFound, Io;
  // InvalidArgument (not a regular file, whose mode is refused).
  Status Read(const std::string& path, const char* expected, size_t max_num_bytes, mode_t refused_mode,
              const std::string& remedy);

 private:
  std::string characters_;
  size_t size_ = 0;
};

bool IsHex(std::string_view text);
// REQUIRES: IsHex(digits), twice `num_bytes` of them.
void DecodeHex(std::string_view digits, uint8_t* bytes, size_t num_bytes);
std::string HexOfBytes(const uint8_t* bytes, size_t num_bytes);

// The next line of a text, taken from its beginning, without its line feed; lines are counted in `num_lines`.
// Errors: Corrupt (the line has no line feed: it was cut off; or a carriage return).
Result<std::string_view> NextLine(std::string_view* text, int* num_lines, const std::string& path);

}  // namespace cairn
