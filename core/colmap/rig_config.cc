#include "core/colmap/rig_config.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include <nlohmann/json.hpp>

#include "core/files/file.h"

namespace cairn {
namespace {

// So many numbers of an array; none where it is something else.
std::optional<std::vector<double>> NumbersOf(const nlohmann::json& json, size_t num) {
  if (!json.is_array() || json.size() != num) return std::nullopt;
  std::vector<double> numbers;
  for (const nlohmann::json& number : json) {
    if (!number.is_number()) return std::nullopt;
    numbers.push_back(number.get<double>());
  }
  return numbers;
}

Result<RigCamera> ReadCamera(const nlohmann::json& json, const std::string& place) {
  const auto corrupt = [&](const char* expected) {
    return MakeError(ErrorCode::kCorrupt, "{}: expected {}", place, expected);
  };
  if (!json.is_object() || !json.contains("image_prefix") || !json["image_prefix"].is_string())
    return corrupt("an object with the text 'image_prefix'");
  RigCamera camera{.image_prefix = json["image_prefix"].get<std::string>()};
  if (camera.image_prefix.empty()) return corrupt("an 'image_prefix' that tells its images from the others'");
  const bool has_rotation = json.contains("cam_from_rig_rotation"),
             has_translation = json.contains("cam_from_rig_translation");
  if (has_rotation || has_translation) {
    const auto wxyz = NumbersOf(json.value("cam_from_rig_rotation", nlohmann::json({1, 0, 0, 0})), 4);
    if (!wxyz) return corrupt("four numbers w, x, y, z in 'cam_from_rig_rotation'");
    const Eigen::Quaterniond rotation((*wxyz)[0], (*wxyz)[1], (*wxyz)[2], (*wxyz)[3]);
    constexpr double kUnit = 0.01;
    if (!(std::abs(rotation.norm() - 1) <= kUnit)) return corrupt("a 'cam_from_rig_rotation' of length 1");
    const auto translation = NumbersOf(json.value("cam_from_rig_translation", nlohmann::json({0, 0, 0})), 3);
    if (!translation) return corrupt("three numbers in 'cam_from_rig_translation'");
    camera.cam_from_rig = {rotation.normalized(), Eigen::Vector3d(translation->data())};
  } else if (json.value("ref_sensor", nlohmann::json()) != true) {
    return corrupt(
        "'cam_from_rig_rotation' and 'cam_from_rig_translation', which only the reference sensor may leave "
        "out");
  }
  if (json.contains("camera_model_name") || json.contains("camera_params")) {
    if (!json.contains("camera_model_name") || !json["camera_model_name"].is_string())
      return corrupt("the text 'camera_model_name' beside 'camera_params'");
    Camera intrinsics;
    CAIRN_ASSIGN_OR_RETURN(intrinsics.model,
                           CameraModelFromName(json["camera_model_name"].get<std::string>()));
    const auto params = NumbersOf(json.value("camera_params", nlohmann::json()),
                                  static_cast<size_t>(NumCameraParams(intrinsics.model)));
    if (!params) return corrupt("as many numbers in 'camera_params' as its model has");
    intrinsics.params.assign(params->begin(), params->end());
    camera.camera = std::move(intrinsics);
  }
  return camera;
}

}  // namespace

Result<std::vector<RigCamera>> ReadRigConfig(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  const auto document = nlohmann::json::parse(text, nullptr, false);
  if (!document.is_array() || document.empty() || !document[0].is_object() ||
      !document[0].contains("cameras") || !document[0]["cameras"].is_array() ||
      document[0]["cameras"].empty()) {
    return MakeError(ErrorCode::kCorrupt,
                     "{}: expected a JSON list with an object that has a list 'cameras', as COLMAP's "
                     "rig_configurator takes it",
                     path);
  }
  if (document.size() > 1)
    return MakeError(ErrorCode::kUnsupported, "{}: {} rigs; give a file of the one that took the images",
                     path, document.size());
  std::vector<RigCamera> cameras;
  std::set<std::string> prefixes;
  int num_reference = 0;
  for (const nlohmann::json& json : document[0]["cameras"]) {
    const std::string place = fmt::format("{}: camera {}", path, cameras.size() + 1);
    CAIRN_ASSIGN_OR_RETURN(RigCamera camera, ReadCamera(json, place));
    if (!prefixes.insert(camera.image_prefix).second)
      return MakeError(ErrorCode::kCorrupt, "{}: 'image_prefix' {} is another camera's, too", place,
                       camera.image_prefix);
    cameras.push_back(std::move(camera));
    if (json.value("ref_sensor", nlohmann::json()) == true) {
      ++num_reference;
      std::rotate(cameras.begin(), cameras.end() - 1, cameras.end());
    }
  }
  if (num_reference == 1) return cameras;
  return MakeError(ErrorCode::kCorrupt, "{}: {} cameras are the 'ref_sensor'; expected one", path,
                   num_reference);
}

std::string RigConfigJson(const std::vector<RigCamera>& cameras) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const RigCamera& camera : cameras) {
    nlohmann::ordered_json json = {{"image_prefix", camera.image_prefix}};
    const Eigen::Quaterniond& rotation = camera.cam_from_rig.rotation;
    const Eigen::Vector3d& translation = camera.cam_from_rig.translation;
    if (list.empty()) json["ref_sensor"] = true;
    // COLMAP has the reference sensor at the rig's origin, and no pose of it.
    if (!list.empty() || !translation.isZero(0) || !rotation.vec().isZero(0)) {
      json["cam_from_rig_rotation"] = {rotation.w(), rotation.x(), rotation.y(), rotation.z()};
      json["cam_from_rig_translation"] = {translation.x(), translation.y(), translation.z()};
    }
    if (camera.camera) {
      json["camera_model_name"] = CameraModelName(camera.camera->model);
      json["camera_params"] = camera.camera->params;
    }
    list.push_back(std::move(json));
  }
  return nlohmann::ordered_json::array({{{"cameras", list}}}).dump(1) + "\n";
}

Result<std::string> NameInRig(const std::vector<RigCamera>& rig, size_t camera, const std::string& name) {
  const std::string& prefix = rig.front().image_prefix;
  // The last place where a folder or file begins with the prefix.
  for (size_t at = name.rfind(prefix); at != std::string::npos && at < name.size();
       at = at == 0 ? std::string::npos : name.rfind(prefix, at - 1)) {
    if (at == 0 || name[at - 1] == '/')
      return name.substr(0, at) + rig[camera].image_prefix + name.substr(at + prefix.size());
  }
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: is no image of the rig's reference camera, whose names begin with {}", name, prefix);
}

}  // namespace cairn
