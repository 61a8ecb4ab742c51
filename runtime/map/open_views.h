#pragma once

#include <memory>
#include <string>

#include "core/base/error.h"
#include "core/plan/views.h"

namespace cairn {

// The view-invariant regions of a floor plan, from a map that has them or from views.db; the file's contents
// say which of the two it is.  Errors: those of Map::Open and Map::FloorViews, or of ReadViews.
Result<std::shared_ptr<const Views>> OpenViews(const std::string& path);

}  // namespace cairn
