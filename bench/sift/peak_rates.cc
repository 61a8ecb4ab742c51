#include "bench/sift/peak_rates.h"

#include <algorithm>
#include <ctime>
#include <functional>

namespace cairn {
namespace {

constexpr int kNumTries = 15;

double BestSeconds(const std::function<void()>& work) {
  const auto now = [] {
    timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  };
  double best = 1e9;
  for (int i = 0; i < kNumTries; ++i) {
    const double start = now();
    work();
    best = std::min(best, now() - start);
  }
  return best;
}

constexpr int kNumSums = 12;  // more than the latency of a sum times the sums a cycle
constexpr int kNumSteps = 1000000;
volatile float sink;

// A product and a sum, not fused.  The assembler statement keeps the compiler from computing less; `place` is
// its word for a register.
#define CAIRN_SUM_PRODUCTS(lanes, place)                          \
  using Vector = float __attribute__((vector_size(4 * (lanes)))); \
  Vector sums[kNumSums] = {};                                     \
  Vector factor = Vector{} + 0.999f, term = Vector{} + 0.001f;    \
  for (int i = 0; i < kNumSteps; ++i) {                           \
    for (Vector & sum : sums) {                                   \
      Vector product = sum * factor;                              \
      __asm__("" : "+" place(product));                           \
      sum = product + term;                                       \
    }                                                             \
  }                                                               \
  for (const Vector& sum : sums) sink = sum[0];

#if defined(__x86_64__)
void SumProducts4() { CAIRN_SUM_PRODUCTS(4, "x") }
__attribute__((target("avx2"))) void SumProducts8() { CAIRN_SUM_PRODUCTS(8, "x") }
__attribute__((target("avx512f"))) void SumProducts16() { CAIRN_SUM_PRODUCTS(16, "v") }
#else
void SumProducts4() { CAIRN_SUM_PRODUCTS(4, "w") }
#endif

}  // namespace

std::vector<PeakRate> PeakArithmetic() {
  const auto rate = [](int lanes, const std::function<void()>& work) {
    return 2e-9 * lanes * kNumSums * kNumSteps / BestSeconds(work);
  };
  std::vector<PeakRate> rates{{"4 floats", rate(4, SumProducts4)}};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) rates.push_back({"8 floats", rate(8, SumProducts8)});
  if (__builtin_cpu_supports("avx512f")) rates.push_back({"16 floats", rate(16, SumProducts16)});
#endif
  return rates;
}

std::vector<PeakRate> PeakMemory() {
  std::vector<PeakRate> rates;
  for (const int kib : {8, 256, 4096, 65536}) {
    const int num = kib * 256;
    std::vector<float> a(num, 1.0f), b(num, 2.0f), c(num, 3.0f);
    const int num_rounds = std::max(1, 30000000 / num);
    const double seconds = BestSeconds([&] {
      for (int round = 0; round < num_rounds; ++round) {
        for (int i = 0; i < num; ++i) a[i] = b[i] + 0.5f * c[i];
        __asm__ volatile("" ::: "memory");
      }
    });
    rates.push_back({"3 x " + std::to_string(kib) + " KiB", 12e-9 * num * num_rounds / seconds});
  }
  return rates;
}

}  // namespace cairn
