// rosbag2's storage in SQLite (rosbag2_storage_sqlite3 of ROS 2 Foxy to Jazzy): topics(id, name, type,
// serialization_format, ...), messages(id, topic_id, timestamp, data), times in nanoseconds.
#include <filesystem>
#include <map>
#include <set>

#include "core/files/database.h"
#include "pipeline/exchange/bags/files/bag.h"
#include "pipeline/exchange/bags/files/chunk_compression.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

class SqliteBag : public Bag {
 public:
  SqliteBag(std::string path, SQLite::Database database)
      : path_(std::move(path)), database_(std::move(database)) {}

  Status ReadTopics() {
    return WithDatabaseErrors(path_, [&]() -> Status {
      for (const auto& [table, columns] : std::map<std::string, std::vector<std::string>>{
               {"topics", {"id", "name", "type", "serialization_format"}},
               {"messages", {"topic_id", "timestamp", "data"}}}) {
        for (const std::string& column : columns) {
          if (HasTable(database_, table) && HasColumn(database_, table, column)) continue;
          return MakeError(ErrorCode::kUnsupported,
                           "{}: no column {} in a table {}: a SQLite file, but not one that rosbag2 wrote",
                           path_, column, table);
        }
      }
      LimitedStatement query(database_, "SELECT id, name, type, serialization_format FROM topics");
      while (query.executeStep()) {
        const bool is_cdr = query.getColumn(3).getString() == "cdr";
        topics_[query.getColumn(0).getInt64()] = {query.getColumn(1).getString(),
                                                  TypeWithoutMsg(query.getColumn(2).getString()),
                                                  is_cdr ? Serialization::kCdr : Serialization::kUnknown};
      }
      return Ok();
    });
  }

  Result<std::vector<std::string>> Read(BagVisitor& visitor) override {
    std::vector<std::string> damage;
    std::error_code error;
    if (const uintmax_t size = fs::file_size(path_ + "-wal", error); !error && size > 0) {
      damage.push_back(fmt::format(
          "{0}: {0}-wal beside it has messages that are not read: the recording was killed; open it once "
          "with sqlite3, which moves them into the file",
          path_));
    }
    int64_t num_lost = 0;
    int64_t num_shown = 0;
    const Status status = WithDatabaseErrors(path_, [&]() -> Status {
      // In the order of rows, which is that of the file: sorting would hold all images.
      LimitedStatement query(database_, "SELECT topic_id, timestamp, data FROM messages ORDER BY rowid");
      while (query.executeStep()) {
        const auto topic = topics_.find(query.getColumn(0).getInt64());
        if (topic == topics_.end()) {
          ++num_lost;
          continue;
        }
        ++num_shown;
        if (visitor.Wants(topic->second, query.getColumn(1).getInt64()))
          CAIRN_RETURN_IF_ERROR(Show(topic->second, query, visitor, &num_lost));
      }
      return Ok();
    });
    // What SQLite says after some messages, of a page that is missing or damaged: those before are whole.
    const bool is_cut = !status.ok() && status.error().code == ErrorCode::kCorrupt && num_shown > 0 &&
                        status.error().message.starts_with(path_);
    if (!status.ok() && !is_cut) return status.error();
    if (is_cut)
      damage.push_back(fmt::format("{}; the {} messages before are read", status.error().message, num_shown));
    if (num_lost > 0)
      damage.push_back(
          fmt::format("{}: {} messages of no topic, or that cannot be unpacked", path_, num_lost));
    return damage;
  }

 private:
  Status Show(const BagTopic& topic, SQLite::Statement& query, BagVisitor& visitor, int64_t* num_lost) const {
    const SQLite::Column column = query.getColumn(2);
    std::string_view bytes(static_cast<const char*>(column.getBlob()), column.getBytes());
    std::string unpacked;
    if (IsZstd(bytes)) {  // ros2 bag record --compression-mode message; CDR begins with a zero
      Result<std::string> result = UnpackZstd(bytes);
      if (!result.ok()) {
        ++*num_lost;
        return Ok();
      }
      unpacked = std::move(*result);
      bytes = unpacked;
    }
    return visitor.Take({topic, query.getColumn(1).getInt64(), bytes});
  }

  std::string path_;
  SQLite::Database database_;
  std::map<int64_t, BagTopic> topics_;
};

}  // namespace

Result<std::unique_ptr<Bag>> OpenSqliteBag(const std::string& path) {
  std::error_code error;
  const SqliteHeader header = ReadSqliteHeader(path);
  const uint64_t num_bytes = fs::file_size(path, error);
  if (!error && header.page_size * header.num_pages > num_bytes) {
    return MakeError(ErrorCode::kTruncated,
                     "{}: {} bytes of {}: the file was cut off; copy it again, or save what is there with "
                     "sqlite3 FILE .recover | sqlite3 NEW.db3",
                     path, num_bytes, header.page_size * header.num_pages);
  }
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  auto bag = std::make_unique<SqliteBag>(path, std::move(database));
  CAIRN_RETURN_IF_ERROR(bag->ReadTopics());
  return std::unique_ptr<Bag>(std::move(bag));
}

}  // namespace cairn::pipeline
