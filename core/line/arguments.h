#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace cairn {

// The heading of options that --help leaves out and --help-all shows.
inline constexpr char kMoreOptionsHeading[] = "More options";

// A positional or an option while its command is described, and whether it was given once the command line is
// parsed.  A handle: copies mean the same argument.
class Argument {
 public:
  explicit Argument(CLI::Option* option) : option_(option) {}

  Argument Required() const;
  // What --help calls the value: "FILE", "X,Y".
  Argument Type(const std::string& name) const;
  // A number in [least, most].
  Argument Range(int least, int most) const;
  Argument Range(double least, double most) const;
  Argument NonNegative() const;
  // Type("WORD"), too.
  Argument OneOf(const std::vector<std::string>& words) const;
  // A whole number of at least `least`, without a sign: CLI11 itself reads -1 as the largest one.
  Argument WholeNumber(uint64_t least) const;
  // A list of this many values, or of values separated by commas.
  Argument Values(int count) const;
  Argument SeparatedByCommas() const;
  // Takes one value each time it is given.
  Argument OneAtATime() const;
  Argument Excludes(const Argument& other) const;
  // --help shows the value that the variable has now.
  Argument ShowDefault() const;
  // The heading that it stands under in --help.
  Argument Group(const std::string& heading) const;
  // Puts it under kMoreOptionsHeading.
  Argument OnlyInHelpAll() const;

  bool IsGiven() const;

 private:
  CLI::Option* option_;
};

// The arguments of one command.  CLI11 parses them; it is hidden here so that commands compile without it.
class ArgumentParser {
 public:
  explicit ArgumentParser(CLI::App& app) : app_(app) {}

  // "map" is a positional, "-o,--output" an option.  `value` outlives the parsing; it keeps what it has where
  // the argument is not given.  Value: a string, an optional one, a number, or a vector of strings or
  // doubles.
  template <class Value>
  Argument Add(const std::string& names, Value& value, const std::string& help);
  // An option without a value.
  Argument AddFlag(const std::string& names, bool& value, const std::string& help);

 private:
  CLI::App& app_;
};

}  // namespace cairn
