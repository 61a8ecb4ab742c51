#include "pipeline/build/make_words.h"

#include <string_view>

namespace cairn::pipeline {
namespace {

constexpr std::string_view kSpecialInPaths = "$#%:;&|<>()[]{}*?'\"`\\=!";
// A launcher's words may be options and lists of nodes: --mem=4G, node[1-4], A:B, 50%.
constexpr std::string_view kSpecialInLaunchers = "$#;&|<>()*?'\"`\\!";

// Describes the first character that make or a shell would not read as part of a name; empty: none.
std::string FindSpecial(const std::string& text, std::string_view special) {
  for (const char c : text) {
    if (c == '\n' || c == '\r') return "a line break";
    if (c == ' ' || c == '\t') return "a space";
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return "a control character";
    if (special.find(c) != std::string_view::npos) return fmt::format("'{}'", c);
  }
  return "";
}

}  // namespace

Status CheckMakePath(const std::string& what, const std::string& path) {
  const std::string found = FindSpecial(path, kSpecialInPaths);
  if (found.empty()) return Ok();
  return MakeError(ErrorCode::kInvalidArgument,
                   "{} '{}' has {} in its path, which Make cannot handle; rename the folder or move it", what,
                   path, found);
}

Status CheckMakeWord(const std::string& what, const std::string& word) {
  const std::string found =
      word.starts_with('~') ? "'~' at its beginning" : FindSpecial(word, kSpecialInPaths);
  if (found.empty()) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "{} '{}' has {}, which Make cannot handle; write it without",
                   what, word, found);
}

Status MakeVariables::Set(const std::string& variable, const std::string& what,
                          const std::vector<std::string>& words) {
  for (const std::string& word : words) CAIRN_RETURN_IF_ERROR(CheckMakePath(what, word));
  values_.emplace_back(variable, fmt::format("{}", fmt::join(words, " ")));
  return Ok();
}

Status MakeVariables::SetPairs(const std::string& variable, const std::string& what,
                               const std::vector<std::pair<std::string, std::string>>& words) {
  std::string value;
  for (const auto& [first, second] : words) {
    CAIRN_RETURN_IF_ERROR(CheckMakePath(what, first));
    CAIRN_RETURN_IF_ERROR(CheckMakePath(what, second));
    value += fmt::format("{}{}={}", value.empty() ? "" : " ", first, second);
  }
  values_.emplace_back(variable, value);
  return Ok();
}

Status MakeVariables::SetLauncher(const std::string& variable, const std::string& what,
                                  const std::string& words) {
  std::string value;
  for (size_t begin = 0; begin < words.size();) {
    const size_t end = std::min(words.find(' ', begin), words.size());
    const std::string word = words.substr(begin, end - begin);
    if (const std::string found = FindSpecial(word, kSpecialInLaunchers); !found.empty()) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{} '{}' has {}: these words are put before a command and no shell reads them; move "
                       "what needs a shell into a script and give its name",
                       what, words, found);
    }
    if (!word.empty()) value += (value.empty() ? "" : " ") + word;
    begin = end + 1;
  }
  values_.emplace_back(variable, value);
  return Ok();
}

std::string MakeVariables::MakefileText() const {
  std::string text;
  for (const auto& [variable, value] : values_) text += fmt::format("{} := {}\n", variable, value);
  return text;
}

std::vector<std::string> MakeVariables::CommandWords() const {
  std::vector<std::string> words;
  for (const auto& [variable, value] : values_) words.push_back(variable + "=" + value);
  return words;
}

}  // namespace cairn::pipeline
