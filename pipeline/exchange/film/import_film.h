#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/capture/frame_choice.h"
#include "core/capture/keyframes.h"

namespace cairn::pipeline {

struct FilmOptions {
  FrameChoice choice = FrameChoice::kKeyframes;
  double every_s = 0;  // kEvery: time between images, seconds.  REQUIRES: > 0
  // MODEL,WIDTH,HEIGHT,PARAM,... of the upright picture, in COLMAP's pixels; empty: not known, then there is
  // no cameras.txt and `reconstruct` finds the focal length.
  std::string camera;
  // Of the JPEG files; 95: see docs/captures.md.  REQUIRES: in [1, 100]
  int jpeg_quality = 95;
};

struct FilmReport {
  KeyframeStats frames;  // of kAll and kEvery only num_frames and num_keyframes
  double duration_s = 0;
  int width = 0, height = 0;          // of the first image, px
  std::vector<std::string> warnings;  // damage, gaps, cuts: a sentence each
};

// Writes the frames of a film as a capture without poses, in one step: images/SECONDS.jpg, grey, named by
// their time in the film (000012.345.jpg), so that the order of names is that of time; cameras.txt where the
// camera is known.  One pass; memory: a few frames.  With two threads the next frame is decoded meanwhile;
// same files for any number.  Errors: those of FilmReader; InvalidArgument (the camera; or it is of another
// size than the film), NoData (no frame can be decoded; kKeyframes: the camera never moves, all is blank),
// Io, Cancelled.
Result<FilmReport> ImportFilm(const std::string& path, const FilmOptions& options, const std::string& output,
                              int num_threads, Progress& progress);

}  // namespace cairn::pipeline
