#include "core/base/error.h"

namespace cairn {

const char* ErrorCodeName(ErrorCode code) {
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
    case ErrorCode::kEmptyFile:
      return "empty_file";
    case ErrorCode::kTruncated:
      return "truncated";
    case ErrorCode::kNotSqlite:
      return "not_sqlite";
    case ErrorCode::kForeignFile:
      return "foreign_file";
    case ErrorCode::kTooNew:
      return "too_new";
    case ErrorCode::kTooOld:
      return "too_old";
    case ErrorCode::kNotSigned:
      return "not_signed";
    case ErrorCode::kWrongKey:
      return "wrong_key";
    case ErrorCode::kReadOnly:
      return "read_only";
    case ErrorCode::kDiskFull:
      return "disk_full";
    case ErrorCode::kLost:
      return "lost";
    case ErrorCode::kNotNewer:
      return "not_newer";
    case ErrorCode::kOtherMap:
      return "other_map";
    case ErrorCode::kNoMemory:
      return "no_memory";
  }
  return "failed";
}

}  // namespace cairn
