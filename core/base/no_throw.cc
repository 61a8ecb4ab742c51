#include "core/base/no_throw.h"

#include <new>
#include <system_error>

#include <opencv2/core.hpp>

namespace cairn {

bool IsOutOfMemory(const std::exception& exception) {
  if (dynamic_cast<const std::bad_alloc*>(&exception) != nullptr) return true;
  if (const auto* of_opencv = dynamic_cast<const cv::Exception*>(&exception))
    return of_opencv->code == cv::Error::StsNoMem;
  const auto* of_system = dynamic_cast<const std::system_error*>(&exception);
  return of_system != nullptr && (of_system->code() == std::errc::resource_unavailable_try_again ||
                                  of_system->code() == std::errc::not_enough_memory);
}

Error ErrorOfCaught(const char* what) {
  try {
    throw;
  } catch (const std::exception& exception) {
    if (IsOutOfMemory(exception)) return MakeError(ErrorCode::kNoMemory, "{}: out of memory", what);
    return MakeError(ErrorCode::kFailed, "{}: {}", what, exception.what());
  } catch (...) {
    return MakeError(ErrorCode::kFailed, "{}: an unknown exception", what);
  }
}

}  // namespace cairn
