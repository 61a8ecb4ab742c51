#pragma once

#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cairn {

// Words of a line, split at white space.
std::vector<std::string> SplitWords(std::string_view line);

// Fields of a line between separators ("a, ,b" at ',' gives "a", "", "b"), without white space at their ends.
std::vector<std::string> SplitFields(std::string_view line, char separator);

// Text without white space at its ends.
std::string_view Trim(std::string_view text);

// Lines of a text without their ends ("\n" or "\r\n").  A last line without an end counts.
std::vector<std::string_view> SplitLines(std::string_view text);

// Whether the whole of `text` is a number of this type, then in `value`.  The locale does not matter.
template <typename T>
bool ParseNumber(std::string_view text, T* value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *value);
  return error == std::errc() && end == text.data() + text.size();
}

// The numbers between commas: "1, 2.5" is {1, 2.5}.  Nothing where one is missing, or is not a finite number.
std::optional<std::vector<double>> ParseNumbers(std::string_view text);

// Indices in the natural order of their names: digits compare by value ("2.jpg" before "10.jpg").
std::vector<int> NaturalOrder(const std::vector<std::string>& names);

}  // namespace cairn
