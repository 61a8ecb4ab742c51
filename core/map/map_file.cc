#include "core/map/map_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <mutex>

#include "core/files/database.h"
#include "core/map/map_findings_tables.h"
#include "core/map/map_head_tables.h"
#include "core/map/map_tables.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr char kSelectBlock[] = "SELECT bytes FROM blocks NOT INDEXED WHERE block_idx = ?";

// A fuzzer cannot get past a hash: built for fuzzing, any hash is accepted.
template <typename T>
bool SameHash(const T& found, const T& stated) {
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
  (void)found, (void)stated;
  return true;
#else
  return found == stated;
#endif
}

// Checks the header of a regular file and its length; never waits for a pipe.
Status CheckContainer(const std::string& path) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) {
    if (errno == ENOENT || errno == ENOTDIR) return MakeError(ErrorCode::kNotFound, "{}: no such file", path);
    return MakeError(ErrorCode::kIo, "{}: cannot be opened: {}", path, std::strerror(errno));
  }
  struct stat status = {};
  const bool is_regular = fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
  std::string head(100, '\0');
  const ssize_t num_read = is_regular ? pread(descriptor, head.data(), head.size(), 0) : 0;
  const int error = errno;
  close(descriptor);
  if (!is_regular) return MakeError(ErrorCode::kNotSqlite, "{}: not a regular file, expected a map", path);
  if (num_read < 0) return MakeError(ErrorCode::kIo, "{}: cannot be read: {}", path, std::strerror(error));
  const auto num_bytes = static_cast<uint64_t>(status.st_size);
  if (num_bytes == 0) {
    return MakeError(ErrorCode::kEmptyFile, "{}: is empty, expected a map; copy it again", path);
  }
  head.resize(static_cast<size_t>(num_read));
  if (!head.starts_with(std::string_view("SQLite format 3", 16))) {
    return MakeError(
        ErrorCode::kNotSqlite,
        "{}: not a SQLite database, and so not a map ({} bytes without the magic 'SQLite format 3')", path,
        num_bytes);
  }
  const SqliteHeader header = ParseSqliteHeader(head);
  const uint64_t stated = header.page_size * header.num_pages;
  if (num_bytes < stated || num_bytes < 512) {
    return MakeError(ErrorCode::kTruncated, "{}: has {} bytes, but should have {}; copy it again", path,
                     num_bytes, stated);
  }
  if (num_bytes > stated) {
    return MakeError(ErrorCode::kCorrupt, "{}: has {} bytes, but should have {}; copy it again", path,
                     num_bytes, stated);
  }
  return Ok();
}

Result<std::string> ReadDirectory(SQLite::Database& database, const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckPlainTable(database, path, "directory"));
  LimitedStatement query(database, "SELECT entries FROM directory NOT INDEXED");
  if (!query.executeStep()) return Corrupt(path, "table directory is empty");
  return std::string(BlobView(query.getColumn(0)));
}

Error DamagedHead(const std::string& path) {
  return Corrupt(path,
                 "head and directory do not have the hash that is sealed: the file was damaged or changed; "
                 "copy it again");
}

// The result of `read`, or SQLite's error, also for more steps than reading such a file takes.
template <typename Read>
auto WithinSteps(SQLite::Database& database, const std::string& path, int64_t num_bytes, Read&& read)
    -> std::invoke_result_t<Read> {
  const StepLimit steps(database, MaxStepsFor(num_bytes));
  return WithDatabaseErrors(path, std::forward<Read>(read));
}

}  // namespace

struct MapFile::Connection {
  explicit Connection(SQLite::Database opened) : database(std::move(opened)), block(database, kSelectBlock) {}
  SQLite::Database database;
  SQLite::Statement block;
  std::mutex mutex;
};

MapFile::MapFile() = default;
MapFile::MapFile(MapFile&&) noexcept = default;
MapFile::~MapFile() = default;

Result<MapFile> MapFile::Open(const std::string& path, const MapFileOptions& options) {
  CAIRN_RETURN_IF_ERROR(CheckContainer(path));
  return WithDatabaseErrors(path, [&]() -> Result<MapFile> {
    std::error_code error;
    MapFile file;
    file.path_ = path;
    file.num_bytes_ = static_cast<int64_t>(fs::file_size(path, error));
    SQLite::Database database = OpenImmutable(path);
    database.exec("PRAGMA cache_size = -256");  // what is read is kept decoded: more would be wasted
    CAIRN_RETURN_IF_ERROR(WithinSteps(database, path, file.num_bytes_,
                                      [&]() -> Status { return file.ReadHead(database, options); }));
    file.connection_ = std::make_unique<Connection>(std::move(database));
    return file;
  });
}

