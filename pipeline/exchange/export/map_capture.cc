#include "pipeline/exchange/export/map_capture.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "core/camera/pixel_ray.h"
#include "core/capture/capture.h"
#include "core/capture/capture_features.h"
#include "core/capture/sessions.h"
#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_database.h"
#include "core/features/descriptor_kind_table.h"
#include "core/files/file.h"
#include "core/files/folder.h"
#include "core/options/toml_options.h"
#include "pipeline/exchange/export/colmap_export.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxSessionNameBytes = 100;
// Of landmarks whose size is not known.
constexpr double kUnknownScalePx = 2;
// How far above a landmark its orientation is taken, as a part of its depth.
constexpr double kUpStepRatio = 0.01;

// An image of the map with its landmarks as features.
struct LandmarkImage {
  CaptureImage listed;
  Features features;
};

bool IsInside(const Camera& camera, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= camera.width && pixel.y() <= camera.height;
}

Keypoint KeypointOf(const Camera& camera, const Pose& cam_from_world, const Eigen::Vector2d& pixel,
                    const MapLandmark& landmark, const Eigen::Vector3d& up) {
  const Eigen::Vector3d in_camera = cam_from_world * landmark.position;
  const double depth = DepthOfScale(camera, in_camera);
  Keypoint keypoint{static_cast<float>(pixel.x()), static_cast<float>(pixel.y())};
  const bool has_scale = landmark.scale_m > 0 && depth > 0;
  keypoint.scale =
      static_cast<float>(has_scale ? landmark.scale_m * camera.MeanFocal() / depth : kUnknownScalePx);
  const auto above =
      ImageFromCamera(camera, in_camera + cam_from_world.rotation * (kUpStepRatio * std::abs(depth) * up));
  if (above)
    keypoint.orientation = static_cast<float>(std::atan2(above->y() - pixel.y(), above->x() - pixel.x()));
  return keypoint;
}

std::vector<LandmarkImage> LandmarkImages(const MapRows& rows) {
  const Eigen::Vector3d up = UpOfMap(rows);
  const ColmapModel model = ModelFromMap(rows);
  std::vector<LandmarkImage> images;
  for (const ModelImage& image : model.images) {
    const Camera& camera = model.cameras.at(image.camera_id);
    LandmarkImage added;
    added.listed = {image.name, image.camera_id, rows.camera_from_given.Inverse() * image.cam_from_world};
    std::vector<uint64_t> landmarks;
    for (const ModelKeypoint& keypoint : image.keypoints) {
      if (!IsInside(camera, keypoint.position)) continue;
      const uint64_t landmark = keypoint.point_id - 1;
      added.features.keypoints.push_back(
          KeypointOf(camera, image.cam_from_world, keypoint.position, rows.landmarks[landmark], up));
      landmarks.push_back(landmark);
    }
    if (landmarks.empty()) continue;
    added.features.descriptors.resize(static_cast<Eigen::Index>(landmarks.size()), rows.descriptors.cols());
    added.features.kind = rows.descriptor_kind;
    for (size_t i = 0; i < landmarks.size(); ++i)
      added.features.descriptors.row(static_cast<Eigen::Index>(i)) =
          rows.descriptors.row(static_cast<Eigen::Index>(landmarks[i]));
    images.push_back(std::move(added));
  }
  std::sort(images.begin(), images.end(),
            [](const auto& a, const auto& b) { return a.listed.name < b.listed.name; });
  return images;
}

Status CheckIsSeen(const MapRows& rows) {
  std::vector<int> num_seen(rows.landmarks.size(), 0);
  for (const MapImage& image : rows.images) {
    for (const LandmarkIdx landmark : image.landmarks) {
      if (++num_seen[landmark] > 1) return Ok();
    }
  }
  return MakeError(
      ErrorCode::kNoData,
      "map '{}': no landmark is seen by two of its {} images, so that nothing could be joined to "
      "it; compile it anew from its survey",
      rows.name, rows.images.size());
}

