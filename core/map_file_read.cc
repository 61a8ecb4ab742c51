// Maps in SQLite, read and checked: the tables that map_file_write.cc writes.
#include <cmath>

#include "core/blob.h"
#include "core/database.h"
#include "core/map_rows.h"
#include "core/text.h"

namespace cairn {
namespace {

constexpr int kApplicationId = 0x63726d70;  // 'crmp'

std::string_view BlobView(const SQLite::Column& column) {
  return {static_cast<const char*>(column.getBlob()), static_cast<size_t>(column.getBytes())};
}

Pose PoseFromColumns(SQLite::Statement& statement, int first) {
  const auto value = [&](int i) { return statement.getColumn(first + i).getDouble(); };
  return {Eigen::Quaterniond(value(0), value(1), value(2), value(3)), {value(4), value(5), value(6)}};
}

template <typename... Args>
Error Corrupt(const std::string& path, fmt::format_string<Args...> format, Args&&... args) {
  return MakeError(ErrorCode::kCorrupt, "{}: {}", path, fmt::format(format, std::forward<Args>(args)...));
}

std::map<std::string, std::string> ReadTexts(SQLite::Database& database, const char* sql) {
  std::map<std::string, std::string> texts;
  SQLite::Statement query(database, sql);
  while (query.executeStep()) texts[query.getColumn(0).getString()] = query.getColumn(1).getString();
  return texts;
}

Status CheckVersion(SQLite::Database& database, const std::string& path) {
  const int application_id = database.execAndGet("PRAGMA application_id").getInt();
  if (application_id != kApplicationId) {
    return Corrupt(path, "a SQLite file, but not a cairn map (application_id {:#x}, expected {:#x})",
                   application_id, kApplicationId);
  }
  const int version = database.execAndGet("PRAGMA user_version").getInt();
  const int major = version / 1000;
  if (major == kMapVersionMajor) return Ok();
  const auto meta = HasTable(database, "meta") ? ReadTexts(database, "SELECT key, value FROM meta")
                                               : std::map<std::string, std::string>();
  const auto writer = meta.find("writer");
  return MakeError(
      ErrorCode::kUnsupported, "{}: map version {}.{}, written by {}; this program reads {}.x. {}", path,
      major, version % 1000, writer == meta.end() ? "an unknown program" : writer->second, kMapVersionMajor,
      major > kMapVersionMajor ? "Update the program, or compile the map with this one."
                               : "Compile the map again.");
}

// Of a map without these rows, the frame is a survey's, in metres.
Status ReadFrame(std::map<std::string, std::string> meta, const std::string& path, CaptureFrame* frame) {
  if (meta.count("unit") > 0) frame->unit = meta["unit"];
  if (meta.count("frame_source") > 0) frame->source = meta["frame_source"];
  frame->is_reconstructed = meta["is_reconstructed"] == "1";
  if (meta.count("anchor_latitude_deg") > 0) {
    frame->anchor.emplace();
    if (!ParseNumber(meta["anchor_latitude_deg"], &frame->anchor->latitude_deg) ||
        !ParseNumber(meta["anchor_longitude_deg"], &frame->anchor->longitude_deg) ||
        !ParseNumber(meta["anchor_altitude_m"], &frame->anchor->altitude_m)) {
      return Corrupt(path, "table meta: anchor '{}', '{}', '{}' is not three numbers",
                     meta["anchor_latitude_deg"], meta["anchor_longitude_deg"], meta["anchor_altitude_m"]);
    }
  }
  const Status status = CheckCaptureFrame(*frame);
  return status.ok() ? status : Corrupt(path, "table meta: {}", status.error().message);
}

Status ReadHead(SQLite::Database& database, const std::string& path, MapRows* rows) {
  auto meta = ReadTexts(database, "SELECT key, value FROM meta");
  rows->name = meta["name"];
  rows->writer = meta["writer"];
  rows->sealed = meta["sealed"] == "1";
  rows->landmark_choice = meta["landmarks"];
  rows->algorithm = meta["algorithm"];
  if (!ParseNumber(meta["seed"], &rows->seed) || !ParseNumber(meta["k"], &rows->k) ||
      !ParseNumber(meta["tau"], &rows->tau) || !ParseNumber(meta["rho"], &rows->rho)) {
    return Corrupt(path, "table meta: seed '{}', k '{}', tau '{}' or rho '{}' is not an integer",
                   meta["seed"], meta["k"], meta["tau"], meta["rho"]);
  }
  if (meta.count("lower_bound")) {
    rows->lower_bound.emplace();
    if (!ParseNumber(meta["lower_bound"], &*rows->lower_bound) ||
        !ParseNumber(meta["uncovered_limit"], &rows->uncovered_limit)) {
      return Corrupt(path, "table meta: lower_bound '{}' or uncovered_limit '{}' is not an integer",
                     meta["lower_bound"], meta["uncovered_limit"]);
    }
  }
  if (!ParseNumber(meta["stated_pose_sigma_m"], &rows->stated_pose_sigma_m) ||
      !ParseNumber(meta["stated_pose_sigma_deg"], &rows->stated_pose_sigma_deg)) {
    return Corrupt(path, "table meta: stated_pose_sigma_m '{}' or stated_pose_sigma_deg '{}' is not a number",
                   meta["stated_pose_sigma_m"], meta["stated_pose_sigma_deg"]);
  }
  CAIRN_RETURN_IF_ERROR(ReadFrame(meta, path, &rows->frame));
  rows->stage_options = ReadTexts(database, "SELECT stage, options FROM stage_options");
  rows->input_hashes = ReadTexts(database, "SELECT name, hash FROM inputs");
  SQLite::Statement frames(database, "SELECT name, qw, qx, qy, qz, tx, ty, tz FROM frames");
  int num_frames = 0;
  while (frames.executeStep()) {
    const std::string name = frames.getColumn(0).getString();
    if (name != "floor_from_world" && name != "camera_from_given") continue;  // of a later minor version
    (name == "floor_from_world" ? rows->floor_from_world : rows->camera_from_given) =
        PoseFromColumns(frames, 1);
    ++num_frames;
  }
  if (num_frames != 2) return Corrupt(path, "table frames lacks floor_from_world or camera_from_given");
  SQLite::Statement figures(database, "SELECT name, value FROM self_test");
  while (figures.executeStep())
    rows->self_test[figures.getColumn(0).getString()] = figures.getColumn(1).getDouble();
  return Ok();
}

Status ReadCameras(SQLite::Database& database, const std::string& path, MapRows* rows) {
  SQLite::Statement query(
      database,
      "SELECT camera_id, model, width, height, has_focal_prior, params FROM cameras ORDER BY camera_id");
  while (query.executeStep()) {
    Camera camera;
    const int64_t camera_id = query.getColumn(0).getInt64();
    if (camera_id < 0 || camera_id > UINT32_MAX)
      return Corrupt(path, "camera {}: id out of range", camera_id);
    camera.camera_id = static_cast<CameraId>(camera_id);
    const Result<CameraModel> model = CameraModelFromId(query.getColumn(1).getInt());
    if (!model.ok()) return Corrupt(path, "camera {}: {}", camera_id, model.error().message);
    camera.model = *model;
    camera.width = query.getColumn(2).getInt();
    camera.height = query.getColumn(3).getInt();
    camera.has_focal_prior = query.getColumn(4).getInt() != 0;
    const std::string_view params = BlobView(query.getColumn(5));
    BlobReader reader(params);
    for (int i = 0; i < NumCameraParams(camera.model); ++i) camera.params.push_back(reader.Float64());
    if (!reader.Finished())
      return Corrupt(path, "camera {}: {} bytes of parameters", camera_id, params.size());
    rows->cameras.push_back(std::move(camera));
  }
  return Ok();
}

Status ReadImages(SQLite::Database& database, const std::string& path, MapRows* rows) {
  SQLite::Statement query(
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
  const int64_t num_stations = database.execAndGet("SELECT count(*) FROM stations").getInt64();
  SQLite::Statement query(
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
  SQLite::Statement query(
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

Status ReadLandmarks(SQLite::Database& database, const std::string& path, MapRows* rows) {
  const int64_t num_landmarks = database.execAndGet("SELECT count(*) FROM landmarks").getInt64();
  if (num_landmarks > INT32_MAX) return Corrupt(path, "{} landmarks", num_landmarks);
  rows->landmarks.reserve(num_landmarks);
  rows->descriptors.resize(num_landmarks, kDescriptorDim);
  SQLite::Statement query(
      database,
      "SELECT landmark_idx, class_id, x, y, z, scale, num_observations, covariance, descriptor FROM "
      "landmarks ORDER BY landmark_idx");
  while (query.executeStep()) {
    const int64_t landmark_idx = query.getColumn(0).getInt64();
    if (landmark_idx != static_cast<int64_t>(rows->landmarks.size()) || landmark_idx >= num_landmarks) {
      return Corrupt(path, "landmark {} where {} was expected", landmark_idx, rows->landmarks.size());
    }
    MapLandmark landmark;
    landmark.class_id = static_cast<ClassId>(query.getColumn(1).getInt64());
    for (int axis = 0; axis < 3; ++axis) {
      landmark.position[axis] = static_cast<double>(query.getColumn(2 + axis).getInt64()) * kMapLengthUnitM;
    }
    landmark.scale_m = static_cast<double>(query.getColumn(5).getInt64()) * kMapLengthUnitM;
    landmark.num_observations = query.getColumn(6).getInt();
    BlobReader reader(BlobView(query.getColumn(7)));
    for (int row = 0; row < 3; ++row) {
      for (int col = row; col < 3; ++col)
        landmark.covariance(row, col) = landmark.covariance(col, row) = reader.Float32();
    }
    const std::string_view descriptor = BlobView(query.getColumn(8));
    if (!reader.Finished() || descriptor.size() != kDescriptorDim) {
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
  CAIRN_RETURN_IF_ERROR(CheckVersion(database, path));
  MapRows rows;
  CAIRN_RETURN_IF_ERROR(ReadHead(database, path, &rows));
  CAIRN_RETURN_IF_ERROR(ReadCameras(database, path, &rows));
  CAIRN_RETURN_IF_ERROR(ReadLandmarks(database, path, &rows));
  CAIRN_RETURN_IF_ERROR(ReadStations(database, path, &rows));
  CAIRN_RETURN_IF_ERROR(ReadRegions(database, path, &rows));
  CAIRN_RETURN_IF_ERROR(ReadImages(database, path, &rows));
  CAIRN_ASSIGN_OR_RETURN(rows.vocabulary, ReadVocabularyTables(database, path));
  if (Status status = CheckMapRows(rows); !status.ok()) return Corrupt(path, "{}", status.error().message);
  return rows;
}

}  // namespace

Result<MapRows> ReadMapRows(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  return WithDatabaseErrors(path, [&] { return ReadTables(database, path); });
}

}  // namespace cairn
