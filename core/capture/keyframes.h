#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include <opencv2/core.hpp>

namespace cairn {

// Lengths in the image are parts of a frame's longer side, so that they hold for any resolution.
struct KeyframeOptions {
  // Frames are made smaller than this before corners are tracked, pixels.  REQUIRES: >= 64
  int max_side_px = 640;
  // Corners of a keyframe that are looked for in the frames after it.  REQUIRES: >= 30
  int num_corners = 200;
  // A keyframe is due when corners moved by this because the camera changed its place, ...
  // REQUIRES: > 0
  double parallax_ratio = 0.05;
  // ... by this for any reason (0.12: turns of 13 degrees at 90 degrees of view, of 8 at 60), ...
  // REQUIRES: > 0
  double shift_ratio = 0.12;
  // ... or fewer of them than this are still found.  REQUIRES: in (0, 1)
  double min_overlap_ratio = 0.5;
  // ... or, where the camera moved by a tenth of the first two, so long after the last one, seconds: an IMU
  // says less of two images the longer it is from one to the other; 0: at any time.  REQUIRES: >= 0
  double max_interval_s = 0;
  // Frames as far as this from the last keyframe to the next are candidates for the next.  REQUIRES: in (0,
  // 1)
  double first_candidate = 0.7;
  // Where all candidates are less sharp than this part of what is usual, one is waited for until
  // `last_candidate` times the way.  REQUIRES: in [0, 1]
  double min_sharpness_ratio = 0.7;
  double last_candidate = 1.4;  // REQUIRES: >= 1
  // Blurred frames in a row in which the corners may be lost before the film counts as cut.  REQUIRES: >= 0
  int max_num_lost = 15;
  // Focal length of the camera, parts of the longer side; 0: unknown, then several are tried.
  double focal_ratio = 0;
};

// What the chooser saw.
struct KeyframeStats {
  int64_t num_frames = 0;
  int64_t num_keyframes = 0;
  int64_t num_repeated = 0;         // the same picture as the frame before
  int64_t num_blank = 0;            // black, or of one colour: never keyframes
  int64_t num_blurred = 0;          // less sharp than min_sharpness_ratio of what is usual around them
  int64_t num_with_still_part = 0;  // keyframes before which a part of the picture stood while the rest moved
  std::vector<int64_t> cuts;        // frames in which nothing of the film before is found
};

// Chooses the keyframes of a film: few, sharp, and none loses sight of the one before.  Corners of the last
// keyframe are looked for in every frame (pyramidal Lucas-Kanade [Bouguet 2000], forwards and backwards, so
// that they do not drift while the camera stands).  How far the camera is on the way to the next keyframe is
// the largest of
//   parallax / parallax_ratio,  shift / shift_ratio,  (1 - share found) / (1 - min_overlap_ratio),
//   time / max_interval_s:
// 0 while it stands, 1 when a keyframe is due.  Corners that stand while the others move far are of a logo or
// a frame in the picture, and do not count.  Among the frames from first_candidate on the sharpest becomes
// it (variance of the Laplacian).  Blank frames are passed over, and blurred ones where corners are lost.  In
// a frame that shows nothing of the keyframe a new part of the film begins, whose first keyframe is the
// sharpest before the camera has moved far.  Of frames that are far apart each is a keyframe.
//
// One pass; the memory of one full frame is the caller's, and two small ones are here.  About 5 ms a frame.
// Same keyframes for any number of threads.
class KeyframeChooser {
 public:
  explicit KeyframeChooser(const KeyframeOptions& options = {});

  // Takes the next frame, CV_8UC1 of any size; `index` ascends, and so does its time, which only
  // max_interval_s asks for.  Returns the frames, this or earlier ones, that are now known to be keyframes,
  // ascending; often none.  A frame of another size begins a new part.
  std::vector<int64_t> Add(int64_t index, const cv::Mat& grey, double time_s = 0);

  // The only frame so far, besides those that Add returned, that may still become a keyframe: the caller
  // keeps its picture and may forget all others.
  std::optional<int64_t> Candidate() const;

  // The keyframes that the end of the film makes certain.  Nothing may be added afterwards.
  std::vector<int64_t> Finish();

  const KeyframeStats& stats() const { return stats_; }

 private:
  struct Frame {
    int64_t index = 0;
    double time_s = 0;
    cv::Mat small;
    double sharpness = 0;
    double way = 0;  // from the reference, 1: a keyframe is due
  };

  bool Begin(const Frame& frame);
  void SetReference(const Frame& frame);
  double Look(const cv::Mat& small, double* way);
  double WayByTime(const Frame& frame) const;
  void Follow(Frame frame, std::vector<int64_t>* keyframes);
  void Lose(const Frame& frame);
  void Consider(const Frame& frame);
  void Commit(std::vector<int64_t>* keyframes);
  bool IsSharp(const Frame& frame) const;

  KeyframeOptions options_;
  KeyframeStats stats_;
  // The last keyframe; at the beginning of a part its first frame, which need not become one.
  std::vector<cv::Mat> reference_;  // its pyramid; empty: no part has begun
  double reference_s_ = 0;
  bool reference_is_keyframe_ = false;
  bool has_still_part_ = false;       // in a frame since the reference
  std::vector<cv::Point2f> corners_;  // of the reference
  std::vector<cv::Point2f> guesses_;  // where they were last
  std::optional<Frame> candidate_;
  double best_sharpness_ = 0;  // of the frames from first_candidate on
  int num_lost_ = 0;           // frames in a row
  std::deque<double> recent_sharpness_;
  cv::Mat previous_;
};

}  // namespace cairn
