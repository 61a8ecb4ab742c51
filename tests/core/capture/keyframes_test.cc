#include "core/capture/keyframes.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "core/capture/frame_motion.h"
#include "tests/core/capture/drawn_wall.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

const cv::Size kFrame(320, 240);
constexpr double kFramesPerSecond = 30;

// Frames of a camera that goes along a wall, from `begin_px` on.
std::vector<cv::Mat> Walk(int num_frames, int step_px, int begin_px = 0, int seed = 1) {
  const cv::Mat wall = DrawnWall(seed);
  std::vector<cv::Mat> frames;
  for (int i = 0; i < num_frames; ++i)
    frames.push_back(wall(cv::Rect(cv::Point(begin_px + step_px * i, 100), kFrame)).clone());
  return frames;
}

// Its keyframes, with every claim of the header about what Add returns.
std::vector<int64_t> Choose(const std::vector<cv::Mat>& frames, KeyframeStats* stats = nullptr,
                            const KeyframeOptions& options = {}) {
  KeyframeChooser chooser(options);
  std::vector<int64_t> keyframes;
  std::optional<int64_t> kept;
  for (int64_t i = 0; i < std::ssize(frames); ++i) {
    for (const int64_t keyframe : chooser.Add(i, frames[i], static_cast<double>(i) / kFramesPerSecond)) {
      EXPECT_TRUE(keyframe == i || keyframe == kept) << keyframe << " had been forgotten at " << i;
      keyframes.push_back(keyframe);
    }
    kept = chooser.Candidate();
  }
  for (const int64_t keyframe : chooser.Finish()) {
    EXPECT_EQ(keyframe, kept);
    keyframes.push_back(keyframe);
  }
  EXPECT_TRUE(std::is_sorted(keyframes.begin(), keyframes.end()));
  EXPECT_EQ(std::adjacent_find(keyframes.begin(), keyframes.end()), keyframes.end());
  EXPECT_EQ(chooser.stats().num_frames, frames.size());
  EXPECT_EQ(chooser.stats().num_keyframes, keyframes.size());
  if (stats != nullptr) *stats = chooser.stats();
  return keyframes;
}

// A shift of 0.12 x 320 = 38.4 pixels makes a keyframe due; frames from 0.7 of it on, 27 pixels, are
// candidates, and those of one sharpness are taken as late as possible.
TEST(Keyframes, AreAsFarApartAsTheOptionsSay) {
  const std::vector<int64_t> keyframes = Choose(Walk(200, 4));
  ASSERT_GE(keyframes.size(), 15u);
  EXPECT_LE(keyframes[0], 3) << "0.3 of the way, 11 pixels, is where the first is chosen";
  for (size_t i = 1; i < keyframes.size(); ++i) {
    EXPECT_GE(keyframes[i] - keyframes[i - 1], 27 / 4) << i;
    EXPECT_LE(keyframes[i] - keyframes[i - 1], 40 / 4) << i;
  }
  const size_t num_of_half = Choose(Walk(200, 4), nullptr, {.shift_ratio = 0.06}).size();
  EXPECT_NEAR(static_cast<double>(num_of_half), 2.0 * keyframes.size(), 0.3 * keyframes.size());
}

// A pixel a frame: 38 frames would be due by what moves.  By the time 12 are, from the 4th on, when it moved
// by a tenth of 38 pixels; frames from the 9th on are candidates.
TEST(Keyframes, AreNoFartherApartInTimeThanIsAskedFor) {
  const std::vector<cv::Mat> frames = Walk(200, 1);
  EXPECT_LE(Choose(frames).size(), 8u);
  std::vector<int64_t> keyframes = Choose(frames, nullptr, {.max_interval_s = 0.4});
  ASSERT_GE(keyframes.size(), 15u);
  keyframes.pop_back();  // where the film ends there is no choice
  for (size_t i = 1; i < keyframes.size(); ++i) {
    EXPECT_GE(keyframes[i] - keyframes[i - 1], 9) << i;
    EXPECT_LE(keyframes[i] - keyframes[i - 1], 12) << i;
  }
  // What is due by what moves is due earlier.
  EXPECT_EQ(Choose(Walk(100, 8), nullptr, {.max_interval_s = 0.4}), Choose(Walk(100, 8)));
}

// It rests for 2 s in noise, and moves too little for the time to count; then it goes on, and the rest's last
// image is one of them.
TEST(Keyframes, ARestIsNotDividedByTime) {
  cv::RNG random(3);
  std::vector<cv::Mat> frames = Walk(40, 4);
  const cv::Mat stand = frames.back();
  for (int i = 0; i < 60; ++i) {
    cv::Mat noise(kFrame, CV_16SC1), frame;
    random.fill(noise, cv::RNG::NORMAL, 0, 4);
    cv::add(stand, noise, frame, cv::noArray(), CV_8U);
    frames.push_back(frame);
  }
  const std::vector<cv::Mat> more = Walk(40, 1, 160);
  frames.insert(frames.end(), more.begin(), more.end());
  const std::vector<int64_t> keyframes = Choose(frames, nullptr, {.max_interval_s = 0.4});
  const auto num_in_rest =
      std::count_if(keyframes.begin(), keyframes.end(), [](int64_t i) { return i >= 42 && i < 97; });
  EXPECT_LE(num_in_rest, 1);
  EXPECT_GE(std::count_if(keyframes.begin(), keyframes.end(), [](int64_t i) { return i >= 97; }), 3);
}

