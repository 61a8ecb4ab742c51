#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/colmap/colmap_database.h"

namespace cairn {

// A database whose end is missing: a log whose copying was stopped, or whose disk was full.  SQLite refuses
// it as a whole; what lies on the pages that are there can be read all the same.

// How much of a database's file there is.
struct DatabasePart {
  uint64_t num_bytes = 0;
  uint64_t num_bytes_whole = 0;  // that its head states; 0: it is no database, or its head does not know
  bool is_cut() const { return num_bytes < num_bytes_whole; }
};
// Whole where a filled write-ahead log lies beside it: the rest may be there.
DatabasePart PartOfDatabase(const std::string& path);

// "PATH: truncated: N of M bytes are there"
std::string CutText(const std::string& path, const DatabasePart& part);

// Opens a cut database of COLMAP, immutable and hardened.  Rows that reach beyond its end fail where they are
// read (SQLite's exception); of a blob that ends on the last page, if that page is not whole either, the end
// reads as zeros.  Throws SQLite::Exception.  Errors: Corrupt (a table is missing).
Result<SQLite::Database> OpenCutDatabase(const std::string& path);

// Its images in the order of their ids, up to the first whose row is missing.
std::vector<DatabaseImage> ReadCutDatabaseImages(SQLite::Database& database);

}  // namespace cairn
