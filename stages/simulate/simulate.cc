#include "stages/simulate/simulate.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/capture/capture.h"
#include "core/colmap/cameras_text.h"
#include "core/colmap/rig_config.h"
#include "core/files/file.h"
#include "core/files/folder.h"
#include "core/files/write_error.h"
#include "core/images/image_file.h"
#include "sim/render/building.h"
#include "sim/render/floor_plan.h"
#include "sim/survey/survey.h"

namespace cairn::simulate {
namespace {

namespace fs = std::filesystem;

Status WriteJpeg(const std::string& path, const cv::Mat& grey, int quality) {
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, EncodeJpeg(grey, quality, path));
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) return WriteError(path, "cannot be written", errno);
  return Ok();
}

// Renders and writes all images, of the survey and the queries.
Status WriteImages(const sim::Building& building, const sim::Survey& survey,
                   const sim::SimulateOptions& options, uint64_t seed, const std::string& folder,
                   int num_threads, Progress& progress) {
  const sim::Renderer survey_renderer(building, survey.camera);
  const bool same_camera = survey.query_camera.camera_id == survey.camera.camera_id;
  const std::optional<sim::Renderer> own_query_renderer =
      same_camera ? std::nullopt : std::optional<sim::Renderer>(std::in_place, building, survey.query_camera);
  const sim::Renderer& query_renderer = same_camera ? survey_renderer : *own_query_renderer;
  const int64_t num_survey = static_cast<int64_t>(survey.images.size());
  const int64_t num_images = num_survey + static_cast<int64_t>(survey.queries.size());
  std::vector<Status> statuses(num_images);
  progress.Begin("simulate", num_images, "images");
  ParallelFor(num_images, num_threads, [&](int64_t i) {
    if (progress.Cancelled()) {
      statuses[i] = MakeError(ErrorCode::kCancelled, "simulate: cancelled");
      return;
    }
    const sim::PlannedImage& image = i < num_survey ? survey.images[i] : survey.queries[i - num_survey];
    const sim::Renderer& renderer = i < num_survey ? survey_renderer : query_renderer;
    const cv::Mat grey = sim::TakeImage(renderer, image, MixSeed(MixSeed(seed, 20), i));
    statuses[i] = WriteJpeg(folder + "/" + image.name, grey, options.jpeg_quality);
    progress.Advance();
  });
  progress.End();
  for (const Status& status : statuses) CAIRN_RETURN_IF_ERROR(status);
  return Ok();
}

std::vector<CaptureImage> StatedImages(const std::vector<sim::PlannedImage>& planned, CameraId camera_id) {
  std::vector<CaptureImage> images;
  for (const sim::PlannedImage& image : planned)
    images.push_back({image.name, camera_id, image.stated_cam_from_world});
  return images;
}

// The rig, and the folders of its images.
Status WriteRig(const sim::Survey& survey, const std::string& folder) {
  std::vector<RigCamera> cameras;
  for (size_t i = 0; i < survey.cams_from_rig.size(); ++i) {
    const std::string of_camera = sim::RigFolder(static_cast<int>(i));
    std::error_code error;
    if (!fs::create_directory(folder + "/images/" + of_camera, error))
      return WriteError(folder, "cannot be created", error.value());
    cameras.push_back({of_camera, survey.cams_from_rig[i], std::nullopt});
  }
  return WriteFileAtomically(folder + "/" + kRigConfigFile, RigConfigJson(cameras));
}

// What of the building is otherwise than when it was built: boxes, flat ones of panels, metres.
std::string ChangesJson(const sim::Building& building) {
  nlohmann::ordered_json changes = nlohmann::ordered_json::array();
  for (const sim::ChangedSurface& changed : building.changed) {
    using Kind = sim::ChangedSurface::Kind;
    const auto json = [](const Eigen::Vector3d& point) {
      return nlohmann::ordered_json{point.x(), point.y(), point.z()};
    };
    const bool is_moved = changed.kind == Kind::kMovedPanel || changed.kind == Kind::kMovedFurniture;
    nlohmann::ordered_json row = {{"kind", changed.kind == Kind::kPanel        ? "panel"
                                           : changed.kind == Kind::kFurniture  ? "furniture"
                                           : changed.kind == Kind::kMovedPanel ? "moved panel"
                                                                               : "moved furniture"},
                                  {"min", json(changed.min)},
                                  {"max", json(changed.max)}};
    if (is_moved) {
      row["now_min"] = json(changed.now_min);
      row["now_max"] = json(changed.now_max);
    }
    changes.push_back(std::move(row));
  }
  return nlohmann::ordered_json{{"changed", changes}}.dump(1) + "\n";
}

}  // namespace

Result<SimulateResult> SimulateCapture(const sim::SimulateOptions& options, const std::string& path,
                                       uint64_t seed, int num_threads, Progress& progress) {
  CAIRN_ASSIGN_OR_RETURN(const sim::Building building, sim::MakeBuilding(options, seed, num_threads));
  const uint64_t survey_seed = options.run == 0 ? seed : MixSeed(MixSeed(seed, 21), options.run);
  CAIRN_ASSIGN_OR_RETURN(const sim::Survey survey, sim::PlanSurvey(building, options, survey_seed));

  CAIRN_RETURN_IF_ERROR(ReplaceFolderAtomically(path, "a capture", [&](const std::string& folder) -> Status {
    std::error_code error;
    if (!fs::create_directory(folder + "/images", error)) {
      return WriteError(folder, "cannot be created", error.value());
    }
    if (survey.cams_from_rig.size() > 1) CAIRN_RETURN_IF_ERROR(WriteRig(survey, folder));
    CAIRN_RETURN_IF_ERROR(
        WriteImages(building, survey, options, survey_seed, folder + "/images", num_threads, progress));
    CAIRN_RETURN_IF_ERROR(WriteCamerasText(
        folder + "/cameras.txt",
        {{survey.camera.camera_id, survey.camera}, {survey.query_camera.camera_id, survey.query_camera}}));
    CAIRN_RETURN_IF_ERROR(
        WriteImagesText(folder + "/images.txt", StatedImages(survey.images, survey.camera.camera_id)));
    CAIRN_RETURN_IF_ERROR(WriteImagesText(folder + "/queries.txt",
                                          StatedImages(survey.queries, survey.query_camera.camera_id)));
    if (options.change > 0)
      CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/changes.json", ChangesJson(building)));
    return sim::WriteFloorPlan(building.layout, building.obstacles, folder + "/floor_plan.geojson");
  }));
  return SimulateResult{static_cast<int>(survey.stations.size()), static_cast<int>(survey.images.size()),
                        static_cast<int>(survey.queries.size())};
}

}  // namespace cairn::simulate
