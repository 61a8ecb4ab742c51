#pragma once

#include <string>

#include "core/base/error.h"
#include "core/features/features.h"
#include "core/files/database.h"

namespace cairn {

// What kind of descriptors a database holds: its table `descriptor_kind`, of one row; without it, SIFT's.
// Both throw SQLite::Exception: call them inside WithDatabaseErrors.  Errors: Corrupt.
Result<DescriptorKind> ReadDescriptorKind(SQLite::Database& database, const std::string& path);
// Whether it has that table.
bool HasDescriptorKind(SQLite::Database& database);
// Writes the table; for SIFT nothing.
void WriteDescriptorKind(SQLite::Database& database, const DescriptorKind& kind);
// The same for SIFT, too.
void StateDescriptorKind(SQLite::Database& database, const DescriptorKind& kind);

}  // namespace cairn
