#include "pipeline/exchange/film/import_film.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "core/base/parallel.h"
#include "core/camera/camera.h"
#include "core/colmap/cameras_text.h"
#include "core/files/file.h"
#include "core/files/folder.h"
#include "core/images/image_file.h"
#include "pipeline/exchange/film/film_reader.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// Between two frames: a gap is longer than this, seconds, and than this many times what is usual.
constexpr double kGapS = 0.5;
constexpr double kGapFactor = 5;
// A film that ends before this part of the length that it states, and by more than a second, was cut off.
constexpr double kWholeRatio = 0.98;
// A frame that is due counts although it comes early by this part of the interval: films round their times.
constexpr double kEarlyRatio = 0.01;
// In a warning.
constexpr size_t kMaxNumTimes = 8;

// "12.3 s, 15.0 s and 4 more".
std::string TimesText(const std::vector<double>& times_s) {
  std::vector<std::string> texts;
  for (size_t i = 0; i < std::min(times_s.size(), kMaxNumTimes); ++i)
    texts.push_back(fmt::format("{:.1f} s", times_s[i]));
  return fmt::format(
      "{}{}", fmt::join(texts, ", "),
      times_s.size() > kMaxNumTimes ? fmt::format(" and {} more", times_s.size() - kMaxNumTimes) : "");
}

// The frames of a film, the next one decoded meanwhile where a second thread is allowed.
class FrameQueue {
 public:
  FrameQueue(FilmReader& reader, int num_threads)
      : reader_(reader), policy_(num_threads > 1 ? std::launch::async : std::launch::deferred) {
    Ask();
  }

  Result<std::optional<FilmFrame>> Next() {
    Result<std::optional<FilmFrame>> frame = next_.get();
    if (frame.ok() && frame->has_value()) Ask();
    return frame;
  }

 private:
  void Ask() {
    next_ = std::async(policy_, [this] { return reader_.Next(); });
  }

  FilmReader& reader_;
  std::launch policy_;
  std::future<Result<std::optional<FilmFrame>>> next_;  // waits for its thread when it is destroyed
};

// Times of the frames: gaps between them, and their names.
class FilmClock {
 public:
  void Tick(double time_s) {
    if (num_intervals_ >= 0) {
      const double interval_s = time_s - last_s_;
      const double usual_s = num_intervals_ > 0 ? sum_s_ / static_cast<double>(num_intervals_) : interval_s;
      if (interval_s > kGapS && interval_s > kGapFactor * usual_s) {
        gaps_s_.push_back(last_s_);
      } else {
        sum_s_ += interval_s;
        ++num_intervals_;
      }
    } else {
      num_intervals_ = 0;
    }
    last_s_ = time_s;
  }
  double last_s() const { return last_s_; }
  const std::vector<double>& gaps_s() const { return gaps_s_; }

 private:
  int64_t num_intervals_ = -1;  // -1: no frame yet
  double sum_s_ = 0, last_s_ = 0;
  std::vector<double> gaps_s_;
};

class FilmImporter {
 public:
  FilmImporter(const std::string& path, const FilmOptions& options, std::optional<Camera> camera,
               std::string folder, FilmReport* report)
      : path_(path),
        options_(options),
        camera_(std::move(camera)),
        folder_(std::move(folder)),
        report_(*report),
        chooser_(ChooserOptions()) {}

