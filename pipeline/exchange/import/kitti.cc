// KITTI odometry [Geiger12]: sequences/NN/{calib.txt, image_0 .. image_3/NNNNNN.png}, poses/NN.txt with a
// 3 x 4 world_from_cam0 for each frame.  P0 .. P3 of calib.txt are rectified 3 x 4 projections K [I | t]
// from the frame of camera 0, in OpenCV's pixels.
#include <algorithm>
#include <array>
#include <filesystem>
#include <map>

#include "core/base/text.h"
#include "core/files/file.h"
#include "pipeline/exchange/import/layouts.h"
#include "pipeline/exchange/import/parts.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

struct Sequence {
  std::string folder;
  std::string poses_path;
};

Result<Sequence> FindSequence(const std::string& source, const std::string& chosen) {
  std::error_code error;
  if (!fs::exists(source + "/sequences", error)) {  // the folder of one sequence
    const fs::path folder = fs::weakly_canonical(source, error);
    const std::string file = folder.filename().string() + ".txt";
    for (const fs::path& path :
         {folder / ".." / ".." / "poses" / file, folder / "poses.txt", folder / file}) {
      if (fs::exists(path, error)) return Sequence{source, path.lexically_normal().string()};
    }
    return MakeError(ErrorCode::kNotFound,
                     "{}: no poses for this sequence: neither ../../poses/{} nor poses.txt is there (KITTI "
                     "publishes those of 00 to 10)",
                     source, file);
  }
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(source + "/sequences", error))
    names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  const std::string name = chosen.empty() && names.size() == 1 ? names[0] : chosen;
  if (std::find(names.begin(), names.end(), name) == names.end()) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: name one of its sequences with --sequence: {}", source,
                     fmt::join(names, ", "));
  }
  return Sequence{source + "/sequences/" + name, source + "/poses/" + name + ".txt"};
}

using Projection = std::array<double, 12>;

Result<std::map<std::string, Projection>> ReadCalibration(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  std::map<std::string, Projection> projections;
  for (const ListLine& line : ListLines(contents, path)) {
    const std::vector<std::string> words = SplitWords(line.text);
    if (!words[0].starts_with("P")) continue;
    const auto numbers = ParseNumbers(std::span(words).subspan(1));
    if (!numbers.ok() || numbers->size() != 12 || !((*numbers)[0] > 0) || !((*numbers)[5] > 0)) {
      return MakeError(ErrorCode::kCorrupt, "{}: expected a name and a 3 x 4 projection, found '{}'",
                       line.place, line.text);
    }
    std::copy(numbers->begin(), numbers->end(), projections[words[0].substr(0, 2)].begin());
  }
  return projections;
}

Result<std::vector<Pose>> ReadPoses(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  std::vector<Pose> poses;
  for (const ListLine& line : ListLines(contents, path)) {
    const auto numbers = ParseNumbers(SplitWords(line.text));
    if (!numbers.ok() || numbers->size() != 12) {
      return MakeError(ErrorCode::kCorrupt, "{}: expected the 12 numbers of a 3 x 4 pose", line.place);
    }
    const Result<Pose> pose = PoseFromMatrix(*numbers);
    if (!pose.ok()) return MakeError(pose.error().code, "{}: {}", line.place, pose.error().message);
    poses.push_back(*pose);
  }
  return poses;
}

// K^-1 times the last column: where camera 0's origin lies in the frame of this camera.
Pose CamFromCam0(const Projection& P) {
  Pose pose;
  pose.translation.z() = P[11];
  pose.translation.x() = (P[3] - P[2] * P[11]) / P[0];
  pose.translation.y() = (P[7] - P[6] * P[11]) / P[5];
  return pose;
}

Status ReadCamera(const Sequence& sequence, const std::string& sensor, const std::vector<Pose>& poses,
                  const std::map<std::string, Projection>& projections, ImportedSurvey* survey) {
  const auto projection =
      projections.find(fmt::format("P{}", sensor.substr(std::min<size_t>(sensor.size(), 6))));
  std::error_code error;
  if (!sensor.starts_with("image_") || projection == projections.end() ||
      !fs::is_directory(sequence.folder + "/" + sensor, error)) {
    return MakeError(ErrorCode::kNotFound,
                     "{}/{}: no such camera: a folder image_N and a line PN of calib.txt are needed",
                     sequence.folder, sensor);
  }
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(sequence.folder + "/" + sensor, error))
    files.push_back(entry.path().filename().string());
  std::sort(files.begin(), files.end());
  if (files.empty()) return Ok();
  const Projection& P = projection->second;
  const Pose cam_from_cam0 = CamFromCam0(P);
  const std::string folder = sequence.folder + "/" + sensor + "/";
  CAIRN_ASSIGN_OR_RETURN(const ImageSize size, ReadImageSize(folder + files[0]));
  const auto camera_id = static_cast<CameraId>(survey->cameras.size() + 1);
  survey->cameras.emplace(camera_id, CameraFromOpenCv(camera_id, CameraModel::kPinhole, size.width,
                                                      size.height, {P[0], P[5], P[2], P[6]}));
  for (const std::string& file : files) {
    const std::string name = sensor + "/" + file;
    size_t frame = 0;
    if (!ParseNumber(fs::path(file).stem().string(), &frame) || frame >= poses.size()) {
      survey->left_out.push_back({name, fmt::format("{} has poses of frames 0 to {}", sequence.poses_path,
                                                    static_cast<int64_t>(poses.size()) - 1)});
      continue;
    }
    survey->images.push_back({name, folder + file, camera_id, cam_from_cam0 * poses[frame].Inverse()});
  }
  return Ok();
}

}  // namespace

Result<ImportedSurvey> ReadKittiSurvey(const std::string& source, const ImportOptions& options) {
  CAIRN_ASSIGN_OR_RETURN(const Sequence sequence, FindSequence(source, options.sequence));
  CAIRN_ASSIGN_OR_RETURN(const auto projections, ReadCalibration(sequence.folder + "/calib.txt"));
  CAIRN_ASSIGN_OR_RETURN(const std::vector<Pose> poses, ReadPoses(sequence.poses_path));
  std::vector<std::string> sensors = options.sensors;
  std::error_code error;
  for (const char* sensor : {"image_0", "image_2", "image_1", "image_3"}) {
    if (sensors.empty() && fs::is_directory(sequence.folder + "/" + sensor, error)) sensors = {sensor};
  }
  if (sensors.empty())
    return MakeError(ErrorCode::kNotFound, "{}: none of image_0 to image_3 is there", sequence.folder);
  ImportedSurvey survey;
  for (const std::string& sensor : sensors)
    CAIRN_RETURN_IF_ERROR(ReadCamera(sequence, sensor, poses, projections, &survey));
  return survey;
}

}  // namespace cairn::pipeline
