#include "core/map/map_head_tables.h"

#include <algorithm>
#include <array>

#include "core/base/blob.h"
#include "core/base/text.h"
#include "core/features/features.h"

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

// Rows of `meta` that describe the world frame.
std::map<std::string, std::string> FrameTexts(const CaptureFrame& frame) {
  std::map<std::string, std::string> texts = {{"unit", frame.unit},
                                              {"frame_source", frame.source},
                                              {"is_reconstructed", frame.is_reconstructed ? "1" : "0"}};
  if (frame.anchor) {
    texts["anchor_latitude_deg"] = fmt::format("{}", frame.anchor->latitude_deg);
    texts["anchor_longitude_deg"] = fmt::format("{}", frame.anchor->longitude_deg);
    texts["anchor_altitude_m"] = fmt::format("{}", frame.anchor->altitude_m);
  }
  if (frame.scale_sigma_ratio > 0) {
    texts["scale_sigma_ratio"] = fmt::format("{}", frame.scale_sigma_ratio);
    texts["scale_centre"] =
        fmt::format("{} {} {}", frame.scale_centre.x(), frame.scale_centre.y(), frame.scale_centre.z());
  }
  return texts;
}

using Texts = std::map<std::string, std::string>;

// Rows of a key and a value.
Result<Texts> TextsOf(const std::vector<StoredRow>& rows) {
  std::map<std::string, std::string> texts;
  for (const StoredRow& row : rows) {
    CAIRN_ASSIGN_OR_RETURN(const std::string key, row.Text(0));
    CAIRN_ASSIGN_OR_RETURN(texts[key], row.Text(1));
  }
  return texts;
}

// Columns first .. first + 6: qw, qx, qy, qz, tx, ty, tz.
Result<Pose> PoseOf(const StoredRow& row, size_t first) {
  std::array<double, 7> values;
  for (size_t i = 0; i < values.size(); ++i) {
    CAIRN_ASSIGN_OR_RETURN(values[i], row.Real(first + i));
  }
  return Pose{Eigen::Quaterniond(values[0], values[1], values[2], values[3]),
              {values[4], values[5], values[6]}};
}

// Without these rows, the frame is a survey's, in metres.
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
  if (meta.count("scale_sigma_ratio") > 0) {
    const std::vector<std::string> centre = SplitWords(meta["scale_centre"]);
    bool are_numbers =
        ParseNumber(meta["scale_sigma_ratio"], &frame->scale_sigma_ratio) && centre.size() == 3;
    for (size_t i = 0; are_numbers && i < 3; ++i)
      are_numbers = ParseNumber(centre[i], &frame->scale_centre[static_cast<Eigen::Index>(i)]);
    if (!are_numbers) {
      return Corrupt(path,
                     "table meta: scale_sigma_ratio '{}' with scale_centre '{}' is not one and three numbers",
                     meta["scale_sigma_ratio"], meta["scale_centre"]);
    }
  }
  const Status status = CheckCaptureFrame(*frame);
  return status.ok() ? status : Corrupt(path, "table meta: {}", status.error().message);
}

// An optional whole number of `meta`.
template <typename T>
Status ReadNumber(const Texts& meta, const char* key, const std::string& path, T* value) {
  const auto row = meta.find(key);
  if (row == meta.end() || ParseNumber(row->second, value)) return Ok();
  return Corrupt(path, "table meta: {} '{}' is not a number that fits", key, row->second);
}

constexpr char kStatedCamera[] = "stated_camera_";

// Rows stated_camera_ID: MODEL WIDTH HEIGHT PARAMS..., as in COLMAP's cameras.txt.
Status ReadStatedCameras(const Texts& meta, const std::string& path, MapHead* head) {
  for (auto row = meta.lower_bound(kStatedCamera); row != meta.end() && row->first.starts_with(kStatedCamera);
       ++row) {
    Result<Camera> camera = CameraFromWords(SplitWords(row->second), 0);
    if (!camera.ok() || !ParseNumber(row->first.substr(sizeof(kStatedCamera) - 1), &camera->camera_id))
      return Corrupt(path, "table meta: {} '{}' is not a camera", row->first, row->second);
    head->stated_cameras.push_back(std::move(*camera));
  }
  std::sort(head->stated_cameras.begin(), head->stated_cameras.end(),
            [](const Camera& a, const Camera& b) { return a.camera_id < b.camera_id; });
  return Ok();
}

