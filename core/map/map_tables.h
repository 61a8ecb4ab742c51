#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/blocks/map_blocks.h"
#include "core/files/database.h"

namespace cairn {

// Rows of a map's small tables, each read once and by position: what is hashed is what is used.  SQLite may
// answer a second query of a table differently from the first: from an index with other values, or under
// column names that somebody exchanged.  So no table is queried twice.

// A value as SQLite returns it.
struct StoredText {
  std::string text;
};
struct StoredBlob {
  std::string bytes;
};
using StoredValue = std::variant<std::monostate, int64_t, double, StoredText, StoredBlob>;

// One row, with typed access: a value of another type is an error that names table, row and column.
class StoredRow {
 public:
  // `table`: for messages, "kitchen.cairn: table frames"; shared by its rows, which are counted from 1.
  StoredRow(std::shared_ptr<const std::string> table, size_t row, std::vector<StoredValue> values)
      : table_(std::move(table)), row_(row), values_(std::move(values)) {}
  const std::vector<StoredValue>& values() const { return values_; }

  // Errors: Corrupt.  REQUIRES: column < the table's min_num_columns
  Result<std::string> Text(size_t column) const;
  Result<std::string> Blob(size_t column) const;
  Result<double> Real(size_t column) const;
  Result<int64_t> Integer(size_t column) const;
  // In [least, most].
  Result<int64_t> Integer(size_t column, int64_t least, int64_t most) const;
  bool IsNull(size_t column) const { return std::holds_alternative<std::monostate>(values_[column]); }

 private:
  std::string Where() const;
  Error OtherThan(size_t column, const char* expected) const;

  std::shared_ptr<const std::string> table_;
  size_t row_;
  std::vector<StoredValue> values_;
};

// The expected form of a table.  Later minor versions add columns at the end.
struct StoredTable {
  const char* name;
  size_t min_num_columns;
  size_t max_num_rows;
};
using StoredRows = std::map<std::string, std::vector<StoredRow>>;  // by table

// The tables that a robot reads when it opens a map.
const std::vector<StoredTable>& HeadTables();

// Reads tables in the order of their primary keys, in which they lie in the file: no index is used.  Refuses
// texts and blobs of more than `max_num_bytes` together: a file of that size holds more only where several
// values share the same bytes; and more values than such a file has in rows of its own.  Throws
// SQLite::Exception: call it inside WithDatabaseErrors.  Errors: Corrupt (not a plain table, too few columns,
// too many rows or bytes).
Result<StoredRows> ReadStoredRows(SQLite::Database& database, const std::string& path,
                                  const std::vector<StoredTable>& tables, int64_t max_num_bytes);

// BLAKE2b over tables, in the order of their names, as schemas/FORMAT.md says.
Hash TablesHash(const StoredRows& rows);
// The same over the head's tables and then the directory: the hash that a map's signature covers.
Hash RootHash(const StoredRows& head, std::string_view directory);

// Limit of steps: more than reading the head, the findings or a block of a map of this size takes.
int64_t MaxStepsFor(int64_t num_bytes);

}  // namespace cairn
