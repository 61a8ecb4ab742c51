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

// Reads the frames of a film, in the order in which they are shown:
//
//   CAIRN_ASSIGN_OR_RETURN(const std::unique_ptr<FilmReader> reader, FilmReader::Open(path));
//   for (;;) {
//     CAIRN_ASSIGN_OR_RETURN(const std::optional<FilmFrame> frame, reader->Next());
//     if (!frame) break;
//     ...
//   }
//
// Frames have the times that the film states, at any rate, and are turned and stretched as it states.  What
// is damaged is passed over.  Only the file itself is opened: no network, no files that it names.
//
// FFmpeg's libraries do the work, some eighty with what they need.  They are loaded, by a module
// (film_module.h), when the first film is opened: who reads no film waits for none of them.
class FilmReader {
 public:
  // Errors: those of CheckInputFile, EmptyFile, those of LoadFilmModule; Corrupt (not a film, or one that was
  // cut off before its index was written), NoData (no video in it), Unsupported (a codec that is not here).
  static Result<std::unique_ptr<FilmReader>> Open(const std::string& path);
  virtual ~FilmReader() = default;

  // The next frame, or none at the end; frames of more than 2^26 pixels count as damaged.  Errors: Io,
  // Unsupported (pixels that FFmpeg cannot convert).
  virtual Result<std::optional<FilmFrame>> Next() = 0;

  // How many frames there are about, for showing progress; 0: not known.
  virtual int64_t ExpectedNumFrames() const = 0;
  // What the file says of its length, seconds; 0: nothing.  It need not be true.
  virtual double StatedDurationS() const = 0;
  // Packets and frames, so far, that were damaged.
  virtual int64_t num_damaged() const = 0;
  virtual bool is_interlaced() const = 0;  // some frame so far
};

}  // namespace cairn::pipeline
