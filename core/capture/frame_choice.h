#pragma once

#include <string>

#include "core/base/error.h"

namespace cairn {

// Which frames of a film, or images of a bag, become images of a capture.
enum class FrameChoice {
  kKeyframes,  // as KeyframeChooser decides
  kAll,
  kEvery,  // by time alone
};

struct WantedFrames {
  FrameChoice choice = FrameChoice::kKeyframes;
  double every_s = 0;  // kEvery: time between images, seconds
};

// Parses "auto", "all" or seconds.  Errors: InvalidArgument.
Result<WantedFrames> ParseFrameChoice(const std::string& text);

}  // namespace cairn
