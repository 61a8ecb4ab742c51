#pragma once

#include <string>
#include <string_view>

#include "core/blocks/map_head.h"
#include "core/files/database.h"
#include "core/map/map_tables.h"

namespace cairn {

// The small tables of a map that every format has: meta, stage_options, inputs, frames, cameras, self_test.
// All of these throw SQLite::Exception: call them inside WithDatabaseErrors.

// From the rows of HeadTables().  Errors: Corrupt.
Status DecodeMapHead(const StoredRows& rows, const std::string& path, MapHead* head);
void WriteMapHead(SQLite::Database& database, const MapHead& head);

// Whether the file is a map of this major version.  Errors: ForeignFile; TooNew, naming the writer; TooOld.
Status CheckMapVersion(SQLite::Database& database, const std::string& path, int major);

// A column's bytes, valid until the statement's next step.
std::string_view BlobView(const SQLite::Column& column);
// Columns first .. first + 6: qw, qx, qy, qz, tx, ty, tz.
Pose PoseFromColumns(SQLite::Statement& statement, int first);

}  // namespace cairn
