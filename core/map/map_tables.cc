#include "core/map/map_tables.h"

#include <bit>

#include "core/seal/map_seal.h"

namespace cairn {
namespace {

StoredValue ValueOf(const SQLite::Column& column) {
  switch (column.getType()) {
    case SQLITE_INTEGER:
      return column.getInt64();
    case SQLITE_FLOAT:
      return column.getDouble();
    case SQLITE_TEXT:
      return StoredText{column.getString()};
    case SQLITE_BLOB:
      return StoredBlob{column.getString()};
    default:
      return std::monostate();
  }
}

int64_t NumBytes(const StoredValue& value) {
  if (const auto* const text = std::get_if<StoredText>(&value)) return std::ssize(text->text);
  if (const auto* const blob = std::get_if<StoredBlob>(&value)) return std::ssize(blob->bytes);
  return 0;
}

// A NULL or a small number takes a byte of a file, and as much memory as any other value.  A row takes as
// much as three.
int64_t MaxNumValues(int64_t num_bytes) { return 100'000 + num_bytes / 3; }
constexpr int64_t kValuesOfRow = 3;

void AddBytes(std::string_view bytes, Hasher* hasher) {
  hasher->Add(static_cast<uint64_t>(bytes.size()));
  hasher->Add(bytes);
}

void AddValue(const StoredValue& value, Hasher* hasher) {
  if (const auto* const integer = std::get_if<int64_t>(&value)) {
    hasher->Add(uint64_t{SQLITE_INTEGER});
    hasher->Add(static_cast<uint64_t>(*integer));
  } else if (const auto* const real = std::get_if<double>(&value)) {
    hasher->Add(uint64_t{SQLITE_FLOAT});
    hasher->Add(std::bit_cast<uint64_t>(*real));
  } else if (const auto* const text = std::get_if<StoredText>(&value)) {
    hasher->Add(uint64_t{SQLITE_TEXT});
    AddBytes(text->text, hasher);
  } else if (const auto* const blob = std::get_if<StoredBlob>(&value)) {
    hasher->Add(uint64_t{SQLITE_BLOB});
    AddBytes(blob->bytes, hasher);
  } else {
    hasher->Add(uint64_t{SQLITE_NULL});
  }
}

void AddTables(const StoredRows& rows, Hasher* hasher) {
  for (const auto& [table, of_table] : rows) {
    hasher->Add(table);
    for (const StoredRow& row : of_table) {
      hasher->Add(static_cast<uint64_t>(row.values().size()));
      for (const StoredValue& value : row.values()) AddValue(value, hasher);
    }
    hasher->Add(uint64_t{0});
  }
}

}  // namespace

std::string StoredRow::Where() const { return fmt::format("{}, row {}", *table_, row_); }

Error StoredRow::OtherThan(size_t column, const char* expected) const {
  constexpr const char* kTypes[] = {"nothing", "an integer", "a number", "a text", "a blob"};
  return Corrupt(Where(), "column {} is {}, expected {}", column + 1, kTypes[values_[column].index()],
                 expected);
}

Result<std::string> StoredRow::Text(size_t column) const {
  const auto* const value = std::get_if<StoredText>(&values_[column]);
  if (value == nullptr) return OtherThan(column, "a text");
  return value->text;
}

Result<std::string> StoredRow::Blob(size_t column) const {
  const auto* const value = std::get_if<StoredBlob>(&values_[column]);
  if (value == nullptr) return OtherThan(column, "a blob");
  return value->bytes;
}

Result<double> StoredRow::Real(size_t column) const {
  const auto* const value = std::get_if<double>(&values_[column]);
  if (value == nullptr) return OtherThan(column, "a number");
  return *value;
}

Result<int64_t> StoredRow::Integer(size_t column) const {
  const auto* const value = std::get_if<int64_t>(&values_[column]);
  if (value == nullptr) return OtherThan(column, "an integer");
  return *value;
}

Result<int64_t> StoredRow::Integer(size_t column, int64_t least, int64_t most) const {
  CAIRN_ASSIGN_OR_RETURN(const int64_t value, Integer(column));
  if (value >= least && value <= most) return value;
  return Corrupt(Where(), "column {} is {}, expected {} to {}", column + 1, value, least, most);
}

const std::vector<StoredTable>& HeadTables() {
  static const std::vector<StoredTable> tables = {{"cameras", 6, 1 << 20},   {"frames", 8, 64},
                                                  {"inputs", 2, 4096},       {"meta", 2, 4096},
                                                  {"self_test", 2, 1 << 16}, {"stage_options", 2, 1024}};
  return tables;
}

Result<StoredRows> ReadStoredRows(SQLite::Database& database, const std::string& path,
                                  const std::vector<StoredTable>& tables, int64_t max_num_bytes) {
  StoredRows rows;
  int64_t num_bytes = 0, num_values = 0;
  for (const StoredTable& table : tables) {
    CAIRN_RETURN_IF_ERROR(CheckPlainTable(database, path, table.name));
    // No ORDER BY: the order is that of the table's b-tree, and a sorter would keep all rows before
    // the first.
    LimitedStatement query(database, fmt::format("SELECT * FROM {} NOT INDEXED", table.name));
    const auto num_columns = static_cast<size_t>(query.getColumnCount());
    if (num_columns < table.min_num_columns) {
      return Corrupt(path, "table {} has {} columns, expected {}", table.name, num_columns,
                     table.min_num_columns);
    }
    const auto where = std::make_shared<const std::string>(fmt::format("{}: table {}", path, table.name));
    std::vector<StoredRow>& of_table = rows[table.name];
    while (query.executeStep()) {
      if (of_table.size() == table.max_num_rows)
        return Corrupt(path, "table {} has more than {} rows", table.name, table.max_num_rows);
      std::vector<StoredValue> values;
      for (size_t i = 0; i < num_columns; ++i) {
        values.push_back(ValueOf(query.getColumn(static_cast<int>(i))));
        num_bytes += NumBytes(values.back());
      }
      num_values += kValuesOfRow + static_cast<int64_t>(num_columns);
      if (num_bytes > max_num_bytes || num_values > MaxNumValues(max_num_bytes)) {
        return Corrupt(path, "table {} shows more than the {} bytes that the file has", table.name,
                       max_num_bytes);
      }
      of_table.emplace_back(where, of_table.size() + 1, std::move(values));
    }
  }
  return rows;
}

Hash TablesHash(const StoredRows& rows) {
  Hasher hasher;
  AddTables(rows, &hasher);
  return hasher.Finish();
}

Hash RootHash(const StoredRows& head, std::string_view directory) {
  Hasher hasher;
  AddTables(head, &hasher);
  AddBytes(directory, &hasher);
  return hasher.Finish();
}

int64_t MaxStepsFor(int64_t num_bytes) { return 1'000'000 + num_bytes; }

}  // namespace cairn
