#include "pipeline/program/manual.h"

#include <algorithm>
#include <map>
#include <vector>

#include <fmt/format.h>

#include "core/base/error.h"

namespace cairn::pipeline {
namespace {

// Text as roff shows it: backslashes and hyphens as they are, no line that begins with a request.
std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\n' || (escaped.empty() && (c == '.' || c == '\''))) {
      escaped += c == '\n' ? " " : std::string("\\&") + c;
    } else if (c == '\\') {
      escaped += "\\e";
    } else if (c == '-') {
      escaped += "\\-";
    } else if (c == '|') {
      escaped += "|\\:";  // a list of choices may be longer than a line: here it may be broken
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string Header(const std::string& page, const std::string& version) {
  std::string title = page;
  std::transform(title.begin(), title.end(), title.begin(), [](unsigned char c) { return std::toupper(c); });
  return fmt::format(".TH {} 1 \"\" \"cairn {}\" \"cairn\"\n.ad l\n", Escaped(title), version);
}

bool TakesValue(const CLI::Option& option) { return option.get_items_expected_max() > 0; }

// "-o, --output FILE".
std::string NameOf(const CLI::Option& option) {
  if (option.get_positional()) return "\\fI" + Escaped(option.get_type_name()) + "\\fR";
  std::string names;
  for (const std::string& name : option.get_snames())
    names += (names.empty() ? "" : ", ") + ("\\fB\\-" + Escaped(name) + "\\fR");
  for (const std::string& name : option.get_lnames())
    names += (names.empty() ? "" : ", ") + ("\\fB\\-\\-" + Escaped(name) + "\\fR");
  if (TakesValue(option)) names += " \\fI" + Escaped(option.get_type_name()) + "\\fR";
  return names;
}

std::string Entry(const CLI::Option& option) {
  return fmt::format(".TP\n{}\n{}\n", NameOf(option), Escaped(option.get_description()));
}

// "cairn localize MAP [IMAGE...] [OPTIONS]".
std::string Synopsis(const CalledCommand& command) {
  std::string synopsis = ".B cairn " + Escaped(command.words) + "\n";
  for (const CLI::Option* option : command.arguments->get_options()) {
    if (!option->get_positional()) continue;
    std::string name = "\\fI" + Escaped(option->get_type_name()) + "\\fR";
    if (option->get_items_expected_max() > 1) name += "...";
    synopsis += option->get_required() ? name + "\n" : "[" + name + "]\n";
  }
  return synopsis + "[\\fIOPTIONS\\fR]\n";
}

}  // namespace

std::string ProgramPage(const CLI::App& program, const std::string& version) {
  std::string page = Header("cairn", version);
  page += ".SH NAME\ncairn \\- offline compiler for landmark maps\n";
  page += ".SH SYNOPSIS\n.B cairn\n\\fICOMMAND\\fR [\\fIARGUMENTS\\fR]\n";
  page += ".SH DESCRIPTION\n" + Escaped(program.get_description()) + "\n";
  page +=
      "Every command has a page of its own, \\fBcairn\\-COMMAND\\fR(1), and says the same with "
      "\\fB\\-\\-help\\fR.\n";
  page += ".SH COMMANDS\n";
  for (const CalledCommand& command : CalledCommands(program))
    page += fmt::format(".TP\n\\fB{}\\fR\n{}\n", Escaped(command.words),
                        Escaped(command.arguments->get_description()));
  page += ".SH EXIT STATUS\n.TP\n0\ndone\n";
  for (int code = static_cast<int>(ErrorCode::kFailed); code <= static_cast<int>(ErrorCode::kNoMemory);
       ++code)
    page += fmt::format(".TP\n{}\n{}\n", code, Escaped(ErrorCodeName(static_cast<ErrorCode>(code))));
  return page;
}

std::string PageName(const CalledCommand& command) {
  std::string name = "cairn-" + command.words;
  std::replace(name.begin(), name.end(), ' ', '-');
  return name;
}

std::string CommandPage(const CalledCommand& command, const std::string& version) {
  const std::string name = PageName(command);
  std::string page = Header(name, version);
  page += fmt::format(".SH NAME\n{} \\- {}\n", Escaped(name), Escaped(command.arguments->get_description()));
  page += ".SH SYNOPSIS\n" + Synopsis(command);
  std::vector<std::string> groups;  // in the order of --help
  std::map<std::string, std::string> entries;
  for (const CLI::Option* option : command.arguments->get_options()) {
    const std::string group = option->get_positional() ? "Arguments" : option->get_group();
    if (group.empty()) continue;  // hidden
    if (entries[group].empty()) groups.push_back(group);
    entries[group] += Entry(*option);
  }
  std::stable_partition(groups.begin(), groups.end(), [](const std::string& g) { return g == "Arguments"; });
  for (std::string group : groups) {
    const std::string& text = entries[group];
    std::transform(group.begin(), group.end(), group.begin(),
                   [](unsigned char c) { return std::toupper(c); });
    page += ".SH " + Escaped(group) + "\n" + text;
  }
  return page + ".SH SEE ALSO\n.BR cairn (1)\n";
}

std::string BashCompletion(const CLI::App& program) {
  std::string commands, families, cases;
  for (const CLI::App* command : program.get_subcommands(nullptr)) {
    commands += (commands.empty() ? "" : " ") + command->get_name();
    std::string words;
    for (const CLI::App* subcommand : command->get_subcommands(nullptr))
      words += (words.empty() ? "" : " ") + subcommand->get_name();
    if (!words.empty()) families += fmt::format("    {}) words=\"{}\" ;;\n", command->get_name(), words);
  }
  for (const CalledCommand& command : CalledCommands(program)) {
    std::string options;
    for (const CLI::Option* option : command.arguments->get_options()) {
      for (const std::string& name : option->get_snames()) options += " -" + name;
      for (const std::string& name : option->get_lnames()) options += " --" + name;
    }
    cases += fmt::format("    \"{} \"*) words=\"{}\" ;;\n", command.words,
                         options.substr(options.empty() ? 0 : 1));
  }
  return fmt::format(R"(# Completion for cairn, written by `cairn manual`.
_cairn() {{
  local words=
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    COMPREPLY=($(compgen -W "{} --help --help-all --version" -- "$2"))
    return
  fi
  if ((COMP_CWORD == 2)); then
    case ${{COMP_WORDS[1]}} in
{}    esac
  fi
  if [[ $words == "" && $2 == -* ]]; then
    case "${{COMP_WORDS[1]}} ${{COMP_WORDS[2]}} " in
{}    esac
  fi
  COMPREPLY=($(compgen -W "$words" -- "$2"))
}}
complete -o default -F _cairn cairn
)",
                     commands, families, cases);
}

}  // namespace cairn::pipeline
