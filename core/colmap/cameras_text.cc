#include "core/colmap/cameras_text.h"

#include <algorithm>
#include <vector>

#include <fmt/ranges.h>

#include "core/base/text.h"
#include "core/files/file.h"

namespace cairn {
namespace {

// Fields MODEL WIDTH HEIGHT PARAMS... from words[first] on.
Result<Camera> CameraFromWords(const std::vector<std::string>& words, size_t first) {
  if (words.size() < first + 3) {
    return MakeError(ErrorCode::kCorrupt, "expected MODEL WIDTH HEIGHT PARAMS, found {} fields",
                     words.size() - first);
  }
  Camera camera;
  CAIRN_ASSIGN_OR_RETURN(camera.model, CameraModelFromName(words[first]));
  uint32_t width = 0, height = 0;
  if (!ParseNumber(words[first + 1], &width) || !ParseNumber(words[first + 2], &height)) {
    return MakeError(ErrorCode::kCorrupt, "image size '{} x {}' is not two positive integers",
                     words[first + 1], words[first + 2]);
  }
  camera.width = static_cast<int>(std::min(width, 1u << 30));
  camera.height = static_cast<int>(std::min(height, 1u << 30));
  for (size_t i = first + 3; i < words.size(); ++i) {
    double param = 0;
    if (!ParseNumber(words[i], &param)) {
      return MakeError(ErrorCode::kCorrupt, "camera parameter '{}' is not a number", words[i]);
    }
    camera.params.push_back(param);
  }
  // Some programs repeat a panorama's size as its parameters.
  const bool repeats_size = camera.params == std::vector<double>{double(width), double(height)};
  if (camera.model == CameraModel::kEquirectangular && repeats_size) camera.params.clear();
  CAIRN_RETURN_IF_ERROR(CheckCamera(camera));
  return camera;
}

}  // namespace

Result<Camera> ParseCamera(const std::string& text) {
  std::string spaced = text;
  std::replace(spaced.begin(), spaced.end(), ',', ' ');
  Result<Camera> camera = CameraFromWords(SplitWords(spaced), 0);
  if (camera.ok()) return camera;
  return MakeError(camera.error().code, "camera '{}': {}; the form is MODEL,WIDTH,HEIGHT,PARAM,...", text,
                   camera.error().message);
}

Result<std::map<CameraId, Camera>> ReadCamerasText(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  std::map<CameraId, Camera> cameras;
  int line_number = 0;
  for (const std::string_view line : SplitLines(contents)) {
    ++line_number;
    const std::vector<std::string> words = SplitWords(line);
    if (words.empty() || words[0][0] == '#') continue;
    CameraId camera_id = 0;
    if (!ParseNumber(words[0], &camera_id)) {
      return MakeError(ErrorCode::kCorrupt, "{}:{}: camera id '{}' is not a number", path, line_number,
                       words[0]);
    }
    Result<Camera> camera = CameraFromWords(words, 1);
    if (!camera.ok()) {
      return MakeError(camera.error().code, "{}:{}: {}", path, line_number, camera.error().message);
    }
    camera->camera_id = camera_id;
    if (!cameras.emplace(camera_id, *camera).second) {
      return MakeError(ErrorCode::kCorrupt, "{}:{}: camera {} is listed twice", path, line_number, camera_id);
    }
  }
  if (cameras.empty()) return MakeError(ErrorCode::kNoData, "{}: lists no camera", path);
  return cameras;
}

Status WriteCamerasText(const std::string& path, const std::map<CameraId, Camera>& cameras) {
  std::string text = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n";
  for (const auto& [camera_id, camera] : cameras) {
    text += fmt::format("{} {} {} {} {}\n", camera_id, CameraModelName(camera.model), camera.width,
                        camera.height, fmt::join(camera.params, " "));
  }
  return WriteFileAtomically(path, text);
}

}  // namespace cairn
