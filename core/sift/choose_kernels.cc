#include "core/sift/choose_kernels.h"

namespace cairn {

std::vector<const SiftKernels*> UsableSiftKernels() {
  std::vector<const SiftKernels*> usable{&kSiftPortable};
#if defined(__x86_64__)
  // What the files are compiled for, see CMakeLists.txt; asks the system too whether it saves the registers.
  if (__builtin_cpu_supports("avx2")) usable.push_back(&kSiftAvx2);
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")) {
    usable.push_back(&kSiftAvx512);
  }
#elif defined(__aarch64__)
  usable.push_back(&kSiftNeon);
#endif
  return usable;
}

const SiftKernels& BestSiftKernels() {
  static const SiftKernels& best = *UsableSiftKernels().back();
  return best;
}

}  // namespace cairn
