#include "core/base/text.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numeric>

namespace cairn {
namespace {

constexpr std::string_view kWhiteSpace = " \t\r\n\v\f";

// Negative, zero, positive: a before, equal to, after b, runs of digits compared by value.
int CompareNaturally(std::string_view a, std::string_view b) {
  const auto take_digits = [](std::string_view* text) {
    size_t length = 0;
    while (length < text->size() && std::isdigit(static_cast<unsigned char>((*text)[length])) != 0) ++length;
    std::string_view digits = text->substr(0, length);
    text->remove_prefix(length);
    digits.remove_prefix(std::min(digits.find_first_not_of('0'), digits.size()));
    return digits;
  };
  while (!a.empty() && !b.empty()) {
    const bool digit_a = std::isdigit(static_cast<unsigned char>(a[0])) != 0;
    const bool digit_b = std::isdigit(static_cast<unsigned char>(b[0])) != 0;
    if (digit_a && digit_b) {
      const std::string_view digits_a = take_digits(&a), digits_b = take_digits(&b);
      if (digits_a.size() != digits_b.size()) return digits_a.size() < digits_b.size() ? -1 : 1;
      if (const int comparison = digits_a.compare(digits_b); comparison != 0) return comparison;
    } else {
      if (a[0] != b[0]) return static_cast<unsigned char>(a[0]) < static_cast<unsigned char>(b[0]) ? -1 : 1;
      a.remove_prefix(1);
      b.remove_prefix(1);
    }
  }
  return static_cast<int>(b.empty()) - static_cast<int>(a.empty());
}

}  // namespace

std::vector<std::string> SplitWords(std::string_view line) {
  std::vector<std::string> words;
  for (size_t begin = line.find_first_not_of(kWhiteSpace); begin != std::string_view::npos;) {
    const size_t end = std::min(line.find_first_of(kWhiteSpace, begin), line.size());
    words.emplace_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kWhiteSpace, end);
  }
  return words;
}

std::vector<std::string> SplitFields(std::string_view line, char separator) {
  std::vector<std::string> fields;
  for (size_t begin = 0; begin <= line.size();) {
    const size_t end = std::min(line.find(separator, begin), line.size());
    fields.emplace_back(Trim(line.substr(begin, end - begin)));
    begin = end + 1;
  }
  return fields;
}

std::string_view Trim(std::string_view text) {
  const size_t begin = text.find_first_not_of(kWhiteSpace);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kWhiteSpace) - begin + 1);
}

std::vector<std::string_view> SplitLines(std::string_view text) {
  std::vector<std::string_view> lines;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    std::string_view line = text.substr(begin, end - begin);
    if (line.ends_with('\r')) line.remove_suffix(1);
    lines.push_back(line);
    begin = end + 1;
  }
  return lines;
}

std::optional<std::vector<double>> ParseNumbers(std::string_view text) {
  std::vector<double> numbers;
  for (const std::string& field : SplitFields(text, ',')) {
    double number = 0;
    if (!ParseNumber(field, &number) || !std::isfinite(number)) return std::nullopt;
    numbers.push_back(number);
  }
  return numbers;
}

std::vector<int> NaturalOrder(const std::vector<std::string>& names) {
  std::vector<int> order(names.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    const int comparison = CompareNaturally(names[a], names[b]);
    return comparison != 0 ? comparison < 0 : a < b;
  });
  return order;
}

}  // namespace cairn
