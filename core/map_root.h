#pragma once

#include <string_view>

#include "core/database.h"
#include "core/map_blocks.h"

namespace cairn {

// Hash of every row of the tables that a robot reads when it opens a map, and of its directory: what a map's
// signature stands for (schemas/FORMAT.md).  Throws SQLite::Exception.
Hash RootHash(SQLite::Database& database, std::string_view directory);

}  // namespace cairn
