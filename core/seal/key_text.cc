#include "core/seal/key_text.h"

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>

#include "core/files/file_descriptor.h"

namespace cairn {

KeyText::~KeyText() { sodium_memzero(characters_.data(), characters_.size()); }

std::string_view KeyText::trimmed() const {
  std::string_view text = view();
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())) != 0) text.remove_suffix(1);
  return text;
}

Status KeyText::Read(const std::string& path, const char* expected, size_t max_num_bytes, mode_t refused_mode,
                     const std::string& remedy) {
  const FileDescriptor file(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC));
  struct stat status = {};
  if (file.get() < 0 || fstat(file.get(), &status) != 0) {
    if (errno == ENOENT || errno == ENOTDIR) return MakeError(ErrorCode::kNotFound, "{}: no such file", path);
    return MakeError(ErrorCode::kIo, "{}: cannot be read: {}", path, std::strerror(errno));
  }
  if (!S_ISREG(status.st_mode))
    return MakeError(ErrorCode::kInvalidArgument, "{}: not a regular file, expected {}", path, expected);
  if ((status.st_mode & refused_mode) != 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: users other than its owner may use it (mode {:04o}), expected {}", path,
                     status.st_mode & 07777, remedy);
  }
  characters_.assign(max_num_bytes + 1, '\0');
  while (size_ < characters_.size()) {
    const ssize_t num_read = read(file.get(), characters_.data() + size_, characters_.size() - size_);
    if (num_read < 0 && errno == EINTR) continue;
    if (num_read < 0) return MakeError(ErrorCode::kIo, "{}: cannot be read: {}", path, std::strerror(errno));
    if (num_read == 0) break;
    size_ += static_cast<size_t>(num_read);
  }
  return Ok();
}

bool IsHex(std::string_view text) {
  return std::all_of(text.begin(), text.end(),
                     [](unsigned char character) { return std::isxdigit(character) != 0; });
}

void DecodeHex(std::string_view digits, uint8_t* bytes, size_t num_bytes) {
  sodium_hex2bin(bytes, num_bytes, digits.data(), digits.size(), nullptr, nullptr, nullptr);
}

std::string HexOfBytes(const uint8_t* bytes, size_t num_bytes) {
  std::string text;
  for (size_t i = 0; i < num_bytes; ++i) text += fmt::format("{:02x}", bytes[i]);
  return text;
}

Result<std::string_view> NextLine(std::string_view* text, int* num_lines, const std::string& path) {
  ++*num_lines;
  const size_t end = text->find('\n');
  if (end == std::string_view::npos) {
    return MakeError(ErrorCode::kCorrupt,
                     "{}: line {}: ends without a line feed: the file was cut off; copy it again", path,
                     *num_lines);
  }
  const std::string_view line = text->substr(0, end);
  text->remove_prefix(end + 1);
  if (line.ends_with('\r')) {
    return MakeError(
        ErrorCode::kCorrupt,
        "{}: line {}: ends with a carriage return: another system's editor or transfer has changed "
        "the file; copy it again as binary",
        path, *num_lines);
  }
  return line;
}

}  // namespace cairn
