#pragma once

#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "core/files/database.h"

namespace cairn {

// A database of these bytes as somebody else might have changed it.  Nothing waits for the disk, which would
// take longer than the tests.
inline std::string EditedDatabase(const std::string& name, const std::string& bytes, const std::string& sql) {
  const std::string path = testing::TempDir() + "/" + name;
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
  SQLite::Database(path, SQLite::OPEN_READWRITE)
      .exec("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; " + sql);
  return path;
}

}  // namespace cairn
