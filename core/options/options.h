#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "core/base/error.h"

namespace cairn {

// The condition that an option has one of these values, as OptionValueText writes them; "not X": any but X.
struct OptionCondition {
  std::string option;
  std::vector<std::string> values;
};

// One field of a stage's options struct, described once: --help, the recipe's table, its reference page and
// the range check are all made from this.
struct Option {
  std::string name;  // the field's name, snake_case, unit as suffix
  std::variant<bool*, int*, double*, std::string*, std::vector<double>*> value;
  std::string help;  // one sentence, with the unit and the source's value
  double min = -std::numeric_limits<double>::infinity();  // numbers: inclusive range
  double max = std::numeric_limits<double>::infinity();
  std::vector<std::string> choices;  // strings: the allowed values; empty = any
  // Where the other options have other values, this one has no effect: it is then refused on the command
  // line, and a warning is given for it in a recipe.
  std::vector<OptionCondition> only_where = {};
  // Numbers (double): words that stand for values, which may lie outside of the range: "auto" for -1.
  std::vector<std::pair<std::string, double>> words = {};
};
using OptionTable = std::vector<Option>;

// Sets an option from its text ("16", "true", "frustum", "0,0,1").
// Errors: InvalidArgument, naming the option, what was found, and the range or choices.
Status SetOption(const Option& option, const std::string& text);
// Value as text, in the form that SetOption reads.
std::string OptionValueText(const Option& option);
// Errors: InvalidArgument for the first value outside of its range or choices.
Status CheckOptions(const OptionTable& table);

std::vector<std::string> NamesOf(const OptionTable& table);
// Adds a condition to options of the table.  REQUIRES: the table has all of them
void AddCondition(const OptionCondition& condition, const std::vector<std::string>& names,
                  OptionTable* table);
// The words of an option, and its range, as documents say them: "auto, or 0 to 0.5"; empty where any value
// will do.
std::string ValuesText(const Option& option);
// Whether this option of the table has an effect, by its conditions.  Errors: InvalidArgument, naming the
// condition that does not hold.
Status CheckIsRead(const Option& option, const OptionTable& table);

// Sets options from the keys of a TOML file (a stage's options file: one table, no headers).
// Errors: NotFound, Corrupt (not TOML; line), InvalidArgument (unknown key, with the nearest valid one;
// wrong type).
Status ReadOptionsFile(const std::string& path, const OptionTable& table);
// The table as a TOML document, every key with its value in the table's order.  Canonical: equal options give
// equal bytes.
std::string OptionsToml(const OptionTable& table);

// Of `candidates`, the one with the least edit distance to `word`; empty when none is near.
std::string NearestWord(const std::string& word, const std::vector<std::string>& candidates);

}  // namespace cairn
