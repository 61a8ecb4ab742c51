#include "core/map_findings.h"

#include <cmath>
#include <limits>

#include "core/blob.h"
#include "core/database.h"
#include "core/map_head.h"

namespace cairn {
namespace {

template <typename... Args>
Error Invalid(fmt::format_string<Args...> format, Args&&... args) {
  return MakeError(ErrorCode::kInvalidArgument, "map: {}", fmt::format(format, std::forward<Args>(args)...));
}

Status CheckRegionSelfTest(const RegionSelfTest& row, size_t num_regions) {
  if (row.region < kOutsideRegions || row.region >= static_cast<int64_t>(num_regions))
    return Invalid("self-test of region {} of {}", row.region, num_regions);
  if (row.num_held_out < 1 || row.num_localized < 0 || row.num_localized > row.num_held_out ||
      row.num_gross_errors < 0 || row.num_gross_errors > row.num_localized) {
    return Invalid("self-test of region {}: {} gross errors of {} localized of {} images", row.region,
                   row.num_gross_errors, row.num_localized, row.num_held_out);
  }
  if (row.errors.has_value() != (row.num_localized > 0))
    return Invalid("self-test of region {}: {} localized, with errors: {}", row.region, row.num_localized,
                   row.errors.has_value());
  if (!row.errors) return Ok();
  for (const double error :
       {row.errors->median_m, row.errors->median_deg, row.errors->p90_m, row.errors->p90_deg}) {
    if (!(error >= 0 && std::isfinite(error)))
      return Invalid("self-test of region {}: an error of {}", row.region, error);
  }
  return Ok();
}

Status CheckDropCount(const DropCount& row, size_t num_stations) {
  if (row.reason_id < 0 || row.num_dropped < 1)
    return Invalid("{} dropped for reason {}", row.num_dropped, row.reason_id);
  if (!row.at_stations.empty() && row.at_stations.size() != num_stations) {
    return Invalid("dropped as {}: counts of {} stations, of {}", row.name, row.at_stations.size(),
                   num_stations);
  }
  for (const int32_t count : row.at_stations) {
    if (count < 0 || count > row.num_dropped)
      return Invalid("dropped as {}: {} at a station, {} in all", row.name, count, row.num_dropped);
  }
  return Ok();
}

// A count of a row, or -1, which no check lets pass, where it is no 31-bit number.
int CountOf(const SQLite::Column& column) {
  const int64_t value = column.getInt64();
  return column.isInteger() && value >= 0 && value <= std::numeric_limits<int>::max()
             ? static_cast<int>(value)
             : -1;
}

void WriteSelfTestRegions(SQLite::Database& database, const MapFindings& findings) {
  SQLite::Statement insert(database, "INSERT INTO self_test_regions VALUES (?, ?, ?, ?, ?, ?, ?, ?)");
  for (const RegionSelfTest& row : findings.self_test_regions) {
    insert.bind(1, row.region);
    insert.bind(2, row.num_held_out);
    insert.bind(3, row.num_localized);
    insert.bind(4, row.num_gross_errors);
    if (row.errors) {
      insert.bind(5, row.errors->median_m);
      insert.bind(6, row.errors->median_deg);
      insert.bind(7, row.errors->p90_m);
      insert.bind(8, row.errors->p90_deg);
    }
    insert.exec();
    insert.reset();
    insert.clearBindings();
  }
}

void WriteRegionEntropies(SQLite::Database& database, const MapFindings& findings) {
  SQLite::Statement insert(database, "INSERT INTO region_entropies VALUES (?, ?)");
  for (const RegionEntropy& row : findings.region_entropies) {
    insert.bind(1, row.region);
    insert.bind(2, row.entropy);
    insert.exec();
    insert.reset();
  }
}

void WriteDropCounts(SQLite::Database& database, const MapFindings& findings) {
  SQLite::Statement insert(database, "INSERT INTO drop_reasons VALUES (?, ?, ?, ?, ?, ?, ?)");
  for (const DropCount& row : findings.drops) {
    insert.bind(1, row.reason_id);
    insert.bind(2, row.stage);
    insert.bind(3, row.kind);
    insert.bind(4, row.name);
    insert.bind(5, row.text);
    insert.bind(6, row.num_dropped);
    BlobWriter counts;
    for (const int32_t count : row.at_stations) counts.Varint(static_cast<uint64_t>(count));
    const std::string bytes = counts.Take();
    insert.bind(7, bytes.data(), static_cast<int>(bytes.size()));
    insert.exec();
    insert.reset();
  }
}

Status ReadSelfTestRegions(SQLite::Database& database, const std::string& path, MapFindings* findings) {
  SQLite::Statement query(database,
                          "SELECT region_idx, num_held_out, num_localized, num_gross_errors, median_error_m, "
                          "median_error_deg, p90_error_m, p90_error_deg FROM self_test_regions "
                          "ORDER BY region_idx");
  while (query.executeStep()) {
    RegionSelfTest row;
    const int64_t region = query.getColumn(0).getInt64();
    if (region < kOutsideRegions || region > std::numeric_limits<RegionIdx>::max())
      return Corrupt(path, "table self_test_regions: region {}", region);
    row.region = static_cast<RegionIdx>(region);
    row.num_held_out = CountOf(query.getColumn(1));
    row.num_localized = CountOf(query.getColumn(2));
    row.num_gross_errors = CountOf(query.getColumn(3));
    if (!query.getColumn(4).isNull()) {
      const auto error = [&](int column) { return query.getColumn(column).getDouble(); };
      row.errors = {error(4), error(5), error(6), error(7)};
    }
    findings->self_test_regions.push_back(row);
  }
  return Ok();
}

Status ReadRegionEntropies(SQLite::Database& database, const std::string& path, MapFindings* findings) {
  SQLite::Statement query(database, "SELECT region_idx, entropy FROM region_entropies ORDER BY region_idx");
  while (query.executeStep()) {
    const int64_t region = query.getColumn(0).getInt64();
    if (region < 0 || region > std::numeric_limits<RegionIdx>::max())
      return Corrupt(path, "table region_entropies: region {}", region);
    findings->region_entropies.push_back({static_cast<RegionIdx>(region), query.getColumn(1).getDouble()});
  }
  return Ok();
}

Status ReadDropCounts(SQLite::Database& database, const std::string& path, MapFindings* findings) {
  SQLite::Statement query(database,
                          "SELECT reason_id, stage, kind, name, text, num_dropped, at_stations FROM "
                          "drop_reasons ORDER BY reason_id");
  while (query.executeStep()) {
    DropCount row;
    row.reason_id = CountOf(query.getColumn(0));
    row.stage = query.getColumn(1).getString();
    row.kind = query.getColumn(2).getString();
    row.name = query.getColumn(3).getString();
    row.text = query.getColumn(4).getString();
    row.num_dropped = query.getColumn(5).getInt64();
    const SQLite::Column blob = query.getColumn(6);
    BlobReader counts({static_cast<const char*>(blob.getBlob()), static_cast<size_t>(blob.getBytes())});
    while (counts.ok() && counts.num_left() > 0) {
      const uint64_t count = counts.Varint();
      row.at_stations.push_back(count <= std::numeric_limits<int32_t>::max() ? static_cast<int32_t>(count)
                                                                             : -1);
    }
    if (!counts.ok()) {
      return Corrupt(path, "table drop_reasons: the counts of reason {} are cut off", row.reason_id);
    }
    findings->drops.push_back(std::move(row));
  }
  return Ok();
}

}  // namespace

Status CheckMapFindings(const MapFindings& findings, size_t num_regions, size_t num_stations) {
  for (size_t i = 0; i < findings.self_test_regions.size(); ++i) {
    const RegionSelfTest& row = findings.self_test_regions[i];
    if (i > 0 && row.region <= findings.self_test_regions[i - 1].region)
      return Invalid("self-test of region {} is out of order", row.region);
    CAIRN_RETURN_IF_ERROR(CheckRegionSelfTest(row, num_regions));
  }
  for (size_t i = 0; i < findings.region_entropies.size(); ++i) {
    const RegionEntropy& row = findings.region_entropies[i];
    if (row.region < 0 || static_cast<size_t>(row.region) >= num_regions ||
        (i > 0 && row.region <= findings.region_entropies[i - 1].region) ||
        !(row.entropy >= 0 && std::isfinite(row.entropy)))
      return Invalid("an entropy of {} nats of region {} of {}", row.entropy, row.region, num_regions);
  }
  for (size_t i = 0; i < findings.drops.size(); ++i) {
    const DropCount& row = findings.drops[i];
    if (i > 0 && row.reason_id <= findings.drops[i - 1].reason_id)
      return Invalid("what is dropped for reason {} is out of order", row.reason_id);
    CAIRN_RETURN_IF_ERROR(CheckDropCount(row, num_stations));
  }
  return Ok();
}

void WriteMapFindings(SQLite::Database& database, const MapFindings& findings) {
  WriteSelfTestRegions(database, findings);
  WriteRegionEntropies(database, findings);
  WriteDropCounts(database, findings);
}

Status ReadMapFindings(SQLite::Database& database, const std::string& path, MapFindings* findings) {
  if (HasTable(database, "self_test_regions")) {
    CAIRN_RETURN_IF_ERROR(CheckPlainTable(database, path, "self_test_regions"));
    CAIRN_RETURN_IF_ERROR(ReadSelfTestRegions(database, path, findings));
  }
  if (HasTable(database, "region_entropies")) {
    CAIRN_RETURN_IF_ERROR(CheckPlainTable(database, path, "region_entropies"));
    CAIRN_RETURN_IF_ERROR(ReadRegionEntropies(database, path, findings));
  }
  if (!HasTable(database, "drop_reasons")) return Ok();
  CAIRN_RETURN_IF_ERROR(CheckPlainTable(database, path, "drop_reasons"));
  return ReadDropCounts(database, path, findings);
}

}  // namespace cairn
