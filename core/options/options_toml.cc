// Options in TOML: in a file of its own, since a robot needs the options but not TOML.
#include <algorithm>
#include <sstream>

#include "core/files/file.h"
#include "core/options/find_option.h"
#include "core/options/options.h"
#include "core/options/toml_options.h"

namespace cairn {
namespace {

// A TOML value in the form that SetOption reads.
std::string TextFromToml(const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* list = node.as_array()) {
    std::string joined;
    for (const toml::node& item : *list) joined += (joined.empty() ? "" : ",") + TextFromToml(item);
    return joined;
  }
  std::ostringstream text;
  if (const auto* boolean = node.as_boolean()) {
    text << (boolean->get() ? "true" : "false");
  } else if (const auto* integer = node.as_integer()) {
    text << integer->get();
  } else if (const auto* number = node.as_floating_point()) {
    text << fmt::format("{}", number->get());
  } else {
    text << "a table or date";
  }
  return text.str();
}

// toml++ takes a key's parts, and what they lead to, one inside the other, without a limit of its own.
constexpr int kMaxPartsOfAKey = 100;
// In all of a text, whatever they stand in: quotes may hide a key from MostPartsOfAKey.  (20,000 did no
// harm.)
constexpr int64_t kMaxDots = 10'000;

// Of dotted keys and headers of tables, wherever they may stand; numbers have one dot.
int MostPartsOfAKey(const std::string& contents) {
  int num = 1, most = 1;
  char quote = 0;  // of the string that this is in
  for (size_t i = 0; i < contents.size(); ++i) {
    const char c = contents[i];
    if (quote != 0) {
      if (c == '\\' && quote == '"') ++i;
      if (c == quote || c == '\n') quote = 0;  // lines of a longer string count as if they were keys
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '#') {
      i = std::min(contents.find('\n', i), contents.size()) - 1;
    } else if (c == '.') {
      most = std::max(most, ++num);
    } else if (c == '=' || c == ',' || c == '\n' || c == '{' || c == '[') {
      num = 1;
    }
  }
  return most;
}

}  // namespace

Result<toml::table> ReadTomlFile(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  return ParseToml(contents, path);
}

Result<toml::table> ParseToml(const std::string& contents, const std::string& path) {
  if (MostPartsOfAKey(contents) > kMaxPartsOfAKey)
    return MakeError(ErrorCode::kCorrupt, "{}: not TOML for cairn: a key of more than {} parts", path,
                     kMaxPartsOfAKey);
  if (std::count(contents.begin(), contents.end(), '.') > kMaxDots)
    return MakeError(ErrorCode::kCorrupt, "{}: not TOML for cairn: more than {} dots", path, kMaxDots);
  try {
    return toml::table(toml::parse(contents, path));
  } catch (const toml::parse_error& error) {
    return MakeError(ErrorCode::kCorrupt, "{}:{}: not TOML: {}", path, error.source().begin.line,
                     error.description());
  }
}

std::string TomlPlace(const std::string& path, const toml::node& node) {
  return fmt::format("{}:{}", path, node.source().begin.line);
}

Status SetOptionsFromToml(const toml::table& keys, const std::string& path, const OptionTable& table) {
  std::vector<std::string> names;
  for (const Option& option : table) names.push_back(option.name);
  const std::string valid = fmt::format("valid are {}", fmt::join(names, ", "));
  for (const auto& [key, node] : keys) {
    const std::string name(key.str());
    const std::string place = fmt::format("{}:{}", path, key.source().begin.line);
    const Result<const Option*> option = FindOption(table, name, valid);
    if (!option.ok()) return MakeError(option.error().code, "{}: {}", place, option.error().message);
    if (Status status = SetOption(**option, TextFromToml(node)); !status.ok()) {
      return MakeError(status.error().code, "{}: {}", place, status.error().message);
    }
  }
  return Ok();
}

Status ReadOptionsFile(const std::string& path, const OptionTable& table) {
  CAIRN_ASSIGN_OR_RETURN(const toml::table document, ReadTomlFile(path));
  return SetOptionsFromToml(document, path, table);
}

std::string OptionsToml(const OptionTable& table) {
  std::string document;
  for (const Option& option : table) {
    std::string value = OptionValueText(option);
    const bool is_word = std::any_of(option.words.begin(), option.words.end(),
                                     [&](const auto& word) { return word.first == value; });
    if (is_word || std::holds_alternative<std::string*>(option.value)) {
      std::ostringstream quoted;
      quoted << toml::value<std::string>(value);
      value = quoted.str();
    } else if (std::holds_alternative<std::vector<double>*>(option.value)) {
      value = "[" + value + "]";
    }
    document += option.name + " = " + value + "\n";
  }
  return document;
}

}  // namespace cairn
