// Milliseconds of SIFT, ours and OpenCV's, on the same images in the same run, one core, and how far the two
// agree.
//
//   compare_sift IMAGE...            prints tables in Markdown: times, parts, agreement
//   compare_sift write FILE IMAGE... writes OpenCV's features with this process's instruction set
//   compare_sift with FILE IMAGE...  compares them with OpenCV's in this process and with ours
//   compare_sift peak                what one core reaches in arithmetic and in memory
//
// Images are cut, after scaling, to 640 x 480 and 1024 x 768 px.
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

#include <opencv2/core/utility.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "bench/sift/peak_rates.h"
#include "core/base/quantiles.h"
#include "core/features/sift.h"
#include "core/sift/find_sift.h"

namespace cairn {
namespace {

constexpr int kNumRuns = 15;
const cv::Size kSizes[] = {{640, 480}, {1024, 768}};

cv::Mat ReadImage(const std::string& path, cv::Size size) {
  const cv::Mat whole = cv::imread(path, cv::IMREAD_GRAYSCALE);
  if (whole.empty()) {
    std::fprintf(stderr, "%s: no image\n", path.c_str());
    std::exit(3);
  }
  const double scale =
      std::max(static_cast<double>(size.width) / whole.cols, static_cast<double>(size.height) / whole.rows);
  const cv::Size scaled(std::max(size.width, cvRound(scale * whole.cols)),
                        std::max(size.height, cvRound(scale * whole.rows)));
  cv::Mat image;
  cv::resize(whole, image, scaled, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  return image(cv::Rect({0, 0}, size)).clone();
}

cv::Ptr<cv::SIFT> OpenCvSift(double contrast_threshold = 0.02) {
  return cv::SIFT::create(SiftOptions().max_num_features, 3, contrast_threshold, 10, 1.6, CV_32F);
}

double CpuMs() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

struct Task {
  std::string name;
  std::function<void(const cv::Mat&)> run;
  std::vector<double> ms;  // medians of the images
};

// Each image by all tasks in turn, so that what else the machine does meets them alike.
void Time(const std::vector<cv::Mat>& images, std::vector<Task>* tasks) {
  for (const cv::Mat& image : images) {
    std::vector<std::vector<double>> ms(tasks->size());
    for (int run = 0; run < kNumRuns; ++run) {
      for (size_t t = 0; t < tasks->size(); ++t) {
        const double start = CpuMs();
        (*tasks)[t].run(image);
        ms[t].push_back(CpuMs() - start);
      }
    }
    for (size_t t = 0; t < tasks->size(); ++t) (*tasks)[t].ms.push_back(Median(ms[t]));
  }
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

// A picture's pyramid by OpenCV's functions, as its SIFT calls them: blurs, and then the differences.
void OpenCvPyramid(const cv::Mat& image, bool with_differences) {
  cv::Mat grey, doubled;
  image.convertTo(grey, CV_32F);
  cv::resize(grey, doubled, grey.size() * 2, 0, 0, cv::INTER_LINEAR);
  std::vector<cv::Mat> levels(1);
  cv::GaussianBlur(doubled, levels[0], {}, std::sqrt(1.6 * 1.6 - 1));
  while (std::min(levels.back().cols, levels.back().rows) > 10) {
    const size_t first = levels.size() - 1;
    for (int l = 1; l < kSiftLevels; ++l) {
      cv::Mat next;
      cv::GaussianBlur(levels.back(), next, {},
                       1.6 * std::pow(2, (l - 1) / 3.0) * std::sqrt(std::pow(2, 2 / 3.0) - 1));
      levels.push_back(next);
    }
    cv::Mat half;
    const cv::Mat& from = levels[first + kSiftLayers];
    cv::resize(from, half, from.size() / 2, 0, 0, cv::INTER_NEAREST);
    levels.push_back(half);
  }
  if (!with_differences) return;
  std::vector<cv::Mat> differences(levels.size());
  for (size_t i = 1; i < levels.size(); ++i) {
    if (levels[i].size() == levels[i - 1].size()) cv::subtract(levels[i], levels[i - 1], differences[i]);
  }
}

void FindOurs(const cv::Mat& image, const SiftKernels& kernels, const SiftSearch& search) {
  FindSift(image, {}, search, kernels);
}

std::vector<Task> Tasks() {
  const SiftSearch all{.max_num_features = SiftOptions().max_num_features};
  SiftSearch none = all, region = all, coarse = all;
  none.contrast_threshold = 1;  // the pyramid and the search, and next to nothing to describe
  coarse.first_octave = 1;
  const auto opencv = [](const cv::Mat& image) {
    std::vector<cv::KeyPoint> keypoints;
    cv::Mat descriptors;
    OpenCvSift()->detectAndCompute(image, {}, keypoints, descriptors);
  };
  std::vector<Task> tasks{
      {"OpenCV 4.6", opencv, {}},
      {"OpenCV, its blurs alone", [](const cv::Mat& i) { OpenCvPyramid(i, false); }, {}},
      {"OpenCV, blurs and differences", [](const cv::Mat& i) { OpenCvPyramid(i, true); }, {}},
      {"OpenCV, keypoints without descriptors",
       [](const cv::Mat& image) {
         std::vector<cv::KeyPoint> keypoints;
         OpenCvSift()->detect(image, keypoints);
       },
       {}}};
  for (const SiftKernels* kernels : UsableSiftKernels()) {
    const std::string name = std::string("cairn, ") + kernels->name;
    tasks.push_back({name, [=](const cv::Mat& i) { FindOurs(i, *kernels, all); }, {}});
    tasks.push_back(
        {name + ", pyramid and search", [=](const cv::Mat& i) { FindOurs(i, *kernels, none); }, {}});
  }
  tasks.push_back({"cairn, without the first octave",
                   [=](const cv::Mat& i) { FindOurs(i, BestSiftKernels(), coarse); },
                   {}});
  tasks.push_back({"cairn, not doubled",
                   [=](const cv::Mat& i) { FindOurs(i, BestSiftKernels(), {.doubled = false}); },
                   {}});
  tasks.push_back(
      {"cairn, not doubled, without the first octave",
       [=](const cv::Mat& i) { FindOurs(i, BestSiftKernels(), {.doubled = false, .first_octave = 1}); },
       {}});
  tasks.push_back({"cairn, not doubled, the first octave in a fifth of the image",
                   [=](const cv::Mat& i) {
                     const auto is_wanted = [](float x, float, float) { return std::fmod(x, 50.0f) < 10; };
                     FindOurs(i, BestSiftKernels(),
                              {.doubled = false, .end_octave = 1, .is_wanted = is_wanted});
                   },
                   {}});
  for (const int side : {64, 160}) {
    region.region = cv::Rect(240, 160, side, side);
    region.end_octave = 3;
    tasks.push_back({"cairn, " + std::to_string(side) + " x " + std::to_string(side) + " px, three octaves",
                     [=](const cv::Mat& i) { FindOurs(i, BestSiftKernels(), region); },
                     {}});
  }
  return tasks;
}

// Additions and multiplications of the blurs, the first of the doubled image included: of each value, 3
// radius
// + 1 for either direction.
double BlurOperations(cv::Size size) {
  double operations = 4.0 * size.area() * 2 * (3 * 5 + 1);
  for (size = size * 2; std::min(size.width, size.height) > 10; size = size / 2) {
    for (const int radius : {5, 6, 8, 10, 13}) operations += 2.0 * size.area() * (3 * radius + 1);
  }
  return operations;
}

// Bytes if each value is read once and written once for each blur that it goes through.
double BlurBytes(cv::Size size) {
  double bytes = 8.0 * 4 * size.area();
  for (size = size * 2; std::min(size.width, size.height) > 10; size = size / 2)
    bytes += 5 * 8.0 * size.area();
  return bytes;
}

void PrintTimes(const std::vector<std::string>& paths) {
  cv::setNumThreads(1);
  // In OpenCV's favour: its pyramid's pages are not given back to the system, to be cleared for each image.
  mallopt(M_TRIM_THRESHOLD, 2000000000);
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  for (const cv::Size size : kSizes) {
    std::vector<cv::Mat> images;
    for (const std::string& path : paths) images.push_back(ReadImage(path, size));
    std::vector<Task> tasks = Tasks();
    Time(images, &tasks);
    const double opencv = Mean(tasks[0].ms);
    std::printf(
        "\n| %d x %d px | ms, mean of the images | times as fast | blurs: Gflop/s | GB/s "
        "|\n|---|--:|--:|--:|--:|\n",
        size.width, size.height);
    for (const Task& task : tasks) {
      const double ms = Mean(task.ms);
      std::printf("| %s | %.1f | %.2f | ", task.name.c_str(), ms, opencv / ms);
      if (task.name.ends_with("search") || task.name.ends_with("alone"))
        std::printf("%.0f | %.1f |\n", 1e-6 * BlurOperations(size) / ms, 1e-6 * BlurBytes(size) / ms);
      else
        std::printf("| |\n");
    }
  }
}

struct PeerFeature {
  float x, y, size, angle_deg;
  uint8_t root_sift[kSiftDim];
};

std::vector<PeerFeature> OpenCvFeatures(const cv::Mat& image) {
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  cv::SIFT::create(0, 3, 0.02, 10, 1.6, CV_32F)->detectAndCompute(image, {}, keypoints, descriptors);
  std::vector<PeerFeature> features;
  for (size_t i = 0; i < keypoints.size(); ++i) {
    const cv::KeyPoint& k = keypoints[i];
    PeerFeature feature{k.pt.x, k.pt.y, k.size, k.angle, {}};
    const float* sift = descriptors.ptr<float>(static_cast<int>(i));
    double l1 = 0;
    for (int d = 0; d < kSiftDim; ++d) l1 += sift[d];
    for (int d = 0; d < kSiftDim; ++d)
      feature.root_sift[d] = static_cast<uint8_t>(std::min(255.0, std::round(512 * std::sqrt(sift[d] / l1))));
    features.push_back(feature);
  }
  return features;
}

std::vector<PeerFeature> OurFeatures(const cv::Mat& image) {
  std::vector<PeerFeature> features;
  for (const SiftFeature& f : FindSift(image, {}, {})) {
    features.push_back({f.x, f.y, f.size, f.angle_deg, {}});
    std::copy(f.root_sift.begin(), f.root_sift.end(), features.back().root_sift);
  }
  return features;
}

struct Agreement {
  int num = 0, num_found = 0, num_equal = 0;
  std::vector<double> distances;  // of descriptors of length 512
};

// Features of `a` with one of `b` within 0.05 px, 1 % and 1 degree.
void Compare(const std::vector<PeerFeature>& a, const std::vector<PeerFeature>& b, Agreement* agreement) {
  for (const PeerFeature& f : a) {
    ++agreement->num;
    double least = 1e9;
    for (const PeerFeature& g : b) {
      const double turn = std::abs(f.angle_deg - g.angle_deg);
      if (std::hypot(f.x - g.x, f.y - g.y) > 0.05 || std::abs(f.size / g.size - 1) > 0.01 ||
          std::min(turn, 360 - turn) > 1)
        continue;
      double squared = 0;
      for (int d = 0; d < kSiftDim; ++d) squared += std::pow(f.root_sift[d] - g.root_sift[d], 2);
      least = std::min(least, std::sqrt(squared));
    }
    if (least == 1e9) continue;
    ++agreement->num_found;
    agreement->num_equal += least == 0;
    agreement->distances.push_back(least);
  }
}

void PrintAgreement(const char* name, const Agreement& agreement) {
  std::printf("| %s | %d | %.2f %% | %.1f %% | %.2f | %.2f |\n", name, agreement.num,
              100.0 * agreement.num_found / agreement.num, 100.0 * agreement.num_equal / agreement.num,
              Mean(agreement.distances), Quantile(agreement.distances, 0.99));
}

void WriteOpenCv(const char* file, const std::vector<std::string>& paths) {
  std::FILE* out = std::fopen(file, "wb");
  for (const std::string& path : paths) {
    const std::vector<PeerFeature> features = OpenCvFeatures(ReadImage(path, kSizes[0]));
    const size_t num = features.size();
    std::fwrite(&num, sizeof(num), 1, out);
    std::fwrite(features.data(), sizeof(PeerFeature), num, out);
  }
  std::fclose(out);
}

void CompareWith(const char* file, const std::vector<std::string>& paths) {
  std::FILE* in = std::fopen(file, "rb");
  Agreement of_opencv, of_ours, to_ours;
  for (const std::string& path : paths) {
    size_t num = 0;
    if (in == nullptr || std::fread(&num, sizeof(num), 1, in) != 1) std::exit(3);
    std::vector<PeerFeature> written(num);
    if (std::fread(written.data(), sizeof(PeerFeature), num, in) != num) std::exit(3);
    const cv::Mat image = ReadImage(path, kSizes[0]);
    const std::vector<PeerFeature> opencv = OpenCvFeatures(image), ours = OurFeatures(image);
    Compare(written, opencv, &of_opencv);
    Compare(ours, opencv, &of_ours);
    Compare(opencv, ours, &to_ours);
  }
  std::fclose(in);
  std::printf(
      "| features of | number | found | of equal descriptor | mean distance | 99 %% "
      "|\n|---|--:|--:|--:|--:|--:|\n");
  PrintAgreement("OpenCV with the file's instruction set, in OpenCV's", of_opencv);
  PrintAgreement("cairn, in OpenCV's", of_ours);
  PrintAgreement("OpenCV, in cairn's", to_ours);
}

void PrintPeaks() {
  for (const PeakRate& rate : PeakArithmetic())
    std::printf("%s: %.0f Gflop/s\n", rate.what.c_str(), rate.per_second);
  for (const PeakRate& rate : PeakMemory())
    std::printf("%s: %.0f GB/s\n", rate.what.c_str(), rate.per_second);
}

int Run(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  if (what == "peak") {
    PrintPeaks();
  } else if ((what == "write" || what == "with") && argc > 3) {
    (what == "write" ? WriteOpenCv : CompareWith)(argv[2], {argv + 3, argv + argc});
  } else if (argc > 1) {
    PrintTimes({argv + 1, argv + argc});
  } else {
    std::fprintf(stderr, "usage: compare_sift [write FILE | with FILE] IMAGE... | peak\n");
    return 2;
  }
  return 0;
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) { return cairn::Run(argc, argv); }
