#include "core/line/command.h"

#include <algorithm>
#include <variant>

namespace cairn {
namespace {

std::string Dashed(std::string name) {
  std::replace(name.begin(), name.end(), '_', '-');
  return name;
}

const char* TypeText(const Option& option) {
  static constexpr const char* kTypes[] = {"true|false", "INT", "FLOAT", "TEXT", "LIST"};
  return option.choices.empty() ? kTypes[option.value.index()] : "WORD";
}

std::string HelpText(const Option& option) {
  std::string help = option.help;
  if (!option.choices.empty()) help += fmt::format("; one of {}", fmt::join(option.choices, "|"));
  const bool is_number =
      std::holds_alternative<int*>(option.value) || std::holds_alternative<double*>(option.value);
  if (is_number && !ValuesText(option).empty()) help += "; " + ValuesText(option);
  const std::string value = OptionValueText(option);
  return value.empty() ? help : help + " [" + value + "]";
}

}  // namespace

void OptionArguments::Add(ArgumentParser& parser, OptionTable table, const std::vector<std::string>& shown) {
  table_ = std::move(table);
  texts_.resize(table_.size());
  for (size_t i = 0; i < table_.size(); ++i) {
    const bool is_shown =
        shown.empty() || std::find(shown.begin(), shown.end(), table_[i].name) != shown.end();
    arguments_.push_back(parser.Add("--" + Dashed(table_[i].name), texts_[i], HelpText(table_[i]))
                             .Type(TypeText(table_[i]))
                             .Group(is_shown ? "Tuning" : kMoreOptionsHeading));
  }
  parser.Add("--options", options_file_, "TOML file with these options; the command line overrides it")
      .Type("FILE.toml")
      .OnlyInHelpAll();
}

Status OptionArguments::Apply() const {
  if (!options_file_.empty()) CAIRN_RETURN_IF_ERROR(ReadOptionsFile(options_file_, table_));
  for (size_t i = 0; i < table_.size(); ++i) {
    if (arguments_[i].IsGiven()) CAIRN_RETURN_IF_ERROR(SetOption(table_[i], texts_[i]));
  }
  CAIRN_RETURN_IF_ERROR(CheckOptions(table_));
  for (size_t i = 0; i < table_.size(); ++i) {
    if (arguments_[i].IsGiven()) CAIRN_RETURN_IF_ERROR(CheckIsRead(table_[i], table_));
  }
  return Ok();
}

Status OptionArguments::RefuseGiven(const std::vector<std::string>& names, const std::string& reason) const {
  for (size_t i = 0; i < table_.size(); ++i) {
    const bool is_named = std::find(names.begin(), names.end(), table_[i].name) != names.end();
    if (is_named && arguments_[i].IsGiven()) {
      return MakeError(ErrorCode::kInvalidArgument, "--{}: {}", Dashed(table_[i].name), reason);
    }
  }
  return Ok();
}

}  // namespace cairn
