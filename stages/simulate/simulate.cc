#include "stages/simulate/simulate.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "core/capture.h"
#include "core/parallel.h"
#include "core/random.h"
#include "stages/simulate/building.h"
#include "stages/simulate/floor_plan.h"
#include "stages/simulate/survey.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

Status WriteJpeg(const std::string& path, const cv::Mat& grey, int quality) {
  std::vector<uchar> bytes;
  if (!cv::imencode(".jpg", grey, bytes, {cv::IMWRITE_JPEG_QUALITY, quality})) {
    return MakeError(ErrorCode::kFailed, "{}: cannot be encoded as JPEG", path);
  }
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) {
    return MakeError(ErrorCode::kIo, "{}: cannot be written: {}; is the disk full or the folder read-only?",
                     path, std::strerror(errno));
  }
  return Ok();
}

// Renders and writes all images, of the survey and the queries.
Status WriteImages(const Renderer& renderer, const Survey& survey, const SimulateOptions& options,
                   uint64_t seed, const std::string& folder, int num_threads, Progress& progress) {
  const int64_t num_survey = static_cast<int64_t>(survey.images.size());
  const int64_t num_images = num_survey + static_cast<int64_t>(survey.queries.size());
  std::vector<Status> statuses(num_images);
  progress.Begin("simulate", num_images, "images");
  ParallelFor(num_images, num_threads, [&](int64_t i) {
    if (progress.Cancelled()) {
      statuses[i] = MakeError(ErrorCode::kCancelled, "simulate: cancelled");
      return;
    }
    const PlannedImage& image = i < num_survey ? survey.images[i] : survey.queries[i - num_survey];
    const cv::Mat grey = TakeImage(renderer, image, MixSeed(MixSeed(seed, 20), i));
    statuses[i] = WriteJpeg(folder + "/" + image.name, grey, options.jpeg_quality);
    progress.Advance();
  });
  progress.End();
  for (const Status& status : statuses) CAIRN_RETURN_IF_ERROR(status);
  return Ok();
}

std::vector<CaptureImage> StatedImages(const std::vector<PlannedImage>& planned, CameraId camera_id) {
  std::vector<CaptureImage> images;
  for (const PlannedImage& image : planned)
    images.push_back({image.name, camera_id, image.stated_cam_from_world});
  return images;
}

// Puts the whole folder `temporary` in the place of `path`, in one step where there is something already.
Status ReplaceFolder(const std::string& temporary, const std::string& path) {
  const int fd = open(temporary.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const int synced = fd < 0 ? -1 : syncfs(fd);
  if (fd >= 0) close(fd);
  if (synced != 0)
    return MakeError(ErrorCode::kIo, "{}: cannot be synced: {}", temporary, std::strerror(errno));
  std::error_code error;
  if (!fs::exists(path, error)) {
    if (std::rename(temporary.c_str(), path.c_str()) == 0) return Ok();
    return MakeError(ErrorCode::kIo, "{}: cannot be created: {}", path, std::strerror(errno));
  }
  if (renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, path.c_str(), RENAME_EXCHANGE) != 0) {
    // File systems that cannot exchange: the old folder steps aside first.
    const std::string aside = temporary + "-old";
    if (std::rename(path.c_str(), aside.c_str()) != 0 || std::rename(temporary.c_str(), path.c_str()) != 0) {
      return MakeError(ErrorCode::kIo, "{}: cannot be replaced: {}", path, std::strerror(errno));
    }
    fs::remove_all(aside, error);
  }
  fs::remove_all(temporary, error);
  return Ok();
}

// Removes the temporary folders beside `path` of processes that were killed.
void RemoveLeftovers(const std::string& path) {
  const fs::path target(path);
  const std::string prefix = target.filename().string() + ".tmp-";
  std::vector<fs::path> leftovers;
  std::error_code error;
  const fs::path parent = target.has_parent_path() ? target.parent_path() : fs::path(".");
  for (const fs::directory_entry& entry : fs::directory_iterator(parent, error)) {
    const std::string name = entry.path().filename().string();
    if (name.compare(0, prefix.size(), prefix) != 0) continue;
    pid_t process = 0;
    const char* end = name.data() + name.size();
    const auto [rest, parse_error] = std::from_chars(name.data() + prefix.size(), end, process);
    const bool is_ours = parse_error == std::errc() && process > 0 && (rest == end || *rest == '-');
    if (is_ours && kill(process, 0) != 0 && errno == ESRCH) leftovers.push_back(entry.path());
  }
  for (const fs::path& leftover : leftovers) fs::remove_all(leftover, error);
}

// Refuses to replace what is not a capture.
Status CheckOutput(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) {
    const fs::path parent = fs::path(path).parent_path();
    if (parent.empty() || fs::is_directory(parent, error)) return Ok();
    return MakeError(ErrorCode::kIo, "{}: the folder {} does not exist; create it first", path,
                     parent.string());
  }
  if (!fs::is_directory(path, error)) {
    return MakeError(ErrorCode::kIo, "{}: is a file, expected a folder; remove it or name another", path);
  }
  if (!fs::is_empty(path, error) && !fs::exists(fs::path(path) / "images.txt", error)) {
    return MakeError(
        ErrorCode::kIo,
        "{}: is a folder, but not a capture (it has no images.txt), and is not replaced; remove it or name "
        "another",
        path);
  }
  return Ok();
}

}  // namespace

Result<SimulateResult> SimulateCapture(const SimulateOptions& options, const std::string& path, uint64_t seed,
                                       int num_threads, Progress& progress) {
  std::string target = path;
  while (target.size() > 1 && target.back() == '/') target.pop_back();
  CAIRN_RETURN_IF_ERROR(CheckOutput(target));
  CAIRN_ASSIGN_OR_RETURN(const Building building, MakeBuilding(options, seed, num_threads));
  CAIRN_ASSIGN_OR_RETURN(const Survey survey, PlanSurvey(building, options, seed));
  const Renderer renderer(building, survey.camera);

  RemoveLeftovers(target);
  const std::string temporary = fmt::format("{}.tmp-{}", target, getpid());
  const auto write = [&]() -> Status {
    std::error_code error;
    fs::remove_all(temporary, error);
    if (!fs::create_directories(temporary + "/images", error)) {
      return MakeError(ErrorCode::kIo, "{}: cannot be created: {}", temporary, error.message());
    }
    CAIRN_RETURN_IF_ERROR(
        WriteImages(renderer, survey, options, seed, temporary + "/images", num_threads, progress));
    const CameraId camera_id = survey.camera.camera_id;
    CAIRN_RETURN_IF_ERROR(WriteCamerasText(temporary + "/cameras.txt", {{camera_id, survey.camera}}));
    CAIRN_RETURN_IF_ERROR(WriteImagesText(temporary + "/images.txt", StatedImages(survey.images, camera_id)));
    CAIRN_RETURN_IF_ERROR(
        WriteImagesText(temporary + "/queries.txt", StatedImages(survey.queries, camera_id)));
    CAIRN_RETURN_IF_ERROR(
        WriteFloorPlan(building.layout, building.obstacles, temporary + "/floor_plan.geojson"));
    return ReplaceFolder(temporary, target);
  };
  const Status status = write();
  if (!status.ok()) {
    std::error_code error;
    fs::remove_all(temporary, error);
    return status.error();
  }
  return SimulateResult{static_cast<int>(survey.stations.size()), static_cast<int>(survey.images.size()),
                        static_cast<int>(survey.queries.size())};
}

}  // namespace cairn
