#include "core/features/descriptor_kind_table.h"

#include "core/features/features.h"

namespace cairn {
namespace {

constexpr const char* kTable = "descriptor_kind";

}  // namespace

bool HasDescriptorKind(SQLite::Database& database) { return HasTable(database, kTable); }

Result<DescriptorKind> ReadDescriptorKind(SQLite::Database& database, const std::string& path) {
  if (!HasDescriptorKind(database)) return DescriptorKind();
  LimitedStatement query(database, fmt::format("SELECT kind FROM {}", kTable));
  if (!query.executeStep()) return MakeError(ErrorCode::kCorrupt, "{}: table {} is empty", path, kTable);
  Result<DescriptorKind> kind = ParseDescriptorKind(query.getColumn(0).getString());
  if (!kind.ok())
    return MakeError(ErrorCode::kCorrupt, "{}: table {}: {}", path, kTable, kind.error().message);
  return kind;
}

void WriteDescriptorKind(SQLite::Database& database, const DescriptorKind& kind) {
  if (!kind.is_sift()) StateDescriptorKind(database, kind);
}

void StateDescriptorKind(SQLite::Database& database, const DescriptorKind& kind) {
  database.exec(fmt::format("CREATE TABLE {} (kind TEXT NOT NULL)", kTable));
  SQLite::Statement row(database, fmt::format("INSERT INTO {} VALUES (?)", kTable));
  row.bind(1, ToString(kind));
  row.exec();
}

}  // namespace cairn
