#pragma once

#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "core/files/database.h"
#include "core/files/file.h"
#include "core/map/map_file.h"
#include "core/map/map_tables.h"

namespace cairn {

// A block's kind, how many elements the directory says that it has, and its bytes.
struct BlockContents {
  BlockKind kind;
  uint32_t count = 0;
  std::string bytes;
  bool is_packed = false;
};

inline std::vector<BlockContents> BlocksOf(const MapFile& file) {
  std::vector<BlockContents> blocks;
  for (const BlockEntry& entry : file.directory().blocks()) {
    blocks.push_back({static_cast<BlockKind>(entry.kind), entry.count,
                      *file.ReadBlock(static_cast<int64_t>(blocks.size()))});
  }
  return blocks;
}

// Writes `map` (a map's bytes) to `path` with these blocks, sealed again: the maker of a map can seal
// any contents.
inline Status WriteSealedBlocks(const std::string& map, const std::vector<BlockContents>& blocks,
                                const std::string& path) {
  std::FILE* const file = std::fopen(path.c_str(), "wb");  // WriteFileAtomically waits for the disk
  if (file == nullptr || std::fwrite(map.data(), 1, map.size(), file) != map.size())
    return MakeError(ErrorCode::kIo, "{}: cannot be written", path);
  std::fclose(file);
  Hash root = {};
  CAIRN_RETURN_IF_ERROR(WithDatabaseErrors(path, [&]() -> Status {
    SQLite::Database database(path, SQLite::OPEN_READWRITE);
    database.exec("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN");
    database.exec("DELETE FROM blocks; DELETE FROM directory");
    database.exec("UPDATE seal SET seal = CAST(substr(seal, 1, 48) || zeroblob(128) AS BLOB)");
    MapDirectory directory;
    SQLite::Statement insert(database, "INSERT INTO blocks VALUES (?, ?)");
    std::array<uint32_t, 256> num_elements = {};
    for (const BlockContents& block : blocks) {
      const auto kind = static_cast<uint8_t>(block.kind);
      BlockEntry entry{.kind = kind,
                       .is_packed = block.is_packed,
                       .first = num_elements[kind],
                       .count = block.count,
                       .num_bytes = static_cast<uint32_t>(block.bytes.size()),
                       .hash = HashOf(block.bytes)};
      entry.centers = Eigen::AlignedBox3f(Eigen::Vector3f::Constant(-100), Eigen::Vector3f::Constant(100));
      num_elements[kind] += block.count;
      insert.bind(1, static_cast<int64_t>(directory.blocks().size()));
      insert.bind(2, block.bytes.data(), static_cast<int>(block.bytes.size()));
      insert.exec();
      insert.reset();
      directory.Add(entry);
    }
    const std::string entries = directory.Encode();
    SQLite::Statement insert_directory(database, "INSERT INTO directory VALUES (?)");
    insert_directory.bind(1, entries.data(), static_cast<int>(entries.size()));
    insert_directory.exec();
    CAIRN_ASSIGN_OR_RETURN(const StoredRows rows, ReadStoredRows(database, path, HeadTables(), 1 << 30));
    root = RootHash(rows, entries);
    database.exec("COMMIT");
    return Ok();
  }));
  return SealFile(path, root);
}

}  // namespace cairn
