#include "core/options/options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <optional>

#include "core/base/text.h"

namespace cairn {
namespace {

constexpr std::string_view kNot = "not ";

// The word that stands for an option's value; nothing for a plain number.
std::optional<std::string> WordOf(const Option& option) {
  auto* const* number = std::get_if<double*>(&option.value);
  for (const auto& [word, value] : option.words) {
    if (number != nullptr && **number == value) return word;
  }
  return std::nullopt;
}

std::string WordsText(const Option& option) {
  std::string text;
  for (const auto& [word, value] : option.words) text += word + ", or ";
  return text;
}

std::string RangeText(const Option& option) {
  if (std::isinf(option.min) && std::isinf(option.max)) return "a finite number";
  if (std::isinf(option.max)) return fmt::format("a finite number, at least {:g}", option.min);
  if (std::isinf(option.min)) return fmt::format("at most {:g}", option.max);
  return fmt::format("in [{:g}, {:g}]", option.min, option.max);
}

Status CheckRange(const Option& option, double value) {
  if (std::isfinite(value) && value >= option.min && value <= option.max) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "option {} = {:g}: must be {}{}", option.name, value,
                   WordsText(option), RangeText(option));
}

Error WrongType(const Option& option, const std::string& found) {
  static constexpr const char* kTypes[] = {"true or false", "an integer", "a number", "a text",
                                           "a list of numbers"};
  return MakeError(ErrorCode::kInvalidArgument, "option {}: expected {}{}, found '{}'", option.name,
                   WordsText(option), kTypes[option.value.index()], found);
}

}  // namespace

Status SetOption(const Option& option, const std::string& text) {
  if (auto* const* flag = std::get_if<bool*>(&option.value)) {
    if (text != "true" && text != "false") return WrongType(option, text);
    **flag = text == "true";
  } else if (auto* const* integer = std::get_if<int*>(&option.value)) {
    if (!ParseNumber(text, *integer)) return WrongType(option, text);
  } else if (auto* const* number = std::get_if<double*>(&option.value)) {
    const auto word = std::find_if(option.words.begin(), option.words.end(),
                                   [&](const auto& known) { return known.first == text; });
    if (word != option.words.end()) {
      **number = word->second;
    } else if (!ParseNumber(text, *number)) {
      return WrongType(option, text);
    }
  } else if (auto* const* string = std::get_if<std::string*>(&option.value)) {
    **string = text;
  } else {
    auto* list = std::get<std::vector<double>*>(option.value);
    list->clear();
    for (size_t begin = 0; begin < text.size();) {
      const size_t end = std::min(text.find(',', begin), text.size());
      double value = 0;
      std::string item = text.substr(begin, end - begin);
      item.erase(0, item.find_first_not_of(' '));
      if (!ParseNumber(item, &value)) return WrongType(option, text);
      list->push_back(value);
      begin = end + 1;
    }
  }
  return CheckOptions({option});
}

std::string OptionValueText(const Option& option) {
  if (const std::optional<std::string> word = WordOf(option)) return *word;
  if (auto* const* flag = std::get_if<bool*>(&option.value)) return **flag ? "true" : "false";
  if (auto* const* integer = std::get_if<int*>(&option.value)) return fmt::format("{}", **integer);
  if (auto* const* number = std::get_if<double*>(&option.value)) return fmt::format("{}", **number);
  if (auto* const* text = std::get_if<std::string*>(&option.value)) return **text;
  return fmt::format("{}", fmt::join(*std::get<std::vector<double>*>(option.value), ","));
}

Status CheckOptions(const OptionTable& table) {
  for (const Option& option : table) {
    if (auto* const* integer = std::get_if<int*>(&option.value))
      CAIRN_RETURN_IF_ERROR(CheckRange(option, **integer));
    if (auto* const* number = std::get_if<double*>(&option.value); number != nullptr && !WordOf(option))
      CAIRN_RETURN_IF_ERROR(CheckRange(option, **number));
    if (auto* const* numbers = std::get_if<std::vector<double>*>(&option.value)) {
      for (const double number : **numbers) CAIRN_RETURN_IF_ERROR(CheckRange(option, number));
    }
    auto* const* text = std::get_if<std::string*>(&option.value);
    if (text && !option.choices.empty() &&
        std::find(option.choices.begin(), option.choices.end(), **text) == option.choices.end()) {
      return MakeError(ErrorCode::kInvalidArgument, "option {} = '{}': must be one of {}", option.name,
                       **text, fmt::join(option.choices, ", "));
    }
  }
  return Ok();
}

std::vector<std::string> NamesOf(const OptionTable& table) {
  std::vector<std::string> names;
  for (const Option& option : table) names.push_back(option.name);
  return names;
}

void AddCondition(const OptionCondition& condition, const std::vector<std::string>& names,
                  OptionTable* table) {
  for (const std::string& name : names) {
    const auto is_named = [&](const Option& option) { return option.name == name; };
    std::find_if(table->begin(), table->end(), is_named)->only_where.push_back(condition);
  }
}

std::string ValuesText(const Option& option) {
  if (!option.choices.empty()) return fmt::format("{}", fmt::join(option.choices, ", "));
  const std::string words = WordsText(option);
  if (std::isfinite(option.min) && std::isfinite(option.max))
    return fmt::format("{}{:g} to {:g}", words, option.min, option.max);
  if (std::isfinite(option.min)) return fmt::format("{}at least {:g}", words, option.min);
  if (std::isfinite(option.max)) return fmt::format("{}at most {:g}", words, option.max);
  return std::holds_alternative<bool*>(option.value) ? "true, false" : "";
}

Status CheckIsRead(const Option& option, const OptionTable& table) {
  const auto shown = [](const std::string& value) { return value.empty() ? "empty" : value; };
  for (const OptionCondition& condition : option.only_where) {
    for (const Option& other : table) {
      if (other.name != condition.option) continue;
      const std::string value = OptionValueText(other);
      const auto holds = [&](const std::string& allowed) {
        return allowed.starts_with(kNot) ? value != allowed.substr(kNot.size()) : value == allowed;
      };
      if (std::any_of(condition.values.begin(), condition.values.end(), holds)) continue;
      std::string allowed;
      for (const std::string& text : condition.values)
        allowed += (allowed.empty() ? "" : " or ") + shown(text);
      return MakeError(ErrorCode::kInvalidArgument,
                       "{} is only read where {} is {}, and it is {}; leave {} out, or change {}",
                       option.name, other.name, allowed, shown(value), option.name, other.name);
    }
  }
  return Ok();
}

std::string NearestWord(const std::string& word, const std::vector<std::string>& candidates) {
  std::string nearest;
  size_t least =
      std::max<size_t>(2, word.size() / 3) + 1;  // a word that differs in more than a third is not suggested
  for (const std::string& candidate : candidates) {
    std::vector<size_t> row(candidate.size() + 1);  // Levenshtein distance, one row at a time
    std::iota(row.begin(), row.end(), size_t{0});
    for (size_t i = 1; i <= word.size(); ++i) {
      size_t diagonal = row[0];
      row[0] = i;
      for (size_t j = 1; j <= candidate.size(); ++j) {
        const size_t substitute = diagonal + (word[i - 1] != candidate[j - 1]);
        diagonal = row[j];
        row[j] = std::min({substitute, row[j] + 1, row[j - 1] + 1});
      }
    }
    if (row.back() < least) {
      least = row.back();
      nearest = candidate;
    }
  }
  return nearest;
}

}  // namespace cairn
