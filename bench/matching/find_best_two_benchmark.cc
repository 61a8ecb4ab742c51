// Multiply-adds a second of each matching kernel on packed descriptors of RootSIFT's norm, and descriptors
// packed a second.  The best two of rows and of columns come from the same sweep: the mutual check is
// included.  No data needed; compare_matchers.sh holds the kernels against their peers.
#include <benchmark/benchmark.h>

#include "bench/matching/random_descriptors.h"
#include "core/base/pooled.h"
#include "core/features/descriptor_matcher.h"

namespace cairn {
namespace {

bool SkipIfUnsupported(MatchKernel kernel, benchmark::State& state) {
  if (!IsKernelSupported(kernel)) state.SkipWithError("this processor lacks the instructions");
  return !IsKernelSupported(kernel);
}

void BM_FindBestTwo(benchmark::State& state, MatchKernel kernel) {
  if (SkipIfUnsupported(kernel, state)) return;
  const int num = static_cast<int>(state.range(0));
  const PackedDescriptors descriptors1(RandomDescriptors(num, 1), {}, kernel);
  const PackedDescriptors descriptors2(RandomDescriptors(num, 2), {}, kernel);
  PooledVector<BestTwo> rows, columns;
  for (auto _ : state) {
    FindBestTwo(descriptors1, descriptors2, &rows, &columns);
    benchmark::DoNotOptimize(rows.data());
  }
  const double num_multiply_adds =
      1.0 * num * num * kSiftDescriptorDim * static_cast<double>(state.iterations());
  state.counters["multiply_adds/s"] = benchmark::Counter(num_multiply_adds, benchmark::Counter::kIsRate);
}

void BM_Pack(benchmark::State& state, MatchKernel kernel) {
  if (SkipIfUnsupported(kernel, state)) return;
  const DescriptorMatrix descriptors = RandomDescriptors(static_cast<int>(state.range(0)), 1);
  for (auto _ : state) {
    const PackedDescriptors packed(descriptors, {}, kernel);
    benchmark::DoNotOptimize(packed.size());
  }
  state.SetItemsProcessed(state.range(0) * state.iterations());
}

void RegisterAll() {
  for (const MatchKernel kernel : kMatchKernels) {
    const std::string name(NameOf(kernel));
    benchmark::RegisterBenchmark(("BM_FindBestTwo/" + name).c_str(), BM_FindBestTwo, kernel)
        ->Arg(1000)
        ->Arg(4000)
        ->Arg(8000);
    benchmark::RegisterBenchmark(("BM_Pack/" + name).c_str(), BM_Pack, kernel)->Arg(4000);
  }
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  cairn::RegisterAll();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
