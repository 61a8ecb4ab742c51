#pragma once

#include <string>
#include <vector>

#include "stages/reconstruct/verdict/verdict.h"

namespace cairn::reconstruct {

// A length of the map, with its unit: "12.3 m", "12.3 units".
std::string LengthText(const Verdict& verdict, double length);

// Is it whole?  One sentence, without a full stop.
std::string WholeText(const Verdict& verdict);

// The sentence above, then where and how: loops, the weakest places, what is not joined; each a line.
std::vector<std::string> VerdictLines(const Verdict& verdict);

}  // namespace cairn::reconstruct
