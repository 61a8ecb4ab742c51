#pragma once

#include <memory>
#include <string>

#include "core/base/error.h"
#include "core/plan/views.h"

namespace cairn {

class Progress;  // core/base/progress.h

// A floor plan from a map that has one or from views.db; the file's contents say which of the two it is. With
// its view-invariant regions where the file has them.  Errors: those of Map::Open and Map::Plan, or of
// ReadViews.
Result<std::shared_ptr<const Views>> OpenPlan(const std::string& path);

// The same with the regions in any case.  Errors: those of Map::FloorViews too.
Result<std::shared_ptr<const Views>> OpenViews(const std::string& path, int num_threads, int64_t memory_mib,
                                               Progress& progress);

}  // namespace cairn