// Names of the images in their capture: those of the map without the session's.
Status WriteCaptureOf(const std::vector<const LandmarkImage*>& images, const std::string& session,
                      const MapRows& rows, const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  std::map<CameraId, Camera> cameras;
  for (const Camera& camera : rows.cameras) cameras.emplace(camera.camera_id, camera);
  const std::string prefix = rows.sessions.empty() ? "" : session + "/";
  std::vector<CaptureImage> listed;
  for (const LandmarkImage* image : images) {
    listed.push_back(image->listed);
    listed.back().name = image->listed.name.substr(prefix.size());
  }
  CAIRN_RETURN_IF_ERROR(WriteCamerasText(folder + "/cameras.txt", cameras));
  CAIRN_RETURN_IF_ERROR(WriteImagesText(folder + "/images.txt", listed));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/" + kCaptureFrameFile, CaptureFrameJson(rows.frame)));
  return WriteDatabase(folder + "/" + kFeaturesFile, std::string(kColmapSchema) + kLandmarkFeaturesSchema,
                       [&](SQLite::Database& database) -> Status {
                         WriteDescriptorKind(database, rows.descriptor_kind);
                         for (const auto& [id, camera] : cameras) WriteDatabaseCamera(database, camera);
                         SQLite::Statement row(database, "INSERT INTO cairn_landmark_images VALUES (?)");
                         for (size_t i = 0; i < images.size(); ++i) {
                           const auto image_id = static_cast<ImageId>(i + 1);
                           WriteDatabaseImage(database, {image_id, listed[i].name, listed[i].camera_id});
                           WriteDatabaseFeatures(database, image_id, images[i]->features);
                           row.bind(1, image_id);
                           row.exec();
                           row.reset();
                         }
                         return Ok();
                       });
}

// Options that are about the images of the survey: they have no effect on landmarks, or another one.
bool IsOfSurveyImages(const std::string& stage, const std::string& option) {
  static const std::set<std::string> kStages = {"simulate", "reconstruct", "decompose_views"};
  static const std::set<std::pair<std::string, std::string>> kOptions = {
      {"extract_features", "masks"},
      {"match_features", "pairs"},
      {"filter_visibility", "up"},
      {"build_vocabulary", "tree_from"},
      {"emit_map", "descriptor_bits"}};  // which a map notes where trials chose them
  return kStages.contains(stage) || kOptions.contains({stage, option});
}

}  // namespace

std::string NameOfMap(const MapHead& head) {
  std::string name = head.name.substr(0, kMaxSessionNameBytes);
  for (char& c : name) {
    const bool is_valid = std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' || c == '.';
    if (!is_valid) c = '_';
  }
  if (name.empty()) return "map";
  if (!IsSessionName(name)) name.front() = '_';
  return name;
}

Eigen::Vector3d UpOfMap(const MapHead& head) {
  return head.floor_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ();
}

Result<std::vector<MapCapture>> WriteMapCaptures(const MapRows& rows, const std::string& folder,
                                                 const std::string& map_path) {
  CAIRN_RETURN_IF_ERROR(CheckIsSeen(rows));
  const std::vector<LandmarkImage> images = LandmarkImages(rows);
  std::map<std::string, std::vector<const LandmarkImage*>> of_session;
  for (const LandmarkImage& image : images) {
    const int session = SessionOfImage(rows.sessions, image.listed.name);
    of_session[session < 0 ? NameOfMap(rows) : rows.sessions[session]].push_back(&image);
  }
  std::vector<MapCapture> captures;
  for (const std::string& session :
       rows.sessions.empty() ? std::vector<std::string>{NameOfMap(rows)} : rows.sessions) {
    if (!of_session.contains(session)) continue;
    MapCapture capture{session, folder + "/" + session, static_cast<int>(of_session[session].size())};
    for (const LandmarkImage* image : of_session[session])
      capture.num_keypoints += static_cast<int64_t>(image->features.keypoints.size());
    captures.push_back(capture);
  }
  CAIRN_RETURN_IF_ERROR(
      ReplaceFolderAtomically(folder, "the captures of a map", [&](const std::string& written) -> Status {
        for (const MapCapture& capture : captures) {
          CAIRN_RETURN_IF_ERROR(WriteCaptureOf(of_session[capture.session], capture.session, rows,
                                               written + "/" + capture.session));
        }
        if (map_path.empty()) return Ok();
        CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(map_path));
        return WriteFileAtomically(written + "/" + kCapturedMapFile, bytes);
      }));
  return captures;
}

Result<std::string> OptionsOfMap(const MapHead& head,
                                 const std::vector<std::pair<std::string, OptionTable>>& stages) {
  std::string text;
  for (const auto& [stage, table] : stages) {
    const auto recorded = head.stage_options.find(stage);
    if (recorded == head.stage_options.end()) continue;
    CAIRN_ASSIGN_OR_RETURN(
        const toml::table keys,
        ParseToml(recorded->second, fmt::format("map '{}': options of {}", head.name, stage)));
    OptionTable changed;
    for (const Option& option : table) {
      const toml::node* node = keys.get(option.name);
      if (node == nullptr || IsOfSurveyImages(stage, option.name)) continue;
      const std::string by_default = OptionValueText(option);
      toml::table one;
      one.insert(option.name, *node);
      // A value that this program no longer takes is as if it were not known.
      if (!SetOptionsFromToml(one, stage, {option}).ok() || OptionValueText(option) == by_default) continue;
      changed.push_back(option);
    }
    if (!changed.empty()) text += fmt::format("\n[{}]\n{}", stage, OptionsToml(changed));
  }
  return text;
}

}  // namespace cairn::pipeline
