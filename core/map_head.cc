#include "core/map_head.h"

#include <cmath>

#include "core/blob.h"
#include "core/text.h"

namespace cairn {
namespace {

void BindBlob(SQLite::Statement& statement, int index, const std::string& blob) {
  statement.bind(index, blob.data(), static_cast<int>(blob.size()));
}

void BindPose(SQLite::Statement& statement, int first, const Pose& pose) {
  statement.bind(first, pose.rotation.w());
  statement.bind(first + 1, pose.rotation.x());
  statement.bind(first + 2, pose.rotation.y());
  statement.bind(first + 3, pose.rotation.z());
  for (int i = 0; i < 3; ++i) statement.bind(first + 4 + i, pose.translation[i]);
}

void Step(SQLite::Statement& statement) {
  statement.exec();
  statement.reset();
}

void WriteTexts(SQLite::Database& database, const char* sql,
                const std::map<std::string, std::string>& texts) {
  SQLite::Statement insert(database, sql);
  for (const auto& [key, value] : texts) {
    insert.bind(1, key);
    insert.bind(2, value);
    Step(insert);
  }
}

// Rows of `meta` that say what the world frame means.
std::map<std::string, std::string> FrameTexts(const CaptureFrame& frame) {
  std::map<std::string, std::string> texts = {{"unit", frame.unit},
                                              {"frame_source", frame.source},
                                              {"is_reconstructed", frame.is_reconstructed ? "1" : "0"}};
  if (frame.anchor) {
    texts["anchor_latitude_deg"] = fmt::format("{}", frame.anchor->latitude_deg);
    texts["anchor_longitude_deg"] = fmt::format("{}", frame.anchor->longitude_deg);
    texts["anchor_altitude_m"] = fmt::format("{}", frame.anchor->altitude_m);
  }
  return texts;
}

std::map<std::string, std::string> ReadTexts(SQLite::Database& database, const char* sql) {
  std::map<std::string, std::string> texts;
  SQLite::Statement query(database, sql);
  while (query.executeStep()) texts[query.getColumn(0).getString()] = query.getColumn(1).getString();
  return texts;
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

Status ReadTables(SQLite::Database& database, const std::string& path, MapHead* head) {
  auto meta = ReadTexts(database, "SELECT key, value FROM meta");
  head->name = meta["name"];
  head->writer = meta["writer"];
  head->sessions = SplitWords(meta["sessions"]);
  head->instruction_set = meta["instruction_set"];
  head->sealed = meta["sealed"] == "1";
  head->landmark_choice = meta["landmarks"];
  head->algorithm = meta["algorithm"];
  if (!ParseNumber(meta["seed"], &head->seed) || !ParseNumber(meta["k"], &head->k) ||
      !ParseNumber(meta["tau"], &head->tau) || !ParseNumber(meta["rho"], &head->rho)) {
    return Corrupt(path, "table meta: seed '{}', k '{}', tau '{}' or rho '{}' is not an integer",
                   meta["seed"], meta["k"], meta["tau"], meta["rho"]);
  }
  if (meta.count("documents")) head->documents = meta["documents"];
  if (meta.count("lower_bound")) {
    head->lower_bound.emplace();
    if (!ParseNumber(meta["lower_bound"], &*head->lower_bound) ||
        !ParseNumber(meta["uncovered_limit"], &head->uncovered_limit)) {
      return Corrupt(path, "table meta: lower_bound '{}' or uncovered_limit '{}' is not an integer",
                     meta["lower_bound"], meta["uncovered_limit"]);
    }
  }
  if (!ParseNumber(meta["stated_pose_sigma_m"], &head->stated_pose_sigma_m) ||
      !ParseNumber(meta["stated_pose_sigma_deg"], &head->stated_pose_sigma_deg)) {
    return Corrupt(path, "table meta: stated_pose_sigma_m '{}' or stated_pose_sigma_deg '{}' is not a number",
                   meta["stated_pose_sigma_m"], meta["stated_pose_sigma_deg"]);
  }
  CAIRN_RETURN_IF_ERROR(ReadFrame(meta, path, &head->frame));
  head->stage_options = ReadTexts(database, "SELECT stage, options FROM stage_options");
  head->input_hashes = ReadTexts(database, "SELECT name, hash FROM inputs");
  SQLite::Statement frames(database, "SELECT name, qw, qx, qy, qz, tx, ty, tz FROM frames");
  int num_frames = 0;
  while (frames.executeStep()) {
    const std::string name = frames.getColumn(0).getString();
    if (name != "floor_from_world" && name != "camera_from_given") continue;  // of a later minor version
    (name == "floor_from_world" ? head->floor_from_world : head->camera_from_given) =
        PoseFromColumns(frames, 1);
    ++num_frames;
  }
  if (num_frames != 2) return Corrupt(path, "table frames lacks floor_from_world or camera_from_given");
  SQLite::Statement figures(database, "SELECT name, value FROM self_test");
  while (figures.executeStep())
    head->self_test[figures.getColumn(0).getString()] = figures.getColumn(1).getDouble();
  return Ok();
}

Status ReadCameras(SQLite::Database& database, const std::string& path, MapHead* head) {
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
    head->cameras.push_back(std::move(camera));
  }
  return Ok();
}

void WriteTables(SQLite::Database& database, const MapHead& head) {
  WriteTexts(database, "INSERT INTO meta VALUES (?, ?)", FrameTexts(head.frame));
  if (!head.sessions.empty()) {
    WriteTexts(database, "INSERT INTO meta VALUES (?, ?)",
               {{"sessions", fmt::format("{}", fmt::join(head.sessions, " "))}});
  }
  if (head.documents != "all") {
    WriteTexts(database, "INSERT INTO meta VALUES (?, ?)", {{"documents", head.documents}});
  }
  if (head.lower_bound) {
    WriteTexts(database, "INSERT INTO meta VALUES (?, ?)",
               {{"lower_bound", std::to_string(*head.lower_bound)},
                {"uncovered_limit", std::to_string(head.uncovered_limit)}});
  }
  WriteTexts(database, "INSERT INTO meta VALUES (?, ?)",
             {{"name", head.name},
              {"writer", head.writer},
              {"instruction_set", head.instruction_set},
              {"seed", std::to_string(head.seed)},
              {"sealed", head.sealed ? "1" : "0"},
              {"landmarks", head.landmark_choice},
              {"algorithm", head.algorithm},
              {"k", std::to_string(head.k)},
              {"tau", std::to_string(head.tau)},
              {"rho", std::to_string(head.rho)},
              {"stated_pose_sigma_m", fmt::format("{}", head.stated_pose_sigma_m)},
              {"stated_pose_sigma_deg", fmt::format("{}", head.stated_pose_sigma_deg)}});
  WriteTexts(database, "INSERT INTO stage_options VALUES (?, ?)", head.stage_options);
  WriteTexts(database, "INSERT INTO inputs VALUES (?, ?)", head.input_hashes);
  SQLite::Statement frame(database, "INSERT INTO frames VALUES (?, ?, ?, ?, ?, ?, ?, ?)");
  for (const auto& [name, pose] : {std::pair("camera_from_given", head.camera_from_given),
                                   std::pair("floor_from_world", head.floor_from_world)}) {
    frame.bind(1, name);
    BindPose(frame, 2, pose);
    Step(frame);
  }
  SQLite::Statement figure(database, "INSERT INTO self_test VALUES (?, ?)");
  for (const auto& [name, value] : head.self_test) {
    figure.bind(1, name);
    figure.bind(2, value);
    Step(figure);
  }
}

void WriteCameras(SQLite::Database& database, const MapHead& head) {
  SQLite::Statement insert_camera(database, "INSERT INTO cameras VALUES (?, ?, ?, ?, ?, ?)");
  for (const Camera& camera : head.cameras) {
    BlobWriter params;
    for (const double param : camera.params) params.Float64(param);
    insert_camera.bind(1, static_cast<int64_t>(camera.camera_id));
    insert_camera.bind(2, static_cast<int>(camera.model));
    insert_camera.bind(3, camera.width);
    insert_camera.bind(4, camera.height);
    insert_camera.bind(5, camera.has_focal_prior ? 1 : 0);
    BindBlob(insert_camera, 6, params.Take());
    Step(insert_camera);
  }
}

}  // namespace

Status CheckPlainTable(SQLite::Database& database, const std::string& path, const char* table) {
  SQLite::Statement query(
      database,
      "SELECT count(*) FROM sqlite_schema WHERE type = 'table' AND name = ?1 AND rootpage > 0 "
      "AND sql LIKE 'CREATE TABLE%' AND NOT EXISTS "
      "(SELECT 1 FROM pragma_table_xinfo(?1) WHERE hidden <> 0)");
  query.bind(1, table);
  if (query.executeStep() && query.getColumn(0).getInt() == 1) return Ok();
  return Corrupt(path, "has no plain table '{}'", table);
}

std::string_view BlobView(const SQLite::Column& column) {
  return {static_cast<const char*>(column.getBlob()), static_cast<size_t>(column.getBytes())};
}

Pose PoseFromColumns(SQLite::Statement& statement, int first) {
  const auto value = [&](int i) { return statement.getColumn(first + i).getDouble(); };
  return {Eigen::Quaterniond(value(0), value(1), value(2), value(3)), {value(4), value(5), value(6)}};
}

Status CheckMapVersion(SQLite::Database& database, const std::string& path, int major) {
  constexpr int kApplicationId = 0x63726d70;  // 'crmp'
  const int application_id = database.execAndGet("PRAGMA application_id").getInt();
  if (application_id != kApplicationId) {
    return MakeError(ErrorCode::kForeignFile,
                     "{}: a SQLite file, but not a cairn map (application_id {:#x}, expected {:#x})", path,
                     application_id, kApplicationId);
  }
  const int version = database.execAndGet("PRAGMA user_version").getInt();
  const int found = version / 1000;
  if (found == major) return Ok();
  std::string writer = "an unknown program";
  if (HasTable(database, "meta")) {
    const auto meta = ReadTexts(database, "SELECT key, value FROM meta WHERE key = 'writer'");
    if (!meta.empty()) writer = meta.begin()->second;
  }
  return MakeError(found > major ? ErrorCode::kTooNew : ErrorCode::kTooOld,
                   "{}: map version {}.{}, written by {}; {}.x is read here. {}", path, found, version % 1000,
                   writer, major,
                   found > major ? "Update the program, or compile the map with this one."
                                 : "Make a new one of it with `cairn migrate`, or compile the map again.");
}

Status ReadMapHead(SQLite::Database& database, const std::string& path, MapHead* head) {
  CAIRN_RETURN_IF_ERROR(ReadTables(database, path, head));
  return ReadCameras(database, path, head);
}

void WriteMapHead(SQLite::Database& database, const MapHead& head) {
  WriteTables(database, head);
  WriteCameras(database, head);
}

}  // namespace cairn