// Everything that is used comes from the rows that are hashed here; nothing is read a second time.
Status MapFile::ReadHead(SQLite::Database& database, const MapFileOptions& options) {
  CAIRN_RETURN_IF_ERROR(CheckMapVersion(database, path_, kMapVersionMajor));
  minor_version_ = database.execAndGet("PRAGMA user_version").getInt() % 1000;
  CAIRN_ASSIGN_OR_RETURN(seal_, ReadSeal(path_));
  CAIRN_RETURN_IF_ERROR(CheckSignature(seal_, path_, options.public_key, options.signatures));
  CAIRN_RETURN_IF_ERROR(CheckPlainTable(database, path_, "blocks"));
  CheckKeys(database, kSelectBlock);
  CAIRN_ASSIGN_OR_RETURN(const std::string entries, ReadDirectory(database, path_));
  CAIRN_ASSIGN_OR_RETURN(const StoredRows rows, ReadStoredRows(database, path_, HeadTables(), num_bytes_));
  if (!SameHash(RootHash(rows, entries), seal_.root)) return DamagedHead(path_);
  CAIRN_RETURN_IF_ERROR(DecodeMapHead(rows, path_, &head_));
  if (const Status status = CheckMapHead(head_); !status.ok())
    return Corrupt(path_, "{}", status.error().message);
  Result<MapDirectory> directory = MapDirectory::Decode(entries, num_bytes_);
  if (!directory.ok()) return Corrupt(path_, "{}", directory.error().message);
  directory_ = std::move(*directory);
  // Packed, a thousand landmarks that are alike take few bytes; a robot reads all of them where nothing else
  // helps.
  constexpr int64_t kLandmarkBytes = sizeof(MapLandmark) + 128;
  if (directory_.Count(BlockKind::kLandmarks) > MaxRowBytes(num_bytes_) / kLandmarkBytes)
    return Corrupt(path_, "{} landmarks, more than a map of {} bytes has",
                   directory_.Count(BlockKind::kLandmarks), num_bytes_);
  directory_.set_descriptor_kind(head_.descriptor_kind);
  return Ok();
}

Result<MapFindings> MapFile::ReadFindings() const {
  const std::lock_guard lock(connection_->mutex);
  SQLite::Database& database = connection_->database;
  return WithinSteps(database, path_, num_bytes_, [&]() -> Result<MapFindings> {
    // Earlier formats have no hash of these tables alone.
    if (head_.findings_hash.empty()) CAIRN_RETURN_IF_ERROR(CheckFileHash(path_));
    CAIRN_ASSIGN_OR_RETURN(const StoredRows rows, ReadFindingsRows(database, path_, num_bytes_));
    if (!head_.findings_hash.empty() && !SameHash(HexOf(TablesHash(rows)), head_.findings_hash)) {
      return Corrupt(path_,
                     "its findings do not have the hash that is sealed: damaged or changed; copy it again");
    }
    return DecodeMapFindings(rows, path_);
  });
}

std::string MapFile::NameOf(int64_t block) const { return fmt::format("{}: block {}", path_, block); }

Result<std::string> MapFile::ReadBlock(int64_t block) const {
  const BlockEntry& entry = directory_.blocks()[block];
  const std::lock_guard lock(connection_->mutex);
  return WithinSteps(connection_->database, path_, num_bytes_, [&]() -> Result<std::string> {
    SQLite::Statement& query = connection_->block;
    (void)query.tryReset();  // says again what the last step said
    query.bind(1, block);
    if (!query.executeStep()) return MakeError(ErrorCode::kCorrupt, "{} is not there", NameOf(block));
    std::string bytes(BlobView(query.getColumn(0)));
    query.reset();
    if (bytes.size() == entry.num_bytes && SameHash(HashOf(bytes), entry.hash)) return bytes;
    return MakeError(
        ErrorCode::kCorrupt,
        "{} ({} bytes) does not have the hash that the directory states: the file was damaged; copy "
        "it again",
        NameOf(block), bytes.size());
  });
}

}  // namespace cairn
