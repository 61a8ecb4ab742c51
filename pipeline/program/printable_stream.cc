#include "pipeline/program/printable_stream.h"

#include <algorithm>
#include <new>
#include <utility>

#include "core/base/printable.h"

namespace cairn::pipeline {
namespace {

// How many bytes at the end of a text are the beginning of a character of UTF-8.
size_t NumBegunBytes(std::string_view text) {
  for (size_t num_bytes = 1; num_bytes <= std::min<size_t>(3, text.size()); ++num_bytes) {
    const auto byte = static_cast<uint8_t>(text[text.size() - num_bytes]);
    if (byte < 0x80) return 0;
    if (byte < 0xc0) continue;  // not the first of a character
    const size_t num_needed = byte < 0xe0 ? 2 : byte < 0xf0 ? 3 : 4;
    return num_bytes < num_needed ? num_bytes : 0;
  }
  return 0;
}

}  // namespace

// The stream would take it for a target that cannot be written.
template <typename Body>
bool PrintableStream::Buffer::NotesLackOfMemory(Body&& body) {
  try {
    return body();
  } catch (const std::bad_alloc&) {
    lacked_memory_ = true;
    return false;
  }
}

PrintableStream::Buffer::~Buffer() {
  NotesLackOfMemory([&] { return Write(begun_); });
}

bool PrintableStream::Buffer::Write(std::string_view text) {
  const std::string printable = Printable(text);
  const auto size = static_cast<std::streamsize>(printable.size());
  return target_->sputn(printable.data(), size) == size;
}

PrintableStream::Buffer::int_type PrintableStream::Buffer::overflow(int_type c) {
  if (traits_type::eq_int_type(c, traits_type::eof())) return traits_type::not_eof(c);
  const char character = traits_type::to_char_type(c);
  return xsputn(&character, 1) == 1 ? c : traits_type::eof();
}

std::streamsize PrintableStream::Buffer::xsputn(const char* text, std::streamsize size) {
  const bool written = NotesLackOfMemory([&] {
    begun_.append(text, static_cast<size_t>(size));
    const std::string all = std::exchange(begun_, "");
    const size_t num_whole = all.size() - NumBegunBytes(all);
    begun_ = all.substr(num_whole);
    return Write(std::string_view(all).substr(0, num_whole));
  });
  return written ? size : 0;
}

int PrintableStream::Buffer::sync() {
  const bool written = NotesLackOfMemory([&] { return Write(std::exchange(begun_, "")); });
  return target_->pubsync() == 0 && written ? 0 : -1;
}

}  // namespace cairn::pipeline
