#include "core/work/affordable_sift.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "core/base/random.h"

namespace cairn {
namespace {

constexpr int kCols = 400, kRows = 320;

// Features everywhere.
const cv::Mat& Grey() {
  static const cv::Mat grey = [] {
    Random random(1);
    cv::Mat noise(kRows, kCols, CV_8UC1);
    for (int row = 0; row < kRows; ++row) {
      for (int col = 0; col < kCols; ++col)
        noise.at<uint8_t>(row, col) = static_cast<uint8_t>(random.UniformInt(0, 255));
    }
    cv::GaussianBlur(noise, noise, {}, 0.8);
    return noise;
  }();
  return grey;
}

SiftOptions AllFeatures() {
  SiftOptions options;
  options.contrast_threshold = 0;
  options.edge_threshold = 100;
  return options;
}

// Of features that take a millisecond each: beside them the pixels of a whole image take five, undoubled two,
// coarse one, of a smaller image less.
int64_t MostOfAMs() { return 1'000'000'000 - WorkBudget::PicosecondsOf(Work::kFeature); }

struct Afforded {
  std::optional<AffordedSift> sift;
  WorkBudget work;
};

Afforded Afford(double budget_ms, bool coarse = false, const SiftOptions& options = AllFeatures()) {
  Afforded afforded{.work = WorkBudget(budget_ms)};
  afforded.sift = *AffordableSift(Grey(), options, coarse, MostOfAMs(), &afforded.work);
  return afforded;
}

void ExpectFeatures(const Afforded& afforded, Work pixel, int64_t num_pixels, int64_t num_features,
                    double min_scale_px) {
  ASSERT_TRUE(afforded.sift.has_value());
  EXPECT_EQ(afforded.work.num(pixel), num_pixels);
  for (const Work other : {Work::kWholePixel, Work::kUndoubledPixel, Work::kCoarsePixel, Work::kFinePixel}) {
    if (other != pixel) EXPECT_EQ(afforded.work.num(other), 0);
  }
  EXPECT_EQ(std::ssize(afforded.sift->features.keypoints), num_features);
  EXPECT_EQ(afforded.sift->features.descriptors.rows(), num_features);
  EXPECT_EQ(afforded.work.num(Work::kFeature), num_features);
  EXPECT_DOUBLE_EQ(afforded.sift->min_scale_px, min_scale_px);
  for (const Keypoint& keypoint : afforded.sift->features.keypoints)
    EXPECT_GE(keypoint.scale, 0.95 * min_scale_px);
}

const double& CoarsePx() {
  static const double coarse_px = CoarseSiftScalePx(Grey().size(), AllFeatures());
  return coarse_px;
}

TEST(AffordableSift, WithoutALimitIsAllOfIt) {
  const Features all = *ExtractSift(Grey(), AllFeatures());
  ASSERT_GT(all.keypoints.size(), 1200U);
  const Afforded any = Afford(0);
  ExpectFeatures(any, Work::kWholePixel, kCols * kRows, std::ssize(all.keypoints), 0);
  EXPECT_EQ(any.sift->features.descriptors, all.descriptors);
  ASSERT_TRUE(AffordableSift(Grey(), AllFeatures(), false, 0, nullptr)->has_value());
  const Features coarse = *ExtractUndoubledSift(Grey(), AllFeatures(), SiftScales::kCoarse);
  ExpectFeatures(Afford(0, true), Work::kCoarsePixel, kCols * kRows, std::ssize(coarse.keypoints),
                 CoarsePx());
}

// At each budget that is just enough, and a little below it.
TEST(AffordableSift, TakesTheBestScalesThatThereIsRoomFor) {
  ExpectFeatures(Afford(2010), Work::kWholePixel, kCols * kRows, 1000, 0);
  ExpectFeatures(Afford(2009), Work::kUndoubledPixel, kCols * kRows, 1002, 0.5 * CoarsePx());
  ExpectFeatures(Afford(1204), Work::kUndoubledPixel, kCols * kRows, 600, 0.5 * CoarsePx());
  const auto num_coarse =
      std::ssize(ExtractUndoubledSift(Grey(), AllFeatures(), SiftScales::kCoarse)->keypoints);
  ASSERT_GE(num_coarse, 100);
  ExpectFeatures(Afford(1203), Work::kCoarsePixel, kCols * kRows, std::min<int64_t>(num_coarse, 600),
                 CoarsePx());
  ExpectFeatures(Afford(502), Work::kCoarsePixel, kCols * kRows, std::min<int64_t>(num_coarse, 250),
                 CoarsePx());
  const Afforded half = Afford(501), half_at_most = Afford(200), quarter = Afford(199), least = Afford(134);
  for (const Afforded* afforded : {&half, &half_at_most}) {
    EXPECT_EQ(afforded->work.num(Work::kUndoubledPixel), kCols * kRows / 4);
    EXPECT_DOUBLE_EQ(afforded->sift->min_scale_px, CoarsePx());
  }
  EXPECT_LE(half_at_most.work.num(Work::kFeature), 150);
  for (const Afforded* afforded : {&quarter, &least}) {
    EXPECT_EQ(afforded->work.num(Work::kUndoubledPixel), kCols * kRows / 16);
    EXPECT_DOUBLE_EQ(afforded->sift->min_scale_px, 2 * CoarsePx());
  }
  const Afforded none = Afford(133);
  EXPECT_FALSE(none.sift.has_value());
  EXPECT_EQ(none.work.spent_ms(), 0);
}

TEST(AffordableSift, OfCoarseScalesThereAreTwo) {
  const Afforded coarse = Afford(302, true), half = Afford(301, true), least = Afford(134, true);
  EXPECT_EQ(coarse.work.num(Work::kCoarsePixel), kCols * kRows);
  EXPECT_DOUBLE_EQ(coarse.sift->min_scale_px, CoarsePx());
  for (const Afforded* afforded : {&half, &least}) {
    EXPECT_EQ(afforded->work.num(Work::kUndoubledPixel), kCols * kRows / 4);
    EXPECT_DOUBLE_EQ(afforded->sift->min_scale_px, CoarsePx());
  }
  EXPECT_LE(least.work.num(Work::kFeature), 100);
  EXPECT_FALSE(Afford(133, true).sift.has_value());
}

TEST(AffordableSift, OptionsThatAskForFewFeaturesNeedRoomForThose) {
  SiftOptions few = AllFeatures();
  few.max_num_features = 50;
  ExpectFeatures(Afford(110, false, few), Work::kWholePixel, kCols * kRows, 50, 0);
  ExpectFeatures(Afford(109, false, few), Work::kUndoubledPixel, kCols * kRows, 50, 0.5 * CoarsePx());
  ExpectFeatures(Afford(5000, false, few), Work::kWholePixel, kCols * kRows, 50, 0);
}

TEST(AffordableSift, AnImageThatIsMadeSmallerIsCountedSo) {
  SiftOptions small = AllFeatures();
  small.max_image_side_px = kCols / 2;
  EXPECT_EQ(Afford(0, false, small).work.num(Work::kWholePixel), kCols * kRows / 4);
  const Afforded half = Afford(200, false, small);
  EXPECT_EQ(half.work.num(Work::kUndoubledPixel), kCols * kRows / 16);
  EXPECT_DOUBLE_EQ(half.sift->min_scale_px, 2 * CoarsePx());
}

TEST(AffordableSift, OfASpentBudgetThereIsNothing) {
  WorkBudget work(10000);
  work.GiveUp();
  EXPECT_FALSE(AffordableSift(Grey(), AllFeatures(), false, MostOfAMs(), &work)->has_value());
  EXPECT_FALSE(AffordableSift(cv::Mat(20, 20, CV_32FC1), AllFeatures(), false, 0, nullptr).ok());
}

TEST(AffordableFineSift, IsAsMuchAsThereIsRoomFor) {
  const auto is_wanted = [](const Keypoint& keypoint) { return keypoint.x < kCols / 2; };
  const auto num_found = [&](double budget_ms, int max_num) {
    WorkBudget work(budget_ms);
    const Features fine = *AffordableFineSift(Grey(), AllFeatures(), max_num, is_wanted, MostOfAMs(), &work);
    EXPECT_EQ(work.num(Work::kFeature), std::ssize(fine.keypoints));
    EXPECT_EQ(work.num(Work::kFinePixel), fine.keypoints.empty() ? 0 : kCols * kRows);
    EXPECT_EQ(fine.descriptors.rows(), std::ssize(fine.keypoints));
    for (const Keypoint& keypoint : fine.keypoints) EXPECT_TRUE(is_wanted(keypoint));
    return std::ssize(fine.keypoints);
  };
  EXPECT_EQ(num_found(40, 1000), 20);
  EXPECT_EQ(num_found(40, 7), 7);
  EXPECT_EQ(num_found(2, 1000), 1);
  EXPECT_EQ(num_found(1.9, 1000), 0);
  EXPECT_EQ(num_found(40, 0), 0);
  const Features all = *ExtractUndoubledSift(Grey(), AllFeatures(), SiftScales::kFine, is_wanted);
  EXPECT_EQ(num_found(0, AllFeatures().max_num_features), std::ssize(all.keypoints));
  WorkBudget spent(40);
  spent.GiveUp();
  EXPECT_TRUE(
      AffordableFineSift(Grey(), AllFeatures(), 1000, is_wanted, MostOfAMs(), &spent)->keypoints.empty());
}

}  // namespace
}  // namespace cairn
