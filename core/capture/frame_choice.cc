#include "core/capture/frame_choice.h"

#include <cmath>

#include "core/base/text.h"

namespace cairn {

Result<WantedFrames> ParseFrameChoice(const std::string& text) {
  WantedFrames wanted;
  if (text == "auto") return wanted;
  wanted.choice = FrameChoice::kAll;
  if (text == "all") return wanted;
  wanted.choice = FrameChoice::kEvery;
  if (ParseNumber(text, &wanted.every_s) && std::isfinite(wanted.every_s) && wanted.every_s > 0)
    return wanted;
  return MakeError(ErrorCode::kInvalidArgument,
                   "keyframes '{}': must be auto, all, or the seconds between images, such as 0.5", text);
}

}  // namespace cairn
