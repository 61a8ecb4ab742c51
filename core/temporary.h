#pragma once

#include <string>

namespace cairn {

// Where a file or folder is written before it takes the target's place: TARGET.tmp-PROCESS, in the same
// folder.
std::string TemporaryPath(const std::string& target);
// Whether a name is that of such a temporary of `target` (a name; "" = of anything), or of what SQLite or a
// replaced folder leaves beside one: TARGET.tmp-PROCESS-journal, -old.
bool IsTemporaryName(const std::string& name, const std::string& target);

}  // namespace cairn
