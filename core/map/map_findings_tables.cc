#include "core/map/map_findings_tables.h"

#include <limits>

#include "core/base/blob.h"

namespace cairn {
namespace {

constexpr int64_t kMaxCount = std::numeric_limits<int32_t>::max();

// The tables that a map may have: earlier formats lack some.
const std::vector<StoredTable>& FindingsTables() {
  static const std::vector<StoredTable> tables = {
      {"drop_reasons", 7, 4096}, {"region_entropies", 2, 1 << 24}, {"self_test_regions", 8, 1 << 24}};
  return tables;
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

Result<int> CountOf(const StoredRow& row, size_t column) {
  CAIRN_ASSIGN_OR_RETURN(const int64_t count, row.Integer(column, 0, kMaxCount));
  return static_cast<int>(count);
}

Result<RegionSelfTest> DecodeRegionSelfTest(const StoredRow& stored) {
  RegionSelfTest row;
  CAIRN_ASSIGN_OR_RETURN(const int64_t region, stored.Integer(0, kOutsideRegions, kMaxCount));
  row.region = static_cast<RegionIdx>(region);
  CAIRN_ASSIGN_OR_RETURN(row.num_held_out, CountOf(stored, 1));
  CAIRN_ASSIGN_OR_RETURN(row.num_localized, CountOf(stored, 2));
  CAIRN_ASSIGN_OR_RETURN(row.num_gross_errors, CountOf(stored, 3));
  if (stored.IsNull(4)) return row;
  RegionSelfTest::Errors errors;
  CAIRN_ASSIGN_OR_RETURN(errors.median_m, stored.Real(4));
  CAIRN_ASSIGN_OR_RETURN(errors.median_deg, stored.Real(5));
  CAIRN_ASSIGN_OR_RETURN(errors.p90_m, stored.Real(6));
  CAIRN_ASSIGN_OR_RETURN(errors.p90_deg, stored.Real(7));
  row.errors = errors;
  return row;
}

Result<RegionEntropy> DecodeRegionEntropy(const StoredRow& stored) {
  CAIRN_ASSIGN_OR_RETURN(const int64_t region, stored.Integer(0, 0, kMaxCount));
  CAIRN_ASSIGN_OR_RETURN(const double entropy, stored.Real(1));
  return RegionEntropy{static_cast<RegionIdx>(region), entropy};
}

Result<DropCount> DecodeDropCount(const StoredRow& stored, const std::string& path) {
  DropCount row;
  CAIRN_ASSIGN_OR_RETURN(row.reason_id, CountOf(stored, 0));
  CAIRN_ASSIGN_OR_RETURN(row.stage, stored.Text(1));
  CAIRN_ASSIGN_OR_RETURN(row.kind, stored.Text(2));
  CAIRN_ASSIGN_OR_RETURN(row.name, stored.Text(3));
  CAIRN_ASSIGN_OR_RETURN(row.text, stored.Text(4));
  CAIRN_ASSIGN_OR_RETURN(row.num_dropped, stored.Integer(5));
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, stored.Blob(6));
  BlobReader counts(bytes);
  while (counts.ok() && counts.num_left() > 0) {
    const uint64_t count = counts.Varint();
    row.at_stations.push_back(count <= kMaxCount ? static_cast<int32_t>(count) : -1);
  }
  if (!counts.ok())
    return Corrupt(path, "table drop_reasons: the counts of reason {} are cut off", row.reason_id);
  return row;
}

}  // namespace

void WriteMapFindings(SQLite::Database& database, const MapFindings& findings) {
  WriteSelfTestRegions(database, findings);
  WriteRegionEntropies(database, findings);
  WriteDropCounts(database, findings);
}

Result<StoredRows> ReadFindingsRows(SQLite::Database& database, const std::string& path,
                                    int64_t max_num_bytes) {
  std::vector<StoredTable> tables;
  for (const StoredTable& table : FindingsTables()) {
    if (HasTable(database, table.name)) tables.push_back(table);
  }
  return ReadStoredRows(database, path, tables, max_num_bytes);
}

Result<MapFindings> DecodeMapFindings(const StoredRows& rows, const std::string& path) {
  MapFindings findings;
  for (const auto& [table, of_table] : rows) {
    for (const StoredRow& row : of_table) {
      if (table == "self_test_regions") {
        CAIRN_ASSIGN_OR_RETURN(const RegionSelfTest self_test, DecodeRegionSelfTest(row));
        findings.self_test_regions.push_back(self_test);
      } else if (table == "region_entropies") {
        CAIRN_ASSIGN_OR_RETURN(const RegionEntropy entropy, DecodeRegionEntropy(row));
        findings.region_entropies.push_back(entropy);
      } else {
        CAIRN_ASSIGN_OR_RETURN(DropCount count, DecodeDropCount(row, path));
        findings.drops.push_back(std::move(count));
      }
    }
  }
  return findings;
}

}  // namespace cairn
