#pragma once

#include <functional>
#include <string>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/files/database.h"
#include "core/plan/views.h"

namespace cairn {

// Writes views.db; ReadViews (core/plan/views.h) reads it.  `fill_changes` fills the table plan_changes.
// Errors: those of the file, Cancelled (no file is left).
Status WriteViews(const Views& views, const std::string& path, Progress& progress,
                  const std::function<Status(SQLite::Database&)>& fill_changes);

}  // namespace cairn
