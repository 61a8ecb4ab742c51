#pragma once

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/options/options.h"

namespace cairn {

// An option, and its values just within and just beyond its range; "": it has no limit there.
struct OptionLimits {
  std::string name;
  std::string least, too_small;
  std::string most = "", too_large = "";
};

// Whether an option of a stage's default options may have this value.
template <typename Options>
bool MayHave(const std::string& name, const std::string& text) {
  Options options;
  const OptionTable table = DescribeOptions(&options);
  for (const Option& option : table) {
    if (option.name == name) return SetOption(option, text).ok() && CheckOptions(table).ok();
  }
  ADD_FAILURE() << "no option " << name;
  return false;
}

template <typename Options>
void ExpectLimits(const std::vector<OptionLimits>& limits) {
  for (const OptionLimits& of : limits) {
    EXPECT_TRUE(MayHave<Options>(of.name, of.least)) << of.name << " = " << of.least;
    EXPECT_FALSE(MayHave<Options>(of.name, of.too_small)) << of.name << " = " << of.too_small;
    if (of.most.empty()) continue;
    EXPECT_TRUE(MayHave<Options>(of.name, of.most)) << of.name << " = " << of.most;
    EXPECT_FALSE(MayHave<Options>(of.name, of.too_large)) << of.name << " = " << of.too_large;
  }
}

}  // namespace cairn
