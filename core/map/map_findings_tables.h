#pragma once

#include <string>

#include "core/blocks/map_findings.h"
#include "core/files/database.h"
#include "core/map/map_tables.h"

namespace cairn {

// The tables of schemas/map_findings.sql, and of map_changes.sql where there are changes, inside a map file.
// These throw SQLite::Exception: call them inside WithDatabaseErrors.
void WriteMapFindings(SQLite::Database& database, const MapFindings& findings);
// Reads those of the tables that the file has, as ReadStoredRows: earlier formats lack some.
Result<StoredRows> ReadFindingsRows(SQLite::Database& database, const std::string& path,
                                    int64_t max_num_bytes);

// The findings in the rows; not yet checked with CheckMapFindings.  Errors: Corrupt.
Result<MapFindings> DecodeMapFindings(const StoredRows& rows, const std::string& path);

}  // namespace cairn