Status DecodeMeta(Texts meta, const std::string& path, MapHead* head) {
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
  if (meta.count("descriptors")) {
    const Result<DescriptorKind> kind = ParseDescriptorKind(meta["descriptors"]);
    if (!kind.ok()) return Corrupt(path, "table meta: {}", kind.error().message);
    head->descriptor_kind = *kind;
  }
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
  CAIRN_RETURN_IF_ERROR(ReadNumber(meta, "epoch", path, &head->epoch));
  CAIRN_RETURN_IF_ERROR(ReadNumber(meta, "covariance_scale", path, &head->covariance_scale));
  CAIRN_RETURN_IF_ERROR(ReadNumber(meta, "keypoint_correlation", path, &head->keypoint_correlation));
  CAIRN_RETURN_IF_ERROR(ReadStatedCameras(meta, path, head));
  if (meta.count("findings")) head->findings_hash = meta["findings"];
  return ReadFrame(std::move(meta), path, &head->frame);
}

Status DecodeFrames(const std::vector<StoredRow>& rows, const std::string& path, MapHead* head) {
  bool has_floor = false;
  bool has_given = false;
  for (const StoredRow& row : rows) {
    CAIRN_ASSIGN_OR_RETURN(const std::string name, row.Text(0));
    const bool is_floor = name == "floor_from_world";
    if (!is_floor && name != "camera_from_given") continue;  // of a later minor version
    CAIRN_ASSIGN_OR_RETURN((is_floor ? head->floor_from_world : head->camera_from_given), PoseOf(row, 1));
    (is_floor ? has_floor : has_given) = true;
  }
  if (has_floor && has_given) return Ok();
  return Corrupt(path, "table frames lacks floor_from_world or camera_from_given");
}

Result<Camera> DecodeCamera(const StoredRow& row, const std::string& path) {
  Camera camera;
  CAIRN_ASSIGN_OR_RETURN(const int64_t camera_id, row.Integer(0, 0, UINT32_MAX));
  CAIRN_ASSIGN_OR_RETURN(const int64_t model_id, row.Integer(1, INT32_MIN, INT32_MAX));
  const Result<CameraModel> model = CameraModelFromId(static_cast<int>(model_id));
  if (!model.ok()) return Corrupt(path, "camera {}: {}", camera_id, model.error().message);
  CAIRN_ASSIGN_OR_RETURN(const int64_t width, row.Integer(2, 0, INT32_MAX));
  CAIRN_ASSIGN_OR_RETURN(const int64_t height, row.Integer(3, 0, INT32_MAX));
  CAIRN_ASSIGN_OR_RETURN(const int64_t has_focal_prior, row.Integer(4));
  CAIRN_ASSIGN_OR_RETURN(const std::string params, row.Blob(5));
  camera.camera_id = static_cast<CameraId>(camera_id);
  camera.model = *model;
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
  camera.has_focal_prior = has_focal_prior != 0;
  BlobReader reader(params);
  for (int i = 0; i < NumCameraParams(camera.model); ++i) camera.params.push_back(reader.Float64());
  if (!reader.Finished()) return Corrupt(path, "camera {}: {} bytes of parameters", camera_id, params.size());
  return camera;
}

