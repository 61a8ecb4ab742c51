// Maps written: the tables of schemas/0002_map.sql, map_findings.sql and map_changes.sql.
#include <limits>

#include "core/blocks/map_layout.h"
#include "core/blocks/map_rows.h"
#include "core/files/database.h"
#include "core/map/map_findings_tables.h"
#include "core/map/map_head_tables.h"
#include "core/map/map_tables.h"
#include "core/seal/map_seal.h"
#include "schemas/0002_map_sql.h"
#include "schemas/map_changes_sql.h"
#include "schemas/map_findings_sql.h"
#include "schemas/map_moves_sql.h"

namespace cairn {
namespace {

// Small pages waste less at the ends of blobs, large ones are read faster.
constexpr size_t kLandmarksForLargePages = 20'000;

void InsertBlob(SQLite::Database& database, const char* sql, const std::string& bytes) {
  SQLite::Statement insert(database, sql);
  insert.bindNoCopy(1, bytes.data(), static_cast<int>(bytes.size()));
  insert.exec();
}

// Blocks in file order, then their directory; returns it.
Result<std::string> WriteBlocks(SQLite::Database& database, const MapRows& rows) {
  const MapLayout layout(rows);
  MapDirectory directory;
  SQLite::Statement insert(database, "INSERT INTO blocks VALUES (?, ?)");
  for (BlockEntry entry : layout.entries()) {
    const std::string bytes = layout.Encode(entry);
    if (bytes.size() > 500'000'000) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "map: a block of {} bytes, but at most 500 MB can be stored", bytes.size());
    }
    entry.num_bytes = static_cast<uint32_t>(bytes.size());
    entry.hash = HashOf(bytes);
    insert.bind(1, static_cast<int64_t>(directory.blocks().size()));
    insert.bindNoCopy(2, bytes.data(), static_cast<int>(bytes.size()));
    insert.exec();
    insert.reset();
    directory.Add(entry);
  }
  const std::string entries = directory.Encode();
  InsertBlob(database, "INSERT INTO directory VALUES (?)", entries);
  return entries;
}

// Writes everything except the hashes of the seal; returns the root.
Result<Hash> WriteTables(SQLite::Database& database, const MapRows& rows, const std::string& path) {
  constexpr int64_t kAnyNumBytes = std::numeric_limits<int64_t>::max();
  InsertBlob(database, "INSERT INTO seal VALUES (?)", EncodeSeal(Seal()));
  WriteMapFindings(database, rows.findings);
  CAIRN_ASSIGN_OR_RETURN(const StoredRows findings, ReadFindingsRows(database, path, kAnyNumBytes));
  MapHead head = rows;
  head.findings_hash = HexOf(TablesHash(findings));
  WriteMapHead(database, head);
  CAIRN_ASSIGN_OR_RETURN(const std::string directory, WriteBlocks(database, rows));
  CAIRN_ASSIGN_OR_RETURN(const StoredRows stored, ReadStoredRows(database, path, HeadTables(), kAnyNumBytes));
  return RootHash(stored, directory);
}

}  // namespace

Status WriteMapRows(const MapRows& rows, const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckMapRows(rows));
  const int page_size = rows.landmarks.size() < kLandmarksForLargePages ? 512 : 4096;
  return ReplaceFileAtomically(path, [&](const std::string& temporary) -> Status {
    Hash root = {};
    CAIRN_RETURN_IF_ERROR(WithDatabaseErrors(path, [&]() -> Status {
      SQLite::Database database = OpenPrivate(temporary);
      database.exec(fmt::format("PRAGMA page_size = {}; PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;",
                                page_size));
      database.exec("BEGIN");
      database.exec(k0002MapSql);
      database.exec(kMapFindingsSql);
      if (!rows.findings.changes.empty()) database.exec(kMapChangesSql);
      if (rows.findings.HasMoves()) database.exec(kMapMovesSql);
      CAIRN_ASSIGN_OR_RETURN(root, WriteTables(database, rows, path));
      database.exec("COMMIT");
      return Ok();
    }));
    return SealFile(temporary, root);
  });
}

}  // namespace cairn
