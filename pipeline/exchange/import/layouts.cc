#include "pipeline/exchange/import/layouts.h"

#include <algorithm>
#include <filesystem>
#include <functional>
#include <set>

#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_model.h"
#include "pipeline/exchange/import/parts.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

bool Exists(const std::string& path) {
  std::error_code error;
  return fs::exists(path, error);
}

bool HasFileLike(const std::string& folder, const std::string& prefix, const std::string& suffix) {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(prefix) && name.ends_with(suffix)) return true;
  }
  return false;
}

bool HasSevenScenesFrames(const std::string& folder) {
  if (HasFileLike(folder, "frame-", ".pose.txt")) return true;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().filename().string().starts_with("seq-") &&
        HasFileLike(entry.path().string(), "frame-", ".pose.txt"))
      return true;
  }
  return false;
}

struct Layout {
  const char* name;
  const char* expected;
  std::function<bool(const std::string&)> fits;
  Result<ImportedSurvey> (*read)(const std::string&, const ImportOptions&);
};

const std::vector<Layout>& Layouts() {
  static const std::vector<Layout> kLayouts = {
      {"kapture", "sensors/sensors.txt", [](const auto& s) { return Exists(s + "/sensors/sensors.txt"); },
       ReadKaptureSurvey},
      {"euroc", "mav0/cam0/sensor.yaml",
       [](const auto& s) { return Exists(s + "/mav0/cam0/sensor.yaml") || Exists(s + "/cam0/sensor.yaml"); },
       ReadEurocSurvey},
      {"tum", "rgb.txt and groundtruth.txt", [](const auto& s) { return Exists(s + "/rgb.txt"); },
       ReadTumSurvey},
      {"7scenes", "frame-000000.color.png and frame-000000.pose.txt, in seq-01 or itself",
       HasSevenScenesFrames, ReadSevenScenesSurvey},
      {"kitti", "sequences/00, or calib.txt and image_0",
       [](const auto& s) {
         return Exists(s + "/sequences") || (Exists(s + "/calib.txt") && HasFileLike(s, "image_", ""));
       },
       ReadKittiSurvey},
      {"colmap", "cameras.bin and images.bin (or .txt), in itself, sparse or sparse/0",
       [](const auto& s) {
         return IsColmapModel(s) || IsColmapModel(s + "/sparse/0") || IsColmapModel(s + "/sparse");
       },
       ReadColmapSurvey},
  };
  return kLayouts;
}

// Moves frames whose file is missing to those left out.
void LeaveOutMissing(ImportedSurvey* survey) {
  std::erase_if(survey->images, [&](const ImportedImage& image) {
    std::error_code error;
    if (fs::is_regular_file(image.path, error)) return false;
    survey->left_out.push_back({image.name, image.path + ": no such file"});
    return true;
  });
}

// The first image of each camera must have its size: a wrong --camera shows here, not in a bad map.
Status CheckImageSizes(const ImportedSurvey& survey) {
  std::set<CameraId> checked;
  for (const ImportedImage& image : survey.images) {
    if (!checked.insert(image.camera_id).second) continue;
    const Camera& camera = survey.cameras.at(image.camera_id);
    CAIRN_ASSIGN_OR_RETURN(const ImageSize size, ReadImageSize(image.path));
    if (size.width == camera.width && size.height == camera.height) continue;
    return MakeError(ErrorCode::kCorrupt,
                     "{}: {} x {} px, but its camera has {} x {}; give the right one with --camera",
                     image.path, size.width, size.height, camera.width, camera.height);
  }
  return Ok();
}

Status ReplaceCameras(const std::string& text, ImportedSurvey* survey) {
  CAIRN_ASSIGN_OR_RETURN(Camera camera, ParseCamera(text));
  camera.camera_id = 1;
  survey->cameras = {{1, camera}};
  for (ImportedImage& image : survey->images) image.camera_id = 1;
  return Ok();
}

// Refuses options that only other layouts read.
Status CheckIsRead(const std::string& layout, const ImportOptions& options) {
  const auto check = [&](bool is_given, const char* option,
                         const std::vector<std::string>& layouts) -> Status {
    if (!is_given || std::find(layouts.begin(), layouts.end(), layout) != layouts.end()) return Ok();
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} is for {}, and the data set's layout is {}; leave it out", option,
                     fmt::join(layouts, ", "), layout);
  };
  CAIRN_RETURN_IF_ERROR(check(!options.images_folder.empty(), "--images", {"colmap"}));
  CAIRN_RETURN_IF_ERROR(check(!options.sequence.empty(), "--sequence", {"kitti"}));
  CAIRN_RETURN_IF_ERROR(check(!options.sensors.empty(), "--sensors", {"kitti", "euroc", "kapture"}));
  return check(options.max_time_gap_s != ImportOptions().max_time_gap_s, "--max-time-gap-s",
               {"tum", "euroc"});
}

}  // namespace

Result<std::string> DetectLayout(const std::string& source) {
  std::error_code error;
  if (!fs::is_directory(source, error)) {
    return MakeError(ErrorCode::kNotFound,
                     "{}: no such file or folder; name a film, a bag, or the folder of a data set", source);
  }
  std::string expected;
  for (const Layout& layout : Layouts()) {
    if (layout.fits(source)) return std::string(layout.name);
    expected += fmt::format("\n  {}: {}", layout.name, layout.expected);
  }
  return MakeError(ErrorCode::kUnsupported, "{}: none of the known layouts; looked for{}", source, expected);
}

Result<ImportedSurvey> ReadSurvey(const std::string& source, const ImportOptions& options) {
  std::string name = options.layout;
  if (name == "auto") {
    CAIRN_ASSIGN_OR_RETURN(name, DetectLayout(source));
  }
  const auto layout =
      std::find_if(Layouts().begin(), Layouts().end(), [&](const Layout& l) { return name == l.name; });
  if (layout == Layouts().end()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "format '{}': must be one of auto, colmap, tum, 7scenes, kitti, euroc, kapture", name);
  }
  CAIRN_RETURN_IF_ERROR(CheckIsRead(name, options));
  CAIRN_ASSIGN_OR_RETURN(ImportedSurvey survey, layout->read(source, options));
  if (!options.camera.empty()) CAIRN_RETURN_IF_ERROR(ReplaceCameras(options.camera, &survey));
  LeaveOutMissing(&survey);
  if (survey.images.empty()) {
    return MakeError(ErrorCode::kNoData, "{}: no image with a pose{}", source,
                     survey.left_out.empty()
                         ? ""
                         : fmt::format("; the first of {} left out, {}: {}", survey.left_out.size(),
                                       survey.left_out[0].name, survey.left_out[0].reason));
  }
  std::sort(survey.images.begin(), survey.images.end(),
            [](const ImportedImage& a, const ImportedImage& b) { return a.name < b.name; });
  for (size_t i = 1; i < survey.images.size(); ++i) {
    if (survey.images[i].name == survey.images[i - 1].name)
      return MakeError(ErrorCode::kCorrupt, "{}: image {} is listed twice", source, survey.images[i].name);
  }
  for (const auto& [camera_id, camera] : survey.cameras) CAIRN_RETURN_IF_ERROR(CheckCamera(camera));
  CAIRN_RETURN_IF_ERROR(CheckImageSizes(survey));
  return survey;
}

}  // namespace cairn::pipeline