// A third of the picture is a frame around a screen: most corners stand on it, and the walk counts as before.
TEST(Keyframes, WhatIsPaintedOntoThePictureDoesNotCount) {
  const cv::Mat border = DrawnWall(9)(cv::Rect(cv::Point(0, 0), kFrame));
  const cv::Rect screen(80, 40, 190, 160);
  std::vector<cv::Mat> frames;
  for (const cv::Mat& frame : Walk(200, 4)) {
    frames.push_back(border.clone());
    frame(screen).copyTo(frames.back()(screen));
  }
  KeyframeStats stats;
  const size_t num_keyframes = Choose(frames, &stats).size();
  const size_t num_of_whole = Choose(Walk(200, 4)).size();
  EXPECT_GE(num_keyframes, num_of_whole * 3 / 4);
  EXPECT_GE(stats.num_with_still_part, num_keyframes * 3 / 4);
  Choose(Walk(200, 4), &stats);
  EXPECT_EQ(stats.num_with_still_part, 0);
}

// A frame of twice the size moves twice as many pixels.
TEST(Keyframes, AreTheSameAtAnyResolution) {
  std::vector<cv::Mat> large;
  for (const cv::Mat& frame : Walk(60, 6)) {
    large.emplace_back();
    cv::resize(frame, large.back(), {}, 4, 4, cv::INTER_CUBIC);
  }
  const size_t num_small = Choose(Walk(60, 6)).size();
  EXPECT_NEAR(static_cast<double>(Choose(large).size()), static_cast<double>(num_small), 1);
}

TEST(Keyframes, ACameraThatStandsHasOne) {
  cv::RNG random(3);
  const cv::Mat scene = Walk(1, 0)[0];
  std::vector<cv::Mat> frames;
  for (int i = 0; i < 200; ++i) {
    cv::Mat noise(kFrame, CV_16SC1), frame;
    random.fill(noise, cv::RNG::NORMAL, 0, 4);
    cv::add(scene, noise, frame, cv::noArray(), CV_8U);
    frames.push_back(frame);
  }
  EXPECT_THAT(Choose(frames), SizeIs(1));
}

// It goes, stands for 100 frames, and goes on: no more keyframes than without the rest.
TEST(Keyframes, ARestAddsNone) {
  std::vector<cv::Mat> frames = Walk(40, 5);
  const std::vector<cv::Mat> rest(100, frames.back());
  const std::vector<cv::Mat> more = Walk(40, 5, 200);
  frames.insert(frames.end(), rest.begin(), rest.end());
  frames.insert(frames.end(), more.begin(), more.end());
  KeyframeStats stats;
  const std::vector<int64_t> keyframes = Choose(frames, &stats);
  EXPECT_EQ(stats.num_repeated, 100);
  EXPECT_NEAR(static_cast<double>(keyframes.size()), static_cast<double>(Choose(Walk(80, 5)).size()), 1);
}

TEST(Keyframes, FramesThatAreFarApartAreAllOfThem) {
  EXPECT_THAT(Choose(Walk(6, 100)), ElementsAre(0, 1, 2, 3, 4, 5));
}

// Of the frames near the due one, the only sharp one counts.
TEST(Keyframes, TheSharpestOfTheCandidatesCounts) {
  std::vector<cv::Mat> frames = Walk(120, 4);
  for (size_t i = 0; i < frames.size(); ++i) {
    if (i % 5 != 0) cv::blur(frames[i], frames[i], {7, 1});
  }
  std::vector<int64_t> keyframes = Choose(frames);
  ASSERT_GE(keyframes.size(), 9u);
  keyframes.pop_back();  // where the film ends there is no choice
  for (const int64_t keyframe : keyframes) EXPECT_EQ(keyframe % 5, 0);
}

TEST(Keyframes, BlurredFramesAreCountedAndPassedOver) {
  std::vector<cv::Mat> frames = Walk(120, 4);
  for (size_t i = 40; i < 44; ++i) cv::blur(frames[i], frames[i], {31, 1});
  KeyframeStats stats;
  const std::vector<int64_t> keyframes = Choose(frames, &stats);
  EXPECT_EQ(stats.num_blurred, 4);
  EXPECT_THAT(stats.cuts, IsEmpty());
  for (const int64_t keyframe : keyframes) EXPECT_TRUE(keyframe < 40 || keyframe >= 44) << keyframe;
}

