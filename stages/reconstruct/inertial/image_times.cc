#include "stages/reconstruct/inertial/image_times.h"

#include <algorithm>
#include <string_view>

#include "core/base/text.h"

namespace cairn::reconstruct {
namespace {

constexpr size_t kMinDigitsOfNs = 10, kDigitsOfFraction = 9;

bool AreDigits(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace

std::optional<int64_t> TimeOfImageNs(const std::string& name) {
  std::string_view stem = name;
  stem.remove_prefix(stem.rfind('/') == std::string_view::npos ? 0 : stem.rfind('/') + 1);
  stem = stem.substr(0, stem.rfind('.'));
  const size_t point = stem.find('.');
  int64_t whole = 0;
  if (point == std::string_view::npos) {
    if (!AreDigits(stem) || stem.size() < kMinDigitsOfNs || !ParseNumber(stem, &whole)) return std::nullopt;
    return whole;
  }
  std::string fraction(stem.substr(point + 1));
  if (!AreDigits(stem.substr(0, point)) || !AreDigits(fraction)) return std::nullopt;
  fraction.resize(kDigitsOfFraction, '0');
  int64_t part = 0;
  constexpr int64_t kNsPerS = 1'000'000'000;
  if (!ParseNumber(stem.substr(0, point), &whole) || !ParseNumber(fraction, &part)) return std::nullopt;
  if (whole > (INT64_MAX - part) / kNsPerS) return std::nullopt;
  return whole * kNsPerS + part;
}

}  // namespace cairn::reconstruct
