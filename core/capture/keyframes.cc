#include "core/capture/keyframes.h"

#include <algorithm>
#include <utility>

#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "core/base/quantiles.h"
#include "core/capture/frame_motion.h"

namespace cairn {
namespace {

// Of the tracker: windows of 15 pixels on five levels follow a corner over a sixth of a frame.
const cv::Size kWindow(15, 15);
constexpr int kMaxLevel = 4;
// A corner that is followed there and back ends where it began, up to this, pixels.
constexpr double kMaxReturnPx = 1;
// Nearer to the border than this, pixels, corners have left the frame.
constexpr float kBorderPx = 3;
// Corners are at least this far apart, parts of the longer side, and have at least this part of the
// strongest one's response.
constexpr double kCornerDistance = 0.02;
constexpr double kCornerQuality = 0.01;
// A frame with fewer corners shows nothing by which it could be found again, ...
constexpr int kMinNumCorners = 10;
// ... nor does one with a smaller standard deviation of its grey values, of 255.
constexpr double kBlankDeviation = 4;
// A frame in which fewer of the corners are found does not show what the reference does.
constexpr double kLostRatio = 0.15;
// How far the camera may go while the first keyframe of a part is chosen, ...
constexpr double kBeginningWay = 0.3;
// ... how far it has to have gone for its time to count, ...
constexpr double kMovedWay = 0.1;
// (a frame that is due counts although it comes early by this part of the interval: stamps are rounded), ...
constexpr double kEarlyPart = 0.01;
// ... and how far it has to have gone for the last frame of a film to become one.
constexpr double kEndingWay = 0.5;
// Of candidates about as sharp as the sharpest the last one counts.
constexpr double kAboutAsSharp = 0.9;
// The sharpness that is usual is the median of this many frames: of more, a turn to what has less texture
// would count as blurred.
constexpr size_t kNumRecent = 11;

// Corners that moved less than this, pixels, stand still, ...
constexpr double kStillPx = 0.5;
// ... and are painted onto the picture where they are this part of all, while the others moved by this part
// of the longer side: a camera that moves so far sees nothing that stands, but right ahead.
constexpr double kMinStillRatio = 0.2, kMinMovedRatio = 0.05;

cv::Mat MakeSmall(const cv::Mat& grey, int max_side_px) {
  const double scale = static_cast<double>(max_side_px) / std::max(grey.cols, grey.rows);
  if (scale >= 1) return grey.clone();
  cv::Mat small;
  const cv::Size size(std::max(1, cvRound(grey.cols * scale)), std::max(1, cvRound(grey.rows * scale)));
  cv::resize(grey, small, size, 0, 0, cv::INTER_AREA);
  return small;
}

bool IsBlank(const cv::Mat& small) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(small, mean, deviation);
  return deviation[0] < kBlankDeviation;
}

double Sharpness(const cv::Mat& small) {
  cv::Mat laplacian;
  cv::Laplacian(small, laplacian, CV_16S);
  cv::Scalar mean, deviation;
  cv::meanStdDev(laplacian, mean, deviation);
  return deviation[0] * deviation[0];
}

std::vector<cv::Point2f> FindCorners(const cv::Mat& small, int num_corners) {
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(small, corners, num_corners, kCornerQuality,
                          kCornerDistance * std::max(small.cols, small.rows));
  return corners;
}

std::vector<cv::Mat> Pyramid(const cv::Mat& small) {
  std::vector<cv::Mat> pyramid;
  cv::buildOpticalFlowPyramid(small, pyramid, kWindow, kMaxLevel);
  return pyramid;
}

// Follows `points` from one frame to another, where they are near `places`, which become where they are.
std::vector<uchar> Track(const std::vector<cv::Mat>& from, const std::vector<cv::Mat>& to,
                         const std::vector<cv::Point2f>& points, std::vector<cv::Point2f>* places) {
  std::vector<uchar> is_found;
  cv::calcOpticalFlowPyrLK(from, to, points, *places, is_found, cv::noArray(), kWindow, kMaxLevel,
                           {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 20, 0.03},
                           cv::OPTFLOW_USE_INITIAL_FLOW);
  return is_found;
}

bool IsInside(const cv::Point2f& point, const cv::Size& size) {
  return point.x >= kBorderPx && point.y >= kBorderPx && point.x < size.width - kBorderPx &&
         point.y < size.height - kBorderPx;
}

cv::Point2f MedianShift(const std::vector<cv::Point2f>& before, const std::vector<cv::Point2f>& after) {
  std::vector<double> x, y;
  for (size_t i = 0; i < before.size(); ++i) {
    x.push_back(after[i].x - before[i].x);
    y.push_back(after[i].y - before[i].y);
  }
  if (x.empty()) return {};
  return {static_cast<float>(Median(x)), static_cast<float>(Median(y))};
}

// Takes out the corners that stand still while the others move far; how many.
size_t RemoveStill(double longer_side, std::vector<cv::Point2f>* before, std::vector<cv::Point2f>* after) {
  std::vector<cv::Point2f> moving_before, moving_after;
  std::vector<double> lengths;
  for (size_t i = 0; i < before->size(); ++i) {
    const double length = cv::norm((*after)[i] - (*before)[i]);
    if (length < kStillPx) continue;
    moving_before.push_back((*before)[i]);
    moving_after.push_back((*after)[i]);
    lengths.push_back(length);
  }
  const size_t num_still = before->size() - lengths.size();
  if (lengths.size() < kMinNumCorners ||
      static_cast<double>(num_still) < kMinStillRatio * static_cast<double>(before->size()) ||
      Median(lengths) < kMinMovedRatio * longer_side)
    return 0;
  *before = std::move(moving_before);
  *after = std::move(moving_after);
  return num_still;
}

}  // namespace

