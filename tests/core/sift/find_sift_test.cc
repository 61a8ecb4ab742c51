#include "core/sift/find_sift.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <thread>

#include <gtest/gtest.h>
#include <opencv2/features2d.hpp>

#include "core/base/pooled.h"
#include "tests/core/sift/sift_pictures.h"

namespace cairn {
namespace {

PooledVector<SiftFeature> Find(const cv::Mat& grey, const SiftSearch& search = {}) {
  return FindSift(grey, {}, search);
}

// OpenCV's own features, in our order.
struct Oracle {
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
};
Oracle OpenCvSift(const cv::Mat& grey) {
  Oracle oracle;
  cv::SIFT::create(0, 3, 0.02, 10, 1.6, CV_32F)
      ->detectAndCompute(grey, {}, oracle.keypoints, oracle.descriptors);
  return oracle;
}

double AngleBetween(double a_deg, double b_deg) {
  const double difference = std::abs(a_deg - b_deg);
  return std::min(difference, 360 - difference);
}

// Distance of two descriptors as unit vectors.
double DescriptorDistance(const SiftFeature& feature, const float* sift) {
  double l1 = 0, dot = 0, norm = 0;
  for (int d = 0; d < kSiftDim; ++d) l1 += sift[d];
  for (int d = 0; d < kSiftDim; ++d) {
    dot += feature.root_sift[d] * std::sqrt(sift[d] / l1);
    norm += feature.root_sift[d] * feature.root_sift[d];
  }
  return std::sqrt(std::max(0.0, 2 - 2 * dot / std::sqrt(norm)));
}

// Features of either side with one of the other within 0.05 px, 1 % of size and 1 degree.
struct Agreement {
  int num_ours = 0;
  int num_theirs = 0;
  int num_ours_found = 0;
  int num_theirs_found = 0;
  double sum_of_distances = 0;  // of the descriptors of those found
};
void Compare(std::span<const SiftFeature> ours, const Oracle& oracle, Agreement* agreement) {
  std::vector<bool> is_found(oracle.keypoints.size());
  for (const SiftFeature& f : ours) {
    for (size_t i = 0; i < oracle.keypoints.size(); ++i) {
      const cv::KeyPoint& k = oracle.keypoints[i];
      if (std::hypot(f.x - k.pt.x, f.y - k.pt.y) > 0.05 || std::abs(f.size / k.size - 1) > 0.01 ||
          AngleBetween(f.angle_deg, k.angle) > 1)
        continue;
      is_found[i] = true;
      ++agreement->num_ours_found;
      agreement->sum_of_distances +=
          DescriptorDistance(f, oracle.descriptors.ptr<float>(static_cast<int>(i)));
      break;
    }
  }
  agreement->num_ours += static_cast<int>(ours.size());
  agreement->num_theirs += static_cast<int>(oracle.keypoints.size());
  agreement->num_theirs_found += static_cast<int>(std::count(is_found.begin(), is_found.end(), true));
}

// Those that differ are at the edge of a threshold or of a histogram's bin: OpenCV's arctangent is exact to
// about 0.01 degrees.
TEST(FindSift, HasTheKeypointsOfOpenCv) {
  Agreement agreement;
  for (const cv::Mat& grey : {RandomBlobs({320, 240}, 400, 1), RandomBlobs({401, 303}, 300, 2),
                              Noise({160, 120}, 3), Checkerboard({320, 240}, 23)})
    Compare(Find(grey), OpenCvSift(grey), &agreement);
  ASSERT_GT(agreement.num_theirs, 1000);
  EXPECT_GE(agreement.num_ours_found, 0.995 * agreement.num_ours);
  EXPECT_GE(agreement.num_theirs_found, 0.995 * agreement.num_theirs);
  EXPECT_LT(agreement.sum_of_distances / agreement.num_ours_found, 0.01);
}

TEST(FindSift, ImagesOfHostileSizesHaveTheKeypointsOfOpenCv) {
  for (const cv::Size size :
       {cv::Size(6, 6), cv::Size(7, 6), cv::Size(11, 13), cv::Size(2000, 7), cv::Size(7, 2000),
        cv::Size(31, 33), cv::Size(65, 17), cv::Size(127, 129), cv::Size(300, 9)}) {
    const cv::Mat grey = Noise(size, 5);
    const Oracle oracle = OpenCvSift(grey);
    Agreement agreement;
    Compare(Find(grey), oracle, &agreement);
    EXPECT_GE(agreement.num_ours_found, 0.99 * agreement.num_ours) << size;
    EXPECT_GE(agreement.num_theirs_found, 0.99 * agreement.num_theirs) << size;
  }
}

TEST(FindSift, ValuesAreFiniteAndInOrder) {
  cv::Mat stripes(90, 120, CV_8UC1, cv::Scalar(0));
  for (int j = 0; j < stripes.cols; j += 4) stripes.colRange(j, j + 2).setTo(255);
  cv::Mat dot(80, 80, CV_8UC1, cv::Scalar(0));
  dot.at<uint8_t>(40, 40) = 255;
  for (const cv::Mat& grey :
       {Noise({200, 150}, 7), stripes, dot, cv::Mat(60, 60, CV_8UC1, cv::Scalar(255))}) {
    const PooledVector<SiftFeature> features = Find(grey);
    for (const SiftFeature& f : features) {
      EXPECT_TRUE(std::isfinite(f.x + f.y + f.size + f.response));
      EXPECT_TRUE(f.angle_deg >= 0 && f.angle_deg < 360) << f.angle_deg;
      EXPECT_GE(f.response, 0.02f / 3);
    }
    EXPECT_TRUE(std::is_sorted(features.begin(), features.end(), [](const auto& a, const auto& b) {
      return std::tie(a.y, a.x, a.size, a.angle_deg) < std::tie(b.y, b.x, b.size, b.angle_deg);
    }));
  }
}

TEST(FindSift, EveryInstructionSetGivesTheSameFeatures) {
  for (const cv::Mat& grey :
       {RandomBlobs({333, 247}, 400, 4), Noise({97, 61}, 1), Checkerboard({200, 300}, 17)}) {
    for (const bool doubled : {true, false}) {
      const PooledVector<SiftFeature> expected = FindSift(grey, {}, {.doubled = doubled}, kSiftPortable);
      EXPECT_GT(expected.size(), 15u);
      for (const SiftKernels* kernels : UsableSiftKernels())
        EXPECT_EQ(FindSift(grey, {}, {.doubled = doubled}, *kernels), expected) << kernels->name;
    }
  }
}

TEST(FindSift, DoesNotDependOnThreadsOrOnImagesBefore) {
  const cv::Mat large = Noise({400, 300}, 1), small = RandomBlobs({150, 130}, 90, 6);
  PooledVector<SiftFeature> expected, after;
  std::thread([&] { expected = Find(small); }).join();
  std::thread([&] {
    Find(large);  // leaves its levels in the thread's memory
    after = Find(small);
  }).join();
  EXPECT_EQ(after, expected);
  std::vector<PooledVector<SiftFeature>> at_once(4);
  std::vector<std::thread> threads;
  for (auto& features : at_once) threads.emplace_back([&] { features = Find(small); });
  for (std::thread& thread : threads) thread.join();
  for (const auto& features : at_once) EXPECT_EQ(features, expected);
  EXPECT_GT(expected.size(), 50u);
}

bool IsIn(const SiftFeature& f, const cv::Rect& region) {
  return f.x >= static_cast<float>(region.x) && f.x < static_cast<float>(region.br().x) &&
         f.y >= static_cast<float>(region.y) && f.y < static_cast<float>(region.br().y);
}

class FindSiftInPart : public testing::TestWithParam<bool> {
 protected:
  const bool doubled_ = GetParam();
};
INSTANTIATE_TEST_SUITE_P(, FindSiftInPart, testing::Bool(),
                         [](const auto& info) { return std::string(info.param ? "Doubled" : "NotDoubled"); });

TEST_P(FindSiftInPart, FeaturesOfARegionAreThoseOfTheWholeImageThere) {
  const cv::Mat grey = RandomBlobs({720, 560}, 2500, 8);
  const PooledVector<SiftFeature> whole = Find(grey, {.doubled = doubled_});
  size_t num_compared = 0;
  for (const cv::Rect region :
       {cv::Rect(300, 250, 60, 40), cv::Rect(0, 0, 100, 90), cv::Rect(601, 401, 119, 159),
        cv::Rect(333, 0, 51, 560), cv::Rect(511, 257, 1, 1), cv::Rect(-9, 200, 50, 33),
        cv::Rect(0, 0, 720, 560), cv::Rect(700, 100, 500, 100)}) {
    for (const auto& [first, end] : {std::pair(0, 99), std::pair(0, 1), std::pair(1, 3), std::pair(2, 99)}) {
      PooledVector<SiftFeature> expected;
      std::copy_if(whole.begin(), whole.end(), std::back_inserter(expected), [&](const SiftFeature& f) {
        return IsIn(f, region) && f.octave >= first && f.octave < end;
      });
      EXPECT_EQ(Find(grey, {.doubled = doubled_, .first_octave = first, .end_octave = end, .region = region}),
                expected)
          << region << " octaves " << first << " to " << end;
      num_compared += expected.size();
    }
  }
  EXPECT_GT(num_compared, 3000u);
  EXPECT_TRUE(Find(grey, {.doubled = doubled_, .region = cv::Rect(720, 0, 50, 50)}).empty());
  EXPECT_TRUE(Find(grey, {.doubled = doubled_, .first_octave = 50}).empty());
  EXPECT_TRUE(Find(grey, {.doubled = doubled_, .end_octave = 0}).empty());
}

// Those whose support is the largest, with nothing computed that they do not need.
TEST_P(FindSiftInPart, FeaturesOfOnePixelAreThoseOfTheWholeImageThere) {
  const cv::Mat grey = RandomBlobs({900, 700}, 3000, 13);
  PooledVector<SiftFeature> whole = Find(grey, {.doubled = doubled_});
  const auto octave_size = [](const SiftFeature& f) { return std::ldexp(f.size, -f.octave); };
  std::stable_sort(whole.begin(), whole.end(), [&](const auto& a, const auto& b) {
    return std::tuple(a.octave, octave_size(b)) < std::tuple(b.octave, octave_size(a));
  });
  for (const int octave : {0, 1, 2, 3}) {
    int num_tried = 0;
    for (const SiftFeature& f : whole) {
      if (f.octave != octave || num_tried >= 20) continue;
      ++num_tried;
      const cv::Rect pixel(static_cast<int>(f.x), static_cast<int>(f.y), 1, 1);
      const PooledVector<SiftFeature> found = Find(
          grey, {.doubled = doubled_, .first_octave = octave, .end_octave = octave + 1, .region = pixel});
      EXPECT_TRUE(std::find(found.begin(), found.end(), f) != found.end()) << f.x << " " << f.y;
    }
    EXPECT_GE(num_tried, 8) << octave;
  }
}

TEST(FindSift, KeepsTheStrongestOfAllAndOfARegion) {
  const cv::Mat grey = RandomBlobs({400, 300}, 500, 9);
  for (const cv::Rect region : {cv::Rect(), cv::Rect(100, 80, 200, 150)}) {
    PooledVector<SiftFeature> all = Find(grey, {.region = region});
    for (const size_t num : {size_t{1}, size_t{17}, all.size() / 2, all.size() - 1, all.size() + 5}) {
      const PooledVector<SiftFeature> found =
          Find(grey, {.max_num_features = static_cast<int>(num), .region = region});
      PooledVector<SiftFeature> expected = all;
      std::stable_sort(expected.begin(), expected.end(),
                       [](const auto& a, const auto& b) { return a.response > b.response; });
      expected.resize(std::min(num, all.size()));
      std::sort(expected.begin(), expected.end(), [](const auto& a, const auto& b) {
        return std::tie(a.y, a.x, a.size, a.angle_deg) < std::tie(b.y, b.x, b.size, b.angle_deg);
      });
      EXPECT_EQ(found, expected) << num;
    }
  }
}

TEST(FindSift, MaskedFeaturesAreDroppedBeforeTheStrongestAreKept) {
  const cv::Mat grey = RandomBlobs({300, 200}, 300, 10);
  cv::Mat mask(grey.size(), CV_8UC1, cv::Scalar(0));
  mask(cv::Rect(150, 0, 150, 200)).setTo(1);
  const PooledVector<SiftFeature> all = Find(grey), right = FindSift(grey, mask, {});
  const auto num_right = std::count_if(all.begin(), all.end(), [](const auto& f) { return f.x >= 149.5f; });
  EXPECT_EQ(static_cast<int64_t>(right.size()), num_right);
  EXPECT_TRUE(std::all_of(right.begin(), right.end(), [](const auto& f) { return f.x >= 149.5f; }));
  EXPECT_EQ(FindSift(grey, mask, {.max_num_features = 20}).size(), 20u);
}

TEST_P(FindSiftInPart, OfAllFeaturesThoseWantedAreTheSameBits) {
  const cv::Mat grey = RandomBlobs({400, 300}, 500, 9);
  const auto is_wanted = [](float x, float y, float size) { return x > 2 * y && size < 5; };
  PooledVector<SiftFeature> expected = Find(grey, {.doubled = doubled_});
  const size_t num_all = expected.size();
  std::erase_if(expected, [&](const SiftFeature& f) { return !is_wanted(f.x, f.y, f.size); });
  EXPECT_EQ(Find(grey, {.doubled = doubled_, .is_wanted = is_wanted}), expected);
  EXPECT_GT(expected.size(), 50u);
  EXPECT_LT(expected.size(), num_all / 2);
  // The strongest are chosen of those.
  EXPECT_EQ(Find(grey, {.max_num_features = 20, .doubled = doubled_, .is_wanted = is_wanted}).size(), 20u);
}

// Of features of the doubled image: how many there are without doubling, within half a pixel, 10 % of size
// and 10 degrees, how far from them on the mean, and with which distance of descriptors.
struct Likeness {
  double found_ratio = 0;
  double x = 0, y = 0;
  double size_ratio = 0;
  double distance = 0;
};
Likeness LikenessWithoutDoubling(const cv::Mat& grey, int first, int end) {
  const SiftSearch search{.first_octave = first, .end_octave = end};
  SiftSearch plain = search;
  plain.doubled = false;
  const PooledVector<SiftFeature> doubled = Find(grey, search), own = Find(grey, plain);
  Likeness likeness;
  int num_found = 0;
  for (const SiftFeature& f : doubled) {
    const auto match = std::find_if(own.begin(), own.end(), [&](const SiftFeature& g) {
      return g.octave == f.octave && std::hypot(g.x - f.x, g.y - f.y) < 0.5 &&
             std::abs(g.size / f.size - 1) < 0.1 && AngleBetween(g.angle_deg, f.angle_deg) < 10;
    });
    if (match == own.end()) continue;
    ++num_found;
    likeness.x += match->x - f.x;
    likeness.y += match->y - f.y;
    likeness.size_ratio += match->size / f.size;
    double squared = 0;
    for (int d = 0; d < kSiftDim; ++d) squared += std::pow(match->root_sift[d] - f.root_sift[d], 2);
    likeness.distance += std::sqrt(squared) / 512;
  }
  for (double* sum : {&likeness.x, &likeness.y, &likeness.size_ratio, &likeness.distance}) *sum /= num_found;
  likeness.found_ratio = static_cast<double>(num_found) / static_cast<double>(doubled.size());
  EXPECT_NEAR(static_cast<double>(own.size()) / static_cast<double>(doubled.size()), 1, 0.15);
  return likeness;
}

TEST(FindSift, WithoutDoublingMostFeaturesAreWhereTheyAreWithIt) {
  const cv::Mat grey = RandomBlobs({640, 480}, 2500, 14);
  for (const auto& [first, end] : {std::pair(0, 1), std::pair(1, 2), std::pair(2, 99)}) {
    const Likeness likeness = LikenessWithoutDoubling(grey, first, end);
    // Octave 0 has half of the pixels for each sigma.
    EXPECT_GT(likeness.found_ratio, first == 0 ? 0.55 : 0.8) << first;
    EXPECT_NEAR(likeness.x, 0, 0.01) << first;
    EXPECT_NEAR(likeness.y, 0, 0.01) << first;
    EXPECT_NEAR(likeness.size_ratio, 1, 0.01) << first;
    EXPECT_LT(likeness.distance, first == 0 ? 0.13 : 0.1) << first;
  }
}

TEST(FindSift, WithoutDoublingImagesOfHostileSizesAreSearched) {
  for (const cv::Size size : {cv::Size(6, 6), cv::Size(11, 13), cv::Size(2000, 7), cv::Size(7, 2000),
                              cv::Size(31, 33), cv::Size(65, 17), cv::Size(300, 12)}) {
    const cv::Mat grey = Noise(size, 5);
    const PooledVector<SiftFeature> features = Find(grey, {.doubled = false});
    for (const SiftFeature& f : features) {
      EXPECT_TRUE(std::isfinite(f.size + f.response));
      EXPECT_TRUE(IsIn(f, cv::Rect({0, 0}, size))) << size;
    }
    if (std::min(size.width, size.height) <= 10) EXPECT_TRUE(features.empty()) << size;  // all border
    if (size.width > 20 && size.height > 20) EXPECT_FALSE(features.empty()) << size;
  }
}

// In octaves up to 2, whose pixels are at most two of the image's.
TEST(FindSift, ShiftedImageHasShiftedFeatures) {
  const cv::Mat world = RandomBlobs({604, 502}, 2000, 11);
  const cv::Mat grey = world(cv::Rect(0, 0, 600, 500)), shifted = world(cv::Rect(2, 2, 600, 500));
  const SiftSearch search{.end_octave = 3, .region = cv::Rect(180, 180, 200, 120)};
  SiftSearch there = search;
  there.region -= cv::Point(2, 2);
  const PooledVector<SiftFeature> here = Find(grey, search), found = Find(shifted, there);
  ASSERT_EQ(found.size(), here.size());
  ASSERT_GT(here.size(), 150u);
  for (size_t i = 0; i < here.size(); ++i) {
    EXPECT_NEAR(found[i].x, here[i].x - 2, 1e-4);
    EXPECT_NEAR(found[i].y, here[i].y - 2, 1e-4);
    EXPECT_EQ(found[i].size, here[i].size);
    EXPECT_EQ(found[i].angle_deg, here[i].angle_deg);
    EXPECT_EQ(found[i].root_sift, here[i].root_sift);
  }
}

// In the first octave, whose pixels a rotation maps to pixels.
TEST(FindSift, RotatedImageHasRotatedFeatures) {
  const cv::Mat grey = RandomBlobs({300, 240}, 500, 12);
  cv::Mat rotated;
  cv::rotate(grey, rotated, cv::ROTATE_90_CLOCKWISE);
  const PooledVector<SiftFeature> here = Find(grey, {.end_octave = 1}),
                                  found = Find(rotated, {.end_octave = 1});
  ASSERT_GT(here.size(), 150u);
  int num_found = 0;
  double distance = 0;
  for (const SiftFeature& f : here) {
    // Pixel (x, y) goes to (height - 1 - y, x); positions are a quarter pixel too much.
    const double x = grey.rows - 1 - (f.y - 0.25) + 0.25, y = f.x, angle_deg = f.angle_deg + 90;
    const auto match = std::find_if(found.begin(), found.end(), [&](const SiftFeature& g) {
      return std::hypot(g.x - x, g.y - y) < 0.01 && std::abs(g.size / f.size - 1) < 0.001 &&
             AngleBetween(g.angle_deg, std::fmod(angle_deg, 360)) < 0.3;
    });
    if (match == found.end()) continue;
    ++num_found;
    int squared = 0;
    for (int d = 0; d < kSiftDim; ++d) {
      const int difference = match->root_sift[d] - f.root_sift[d];
      squared += difference * difference;
    }
    distance += std::sqrt(squared) / 512;
  }
  EXPECT_GE(num_found, 0.99 * static_cast<double>(here.size()));
  EXPECT_LT(distance / num_found, 0.01);
}

}  // namespace
}  // namespace cairn
