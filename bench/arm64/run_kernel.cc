// Features of an image, or matches of two sets of descriptors, by one kernel, so that an emulator can count
// the instructions (count_instructions.py):
//   run_kernel sift KERNEL IMAGE TIMES     640 x 480 px around the image's middle
//   run_kernel match KERNEL NUM TIMES      NUM random descriptors with as many others, packed before
//   run_kernel kernels                     the names of those that this processor can run
#include <cstdio>
#include <cstdlib>
#include <string>

#include <opencv2/imgcodecs.hpp>

#include "bench/matching/random_descriptors.h"
#include "core/features/descriptor_matcher.h"
#include "core/features/sift.h"
#include "core/sift/find_sift.h"

namespace cairn {
namespace {

const cv::Size kSize(640, 480);

int FindFeatures(const std::string& kernel, const std::string& path, int times) {
  cv::Mat image = cv::imread(path, cv::IMREAD_GRAYSCALE);
  if (image.cols < kSize.width || image.rows < kSize.height) {
    std::fprintf(stderr, "%s: no image of at least %d x %d px\n", path.c_str(), kSize.width, kSize.height);
    return 3;
  }
  image = image({{(image.cols - kSize.width) / 2, (image.rows - kSize.height) / 2}, kSize}).clone();
  for (const SiftKernels* kernels : UsableSiftKernels()) {
    if (kernels->name != kernel) continue;
    size_t num = 0;
    const SiftSearch search{.max_num_features = SiftOptions().max_num_features};
    for (int i = 0; i < times; ++i) num = FindSift(image, {}, search, *kernels).size();
    std::printf("%zu features\n", num);
    return 0;
  }
  return 2;
}

int Match(const std::string& name, int num, int times) {
  for (const MatchKernel kernel : kMatchKernels) {
    if (NameOf(kernel) != name || !IsKernelSupported(kernel)) continue;
    const PackedDescriptors descriptors1(RandomDescriptors(num, 1), {}, kernel);
    const PackedDescriptors descriptors2(RandomDescriptors(num, 2), {}, kernel);
    size_t num_matches = 0;
    for (int i = 0; i < times; ++i)
      num_matches = MatchDescriptors(descriptors1, descriptors2, {.max_ratio = 1}).size();
    std::printf("%zu matches\n", num_matches);
    return 0;
  }
  return 2;
}

int PrintKernels() {
  for (const SiftKernels* kernels : UsableSiftKernels()) std::printf("sift %s\n", kernels->name);
  for (const MatchKernel kernel : kMatchKernels) {
    if (IsKernelSupported(kernel)) std::printf("match %s\n", std::string(NameOf(kernel)).c_str());
  }
  return 0;
}

int Main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  if (what == "kernels") return PrintKernels();
  if (argc == 5 && what == "sift") return FindFeatures(argv[2], argv[3], std::atoi(argv[4]));
  if (argc == 5 && what == "match") return Match(argv[2], std::atoi(argv[3]), std::atoi(argv[4]));
  std::fprintf(stderr, "usage: run_kernel sift|match KERNEL IMAGE|NUM TIMES, or run_kernel kernels\n");
  return 2;
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) { return cairn::Main(argc, argv); }
