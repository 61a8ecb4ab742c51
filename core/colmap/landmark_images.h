#pragma once

#include <set>

#include "core/base/ids.h"
#include "core/files/database.h"

namespace cairn {

// The images whose features are landmarks of an earlier map (core/capture/capture_features.h), of a database
// with features or matches; none where it has no table of them.  Throws SQLite::Exception: call it inside
// WithDatabaseErrors.
std::set<ImageId> ReadLandmarkImages(SQLite::Database& database);

}  // namespace cairn
