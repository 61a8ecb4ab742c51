#include "core/capture/sessions.h"

#include <algorithm>
#include <cctype>
#include <string_view>

#include "core/base/text.h"
#include "core/files/file.h"

namespace cairn {

bool IsSessionName(const std::string& name) {
  return !name.empty() && name.size() <= 100 && name.front() != '.' && name.front() != '-' &&
         std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return std::isalnum(c) || c == '-' || c == '_' || c == '.'; });
}

Result<std::vector<std::string>> ReadSessionsText(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  std::vector<std::string> sessions;
  int line_number = 0;
  for (const std::string_view line : SplitLines(contents)) {
    ++line_number;
    const std::vector<std::string> words = SplitWords(line);
    if (words.empty() || words[0][0] == '#') continue;
    if (!IsSessionName(words[0])) {
      return MakeError(
          ErrorCode::kCorrupt,
          "{}:{}: session '{}': expected letters, digits, '-', '_' and '.', not beginning with '-' or '.'",
          path, line_number, words[0]);
    }
    if (std::find(sessions.begin(), sessions.end(), words[0]) != sessions.end())
      return MakeError(ErrorCode::kCorrupt, "{}:{}: session '{}' is listed twice", path, line_number,
                       words[0]);
    if (sessions.size() == kMaxNumSessions) {
      return MakeError(ErrorCode::kCorrupt, "{}: more than {} sessions; join the later ones to another map",
                       path, kMaxNumSessions);
    }
    sessions.push_back(words[0]);
  }
  return sessions;
}

int SessionOfImage(const std::vector<std::string>& sessions, const std::string& image_name) {
  const size_t slash = image_name.find('/');
  const auto found = slash == std::string::npos
                         ? sessions.end()
                         : std::find(sessions.begin(), sessions.end(), image_name.substr(0, slash));
  return found == sessions.end() ? -1 : static_cast<int>(found - sessions.begin());
}

}  // namespace cairn