KeyframeChooser::KeyframeChooser(const KeyframeOptions& options) : options_(options) {}

std::vector<int64_t> KeyframeChooser::Add(int64_t index, const cv::Mat& grey, double time_s) {
  ++stats_.num_frames;
  Frame frame = {.index = index, .time_s = time_s, .small = MakeSmall(grey, options_.max_side_px)};
  if (IsBlank(frame.small)) {
    ++stats_.num_blank;
    return {};
  }
  if (frame.small.size() == previous_.size() && cv::norm(frame.small, previous_, cv::NORM_INF) == 0) {
    ++stats_.num_repeated;
    return {};
  }
  previous_ = frame.small;
  frame.sharpness = Sharpness(frame.small);
  recent_sharpness_.push_back(frame.sharpness);
  if (recent_sharpness_.size() > kNumRecent) recent_sharpness_.pop_front();
  if (!IsSharp(frame)) ++stats_.num_blurred;

  std::vector<int64_t> keyframes;
  if (reference_.empty()) {
    Begin(frame);
  } else {
    Follow(std::move(frame), &keyframes);
  }
  return keyframes;
}

std::optional<int64_t> KeyframeChooser::Candidate() const {
  if (!candidate_) return std::nullopt;
  return candidate_->index;
}

std::vector<int64_t> KeyframeChooser::Finish() {
  std::vector<int64_t> keyframes;
  if (candidate_ && (!reference_is_keyframe_ || candidate_->way >= kEndingWay)) Commit(&keyframes);
  candidate_.reset();
  return keyframes;
}

// Begins a part of the film; false where the frame shows nothing to begin with.
bool KeyframeChooser::Begin(const Frame& frame) {
  if (FindCorners(frame.small, kMinNumCorners).size() < kMinNumCorners) {
    ++stats_.num_blank;
    return false;
  }
  SetReference(frame);
  reference_is_keyframe_ = false;
  candidate_ = frame;
  candidate_->way = 0;
  best_sharpness_ = frame.sharpness;
  return true;
}

void KeyframeChooser::SetReference(const Frame& frame) {
  reference_ = Pyramid(frame.small);
  reference_s_ = frame.time_s;
  corners_ = FindCorners(frame.small, options_.num_corners);
  guesses_ = corners_;
  num_lost_ = 0;
}

