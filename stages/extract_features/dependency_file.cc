#include "stages/extract_features/dependency_file.h"

#include <algorithm>
#include <set>
#include <string_view>

namespace cairn::extract_features {
namespace {

constexpr std::string_view kSpecial = " \t#:;|*?[";

bool FitsInMakefile(const std::string& path) {
  return !path.empty() && path.back() != '\\' && path.find_first_of("\n\r") == std::string::npos;
}

// A path in the form that Make reads among a rule's prerequisites: a backslash before each special character,
// and backslashes just before that one doubled.
std::string EscapeForMake(const std::string& path) {
  std::string escaped;
  size_t num_backslashes = 0;  // just before
  for (const char c : path) {
    if (kSpecial.find(c) != std::string_view::npos) escaped.append(num_backslashes + 1, '\\');
    if (c == '$') escaped += '$';
    escaped += c;
    num_backslashes = c == '\\' ? num_backslashes + 1 : 0;
  }
  return escaped;
}

// The same for a pattern, where '%' would match any text.
std::string EscapeForPattern(const std::string& path) {
  std::string escaped;
  for (const char c : EscapeForMake(path)) {
    if (c == '%') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

// What EscapeForMake made of a path; anything of other text.
std::string UnescapeForMake(std::string_view text) {
  std::string path;
  size_t num_backslashes = 0;  // just before
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (kSpecial.find(c) != std::string_view::npos) path.resize(path.size() - (num_backslashes + 1) / 2);
    if (c == '$' && i + 1 < text.size() && text[i + 1] == '$') ++i;
    path += c;
    num_backslashes = c == '\\' ? num_backslashes + 1 : 0;
  }
  return path;
}

std::string UnescapeForPattern(std::string_view text) {
  std::string without;
  for (const char c : text) {
    if (c == '%' && without.ends_with('\\')) without.pop_back();
    without += c;
  }
  return UnescapeForMake(without);
}

}  // namespace

std::string DependencyFile(const std::vector<std::string>& inputs, const std::vector<std::string>& roots) {
  std::string text = "CAPTURE_IMAGES +=";
  for (const std::string& input : inputs) {
    if (FitsInMakefile(input)) text += " \\\n  " + EscapeForMake(input);
  }
  text += "\n";
  for (const std::string& root : roots) {
    if (FitsInMakefile(root)) text += EscapeForPattern(root) + "/%: ;\n";
  }
  return text;
}

bool IsDependencyFile(std::string_view text) {
  std::string_view rest = text;
  const auto skip = [&](std::string_view expected) {
    const bool is_next = rest.starts_with(expected);
    if (is_next) rest.remove_prefix(expected.size());
    return is_next;
  };
  constexpr std::string_view kNextWord = " \\\n  ", kEndOfRoot = "/%: ;\n";
  std::vector<std::string> inputs, roots;
  if (!skip("CAPTURE_IMAGES +=")) return false;
  while (skip(kNextWord)) {
    const size_t end = std::min(rest.find(kNextWord), rest.find('\n'));
    if (end == std::string_view::npos) return false;
    inputs.push_back(UnescapeForMake(rest.substr(0, end)));
    rest.remove_prefix(end);
  }
  if (!skip("\n")) return false;
  while (!rest.empty()) {
    const size_t end = rest.find(kEndOfRoot);
    if (end == std::string_view::npos) return false;
    roots.push_back(UnescapeForPattern(rest.substr(0, end)));
    rest.remove_prefix(end + kEndOfRoot.size());
  }
  return DependencyFile(inputs, roots) == text;
}

std::vector<std::string> FoldersOf(const std::vector<std::string>& files, const std::string& root) {
  std::set<std::string> folders = {root};
  for (const std::string& file : files) {
    if (!file.starts_with(root + "/")) continue;
    for (size_t slash = file.rfind('/'); slash > root.size(); slash = file.rfind('/', slash - 1)) {
      if (!folders.insert(file.substr(0, slash)).second) break;  // and so were those above it
    }
  }
  return {folders.begin(), folders.end()};
}

}  // namespace cairn::extract_features