void WriteTables(SQLite::Database& database, const MapHead& head) {
  WriteTexts(database, "INSERT INTO meta VALUES (?, ?)", FrameTexts(head.frame));
  if (head.epoch != 0) {
    WriteTexts(database, "INSERT INTO meta VALUES (?, ?)", {{"epoch", std::to_string(head.epoch)}});
  }
  if (!head.findings_hash.empty()) {
    WriteTexts(database, "INSERT INTO meta VALUES (?, ?)", {{"findings", head.findings_hash}});
  }
  if (head.covariance_scale != 0) {
    WriteTexts(database, "INSERT INTO meta VALUES (?, ?)",
               {{"covariance_scale", fmt::format("{}", head.covariance_scale)}});
  }
  if (head.keypoint_correlation != 0) {
    WriteTexts(database, "INSERT INTO meta VALUES (?, ?)",
               {{"keypoint_correlation", fmt::format("{}", head.keypoint_correlation)}});
  }
  for (const Camera& camera : head.stated_cameras) {
    WriteTexts(database, "INSERT INTO meta VALUES (?, ?)",
               {{fmt::format("{}{}", kStatedCamera, camera.camera_id),
                 fmt::format("{} {} {} {}", CameraModelName(camera.model), camera.width, camera.height,
                             fmt::join(camera.params, " "))}});
  }
  if (!head.sessions.empty()) {
    WriteTexts(database, "INSERT INTO meta VALUES (?, ?)",
               {{"sessions", fmt::format("{}", fmt::join(head.sessions, " "))}});
  }
  if (!head.instruction_set.empty()) {
    WriteTexts(database, "INSERT INTO meta VALUES (?, ?)", {{"instruction_set", head.instruction_set}});
  }
  if (!head.descriptor_kind.is_sift()) {
    WriteTexts(database, "INSERT INTO meta VALUES (?, ?)", {{"descriptors", ToString(head.descriptor_kind)}});
    // Programs that know SIFT alone refuse the map.
    database.exec(fmt::format("PRAGMA user_version = {}", 1000 * kMapVersionOfKinds + kMapVersionMinor));
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
  if (found == major || (major == kMapVersionMajor && found == kMapVersionOfKinds)) return Ok();
  std::string writer = "an unknown program";
  if (HasTable(database, "meta")) {
    LimitedStatement query(database, "SELECT value FROM meta WHERE key = 'writer'");
    if (query.executeStep()) writer = query.getColumn(0).getString();
  }
  return MakeError(found > major ? ErrorCode::kTooNew : ErrorCode::kTooOld,
                   "{}: map version {}.{}, written by {}; {} is read here. {}", path, found, version % 1000,
                   writer,
                   major == kMapVersionMajor ? fmt::format("{}.x and {}.x", major, kMapVersionOfKinds)
                                             : fmt::format("{}.x", major),
                   found > major ? "Update the program, or compile the map with this one."
                                 : "Convert it with `cairn migrate`, or compile the map again.");
}

Status DecodeMapHead(const StoredRows& rows, const std::string& path, MapHead* head) {
  CAIRN_ASSIGN_OR_RETURN(Texts meta, TextsOf(rows.at("meta")));
  CAIRN_RETURN_IF_ERROR(DecodeMeta(std::move(meta), path, head));
  CAIRN_ASSIGN_OR_RETURN(head->stage_options, TextsOf(rows.at("stage_options")));
  CAIRN_ASSIGN_OR_RETURN(head->input_hashes, TextsOf(rows.at("inputs")));
  CAIRN_RETURN_IF_ERROR(DecodeFrames(rows.at("frames"), path, head));
  for (const StoredRow& row : rows.at("self_test")) {
    CAIRN_ASSIGN_OR_RETURN(const std::string figure, row.Text(0));
    CAIRN_ASSIGN_OR_RETURN(head->self_test[figure], row.Real(1));
  }
  for (const StoredRow& row : rows.at("cameras")) {
    CAIRN_ASSIGN_OR_RETURN(Camera camera, DecodeCamera(row, path));
    head->cameras.push_back(std::move(camera));
  }
  return Ok();
}

void WriteMapHead(SQLite::Database& database, const MapHead& head) {
  WriteTables(database, head);
  WriteCameras(database, head);
}

}  // namespace cairn
