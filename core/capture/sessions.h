#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"

namespace cairn {

// The surveys that a capture was joined from: ROOT/sessions.txt names them, and the image SESSION/NAME
// belongs to one.
inline constexpr const char* kSessionsFile = "sessions.txt";

// Most surveys of one map: what is counted of each pair of them grows with the square.
inline constexpr size_t kMaxNumSessions = 1000;

// Whether a session may have this name: 1 to 100 letters, digits, '-', '_' and '.', not beginning with
// '-' or '.'.
bool IsSessionName(const std::string& name);

// The first word of each line; lines that begin with '#' are skipped.  Errors: NotFound, Io; Corrupt (a name
// that is invalid or listed twice, or more than kMaxNumSessions).
Result<std::vector<std::string>> ReadSessionsText(const std::string& path);

// The position in `sessions` of the session that an image belongs to; -1: to none.
int SessionOfImage(const std::vector<std::string>& sessions, const std::string& image_name);

}  // namespace cairn
