// kapture 1.x [Humenberger20]: sensors/sensors.txt "id, name, camera, MODEL, W, H, P...", records_camera.txt
// "time, id, file", trajectories.txt "time, id, qw qx qy qz tx ty tz" (device_from_world), rigs.txt
// "rig, id, qw qx qy qz tx ty tz" (sensor_from_rig); files below sensors/records_data; COLMAP's cameras.
#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>

#include "core/base/text.h"
#include "core/colmap/cameras_text.h"
#include "core/files/file.h"
#include "pipeline/exchange/import/layouts.h"
#include "pipeline/exchange/import/parts.h"

namespace cairn::pipeline {
namespace {

constexpr int kMaxRigDepth = 8;  // rigs of rigs

struct RigPlace {
  std::string rig;
  Pose sensor_from_rig;
};

struct Records {
  std::map<std::string, CameraId> camera_ids;                             // by sensor
  std::map<std::pair<std::string, std::string>, Pose> device_from_world;  // by time and device
  std::map<std::string, RigPlace> rig_places;                             // by sensor or inner rig
};

// The comma-separated fields of each line, at least `num_fields` of them.
struct Row {
  std::vector<std::string> fields;
  std::string place;
};
Result<std::vector<Row>> ReadRows(const std::string& path, size_t num_fields, const char* expected) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  std::vector<Row> rows;
  for (const ListLine& line : ListLines(contents, path)) {
    rows.push_back({SplitFields(line.text, ','), line.place});
    if (rows.back().fields.size() < num_fields) {
      return MakeError(ErrorCode::kCorrupt, "{}: expected {}, found '{}'", line.place, expected, line.text);
    }
  }
  return rows;
}

// Fields 2 to 8; nothing where some are empty, as kapture writes a pose that is partly known.
Result<std::optional<Pose>> RowPose(const Row& row) {
  const auto fields = std::span(row.fields).subspan(2, 7);
  if (std::any_of(fields.begin(), fields.end(), [](const std::string& field) { return field.empty(); }))
    return std::optional<Pose>();
  const auto numbers = ParseNumbers(fields);
  const Result<Pose> pose = numbers.ok() ? PoseFromNumbers(*numbers) : Result<Pose>(numbers.error());
  if (!pose.ok()) return MakeError(pose.error().code, "{}: {}", row.place, pose.error().message);
  return std::optional<Pose>(*pose);
}

Status ReadSensors(const std::string& path, const std::vector<std::string>& wanted, Records* records,
                   ImportedSurvey* survey) {
  CAIRN_ASSIGN_OR_RETURN(const std::vector<Row> rows, ReadRows(path, 3, "ID, NAME, TYPE, PARAMS"));
  for (const Row& row : rows) {
    const std::vector<std::string>& f = row.fields;
    const bool is_wanted = wanted.empty() || std::find(wanted.begin(), wanted.end(), f[0]) != wanted.end();
    if (f[2] != "camera" || !is_wanted) continue;
    const auto camera_id = static_cast<CameraId>(records->camera_ids.size() + 1);
    int width = 0, height = 0;
    if (f.size() >= 6 && f[3] == "UNKNOWN_CAMERA" && ParseNumber(f[4], &width) &&
        ParseNumber(f[5], &height)) {
      survey->cameras[camera_id] = GuessCamera(camera_id, width, height);
      survey->notes.push_back(fmt::format("{}: UNKNOWN_CAMERA: f = 1.2 max(w, h) assumed", row.place));
    } else {
      Result<Camera> camera = ParseCamera(fmt::format("{}", fmt::join(f.begin() + 3, f.end(), ",")));
      if (!camera.ok()) return MakeError(camera.error().code, "{}: {}", row.place, camera.error().message);
      camera->camera_id = camera_id;
      survey->cameras[camera_id] = *camera;
    }
    records->camera_ids.emplace(f[0], camera_id);
  }
  for (const std::string& sensor : wanted) {
    if (!records->camera_ids.contains(sensor))
      return MakeError(ErrorCode::kNotFound, "{}: no camera '{}'", path, sensor);
  }
  return Ok();
}

Status ReadPoses(const std::string& folder, Records* records) {
  const char* const kExpected = "TIME, ID, QW, QX, QY, QZ, TX, TY, TZ";
  CAIRN_ASSIGN_OR_RETURN(const std::vector<Row> rows, ReadRows(folder + "/trajectories.txt", 9, kExpected));
  for (const Row& row : rows) {
    CAIRN_ASSIGN_OR_RETURN(const std::optional<Pose> pose, RowPose(row));
    if (pose) records->device_from_world.insert_or_assign({row.fields[0], row.fields[1]}, *pose);
  }
  std::error_code error;
  if (!std::filesystem::exists(folder + "/rigs.txt", error)) return Ok();
  CAIRN_ASSIGN_OR_RETURN(const std::vector<Row> rigs,
                         ReadRows(folder + "/rigs.txt", 9, "RIG, ID, QW, QX, QY, QZ, TX, TY, TZ"));
  for (const Row& row : rigs) {
    CAIRN_ASSIGN_OR_RETURN(const std::optional<Pose> pose, RowPose(row));
    if (!pose)
      return MakeError(ErrorCode::kCorrupt, "{}: a sensor's place in its rig has empty fields", row.place);
    if (!records->rig_places.emplace(row.fields[1], RigPlace{row.fields[0], *pose}).second)
      return MakeError(ErrorCode::kCorrupt, "{}: '{}' is in two rigs", row.place, row.fields[1]);
  }
  return Ok();
}

// The device's own pose, or that of the rig which carries it.
std::optional<Pose> DeviceFromWorld(const Records& records, const std::string& time,
                                    const std::string& device) {
  Pose device_from_rig;
  std::string name = device;
  for (int depth = 0; depth <= kMaxRigDepth; ++depth) {
    const auto stated = records.device_from_world.find({time, name});
    if (stated != records.device_from_world.end()) return device_from_rig * stated->second;
    const auto place = records.rig_places.find(name);
    if (place == records.rig_places.end()) return std::nullopt;
    device_from_rig = device_from_rig * place->second.sensor_from_rig;
    name = place->second.rig;
  }
  return std::nullopt;
}

}  // namespace

Result<ImportedSurvey> ReadKaptureSurvey(const std::string& source, const ImportOptions& options) {
  const std::string folder = source + "/sensors";
  ImportedSurvey survey;
  Records records;
  CAIRN_RETURN_IF_ERROR(ReadSensors(folder + "/sensors.txt", options.sensors, &records, &survey));
  CAIRN_RETURN_IF_ERROR(ReadPoses(folder, &records));
  CAIRN_ASSIGN_OR_RETURN(const std::vector<Row> rows,
                         ReadRows(folder + "/records_camera.txt", 3, "TIME, ID, FILE"));
  for (const Row& row : rows) {
    const std::string& name = row.fields[2];
    const auto camera = records.camera_ids.find(row.fields[1]);
    if (camera == records.camera_ids.end()) {
      if (options.sensors.empty())
        return MakeError(ErrorCode::kCorrupt, "{}: camera '{}' is not in sensors.txt", row.place,
                         row.fields[1]);
      continue;
    }
    const std::optional<Pose> pose = DeviceFromWorld(records, row.fields[0], row.fields[1]);
    if (pose) {
      survey.images.push_back({name, folder + "/records_data/" + name, camera->second, *pose});
    } else {
      survey.left_out.push_back(
          {name, fmt::format("{}: no pose at this time in trajectories.txt", row.place)});
    }
  }
  return survey;
}

}  // namespace cairn::pipeline
