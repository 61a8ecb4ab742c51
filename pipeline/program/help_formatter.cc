#include "pipeline/program/help_formatter.h"

#include <sstream>

#include <fmt/format.h>

#include "core/line/arguments.h"

namespace cairn::pipeline {
namespace {

constexpr size_t kLineLength = 100;
constexpr size_t kOptionLength = 28, kCommandLength = 20;  // columns of their names

// A name and what it is for: two columns, or the text in lines of its own below a long name.
std::string Row(const std::string& name, size_t name_length, const std::string& text) {
  std::string row = "  " + name;
  size_t column = row.size();
  const auto break_line = [&] {
    row += "\n" + std::string(name_length + 2, ' ');
    column = name_length + 2;
  };
  if (name.size() >= name_length) {
    break_line();
  } else {
    row.append(name_length + 2 - column, ' ');
    column = name_length + 2;
  }
  std::istringstream words(text);
  bool is_first = true;
  for (std::string word; words >> word;) {
    if (!is_first && column + 1 + word.size() > kLineLength) {
      break_line();
      is_first = true;
    }
    row += (is_first ? "" : " ") + word;
    column += word.size() + (is_first ? 0 : 1);
    is_first = false;
  }
  return row + "\n";
}

// "cairn plan locate".
std::string CalledAs(const CLI::App* app) {
  const CLI::App* const parent = app->get_parent();
  return (parent == nullptr ? "" : CalledAs(parent) + " ") + app->get_name();
}

}  // namespace

HelpFormatter::HelpFormatter() {
  label("SUBCOMMAND", "COMMAND");
  label("Positionals", "Arguments");
}

std::string HelpFormatter::make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const {
  const bool is_short = mode == CLI::AppFormatMode::Normal;
  if (mode == CLI::AppFormatMode::Sub) name = CalledAs(app);  // one command of all
  std::string text = app->get_description() + "\n" + make_usage(app, name) + make_positionals(app);
  size_t num_left_out = 0;
  for (const std::string& group : app->get_groups()) {
    const std::vector<const CLI::Option*> options = app->get_options(
        [&](const CLI::Option* option) { return option->get_group() == group && option->nonpositional(); });
    if (group.empty() || options.empty()) continue;
    if (is_short && group == kMoreOptionsHeading) {
      num_left_out = options.size();
    } else {
      text += make_group(group, false, options);
    }
  }
  text += make_subcommands(app, is_short ? mode : CLI::AppFormatMode::All);
  return text +
         (num_left_out > 0 ? fmt::format("\n{} more: {} --help-all\n", num_left_out, CalledAs(app)) : "");
}

std::string HelpFormatter::make_option(const CLI::Option* option, bool is_positional) const {
  return Row(make_option_name(option, is_positional) + make_option_opts(option), kOptionLength,
             make_option_desc(option));
}

// CLI11 adds what is checked to the type's name: "N:INT in [1 - 100]"; our texts say it in words.
std::string HelpFormatter::make_option_opts(const CLI::Option* option) const {
  if (option->get_type_size() == 0) return "";
  const std::string type = option->get_type_name();
  std::string text = " " + type.substr(0, type.find(':'));
  if (option->get_items_expected_max() > 1 && !text.ends_with("...")) text += "...";
  return text + (option->get_required() ? " (required)" : "");
}

std::string HelpFormatter::make_option_desc(const CLI::Option* option) const {
  const std::string value = option->get_default_str();
  return option->get_description() + (value.empty() ? "" : " [" + value + "]");
}

std::string HelpFormatter::make_subcommand(const CLI::App* app) const {
  return Row(app->get_name(), kCommandLength, app->get_description());
}

}  // namespace cairn::pipeline
