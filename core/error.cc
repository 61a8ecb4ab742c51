#include "core/error.h"

#include <array>

#include "core/map_error.h"

namespace cairn {

const char* MapErrorName(ErrorCode code) {
  constexpr std::array kNames = {"empty_file", "truncated",  "not_sqlite", "foreign_file", "too_new",
                                 "too_old",    "not_signed", "wrong_key",  "read_only",    "disk_full"};
  const auto index = static_cast<size_t>(static_cast<int>(code) - static_cast<int>(kEmptyFile));
  return index < kNames.size() ? kNames[index] : nullptr;
}

const char* ErrorCodeName(ErrorCode code) {
  if (const char* const name = MapErrorName(code)) return name;
  switch (code) {
    case ErrorCode::kFailed:
      return "failed";
    case ErrorCode::kInvalidArgument:
      return "invalid_argument";
    case ErrorCode::kNotFound:
      return "not_found";
    case ErrorCode::kCorrupt:
      return "corrupt";
    case ErrorCode::kUnsupported:
      return "unsupported";
    case ErrorCode::kNoData:
      return "no_data";
    case ErrorCode::kIo:
      return "io";
    case ErrorCode::kGate:
      return "gate";
    case ErrorCode::kBusy:
      return "busy";
    case ErrorCode::kCancelled:
      return "cancelled";
  }
  return "failed";
}

}  // namespace cairn
