#include "core/temporary.h"

#include <unistd.h>

#include <algorithm>
#include <string_view>

#include <fmt/format.h>

namespace cairn {
namespace {

constexpr std::string_view kTemporaryMark = ".tmp-";

}  // namespace

std::string TemporaryPath(const std::string& target) {
  return fmt::format("{}{}{}", target, kTemporaryMark, getpid());
}

bool IsTemporaryName(const std::string& name, const std::string& target) {
  const size_t mark = target.empty() ? name.rfind(kTemporaryMark) : target.size();
  if (mark == std::string::npos || name.compare(0, target.size(), target) != 0 ||
      name.compare(mark, kTemporaryMark.size(), kTemporaryMark) != 0) {
    return false;
  }
  const size_t digits = mark + kTemporaryMark.size();
  const size_t end = std::min(name.find_first_not_of("0123456789", digits), name.size());
  return end > digits && (end == name.size() || name[end] == '-');
}

}  // namespace cairn
