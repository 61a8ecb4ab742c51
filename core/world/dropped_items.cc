#include "core/world/dropped_items.h"

#include <string_view>

#include "core/files/database.h"

namespace cairn {
namespace {

bool HoldsKeypoints(const DropReasonEntry& reason) {
  return reason.kind == DropKind::kKeypoint ||
         (reason.kind == DropKind::kFeature && std::string_view(reason.stage) == "group_classes");
}

Result<DroppedItem> ItemOfRow(SQLite::Statement& row, const std::string& what) {
  DroppedItem item;
  const int64_t reason_id = row.getColumn(0).getInt64();
  const DropReasonEntry* const reason =
      reason_id >= 0 && reason_id < 1 << 16 ? FindDropReason(static_cast<int>(reason_id)) : nullptr;
  if (reason == nullptr) return Corrupt(what, "unknown reason {}", reason_id);
  item.reason = reason->reason;
  item.item_id = row.getColumn(1).getInt64();
  if (item.item_id < 0) return Corrupt(what, "item {}", item.item_id);
  if (!row.getColumn(2).isNull()) item.found = row.getColumn(2).getInt64();
  CAIRN_ASSIGN_OR_RETURN(item.seen_at, BlobToVector<uint32_t>(row.getColumn(3), what));
  if (HoldsKeypoints(*reason) && item.seen_at.size() % 2 != 0)
    return Corrupt(what, "a keypoint without its index");
  return item;
}

}  // namespace

void WriteDroppedItems(SQLite::Database& database, const char* table, const std::vector<DroppedItem>& items) {
  SQLite::Statement insert(database, fmt::format("INSERT INTO {} VALUES (?, ?, ?, ?)", table));
  for (const DroppedItem& item : items) {
    insert.bind(1, static_cast<int>(item.reason));
    insert.bind(2, item.item_id);
    if (item.found) insert.bind(3, *item.found);
    if (!item.seen_at.empty())
      insert.bindNoCopy(4, item.seen_at.data(), static_cast<int>(item.seen_at.size() * sizeof(uint32_t)));
    insert.exec();
    insert.reset();
    insert.clearBindings();
  }
}

Result<std::vector<DroppedItem>> ReadDroppedItems(const std::string& path, const char* table) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  return WithDatabaseErrors(path, [&]() -> Result<std::vector<DroppedItem>> {
    std::vector<DroppedItem> items;
    if (!HasTable(database, table)) return items;
    LimitedStatement row(
        database, fmt::format("SELECT reason_id, item_id, found, seen_at FROM {} ORDER BY rowid", table));
    while (row.executeStep()) {
      const std::string what = fmt::format("{}: table {}, row {}", path, table, items.size() + 1);
      CAIRN_ASSIGN_OR_RETURN(DroppedItem item, ItemOfRow(row, what));
      items.push_back(std::move(item));
    }
    return items;
  });
}

}  // namespace cairn
