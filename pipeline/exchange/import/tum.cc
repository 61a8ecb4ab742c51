// TUM RGB-D [Sturm12]: rgb.txt "time file", groundtruth.txt "time tx ty tz qx qy qz qw", the pose of the
// colour camera's optical frame in the world (world_from_cam), times in seconds.
#include <cmath>
#include <filesystem>
#include <optional>

#include "core/base/pooled.h"
#include "core/base/text.h"
#include "core/files/file.h"
#include "core/geometry/trajectory.h"
#include "pipeline/exchange/import/layouts.h"
#include "pipeline/exchange/import/parts.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// The colour cameras as the data set's page states them, in OpenCV's pixels: fx fy cx cy k1 k2 p1 p2 k3.
std::optional<Camera> KnownCamera(const std::string& source) {
  std::error_code error;
  const std::string path = fs::weakly_canonical(source, error).string();
  const auto full = [](PooledVector<double> params) {
    params.insert(params.end(), {0, 0, 0});  // k4 k5 k6
    return CameraFromOpenCv(1, CameraModel::kFullOpenCv, 640, 480, std::move(params));
  };
  if (path.find("freiburg1") != std::string::npos)
    return full({517.3, 516.5, 318.6, 255.3, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633});
  if (path.find("freiburg2") != std::string::npos)
    return full({520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172});
  if (path.find("freiburg3") != std::string::npos)
    return CameraFromOpenCv(1, CameraModel::kPinhole, 640, 480, {535.4, 539.2, 320.1, 247.6});
  return std::nullopt;
}

int64_t NanosecondsFromSeconds(double seconds) { return std::llround(seconds * 1e9); }
// Times of 1970 to 2250: what an int64_t of nanoseconds holds.
bool IsTime(double seconds) { return std::abs(seconds) < 9e9; }

Result<Trajectory> ReadTumTrajectory(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  Trajectory trajectory;
  for (const ListLine& line : ListLines(contents, path)) {
    const auto v = ParseNumbers(SplitWords(line.text));
    if (!v.ok() || v->size() != 8 || !IsTime((*v)[0])) {
      return MakeError(ErrorCode::kCorrupt, "{}: expected TIME TX TY TZ QX QY QZ QW, found '{}'", line.place,
                       line.text);
    }
    const double numbers[] = {(*v)[7], (*v)[4], (*v)[5], (*v)[6], (*v)[1], (*v)[2], (*v)[3]};
    const Result<Pose> pose = PoseFromNumbers(numbers);
    if (!pose.ok()) return MakeError(pose.error().code, "{}: {}", line.place, pose.error().message);
    trajectory.Add(NanosecondsFromSeconds((*v)[0]), *pose);
  }
  trajectory.Sort();
  return trajectory;
}

}  // namespace

Result<ImportedSurvey> ReadTumSurvey(const std::string& source, const ImportOptions& options) {
  CAIRN_ASSIGN_OR_RETURN(const Trajectory trajectory, ReadTumTrajectory(source + "/groundtruth.txt"));
  ImportedSurvey survey;
  if (options.camera.empty()) {
    const std::optional<Camera> camera = KnownCamera(source);
    if (!camera) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: TUM's layout states no camera, and the path has none of freiburg1, freiburg2, "
                       "freiburg3; give --camera MODEL,WIDTH,HEIGHT,PARAM,...",
                       source);
    }
    survey.cameras = {{1, *camera}};
    survey.notes.push_back("camera as the data set's page states it for this freiburg number");
  }
  const std::string list_path = source + "/rgb.txt";
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(list_path));
  for (const ListLine& line : ListLines(contents, list_path)) {
    const std::vector<std::string> words = SplitWords(line.text);
    double seconds = 0;
    if (words.size() != 2 || !ParseNumber(words[0], &seconds) || !IsTime(seconds)) {
      return MakeError(ErrorCode::kCorrupt, "{}: expected TIME FILE, found '{}'", line.place, line.text);
    }
    const Result<Pose> world_from_cam =
        trajectory.At(NanosecondsFromSeconds(seconds), options.max_time_gap_s);
    if (world_from_cam.ok()) {
      survey.images.push_back({words[1], source + "/" + words[1], 1, world_from_cam->Inverse()});
    } else {
      survey.left_out.push_back({words[1], world_from_cam.error().message});
    }
  }
  return survey;
}

}  // namespace cairn::pipeline
