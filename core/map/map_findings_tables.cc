#include "core/map/map_findings_tables.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/blob.h"
#include "core/packing/map_codes.h"

namespace cairn {
namespace {

constexpr int64_t kMaxCount = std::numeric_limits<int32_t>::max();

// The tables that a map may have: earlier formats lack some.
const std::vector<StoredTable>& FindingsTables() {
  static const std::vector<StoredTable> tables = {
      {"changes", 10, 1 << 20}, {"drop_reasons", 7, 4096},        {"moves", 3, 1 << 20},
      {"promises", 14, 1},      {"region_entropies", 2, 1 << 24}, {"self_test_regions", 8, 1 << 24}};
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

// Probabilities, and sigmas over the views' radius, are stored in steps of 1 / 1000; matches in tenths.
constexpr double kThousandths = 1000;
constexpr double kTenths = 10;

uint64_t Steps(double value, double per_unit) {
  return static_cast<uint64_t>(std::llround(value * per_unit));
}

std::string EncodeNodes(const MapPromise& promise) {
  BlobWriter blob;
  int32_t last = 0;
  for (const NodePromise& node : promise.nodes) {
    blob.Varint(ZigZag(node.image - last));
    blob.Varint(ZigZag(node.other_image - node.image));
    blob.Varint(static_cast<uint64_t>(node.region));
    // Rounded down: nothing is promised that is not kept.
    blob.Varint(static_cast<uint64_t>(node.probability * kThousandths + 1e-9));
    blob.Varint(static_cast<uint64_t>(node.most_probable * kThousandths + 1e-9));
    blob.Varint(Steps(node.num_matches, kTenths));
    blob.Varint(promise.radius_m > 0 ? Steps(std::min(node.sigma_m / promise.radius_m, 1e6), kThousandths)
                                     : 0);
    last = node.image;
  }
  return blob.Take();
}

std::string EncodeCurve(const std::vector<PromiseBin>& bins) {
  BlobWriter blob;
  for (const PromiseBin& bin : bins) {
    blob.Varint(Steps(bin.least, kThousandths));
    blob.Varint(Steps(bin.mean_promised, kThousandths));
    blob.Varint(static_cast<uint64_t>(bin.num));
    blob.Varint(static_cast<uint64_t>(bin.num_kept));
  }
  return blob.Take();
}

void WritePromise(SQLite::Database& database, const MapFindings& findings) {
  if (!findings.promise) return;
  const MapPromise& promise = *findings.promise;
  SQLite::Statement insert(database,
                           "INSERT INTO promises VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  insert.bind(1, 0);
  insert.bind(2, promise.terms.min_matches);
  insert.bind(3, promise.terms.max_error_m);
  insert.bind(4, promise.terms.max_error_deg);
  insert.bind(5, promise.terms.probability);
  insert.bind(6, promise.model.match_ratio);
  insert.bind(7, promise.model.shape);
  insert.bind(8, promise.model.error_ratio);
  insert.bind(9, promise.radius_m);
  insert.bind(10, promise.radius_deg);
  insert.bind(11, promise.landmarks_lower_bound);
  int column = 12;
  for (const std::string& bytes :
       {EncodeNodes(promise), EncodeCurve(promise.left_out), EncodeCurve(promise.held_out)})
    insert.bind(column++, bytes.data(), static_cast<int>(bytes.size()));
  insert.exec();
}

void WriteChanges(SQLite::Database& database, const MapFindings& findings) {
  SQLite::Statement insert(database, "INSERT INTO changes VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (size_t i = 0; i < findings.changes.size(); ++i) {
    const MapChange& row = findings.changes[i];
    insert.bind(1, static_cast<int64_t>(i));
    insert.bind(2, row.session);
    for (int axis = 0; axis < 3; ++axis)
      insert.bind(3 + axis, static_cast<int64_t>(std::llround(row.position[axis] * kThousandths)));
    insert.bind(6, static_cast<int64_t>(std::llround(row.radius_m * kThousandths)));
    insert.bind(7, row.num_vanished);
    insert.bind(8, row.num_appeared);
    insert.bind(9, row.image_before);
    insert.bind(10, row.image_after);
    insert.exec();
    insert.reset();
  }
}

void WriteMoves(SQLite::Database& database, const MapFindings& findings) {
  SQLite::Statement insert(database, "INSERT INTO moves VALUES (?, ?, ?)");
  for (size_t i = 0; i < findings.changes.size(); ++i) {
    if (findings.changes[i].moved_to < 0) continue;
    insert.bind(1, static_cast<int64_t>(i));
    insert.bind(2, findings.changes[i].moved_to);
    insert.bind(3, findings.changes[i].num_moved);
    insert.exec();
    insert.reset();
  }
}

int32_t Int32(int64_t value) { return value >= 0 && value <= kMaxCount ? static_cast<int32_t>(value) : -1; }

// Without overflow: the file may be anything.
int64_t Sum(int64_t a, int64_t b) {
  return static_cast<int64_t>(static_cast<uint64_t>(a) + static_cast<uint64_t>(b));
}

Status DecodeNodes(const std::string& bytes, const std::string& path, MapPromise* promise) {
  BlobReader blob(bytes);
  int64_t last = 0;
  while (blob.ok() && blob.num_left() > 0) {
    NodePromise node;
    const int64_t image = Sum(last, UnZigZag(blob.Varint()));
    node.image = Int32(image);
    node.other_image = Int32(Sum(image, UnZigZag(blob.Varint())));
    if (node.image < 0 || node.other_image < 0) return Corrupt(path, "table promises: a node of no image");
    node.region = Int32(static_cast<int64_t>(blob.Varint()));
    node.probability = static_cast<double>(blob.Varint()) / kThousandths;
    node.most_probable = static_cast<double>(blob.Varint()) / kThousandths;
    node.num_matches = static_cast<double>(blob.Varint()) / kTenths;
    node.sigma_m = static_cast<double>(blob.Varint()) / kThousandths * promise->radius_m;
    last = image;
    promise->nodes.push_back(node);
  }
  return blob.ok() ? Ok() : Corrupt(path, "table promises: the nodes are cut off");
}

Result<std::vector<PromiseBin>> DecodeCurve(const std::string& bytes, const std::string& path) {
  BlobReader blob(bytes);
  std::vector<PromiseBin> bins;
  while (blob.ok() && blob.num_left() > 0) {
    PromiseBin bin{.least = static_cast<double>(blob.Varint()) / kThousandths};
    bin.mean_promised = static_cast<double>(blob.Varint()) / kThousandths;
    bin.num = Int32(static_cast<int64_t>(blob.Varint()));
    bin.num_kept = Int32(static_cast<int64_t>(blob.Varint()));
    bins.push_back(bin);
  }
  if (!blob.ok()) return Corrupt(path, "table promises: a calibration curve is cut off");
  return bins;
}

Result<MapPromise> DecodePromise(const StoredRow& row, const std::string& path) {
  MapPromise promise;
  CAIRN_ASSIGN_OR_RETURN(const int64_t min_matches, row.Integer(1, 1, kMaxCount));
  promise.terms.min_matches = static_cast<int>(min_matches);
  CAIRN_ASSIGN_OR_RETURN(promise.terms.max_error_m, row.Real(2));
  CAIRN_ASSIGN_OR_RETURN(promise.terms.max_error_deg, row.Real(3));
  CAIRN_ASSIGN_OR_RETURN(promise.terms.probability, row.Real(4));
  CAIRN_ASSIGN_OR_RETURN(promise.model.match_ratio, row.Real(5));
  CAIRN_ASSIGN_OR_RETURN(promise.model.shape, row.Real(6));
  CAIRN_ASSIGN_OR_RETURN(promise.model.error_ratio, row.Real(7));
  CAIRN_ASSIGN_OR_RETURN(promise.radius_m, row.Real(8));
  CAIRN_ASSIGN_OR_RETURN(promise.radius_deg, row.Real(9));
  CAIRN_ASSIGN_OR_RETURN(promise.landmarks_lower_bound, row.Integer(10));
  CAIRN_ASSIGN_OR_RETURN(const std::string nodes, row.Blob(11));
  CAIRN_RETURN_IF_ERROR(DecodeNodes(nodes, path, &promise));
  CAIRN_ASSIGN_OR_RETURN(const std::string left_out, row.Blob(12));
  CAIRN_ASSIGN_OR_RETURN(promise.left_out, DecodeCurve(left_out, path));
  CAIRN_ASSIGN_OR_RETURN(const std::string held_out, row.Blob(13));
  CAIRN_ASSIGN_OR_RETURN(promise.held_out, DecodeCurve(held_out, path));
  return promise;
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

Result<MapChange> DecodeChange(const StoredRow& stored) {
  // Whole numbers up to here are exact as doubles; CheckMapFindings knows narrower limits.
  constexpr int64_t kMostThousandths = int64_t{1} << 53;
  MapChange row;
  CAIRN_ASSIGN_OR_RETURN(row.session, CountOf(stored, 1));
  for (int axis = 0; axis < 3; ++axis) {
    CAIRN_ASSIGN_OR_RETURN(const int64_t steps,
                           stored.Integer(2 + axis, -kMostThousandths, kMostThousandths));
    row.position[axis] = static_cast<double>(steps) / kThousandths;
  }
  CAIRN_ASSIGN_OR_RETURN(const int64_t radius, stored.Integer(5, 0, kMostThousandths));
  row.radius_m = static_cast<double>(radius) / kThousandths;
  CAIRN_ASSIGN_OR_RETURN(row.num_vanished, CountOf(stored, 6));
  CAIRN_ASSIGN_OR_RETURN(row.num_appeared, CountOf(stored, 7));
  CAIRN_ASSIGN_OR_RETURN(const int64_t before, stored.Integer(8, -1, kMaxCount));
  CAIRN_ASSIGN_OR_RETURN(const int64_t after, stored.Integer(9, -1, kMaxCount));
  row.image_before = static_cast<int32_t>(before);
  row.image_after = static_cast<int32_t>(after);
  return row;
}

// REQUIRES: the changes have been read.
Status DecodeMove(const StoredRow& stored, const std::string& path, std::vector<MapChange>* changes) {
  CAIRN_ASSIGN_OR_RETURN(const int64_t change, stored.Integer(0));
  if (change < 0 || change >= static_cast<int64_t>(changes->size()))
    return Corrupt(path, "table moves: change {} of {}", change, changes->size());
  CAIRN_ASSIGN_OR_RETURN((*changes)[change].moved_to, CountOf(stored, 1));
  CAIRN_ASSIGN_OR_RETURN((*changes)[change].num_moved, CountOf(stored, 2));
  return Ok();
}

}  // namespace

void WriteMapFindings(SQLite::Database& database, const MapFindings& findings) {
  WriteSelfTestRegions(database, findings);
  WriteRegionEntropies(database, findings);
  WriteDropCounts(database, findings);
  WritePromise(database, findings);
  if (!findings.changes.empty()) WriteChanges(database, findings);
  if (findings.HasMoves()) WriteMoves(database, findings);
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
      } else if (table == "promises") {
        CAIRN_ASSIGN_OR_RETURN(findings.promise, DecodePromise(row, path));
      } else if (table == "changes") {
        CAIRN_ASSIGN_OR_RETURN(const MapChange change, DecodeChange(row));
        findings.changes.push_back(change);
      } else if (table == "moves") {  // after "changes"
        CAIRN_RETURN_IF_ERROR(DecodeMove(row, path, &findings.changes));
      } else {
        CAIRN_ASSIGN_OR_RETURN(DropCount count, DecodeDropCount(row, path));
        findings.drops.push_back(std::move(count));
      }
    }
  }
  return findings;
}

}  // namespace cairn
