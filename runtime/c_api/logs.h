#pragma once

#include <memory>

#include "core/base/error.h"
#include "runtime/c_api/cairn.h"
#include "runtime/c_api/calls.h"
#include "runtime/robot_log/shared_log.h"

namespace cairn {

// What stands behind a cairn_log.
struct OpenLog {
  static constexpr const char* kName = "log";
  std::shared_ptr<SharedLog> log;
};
Handles<cairn_log, OpenLog, HandleKind::kLog>& OpenLogs();

// The log that a localizer or tracker of `map` is given; NULL: none.  Errors: InvalidArgument.
Result<std::shared_ptr<SharedLog>> LogFor(const cairn_log* log, const Map& map);

}  // namespace cairn