// The share of the reference's corners that is found, and how far the camera is on its way.
double KeyframeChooser::Look(const cv::Mat& small, double* way) {
  if (corners_.empty()) return 0;
  const std::vector<cv::Mat> pyramid = Pyramid(small);
  std::vector<cv::Point2f> places = guesses_;
  const std::vector<uchar> is_there = Track(reference_, pyramid, corners_, &places);
  std::vector<cv::Point2f> before, after;
  std::vector<size_t> idx;
  for (size_t i = 0; i < corners_.size(); ++i) {
    if (is_there[i] == 0 || !IsInside(places[i], small.size())) continue;
    before.push_back(corners_[i]);
    after.push_back(places[i]);
    idx.push_back(i);
  }
  if (before.empty()) return 0;
  // Back from where they are, by what most of them moved: that favours no corner's own place.
  const cv::Point2f shift = MedianShift(before, after);
  std::vector<cv::Point2f> returned = after;
  for (cv::Point2f& point : returned) point -= shift;
  const std::vector<uchar> is_back = Track(pyramid, reference_, after, &returned);
  std::vector<cv::Point2f> found_before, found_after;
  std::vector<bool> is_found(corners_.size());
  for (size_t i = 0; i < before.size(); ++i) {
    if (is_back[i] == 0 || cv::norm(returned[i] - before[i]) > kMaxReturnPx) continue;
    found_before.push_back(before[i]);
    found_after.push_back(after[i]);
    is_found[idx[i]] = true;
  }
  const size_t num_still = RemoveStill(std::max(small.cols, small.rows), &found_before, &found_after);
  has_still_part_ = has_still_part_ || num_still > 0;
  const double found_ratio =
      static_cast<double>(found_before.size()) / static_cast<double>(corners_.size() - num_still);
  if (found_ratio < kLostRatio) return found_ratio;
  const cv::Point2f moved = MedianShift(found_before, found_after);
  for (size_t i = 0; i < corners_.size(); ++i) guesses_[i] = is_found[i] ? places[i] : corners_[i] + moved;
  const double focal_px = options_.focal_ratio * std::max(small.cols, small.rows);
  const FrameMotion motion = MeasureMotion(found_before, found_after, small.size(), focal_px);
  *way = std::max({motion.parallax / options_.parallax_ratio, motion.shift / options_.shift_ratio,
                   (1 - found_ratio) / (1 - options_.min_overlap_ratio)});
  return found_ratio;
}

// How far it is on the way because of the time, once the camera moved.
double KeyframeChooser::WayByTime(const Frame& frame) const {
  if (options_.max_interval_s <= 0 || !reference_is_keyframe_ || frame.way < kMovedWay) return 0;
  return (frame.time_s - reference_s_) / ((1 - kEarlyPart) * options_.max_interval_s);
}

void KeyframeChooser::Follow(Frame frame, std::vector<int64_t>* keyframes) {
  for (;;) {
    const bool is_same_size = frame.small.size() == reference_.front().size();
    const bool is_seen = is_same_size && Look(frame.small, &frame.way) >= kLostRatio;
    if (!is_seen && is_same_size && !IsSharp(frame) && num_lost_ < options_.max_num_lost) {
      ++num_lost_;  // the blur will pass
      return;
    }
    if (!is_seen && !candidate_) {
      if (Begin(frame)) stats_.cuts.push_back(frame.index);
      return;
    }
    if (is_seen) {
      num_lost_ = 0;
      frame.way = std::max(frame.way, WayByTime(frame));
    }
    const double last = reference_is_keyframe_ ? options_.last_candidate : kBeginningWay;
    if (!is_seen || (frame.way > last && candidate_)) {
      // Seen from what was nearer to it than the reference is.
      Commit(keyframes);
      continue;
    }
    Consider(frame);
    const bool is_due =
        reference_is_keyframe_ && frame.way >= 1 && (IsSharp(*candidate_) || frame.way > last);
    if (!is_due) return;
    Commit(keyframes);
    if (keyframes->back() == frame.index) return;
  }
}

// Makes the frame the candidate if it is the better one.
void KeyframeChooser::Consider(const Frame& frame) {
  const bool is_early = reference_is_keyframe_ && frame.way < options_.first_candidate;
  if (is_early) {
    best_sharpness_ = 0;
  } else {
    best_sharpness_ = std::max(best_sharpness_, frame.sharpness);
  }
  const bool is_better = frame.sharpness >= kAboutAsSharp * best_sharpness_ &&
                         (!candidate_ || IsSharp(frame) || frame.sharpness >= candidate_->sharpness);
  if (is_better) candidate_ = frame;
}

// The candidate becomes a keyframe.
void KeyframeChooser::Commit(std::vector<int64_t>* keyframes) {
  keyframes->push_back(candidate_->index);
  ++stats_.num_keyframes;
  stats_.num_with_still_part += has_still_part_;
  has_still_part_ = false;
  const Frame keyframe = *std::exchange(candidate_, std::nullopt);
  SetReference(keyframe);
  reference_is_keyframe_ = true;
  best_sharpness_ = 0;
}

bool KeyframeChooser::IsSharp(const Frame& frame) const {
  const std::vector<double> recent(recent_sharpness_.begin(), recent_sharpness_.end());
  return frame.sharpness >= options_.min_sharpness_ratio * Median(recent);
}

}  // namespace cairn
