#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include <opencv2/core/mat.hpp>

#include "core/base/error.h"

namespace cairn::pipeline {

// A frame of a film, as it is meant to be looked at.
struct FilmFrame {
  double time_s = 0;  // since the film's first frame; ascends
  cv::Mat grey;       // CV_8UC1, luma of full range, upright, square pixels
};

// Reads the frames of a film, in the order in which they are shown, through FFmpeg's libraries:
//
//   CAIRN_ASSIGN_OR_RETURN(const std::unique_ptr<FilmReader> reader, FilmReader::Open(path));
//   for (;;) {
//     CAIRN_ASSIGN_OR_RETURN(const std::optional<FilmFrame> frame, reader->Next());
//     if (!frame) break;
//     ...
//   }
//
// Frames have the times that the film states, at any rate, and are turned and stretched as it states.  What
// is damaged is passed over.  One decoder thread: what a decoder makes of a damaged film depends on the
// number. Only the file itself is opened: no network, no files that it names.
class FilmReader {
 public:
  // Errors: those of CheckInputFile, EmptyFile; Corrupt (not a film, or one that was cut off before its index
  // was written), NoData (no video in it), Unsupported (a codec that is not here).
  static Result<std::unique_ptr<FilmReader>> Open(const std::string& path);
  ~FilmReader();

  // The next frame, or none at the end; frames of more than 2^26 pixels count as damaged.  Errors: Io,
  // Unsupported (pixels that FFmpeg cannot convert).
  Result<std::optional<FilmFrame>> Next();

  // How many frames there are about, for showing progress; 0: not known.
  int64_t ExpectedNumFrames() const;
  // What the file says of its length, seconds; 0: nothing.  It need not be true.
  double StatedDurationS() const;
  // Packets and frames, so far, that were damaged.
  int64_t num_damaged() const;
  // Clockwise, to be applied to the stored picture for it to be upright: 0, 90, 180 or 270.
  int turn_deg() const;
  bool is_interlaced() const;  // some frame so far

 private:
  struct Impl;
  explicit FilmReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace cairn::pipeline
