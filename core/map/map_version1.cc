// Maps of format 1.x, read and checked: the tables of schemas/0001_map.sql, and those of vocabulary.sql
// beside them.
#include <algorithm>
#include <filesystem>

#include "core/base/blob.h"
#include "core/files/database.h"
#include "core/map/map_head_tables.h"
#include "core/packing/map_codes.h"

namespace cairn {
namespace {

Status ReadImages(SQLite::Database& database, const std::string& path, MapRows* rows) {
  LimitedStatement query(
      database,
      "SELECT image_id, name, camera_id, station_idx, num_landmarks, landmarks, qw, qx, qy, qz, tx, "
      "ty, tz FROM images ORDER BY image_id");
  while (query.executeStep()) {
    MapImage image;
    const int64_t image_id = query.getColumn(0).getInt64();
    const int64_t camera_id = query.getColumn(2).getInt64();
    const int64_t station = query.getColumn(3).isNull() ? -1 : query.getColumn(3).getInt64();
    if (image_id < 0 || image_id >= kInvalidImageId || camera_id < 0 || camera_id > UINT32_MAX ||
        station < -1 || station > INT32_MAX) {
      return Corrupt(path, "image {}: camera {} or station {} out of range", image_id, camera_id, station);
    }
    image.image_id = static_cast<ImageId>(image_id);
    image.name = query.getColumn(1).getString();
    image.camera_id = static_cast<CameraId>(camera_id);
    image.station = static_cast<StationIdx>(station);
    CAIRN_ASSIGN_OR_RETURN(image.landmarks,
                           DecodeAscending(BlobView(query.getColumn(5)), query.getColumn(4).getInt64(),
                                           static_cast<int64_t>(rows->landmarks.size()),
                                           fmt::format("{}: landmarks of image {}", path, image_id)));
    image.cam_from_world = PoseFromColumns(query, 6);
    rows->images.push_back(std::move(image));
  }
  return Ok();
}

Status ReadStations(SQLite::Database& database, const std::string& path, MapRows* rows) {
  const int64_t num_stations =
      database.execAndGet("SELECT count(*) FROM stations WHERE station_idx >= 0").getInt64();
  LimitedStatement query(
      database,
      "SELECT station_idx, x, y, heading_deg, is_covered, num_neighbours, neighbours FROM stations "
      "ORDER BY station_idx");
  while (query.executeStep()) {
    const int64_t station_idx = query.getColumn(0).getInt64();
    if (station_idx != static_cast<int64_t>(rows->stations.size())) {
      return Corrupt(path, "station {} where {} was expected", station_idx, rows->stations.size());
    }
    MapStation station;
    station.position = {query.getColumn(1).getDouble(), query.getColumn(2).getDouble()};
    if (!query.getColumn(3).isNull()) station.heading_deg = query.getColumn(3).getDouble();
    station.is_covered = query.getColumn(4).getInt() != 0;
    CAIRN_ASSIGN_OR_RETURN(
        const std::vector<int32_t> neighbours,
        DecodeAscending(BlobView(query.getColumn(6)), query.getColumn(5).getInt64(), num_stations,
                        fmt::format("{}: neighbours of station {}", path, station_idx)));
    for (const int32_t neighbour : neighbours) {
      rows->station_edges.emplace_back(static_cast<StationIdx>(station_idx), neighbour);
    }
    rows->stations.push_back(station);
  }
  return Ok();
}

Status ReadRegions(SQLite::Database& database, const std::string& path, MapRows* rows) {
  LimitedStatement query(
      database,
      "SELECT region_idx, num_stations, stations, num_landmarks, landmarks FROM regions ORDER BY region_idx");
  while (query.executeStep()) {
    const int64_t region_idx = query.getColumn(0).getInt64();
    if (region_idx != static_cast<int64_t>(rows->regions.size())) {
      return Corrupt(path, "region {} where {} was expected", region_idx, rows->regions.size());
    }
    MapRegion region;
    CAIRN_ASSIGN_OR_RETURN(region.stations,
                           DecodeAscending(BlobView(query.getColumn(2)), query.getColumn(1).getInt64(),
                                           static_cast<int64_t>(rows->stations.size()),
                                           fmt::format("{}: stations of region {}", path, region_idx)));
    CAIRN_ASSIGN_OR_RETURN(region.landmarks,
                           DecodeAscending(BlobView(query.getColumn(4)), query.getColumn(3).getInt64(),
                                           static_cast<int64_t>(rows->landmarks.size()),
                                           fmt::format("{}: landmarks of region {}", path, region_idx)));
    rows->regions.push_back(std::move(region));
  }
  return Ok();
}

Status ReadLandmarks(SQLite::Database& database, const std::string& path, int64_t num_bytes, MapRows* rows) {
  const int64_t num_landmarks =
      database.execAndGet("SELECT count(*) FROM landmarks WHERE landmark_idx >= 0").getInt64();
  if (num_landmarks > std::min<int64_t>(INT32_MAX, num_bytes / kSiftDescriptorDim)) {
    return Corrupt(path, "{} landmarks, more than a map of {} bytes has descriptors for", num_landmarks,
                   num_bytes);
  }
  rows->landmarks.reserve(num_landmarks);
  rows->descriptors.resize(num_landmarks, kSiftDescriptorDim);
  LimitedStatement query(
      database,
      "SELECT landmark_idx, class_id, x, y, z, scale, num_observations, covariance, descriptor FROM "
      "landmarks ORDER BY landmark_idx");
  while (query.executeStep()) {
    const int64_t landmark_idx = query.getColumn(0).getInt64();
    if (landmark_idx != static_cast<int64_t>(rows->landmarks.size()) || landmark_idx >= num_landmarks) {
      return Corrupt(path, "landmark {} where {} was expected", landmark_idx, rows->landmarks.size());
    }
    const int64_t class_id = query.getColumn(1).getInt64();
    const int64_t num_observations = query.getColumn(6).getInt64();
    if (class_id < 0 || class_id > UINT32_MAX || num_observations < 0 || num_observations > INT32_MAX) {
      return Corrupt(path, "landmark {}: class {} or its {} observations out of range", landmark_idx,
                     class_id, num_observations);
    }
    MapLandmark landmark;
    landmark.class_id = static_cast<ClassId>(class_id);
    for (int axis = 0; axis < 3; ++axis) {
      landmark.position[axis] = static_cast<double>(query.getColumn(2 + axis).getInt64()) * kMapLengthUnitM;
    }
    landmark.scale_m = static_cast<double>(query.getColumn(5).getInt64()) * kMapLengthUnitM;
    landmark.num_observations = static_cast<int32_t>(num_observations);
    BlobReader reader(BlobView(query.getColumn(7)));
    for (int row = 0; row < 3; ++row) {
      for (int col = row; col < 3; ++col)
        landmark.covariance(row, col) = landmark.covariance(col, row) = reader.Float32();
    }
    const std::string_view descriptor = BlobView(query.getColumn(8));
    if (!reader.Finished() || descriptor.size() != kSiftDescriptorDim) {
      return Corrupt(path,
                     "landmark {}: a covariance of {} and a descriptor of {} bytes, expected 24 and 128",
                     landmark_idx, query.getColumn(7).getBytes(), descriptor.size());
    }
    std::memcpy(rows->descriptors.row(landmark_idx).data(), descriptor.data(), descriptor.size());
    rows->landmarks.push_back(landmark);
  }
  return Ok();
}

Result<MapRows> ReadTables(SQLite::Database& database, const std::string& path) {
  std::error_code error;
  const auto num_bytes = static_cast<int64_t>(std::filesystem::file_size(path, error));
  const StepLimit steps(database, 100 * MaxStepsFor(num_bytes));
  CAIRN_RETURN_IF_ERROR(CheckMapVersion(database, path, 1));
  for (const char* table : {"landmarks", "stations", "regions", "images", "vocabulary", "vocabulary_nodes",
                            "vocabulary_words", "vocabulary_documents"}) {
    CAIRN_RETURN_IF_ERROR(CheckPlainTable(database, path, table));
  }
  MapRows rows;
  CAIRN_ASSIGN_OR_RETURN(const StoredRows head, ReadStoredRows(database, path, HeadTables(), num_bytes));
  CAIRN_RETURN_IF_ERROR(DecodeMapHead(head, path, &rows));
  CAIRN_RETURN_IF_ERROR(ReadLandmarks(database, path, num_bytes, &rows));
  CAIRN_RETURN_IF_ERROR(ReadStations(database, path, &rows));
  CAIRN_RETURN_IF_ERROR(ReadRegions(database, path, &rows));
  CAIRN_RETURN_IF_ERROR(ReadImages(database, path, &rows));
  CAIRN_ASSIGN_OR_RETURN(rows.vocabulary, ReadVocabularyTables(database, path));
  if (Status status = CheckMapRows(rows); !status.ok()) return Corrupt(path, "{}", status.error().message);
  return rows;
}

}  // namespace

Result<MapRows> ReadMapRowsVersion1(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  return WithDatabaseErrors(path, [&] { return ReadTables(database, path); });
}

}  // namespace cairn