  Status Run(FilmReader& reader, int num_threads, Progress& progress) {
    FrameQueue frames(reader, num_threads);
    for (int64_t index = 0;; ++index) {
      if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "importing was stopped");
      CAIRN_ASSIGN_OR_RETURN(std::optional<FilmFrame> frame, frames.Next());
      if (!frame) break;
      clock_.Tick(frame->time_s);
      CAIRN_RETURN_IF_ERROR(Take(index, *frame));
      progress.Advance();
    }
    if (options_.choice == FrameChoice::kKeyframes) {
      for (const int64_t index : chooser_.Finish()) CAIRN_RETURN_IF_ERROR(Write(kept_.at(index)));
      report_.frames = chooser_.stats();
    }
    report_.duration_s = clock_.last_s();
    CAIRN_RETURN_IF_ERROR(CheckResult(reader));
    AddWarnings(reader);
    if (camera_) return WriteCamerasText(folder_ + "/cameras.txt", {{camera_->camera_id, *camera_}});
    return Ok();
  }

 private:
  KeyframeOptions ChooserOptions() const {
    KeyframeOptions options;
    if (camera_ && camera_->model != CameraModel::kEquirectangular)
      options.focal_ratio = camera_->MeanFocal() / std::max(camera_->width, camera_->height);
    return options;
  }

  // Writes the frame, or what it makes certain.
  Status Take(int64_t index, const FilmFrame& frame) {
    if (camera_ && frame.grey.size() != cv::Size(camera_->width, camera_->height))
      return OtherSize(index, frame);
    if (options_.choice != FrameChoice::kKeyframes) {
      ++report_.frames.num_frames;
      if (options_.choice == FrameChoice::kEvery && frame.time_s < next_s_ - kEarlyRatio * options_.every_s)
        return Ok();
      // From the frame on that was taken, so that slow films give no bunches.
      next_s_ = std::max(next_s_ + options_.every_s, frame.time_s + 0.5 * options_.every_s);
      ++report_.frames.num_keyframes;
      return Write(frame);
    }
    kept_.emplace(index, frame);
    const size_t num_cuts = chooser_.stats().cuts.size();
    for (const int64_t keyframe : chooser_.Add(index, frame.grey))
      CAIRN_RETURN_IF_ERROR(Write(kept_.at(keyframe)));
    if (chooser_.stats().cuts.size() > num_cuts) cuts_s_.push_back(frame.time_s);
    const std::optional<int64_t> candidate = chooser_.Candidate();
    std::erase_if(kept_, [&](const auto& kept) { return kept.first != candidate; });
    return Ok();
  }

  Status OtherSize(int64_t index, const FilmFrame& frame) {
    if (index > 0) {
      ++num_of_other_size_;
      return Ok();
    }
    const bool is_turned = frame.grey.size() == cv::Size(camera_->height, camera_->width);
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: its picture is {} x {} pixels, but --camera has {} x {}{}", path_, frame.grey.cols,
                     frame.grey.rows, camera_->width, camera_->height,
                     is_turned ? "; the film says that it is turned, and is made upright: give the camera of "
                                 "the upright picture"
                               : "");
  }

  Status Write(const FilmFrame& frame) {
    if (report_.width == 0) {
      report_.width = frame.grey.cols;
      report_.height = frame.grey.rows;
    }
    // Names differ even where frames are nearer to each other than a millisecond.
    name_ms_ = std::max(name_ms_ + 1, static_cast<int64_t>(std::llround(frame.time_s * 1000)));
    const std::string path =
        fmt::format("{}/images/{:06}.{:03}.jpg", folder_, name_ms_ / 1000, name_ms_ % 1000);
    CAIRN_ASSIGN_OR_RETURN(const std::string bytes, EncodeJpeg(frame.grey, options_.jpeg_quality, path));
    return WriteFileAtomically(path, bytes);
  }

  Status CheckResult(const FilmReader& reader) const {
    const KeyframeStats& frames = report_.frames;
    if (frames.num_frames == 0) {
      return MakeError(ErrorCode::kCorrupt,
                       "{}: no frame of it can be decoded ({} are damaged); copy the film again", path_,
                       reader.num_damaged());
    }
    if (options_.choice != FrameChoice::kKeyframes || frames.num_keyframes > 1) return Ok();
    if (frames.num_keyframes == 0) {
      return MakeError(ErrorCode::kNoData,
                       "{}: {} frames, all of them black or of one colour: nothing is seen in this film",
                       path_, frames.num_frames);
    }
    if (frames.num_frames == 1)
      return MakeError(ErrorCode::kNoData, "{}: one frame; a map needs a film of a walk", path_);
    return MakeError(
        ErrorCode::kNoData,
        "{}: the camera never moves: {} frames in {:.1f} s show the same; walk through the place, "
        "or take all frames with --keyframes all",
        path_, frames.num_frames, report_.duration_s);
  }

  void AddWarnings(const FilmReader& reader) {
    std::vector<std::string>& warnings = report_.warnings;
    const double stated_s = reader.StatedDurationS();
    if (report_.duration_s < kWholeRatio * stated_s && report_.duration_s + 1 < stated_s) {
      warnings.push_back(
          fmt::format("{}: says that it is {:.1f} s long, but its frames end after {:.1f} s: was it "
                      "cut off? What is there was taken",
                      path_, stated_s, report_.duration_s));
    }
    if (reader.num_damaged() > 0)
      warnings.push_back(
          fmt::format("{}: {} frames are damaged and were left out", path_, reader.num_damaged()));
    if (num_of_other_size_ > 0) {
      warnings.push_back(fmt::format("{}: {} frames are of another size than --camera and were left out",
                                     path_, num_of_other_size_));
    }
    if (!clock_.gaps_s().empty())
      warnings.push_back(fmt::format("{}: frames are missing after {}", path_, TimesText(clock_.gaps_s())));
    if (!cuts_s_.empty()) {
      warnings.push_back(
          fmt::format("{}: nothing of what was seen before is seen at {}: cuts, or turns that are "
                      "too fast; parts that share no view with the rest are left out of the map",
                      path_, TimesText(cuts_s_)));
    }
    if (2 * report_.frames.num_with_still_part > report_.frames.num_keyframes) {
      warnings.push_back(fmt::format(
          "{}: a part of the picture stands still while the rest moves (a logo, a border, the frame of "
          "a screen that was filmed): images are matched by it although they show different places; "
          "crop it away, for example with ffmpeg -vf crop",
          path_));
    }
    if (reader.is_interlaced()) {
      warnings.push_back(
          fmt::format("{}: interlaced: moving edges are combed; deinterlace it for a better map, "
                      "for example with ffmpeg -vf bwdif",
                      path_));
    }
  }

  const std::string& path_;
  const FilmOptions& options_;
  const std::optional<Camera> camera_;
  const std::string folder_;
  FilmReport& report_;
  KeyframeChooser chooser_;
  FilmClock clock_;
  std::map<int64_t, FilmFrame> kept_;  // frames that may still become images
  std::vector<double> cuts_s_;
  double next_s_ = 0;
  int64_t name_ms_ = -1;
  int64_t num_of_other_size_ = 0;
};

}  // namespace

Result<FilmReport> ImportFilm(const std::string& path, const FilmOptions& options, const std::string& output,
                              int num_threads, Progress& progress) {
  std::optional<Camera> camera;
  if (!options.camera.empty()) {
    CAIRN_ASSIGN_OR_RETURN(camera, ParseCamera(options.camera));
  }
  CAIRN_ASSIGN_OR_RETURN(const std::unique_ptr<FilmReader> reader, FilmReader::Open(path));
  cv::setNumThreads(1);
  FilmReport report;
  progress.Begin("import", reader->ExpectedNumFrames(), "frames");
  const Status status =
      ReplaceFolderAtomically(output, "a capture", [&](const std::string& folder) -> Status {
        std::error_code error;
        if (!fs::create_directories(folder + "/images", error))
          return MakeError(ErrorCode::kIo, "{}: cannot be created: {}", folder, error.message());
        return FilmImporter(path, options, camera, folder, &report)
            .Run(*reader, NumThreads(num_threads), progress);
      });
  progress.End();
  if (!status.ok()) return status.error();
  return report;
}

}  // namespace cairn::pipeline
