#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/world/drop_reason.h"

namespace SQLite {
class Database;
}

namespace cairn {

struct Classes;
struct Decomposition;
struct World;

// One thing that a stage dropped.  Which number names it and what `seen_at` lists depends on the
// reason (schemas/drops.md):
//   image    image_id
//   pair     COLMAP's pair_id                 found: matches before verification
//   feature  group_classes: track_idx         seen_at: keypoints, image_id and keypoint_idx in turn
//            filter_visibility: class_id      found: stations that see it
//            decompose_regions: feature_idx   found: stations that see it
//   keypoint class_id                         seen_at: keypoints, image_id and keypoint_idx in turn
//   view     class_id                         seen_at: station_idx
//   station  station_idx                      found: features visible from it
struct DroppedItem {
  DropReason reason{};
  int64_t item_id = 0;
  std::optional<int64_t> found;
  std::vector<uint32_t> seen_at;
  friend bool operator==(const DroppedItem&, const DroppedItem&) = default;
};

// Name of the table in a stage's own file, and in COLMAP's databases, whose schema has no such table.
inline constexpr char kDroppedItemsTable[] = "dropped_items";
inline constexpr char kColmapDroppedItemsTable[] = "cairn_dropped_items";
inline constexpr char kColmapDroppedItemsSchema[] =
    "CREATE TABLE cairn_dropped_items (reason_id INTEGER NOT NULL, item_id INTEGER NOT NULL, found INTEGER, "
    "seen_at BLOB)";

// Adds rows to the table.  Throws SQLite::Exception.
void WriteDroppedItems(SQLite::Database& database, const char* table, const std::vector<DroppedItem>& items);

// The stages' files with the list of what the stage dropped; otherwise as the functions without it
// (core/world/feature_class.h, world.h, decomposition.h).  A JSON decomposition has no place for the list.
Status WriteClasses(const Classes& classes, const std::string& path,
                    const std::vector<DroppedItem>& dropped_items);
Status WriteWorldDatabase(const World& world, const std::string& path,
                          const std::vector<DroppedItem>& dropped_items);
Status WriteDecomposition(const Decomposition& decomposition, const std::string& path,
                          const std::vector<DroppedItem>& dropped_items);

// All rows, in the order in which they were written; empty where the file has no such table.  Errors: as
// OpenDatabaseReadOnly; Corrupt (an unknown reason, a number out of range, a list of odd length).
Result<std::vector<DroppedItem>> ReadDroppedItems(const std::string& path, const char* table);

}  // namespace cairn
