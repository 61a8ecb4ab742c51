#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/base/error.h"
#include "core/base/progress.h"

namespace cairn::pipeline {

// How progress is shown.
enum class ProgressStyle {
  kBar,    // one line, redrawn in place, with rate and time left: for terminals
  kLines,  // a line at the start and per 10 %: for logs
  kJson,   // a JSON object per line: for programs
  kNone,
};

// "bar", "lines", "json" or "none"; "auto" is a bar if `is_terminal`, lines otherwise.
// Errors: InvalidArgument.
Result<ProgressStyle> ParseProgressStyle(const std::string& text, bool is_terminal);

// Where a display writes and what time it is; tests give their own.
struct ProgressOutput {
  std::function<void(const std::string& text)> write;  // called under the display's lock
  std::function<double()> seconds;                     // a clock that never goes back
  std::function<bool()> cancelled;
};

// A thread-safe display in the given style.  Formats (schema of --progress=json):
//   {"event":"begin","task":T,"total":N,"unit":U}
//   {"event":"advance","task":T,"done":N,"total":N,"seconds":S}     at most 10 a second
//   {"event":"end","task":T,"done":N,"total":N,"seconds":S}
std::unique_ptr<Progress> MakeProgress(ProgressStyle style, ProgressOutput output);

}  // namespace cairn::pipeline
