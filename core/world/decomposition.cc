#include "core/world/decomposition.h"

#include "core/files/database.h"
#include "core/world/dropped_items.h"
#include "schemas/regions_sql.h"

namespace cairn {
namespace {

constexpr int kRegionsApplicationId = 0x63727267;
constexpr int kRegionsVersion = 1;

void BindIndices(SQLite::Statement& statement, int index, const std::vector<int32_t>& values) {
  static constexpr int32_t kNone = 0;  // a blob of no bytes still needs an address, or it is NULL
  statement.bindNoCopy(index, values.empty() ? &kNone : values.data(),
                       static_cast<int>(values.size() * sizeof(int32_t)));
}

Result<Decomposition> ReadRegionsTables(SQLite::Database& database, const std::string& path) {
  if (!HasTable(database, "decomposition") ||
      database.execAndGet("PRAGMA application_id").getInt() != kRegionsApplicationId) {
    return MakeError(ErrorCode::kCorrupt, "{}: not a database of regions (decompose-regions writes them)",
                     path);
  }
  if (const int version = database.execAndGet("PRAGMA user_version").getInt(); version != kRegionsVersion) {
    return MakeError(ErrorCode::kUnsupported, "{}: regions version {}, this program reads {}", path, version,
                     kRegionsVersion);
  }
  Decomposition decomposition;
  LimitedStatement header(database,
                          "SELECT algorithm, k, tau, rho, seed, lower_bound, uncovered_limit, uncovered "
                          "FROM decomposition");
  if (!header.executeStep()) return MakeError(ErrorCode::kCorrupt, "{}: table decomposition is empty", path);
  decomposition.algorithm = header.getColumn(0).getString();
  decomposition.k = header.getColumn(1).getInt();
  decomposition.tau = header.getColumn(2).getInt();
  decomposition.rho = header.getColumn(3).getInt();
  decomposition.seed = static_cast<uint64_t>(header.getColumn(4).getInt64());
  if (!header.getColumn(5).isNull()) decomposition.lower_bound = header.getColumn(5).getInt();
  decomposition.uncovered_limit = header.getColumn(6).getInt();
  CAIRN_ASSIGN_OR_RETURN(decomposition.uncovered,
                         BlobToVector<StationIdx>(header.getColumn(7), path + ": uncovered stations"));

  LimitedStatement regions(database,
                           "SELECT region_idx, features, stations FROM regions ORDER BY region_idx");
  for (int64_t idx = 0; regions.executeStep(); ++idx) {
    const std::string what = fmt::format("{}: region {}", path, idx);
    if (regions.getColumn(0).getInt64() != idx) return MakeError(ErrorCode::kCorrupt, "{}: missing", what);
    Region region;
    CAIRN_ASSIGN_OR_RETURN(region.features, BlobToVector<FeatureIdx>(regions.getColumn(1), what));
    CAIRN_ASSIGN_OR_RETURN(region.stations, BlobToVector<StationIdx>(regions.getColumn(2), what));
    decomposition.regions.push_back(std::move(region));
  }
  return decomposition;
}

void WriteRegionsTables(SQLite::Database& database, const Decomposition& decomposition) {
  SQLite::Statement header(database, "INSERT INTO decomposition VALUES (?, ?, ?, ?, ?, ?, ?, ?)");
  header.bind(1, decomposition.algorithm);
  header.bind(2, decomposition.k);
  header.bind(3, decomposition.tau);
  header.bind(4, decomposition.rho);
  header.bind(5, static_cast<int64_t>(decomposition.seed));
  if (decomposition.lower_bound) header.bind(6, *decomposition.lower_bound);
  header.bind(7, decomposition.uncovered_limit);
  BindIndices(header, 8, decomposition.uncovered);
  header.exec();

  SQLite::Statement row(database, "INSERT INTO regions VALUES (?, ?, ?)");
  for (size_t idx = 0; idx < decomposition.regions.size(); ++idx) {
    row.bind(1, static_cast<int64_t>(idx));
    BindIndices(row, 2, decomposition.regions[idx].features);
    BindIndices(row, 3, decomposition.regions[idx].stations);
    row.exec();
    row.reset();
  }
}

bool HasJsonSuffix(const std::string& path) {
  return path.size() >= 5 && path.compare(path.size() - 5, 5, ".json") == 0;
}

Status WriteWithDropped(const Decomposition& decomposition, const std::string& path,
                        const std::vector<DroppedItem>& dropped_items) {
  return WriteDatabase(path, kRegionsSql, [&](SQLite::Database& database) -> Status {
    WriteRegionsTables(database, decomposition);
    WriteDroppedItems(database, kDroppedItemsTable, dropped_items);
    return Ok();
  });
}

}  // namespace

std::string NumRegionsText(size_t num_regions, std::optional<int> lower_bound) {
  std::string text = fmt::format("{} {}", num_regions, num_regions == 1 ? "region" : "regions");
  if (lower_bound) {
    text += fmt::format(", at least {} {} needed", *lower_bound, *lower_bound == 1 ? "is" : "are");
  }
  return text;
}

Result<Decomposition> ReadDecompositionDatabase(const std::string& path) {
  return WithDatabaseErrors(path, [&]() -> Result<Decomposition> {
    CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
    return ReadRegionsTables(database, path);
  });
}

Status WriteDecompositionDatabase(const Decomposition& decomposition, const std::string& path) {
  return WriteWithDropped(decomposition, path, {});
}

Result<Decomposition> ReadDecomposition(const std::string& path) {
  return IsSqliteFile(path) ? ReadDecompositionDatabase(path) : ReadDecompositionJson(path);
}

Status WriteDecomposition(const Decomposition& decomposition, const std::string& path,
                          const std::vector<DroppedItem>& dropped_items) {
  return HasJsonSuffix(path) ? WriteDecompositionJson(decomposition, path)
                             : WriteWithDropped(decomposition, path, dropped_items);
}

Status WriteDecomposition(const Decomposition& decomposition, const std::string& path) {
  return WriteDecomposition(decomposition, path, {});
}

}  // namespace cairn
