#pragma once

#include <memory>
#include <string>

#include "core/base/error.h"
#include "core/line/command.h"
#include "core/plan/views.h"
#include "runtime/beams/scan_locator.h"

namespace cairn::pipeline {

// The plan of a map or of views.db, with the regions only where locating scans needs them.  Errors: those of
// OpenPlan and OpenViews (runtime/map/open_views.h).
Result<std::shared_ptr<const Views>> OpenPlanFor(const std::string& path, const ScanLocatorOptions& options,
                                                 const CommandEnvironment& environment);

}  // namespace cairn::pipeline
