// Multiply-adds a second of each matching kernel, rows and columns of the same sweep (the mutual check
// included), beside OpenCV's brute-force matcher (one direction only).  All find the same nearest
// descriptors.
#include <benchmark/benchmark.h>
#include <opencv2/core/utility.hpp>
#include <opencv2/features2d.hpp>

#include "core/descriptor_matcher.h"
#include "core/random.h"

namespace cairn {
namespace {

DescriptorMatrix RandomDescriptors(int num, uint64_t seed) {
  Random random(seed);
  DescriptorMatrix descriptors(num, kDescriptorDim);
  for (int i = 0; i < num; ++i) {
    for (int d = 0; d < kDescriptorDim; ++d)
      descriptors(i, d) = static_cast<uint8_t>(random.UniformInt(0, 90));
  }
  return descriptors;
}

void ReportRate(benchmark::State& state) {
  const double num = static_cast<double>(state.range(0));
  state.counters["multiply_adds/s"] = benchmark::Counter(
      num * num * kDescriptorDim * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}

void BM_FindBestTwo(benchmark::State& state, MatchKernel kernel) {
  if (!IsKernelSupported(kernel)) {
    state.SkipWithError("this processor lacks the instructions");
    return;
  }
  const DescriptorMatrix descriptors1 = RandomDescriptors(static_cast<int>(state.range(0)), 1);
  const DescriptorMatrix descriptors2 = RandomDescriptors(static_cast<int>(state.range(0)), 2);
  std::vector<BestTwo> rows, columns;
  for (auto _ : state) {
    FindBestTwo(descriptors1, descriptors2, kernel, &rows, &columns);
    benchmark::DoNotOptimize(rows.data());
  }
  ReportRate(state);
}

void BM_OpenCvBruteForce(benchmark::State& state) {
  cv::setNumThreads(1);
  const DescriptorMatrix descriptors1 = RandomDescriptors(static_cast<int>(state.range(0)), 1);
  const DescriptorMatrix descriptors2 = RandomDescriptors(static_cast<int>(state.range(0)), 2);
  const auto as_float = [](const DescriptorMatrix& descriptors) {
    const cv::Mat bytes(static_cast<int>(descriptors.rows()), kDescriptorDim, CV_8UC1,
                        const_cast<uint8_t*>(descriptors.data()));
    cv::Mat floats;
    bytes.convertTo(floats, CV_32F);
    return floats;
  };
  const cv::Mat floats1 = as_float(descriptors1), floats2 = as_float(descriptors2);
  const cv::BFMatcher matcher(cv::NORM_L2);
  for (auto _ : state) {
    std::vector<std::vector<cv::DMatch>> matches;
    matcher.knnMatch(floats1, floats2, matches, 2);
    benchmark::DoNotOptimize(matches.data());
  }
  ReportRate(state);
}

BENCHMARK_CAPTURE(BM_FindBestTwo, avx512_vnni, MatchKernel::kAvx512Vnni)->Arg(1000)->Arg(4000)->Arg(8000);
BENCHMARK_CAPTURE(BM_FindBestTwo, avx2, MatchKernel::kAvx2)->Arg(1000)->Arg(4000)->Arg(8000);
BENCHMARK_CAPTURE(BM_FindBestTwo, portable, MatchKernel::kPortable)->Arg(1000);
BENCHMARK(BM_OpenCvBruteForce)->Arg(1000)->Arg(4000);

}  // namespace
}  // namespace cairn

BENCHMARK_MAIN();
