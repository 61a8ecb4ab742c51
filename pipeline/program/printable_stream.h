#pragma once

#include <ostream>
#include <streambuf>
#include <string>

namespace cairn::pipeline {

// Writes text to `target` as Printable shows it (core/base/printable.h).  All results and messages go to the
// terminal through it, so that no name in a map, a capture or a recipe can control the terminal.  The
// progress bar and colours, which control it on purpose, do not go through this stream.  A character may come
// in parts; flushing ends it.
class PrintableStream : public std::ostream {
 public:
  explicit PrintableStream(std::ostream& target) : std::ostream(nullptr), buffer_(target.rdbuf()) {
    rdbuf(&buffer_);
  }

  // Whether some of the text is lost for lack of memory; the stream is bad then.
  bool lacked_memory() const { return buffer_.lacked_memory(); }

 private:
  class Buffer : public std::streambuf {
   public:
    explicit Buffer(std::streambuf* target) : target_(target) {}
    ~Buffer() override;
    Buffer(const Buffer&) = delete;
    Buffer& operator=(const Buffer&) = delete;

    bool lacked_memory() const { return lacked_memory_; }

   protected:
    int_type overflow(int_type c) override;
    std::streamsize xsputn(const char* text, std::streamsize size) override;
    int sync() override;

   private:
    bool Write(std::string_view text);
    template <typename Body>
    bool NotesLackOfMemory(Body&& body);

    std::streambuf* target_;
    std::string begun_;  // a character whose last bytes are still to come
    bool lacked_memory_ = false;
  };

  Buffer buffer_;
};

}  // namespace cairn::pipeline
