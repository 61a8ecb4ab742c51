// EuRoC MAV [Burri16], the ASL layout: mav0/cam0/{sensor.yaml, data.csv, data/TIME.png}; ground truth
// mav0/state_groundtruth_estimate0/data.csv "time, p_RS_R xyz, q_RS wxyz, ...": the pose of the state's
// frame S in the world.  T_BS of a sensor.yaml is body_from_sensor.  Times in nanoseconds.
#include <filesystem>

#include <yaml-cpp/yaml.h>

#include "core/base/text.h"
#include "core/files/file.h"
#include "core/geometry/trajectory.h"
#include "pipeline/exchange/import/layouts.h"
#include "pipeline/exchange/import/parts.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// Runs `read` on the document, its exceptions turned into errors with file and line.
template <typename Read>
auto WithYaml(const std::string& path, Read&& read) -> std::invoke_result_t<Read, const YAML::Node&> {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  try {
    return read(YAML::Load(contents));
  } catch (const YAML::Exception& exception) {
    return MakeError(ErrorCode::kCorrupt, "{}:{}: {}", path, exception.mark.line + 1, exception.msg);
  }
}

Result<Pose> BodyFromSensor(const YAML::Node& sensor, const std::string& path) {
  const auto rows = sensor["T_BS"]["data"].as<std::vector<double>>();
  if (rows.size() != 16)
    return MakeError(ErrorCode::kCorrupt, "{}: T_BS has {} numbers, expected 16", path, rows.size());
  const Result<Pose> pose = PoseFromMatrix(rows);
  if (!pose.ok()) return MakeError(pose.error().code, "{}: T_BS: {}", path, pose.error().message);
  return pose;
}

struct Sensor {
  Camera camera;
  Pose body_from_cam;
};

// With `is_camera_given` only the camera's place on the body is read.
Result<Sensor> ReadCameraSensor(const std::string& path, CameraId camera_id, bool is_camera_given) {
  return WithYaml(path, [&](const YAML::Node& node) -> Result<Sensor> {
    Sensor sensor;
    CAIRN_ASSIGN_OR_RETURN(sensor.body_from_cam, BodyFromSensor(node, path));
    if (is_camera_given) return sensor;
    const auto resolution = node["resolution"].as<std::vector<int>>();
    auto params = node["intrinsics"].as<std::vector<double>>();
    const auto camera_model = node["camera_model"].as<std::string>();
    const auto distortion_model = node["distortion_model"].as<std::string>();
    const auto distortion = node["distortion_coefficients"].as<std::vector<double>>();
    const bool is_radtan = distortion_model == "radial-tangential" || distortion_model == "radtan";
    if (camera_model != "pinhole" || (!is_radtan && distortion_model != "equidistant")) {
      return MakeError(ErrorCode::kUnsupported,
                       "{}: camera model '{}' with distortion '{}': pinhole with radial-tangential or "
                       "equidistant distortion is read; give --camera",
                       path, camera_model, distortion_model);
    }
    if (resolution.size() != 2 || params.size() != 4 || distortion.size() != 4) {
      return MakeError(ErrorCode::kCorrupt,
                       "{}: expected a resolution of 2, intrinsics of 4 and distortion_coefficients of 4 "
                       "numbers, found {}, {} and {}",
                       path, resolution.size(), params.size(), distortion.size());
    }
    params.insert(params.end(), distortion.begin(), distortion.end());
    sensor.camera =
        CameraFromOpenCv(camera_id, is_radtan ? CameraModel::kOpenCv : CameraModel::kOpenCvFisheye,
                         resolution[0], resolution[1], {params.begin(), params.end()});
    return sensor;
  });
}

