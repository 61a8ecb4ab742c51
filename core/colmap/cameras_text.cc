#include "core/colmap/cameras_text.h"

#include <algorithm>
#include <vector>

#include <fmt/ranges.h>

#include "core/base/text.h"
#include "core/files/file.h"

namespace cairn {

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
