#pragma once

#include <memory>
#include <string>

#include "core/base/error.h"
#include "runtime/localize/localization.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/map.h"

namespace cairn {

class QueryFrame;  // runtime/localize/localizer.h

// A log of a map's frames for several localizers and trackers, in any threads.  A log that can no longer be
// written keeps nothing more, and keeps no robot from knowing where it is: the answers go on, and error()
// says why.  Frames have no file: they are called as if they came from .pgm files.
class SharedLog {
 public:
  // As RobotLog::Open (runtime/robot_log/robot_log.h), by the machine's clocks; at most 10^6 times so many
  // bytes in any 24 hours.  No images are kept.
  static constexpr double kMaxMbPerDay = 50;
  static Result<std::shared_ptr<SharedLog>> Open(const std::string& folder, const Map& map,
                                                 double max_mb_per_day = kMaxMbPerDay);
  ~SharedLog();
  SharedLog(const SharedLog&) = delete;
  SharedLog& operator=(const SharedLog&) = delete;

  // Errors: InvalidArgument (of a map of another name or frame).
  Status CheckIsOf(const Map& map) const;

  // A frame that was localized; without a fix, or after Close, nothing happens.
  void Offer(const Query& query, const Localization& found);
  // Its features are extracted only where it may be kept; where they cannot be, it is not.
  void Offer(QueryFrame* frame, const Localization& found);

  // What keeps it from being written.
  Status error() const;
  int num_kept() const;
  // Another process may write to it.
  void Close();

 private:
  struct State;
  explicit SharedLog(std::unique_ptr<State> state);
  bool IsWanted(const Localization& found);

  std::unique_ptr<State> state_;
};

}  // namespace cairn