// world_from_body.
Result<Trajectory> ReadGroundTruth(const std::string& folder) {
  Pose state_from_body;
  std::error_code error;
  if (const std::string path = folder + "/sensor.yaml"; fs::exists(path, error)) {
    CAIRN_ASSIGN_OR_RETURN(const Pose body_from_state, WithYaml(path, [&](const YAML::Node& node) {
                             return node["T_BS"] ? BodyFromSensor(node, path) : Result<Pose>(Pose());
                           }));
    state_from_body = body_from_state.Inverse();
  }
  const std::string path = folder + "/data.csv";
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  Trajectory trajectory;
  for (const ListLine& line : ListLines(contents, path)) {
    const std::vector<std::string> fields = SplitFields(line.text, ',');
    int64_t time_ns = 0;
    const auto v = fields.size() < 8 ? Result<std::vector<double>>(Error())
                                     : ParseNumbers(std::span(fields).subspan(1, 7));
    if (!v.ok() || !ParseNumber(fields[0], &time_ns)) {
      return MakeError(ErrorCode::kCorrupt, "{}: expected TIME, PX, PY, PZ, QW, QX, QY, QZ, found '{}'",
                       line.place, line.text);
    }
    const double numbers[] = {(*v)[3], (*v)[4], (*v)[5], (*v)[6], (*v)[0], (*v)[1], (*v)[2]};
    const Result<Pose> world_from_state = PoseFromNumbers(numbers);
    if (!world_from_state.ok())
      return MakeError(world_from_state.error().code, "{}: {}", line.place, world_from_state.error().message);
    trajectory.Add(time_ns, *world_from_state * state_from_body);
  }
  trajectory.Sort();
  return trajectory;
}

Status ReadFrames(const std::string& root, const std::string& sensor_name, const Trajectory& trajectory,
                  const ImportOptions& options, ImportedSurvey* survey) {
  const auto camera_id = static_cast<CameraId>(survey->cameras.size() + 1);
  const std::string folder = root + "/" + sensor_name;
  CAIRN_ASSIGN_OR_RETURN(const Sensor sensor,
                         ReadCameraSensor(folder + "/sensor.yaml", camera_id, !options.camera.empty()));
  survey->cameras.emplace(camera_id, sensor.camera);
  const Pose cam_from_body = sensor.body_from_cam.Inverse();
  const std::string list_path = folder + "/data.csv";
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(list_path));
  for (const ListLine& line : ListLines(contents, list_path)) {
    const std::vector<std::string> fields = SplitFields(line.text, ',');
    int64_t time_ns = 0;
    if (fields.size() < 2 || fields[1].empty() || !ParseNumber(fields[0], &time_ns)) {
      return MakeError(ErrorCode::kCorrupt, "{}: expected TIME, FILE, found '{}'", line.place, line.text);
    }
    const std::string name = sensor_name + "/" + fields[1];
    const Result<Pose> world_from_body = trajectory.At(time_ns, options.max_time_gap_s);
    if (world_from_body.ok()) {
      survey->images.push_back(
          {name, folder + "/data/" + fields[1], camera_id, cam_from_body * world_from_body->Inverse()});
    } else {
      survey->left_out.push_back({name, world_from_body.error().message});
    }
  }
  return Ok();
}

}  // namespace

Result<ImportedSurvey> ReadEurocSurvey(const std::string& source, const ImportOptions& options) {
  std::error_code error;
  const std::string root = fs::is_directory(source + "/mav0", error) ? source + "/mav0" : source;
  std::string truth;
  for (const char* folder : {"/state_groundtruth_estimate0", "/vicon0", "/mocap0"}) {
    if (truth.empty() && fs::exists(root + folder + "/data.csv", error)) truth = root + folder;
  }
  if (truth.empty()) {
    return MakeError(ErrorCode::kNotFound,
                     "{}: no ground truth: state_groundtruth_estimate0, vicon0 or mocap0 with data.csv",
                     root);
  }
  CAIRN_ASSIGN_OR_RETURN(const Trajectory trajectory, ReadGroundTruth(truth));
  ImportedSurvey survey;
  const std::vector<std::string> sensors =
      options.sensors.empty() ? std::vector<std::string>{"cam0"} : options.sensors;
  for (const std::string& sensor : sensors)
    CAIRN_RETURN_IF_ERROR(ReadFrames(root, sensor, trajectory, options, &survey));
  return survey;
}

}  // namespace cairn::pipeline
