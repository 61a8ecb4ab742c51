#pragma once

#include <functional>
#include <string>

#include "core/database.h"
#include "core/error.h"
#include "core/progress.h"
#include "core/views.h"

namespace cairn {

// Writes views.db; ReadViews (core/views.h) reads it.  `fill_changes` fills the table plan_changes.
// Errors: those of the file, Cancelled (nothing is left of it).
Status WriteViews(const Views& views, const std::string& path, Progress& progress,
                  const std::function<Status(SQLite::Database&)>& fill_changes);

}  // namespace cairn
