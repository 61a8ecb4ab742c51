#pragma once

#include "core/error.h"

namespace cairn {

// Codes of files that a robot opens or that a map is written to, where kCorrupt or kIo would not say what to
// do.  They continue those of core/error.h: append only, never renumber.
inline constexpr ErrorCode kEmptyFile{11};    // no bytes at all
inline constexpr ErrorCode kTruncated{12};    // shorter than it says
inline constexpr ErrorCode kNotSqlite{13};    // no SQLite database, but should be one
inline constexpr ErrorCode kForeignFile{14};  // a SQLite database of another program
inline constexpr ErrorCode kTooNew{15};       // a map of a later format than this program reads
inline constexpr ErrorCode kTooOld{16};       // a map of an earlier format: `cairn migrate`
inline constexpr ErrorCode kNotSigned{17};    // a signature is required
inline constexpr ErrorCode kWrongKey{18};     // signed with another key, or the signature is false
inline constexpr ErrorCode kReadOnly{19};     // the folder or file may not be written
inline constexpr ErrorCode kDiskFull{20};     // no space is left

// Their names; null for another code.
const char* MapErrorName(ErrorCode code);

}  // namespace cairn
