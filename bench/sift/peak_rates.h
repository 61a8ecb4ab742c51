#pragma once

#include <string>
#include <vector>

namespace cairn {

// What one core of this machine reaches, the best of several tries of processor time.
struct PeakRate {
  std::string what;
  double per_second = 0;  // operations or bytes, in billions
};

// Sums of products in registers, a product and a sum being two operations, for each width of register.
std::vector<PeakRate> PeakArithmetic();

// Bytes of a = b + 0.5 c, two read and one written, with arrays that fit the caches, or do not.
std::vector<PeakRate> PeakMemory();

}  // namespace cairn
