#include "core/line/arguments.h"

#include <limits>
#include <optional>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "core/base/text.h"

namespace cairn {

Argument Argument::Required() const { return Argument(option_->required()); }

Argument Argument::Type(const std::string& name) const { return Argument(option_->type_name(name)); }

Argument Argument::Range(int least, int most) const {
  return Argument(option_->check(CLI::Range(least, most)));
}

Argument Argument::Range(double least, double most) const {
  return Argument(option_->check(CLI::Range(least, most)));
}

Argument Argument::NonNegative() const { return Argument(option_->check(CLI::NonNegativeNumber)); }

Argument Argument::OneOf(const std::vector<std::string>& words) const {
  return Argument(option_->check(CLI::IsMember(words))->type_name("WORD"));
}

Argument Argument::WholeNumber(uint64_t least) const {
  return Argument(option_->check([least](const std::string& text) {
    uint64_t number = 0;
    if (ParseNumber(text, &number) && number >= least) return std::string();
    return fmt::format("'{}': expected a whole number of {} to {}", text, least,
                       std::numeric_limits<uint64_t>::max());
  }));
}

Argument Argument::Values(int count) const { return Argument(option_->expected(count)); }

Argument Argument::SeparatedByCommas() const { return Argument(option_->delimiter(',')); }

Argument Argument::OneAtATime() const { return Argument(option_->allow_extra_args(false)); }

Argument Argument::Excludes(const Argument& other) const {
  return Argument(option_->excludes(other.option_));
}

Argument Argument::ShowDefault() const { return Argument(option_->capture_default_str()); }

Argument Argument::Group(const std::string& heading) const { return Argument(option_->group(heading)); }

Argument Argument::OnlyInHelpAll() const { return Group(kMoreOptionsHeading); }

bool Argument::IsGiven() const { return option_->count() > 0; }

template <class Value>
Argument ArgumentParser::Add(const std::string& names, Value& value, const std::string& help) {
  return Argument(app_.add_option(names, value, help));
}

template Argument ArgumentParser::Add(const std::string&, std::string&, const std::string&);
template Argument ArgumentParser::Add(const std::string&, std::optional<std::string>&, const std::string&);
template Argument ArgumentParser::Add(const std::string&, int&, const std::string&);
template Argument ArgumentParser::Add(const std::string&, int64_t&, const std::string&);
template Argument ArgumentParser::Add(const std::string&, uint64_t&, const std::string&);
template Argument ArgumentParser::Add(const std::string&, double&, const std::string&);
template Argument ArgumentParser::Add(const std::string&, std::vector<std::string>&, const std::string&);
template Argument ArgumentParser::Add(const std::string&, std::vector<double>&, const std::string&);

Argument ArgumentParser::AddFlag(const std::string& names, bool& value, const std::string& help) {
  return Argument(app_.add_flag(names, value, help));
}

}  // namespace cairn