TEST(Keyframes, BlackFramesAreNoKeyframesAndNoCut) {
  std::vector<cv::Mat> frames = Walk(80, 4);
  for (size_t i = 30; i < 33; ++i) frames[i].setTo(16);
  frames[0].setTo(0);
  KeyframeStats stats;
  const std::vector<int64_t> keyframes = Choose(frames, &stats);
  EXPECT_EQ(stats.num_blank, 4);
  EXPECT_THAT(stats.cuts, IsEmpty());
  for (const int64_t keyframe : keyframes) EXPECT_GT(cv::mean(frames[keyframe])[0], 50);
  EXPECT_THAT(Choose({10, cv::Mat(kFrame, CV_8UC1, cv::Scalar(90))}), IsEmpty());
}

TEST(Keyframes, ACutBeginsANewPart) {
  std::vector<cv::Mat> frames = Walk(37, 4);
  const std::vector<cv::Mat> other = Walk(37, 4, 0, 2);
  frames.insert(frames.end(), other.begin(), other.end());
  KeyframeStats stats;
  const std::vector<int64_t> keyframes = Choose(frames, &stats);
  EXPECT_THAT(stats.cuts, ElementsAre(37));
  // Both parts have their first and their last place.
  const auto second = std::find_if(keyframes.begin(), keyframes.end(), [](int64_t i) { return i >= 37; });
  ASSERT_TRUE(second != keyframes.begin() && second != keyframes.end());
  EXPECT_GE(*(second - 1), 36 - 9);
  EXPECT_LE(*second, 37 + 3);
}

TEST(Keyframes, FramesOfAnotherSizeBeginANewPart) {
  std::vector<cv::Mat> frames = Walk(30, 4);
  for (const cv::Mat& frame : Walk(30, 4, 120)) frames.push_back(frame(cv::Rect(0, 0, 200, 160)).clone());
  KeyframeStats stats;
  const std::vector<int64_t> keyframes = Choose(frames, &stats);
  EXPECT_THAT(stats.cuts, ElementsAre(30));
  EXPECT_GE(keyframes.back(), 50);
}

TEST(Keyframes, NothingAndFramesTooSmallToShowAnythingHaveNone) {
  EXPECT_THAT(Choose({}), IsEmpty());
  cv::Mat noise(3, 3, CV_8UC1);
  cv::randu(noise, 0, 255);
  EXPECT_THAT(Choose({noise, noise.t(), cv::Mat(1, 1, CV_8UC1, cv::Scalar(7))}), IsEmpty());
}

// Points of a camera of f = 320 pixels that turns: they move, but nothing that a rotation does not explain.
TEST(FrameMotion, ATurnHasAShiftAndNoParallax) {
  const double focal_px = 320, turn = 0.1;
  std::vector<cv::Point2f> before, turned;
  for (int x = 40; x < 600; x += 40) {
    for (int y = 40; y < 440; y += 40) {
      const double u = (x - 320) / focal_px, v = (y - 240) / focal_px;
      const double depth = std::cos(turn) - u * std::sin(turn);
      before.emplace_back(static_cast<float>(x), static_cast<float>(y));
      turned.emplace_back(static_cast<float>(320 + focal_px * (u * std::cos(turn) + std::sin(turn)) / depth),
                          static_cast<float>(240 + focal_px * v / depth));
    }
  }
  for (const double known_px : {focal_px, 0.0}) {
    const FrameMotion motion = MeasureMotion(before, turned, {640, 480}, known_px);
    // At least f tan(0.1) = 32.1 of 640 pixels, in the middle.
    EXPECT_GT(motion.shift, 0.0501);
    EXPECT_LT(motion.shift, 0.08);
    EXPECT_LT(motion.parallax, known_px > 0 ? 1e-4 : 0.002);
  }
}

// Points at 2 and at 4 metres, by turns, of a camera that goes 0.2 metres ahead: they move away from the
// middle, by 1/9 and 1/19 of their distance from it, which no rotation does.
TEST(FrameMotion, AWayAheadIsAllParallax) {
  std::vector<cv::Point2f> before, after;
  for (int x = 40; x < 640; x += 40) {
    for (int y = 40; y < 480; y += 40) {
      const float factor = before.size() % 2 == 0 ? 1 + 1 / 9.0F : 1 + 1 / 19.0F;
      before.emplace_back(x, y);
      after.emplace_back(320 + factor * (x - 320), 240 + factor * (y - 240));
    }
  }
  const FrameMotion motion = MeasureMotion(before, after, {640, 480}, 320);
  EXPECT_GT(motion.shift, 0.01);
  EXPECT_GT(motion.parallax, 0.6 * motion.shift);
  EXPECT_LE(MeasureMotion(before, after, {640, 480}, 0).parallax, motion.shift);
}

TEST(FrameMotion, NothingThatIsSeenAgainDoesNotMove) {
  const FrameMotion motion = MeasureMotion({}, {}, {640, 480}, 320);
  EXPECT_EQ(motion.shift, 0);
  EXPECT_EQ(motion.parallax, 0);
}

}  // namespace
}  // namespace cairn
