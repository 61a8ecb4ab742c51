#include "stages/extract_features/dependency_file.h"

#include <set>
#include <string_view>

namespace cairn::extract_features {
namespace {

bool FitsInMakefile(const std::string& path) {
  return !path.empty() && path.back() != '\\' && path.find_first_of("\n\r") == std::string::npos;
}

// A path in the form that Make reads among a rule's prerequisites: a backslash before each special character,
// and backslashes just before that one doubled.
std::string EscapeForMake(const std::string& path) {
  static constexpr std::string_view kSpecial = " \t#:;|*?[";
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
