#include "core/capture/bag_file.h"

#include <algorithm>
#include <filesystem>
#include <string_view>

#include "core/base/text.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "core/files/input_file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

struct BagKind {
  std::string_view suffix;
  std::string_view first_bytes;
  BagStorage storage;
};

constexpr BagKind kBagKinds[] = {
    {".db3", "SQLite format 3", BagStorage::kSqlite},
    {".mcap", "\x89MCAP", BagStorage::kMcap},
    {".bag", "#ROSBAG V", BagStorage::kRos1},
};

bool HasBagSuffix(const std::string& path) {
  return std::any_of(std::begin(kBagKinds), std::end(kBagKinds),
                     [&](const BagKind& kind) { return path.ends_with(kind.suffix); });
}

// A map and the files of stages are SQLite's too.
bool HasBagTables(const std::string& path) {
  const auto has_tables = WithDatabaseErrors(path, [&]() -> Result<bool> {
    SQLite::Database database = OpenImmutable(path);
    return HasTable(database, "topics") && HasTable(database, "messages");
  });
  return has_tables.ok() && *has_tables;
}

}  // namespace

BagStorage BagStorageOf(const std::string& path) {
  const std::string head = ReadHead(path, 16);
  for (const BagKind& kind : kBagKinds) {
    if (head.starts_with(kind.first_bytes)) return kind.storage;
  }
  return BagStorage::kNone;
}

bool IsBag(const std::string& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    if (!BagsInFolder(path).empty()) return true;
    const Result<std::string> text = ReadFile(path + "/" + kBagMetadataFile);
    return text.ok() && text->find("rosbag2_bagfile_information") != std::string::npos;
  }
  if (!CheckInputFile(path).ok()) return false;
  if (HasBagSuffix(path)) return true;
  const BagStorage storage = BagStorageOf(path);
  return storage == BagStorage::kSqlite ? HasBagTables(path) : storage != BagStorage::kNone;
}

std::vector<std::string> BagsInFolder(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (HasBagSuffix(name)) names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  std::vector<std::string> paths;
  for (const int i : NaturalOrder(names)) paths.push_back(folder + "/" + names[i]);
  return paths;
}

std::vector<std::string> FilesOfBag(const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return {path};
  std::vector<std::string> files = BagsInFolder(path);
  const std::string metadata = path + "/" + kBagMetadataFile;
  if (fs::exists(metadata, error)) files.insert(files.begin(), metadata);
  return files;
}

}  // namespace cairn
