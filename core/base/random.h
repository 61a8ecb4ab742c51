#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

namespace cairn {

// Mixes two numbers into a seed (splitmix64's finaliser), for an independent stream per item:
// Random(MixSeed(seed, i)).
inline uint64_t MixSeed(uint64_t seed, uint64_t stream) {
  uint64_t z = seed + 0x9e3779b97f4a7c15ull * (stream + 1);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

// Random numbers that are the same with every standard library: the engine is specified by the standard, the
// distributions are our own.  A stream is cheap to make again from its seed.  Not for cryptography.
class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}

  uint64_t Bits() { return engine_(); }
  // Uniform in [0, 1), 53 bits.
  double Uniform() { return static_cast<double>(engine_() >> 11) * 0x1.0p-53; }
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }
  // Uniform integer in [low, high].  REQUIRES: low <= high
  int64_t UniformInt(int64_t low, int64_t high) {
    const uint64_t span = static_cast<uint64_t>(high - low) + 1;
    return low + static_cast<int64_t>(span == 0 ? engine_() : engine_() % span);
  }
  // Normal with mean and standard deviation (Box-Muller, one value a call).
  double Normal(double mean, double sigma) {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform()));
    return mean + sigma * radius * std::cos(2.0 * std::numbers::pi * Uniform());
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace cairn
