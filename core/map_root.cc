#include "core/map_root.h"

#include <bit>

#include "core/map_head.h"
#include "core/map_seal.h"

namespace cairn {

Hash RootHash(SQLite::Database& database, std::string_view directory) {
  Hasher hasher;
  for (const char* const table : {"cameras", "frames", "inputs", "meta", "self_test", "stage_options"}) {
    hasher.Add(table);
    SQLite::Statement query(database, fmt::format("SELECT * FROM {} ORDER BY 1", table));
    while (query.executeStep()) {
      hasher.Add(static_cast<uint64_t>(query.getColumnCount()));
      for (int i = 0; i < query.getColumnCount(); ++i) {
        const SQLite::Column column = query.getColumn(i);
        const int type = column.getType();
        hasher.Add(static_cast<uint64_t>(type));
        if (type == SQLITE_INTEGER) {
          hasher.Add(static_cast<uint64_t>(column.getInt64()));
        } else if (type == SQLITE_FLOAT) {
          hasher.Add(std::bit_cast<uint64_t>(column.getDouble()));
        } else if (type != SQLITE_NULL) {
          hasher.Add(static_cast<uint64_t>(column.getBytes()));
          hasher.Add(BlobView(column));
        }
      }
    }
    hasher.Add(uint64_t{0});
  }
  hasher.Add(static_cast<uint64_t>(directory.size()));
  hasher.Add(directory);
  return hasher.Finish();
}

}  // namespace cairn
