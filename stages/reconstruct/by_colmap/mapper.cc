#include "stages/reconstruct/by_colmap/mapper.h"

#include <algorithm>
#include <charconv>
#include <filesystem>

#include "core/base/pooled.h"
#include "core/files/write_error.h"
#include "stages/reconstruct/by_colmap/run_program.h"

namespace cairn::reconstruct {
namespace {

namespace fs = std::filesystem;

constexpr double kSecondsPerHour = 3600;
// Least median angle between the rays of the two images of a start, which COLMAP itself takes down to a
// quarter; its default is 16.
constexpr double kSmallTriangulationAngleDeg = 2;

// The camera that is given to the mapper.
Camera MapperCamera(Camera camera, const MapperOptions& options) {
  if (options.refine_distortion && camera.model == CameraModel::kSimplePinhole) {
    camera.model = CameraModel::kSimpleRadial;
    camera.params.push_back(0);
  }
  return camera;
}

Status WriteMapperDatabase(const MapperInput& input, const MapperOptions& options, const std::string& path) {
  return WriteDatabase(path, kColmapSchema, [&](SQLite::Database& database) -> Status {
    for (const auto& [camera_id, camera] : input.cameras)
      WriteDatabaseCamera(database, MapperCamera(camera, options));
    SQLite::Statement keypoints_row(database, "INSERT INTO keypoints VALUES (?, ?, 4, ?)");
    for (size_t i = 0; i < input.images.size(); ++i) {
      WriteDatabaseImage(database, input.images[i]);
      const PooledVector<Keypoint>& keypoints = input.keypoints[i];
      keypoints_row.bind(1, input.images[i].image_id);
      keypoints_row.bind(2, static_cast<int64_t>(keypoints.size()));
      keypoints_row.bind(3, keypoints.data(), static_cast<int>(keypoints.size() * sizeof(Keypoint)));
      keypoints_row.exec();
      keypoints_row.reset();
    }
    for (const TwoViewGeometry& geometry : input.geometries) WriteDatabaseTwoViewGeometry(database, geometry);
    return Ok();
  });
}

std::string Flag(bool value) { return value ? "1" : "0"; }

std::vector<std::string> MapperWords(const std::string& database, const std::string& images_folder,
                                     const MapperOptions& options, const std::string& models) {
  std::vector<std::string> words = {
      "colmap", "mapper", "--database_path", database, "--image_path", images_folder, "--output_path", models,
      "--random_seed", "0", "--Mapper.num_threads", options.deterministic ? "1" : "-1",
      "--Mapper.extract_colors", "0", "--Mapper.min_num_matches", std::to_string(kMinNumMatches),
      // Also small models: they are listed, and a small capture may have only one.
      "--Mapper.min_model_size", "3", "--Mapper.ba_refine_focal_length", Flag(options.refine_focal_length),
      "--Mapper.ba_refine_extra_params", Flag(options.refine_distortion)};
  if (options.start_from_any_pair) {
    words.insert(words.end(), {"--Mapper.init_max_forward_motion", "1", "--Mapper.init_min_tri_angle",
                               fmt::format("{}", kSmallTriangulationAngleDeg)});
  }
  return words;
}

std::string LastLines(const ProgramOutcome& outcome) {
  if (outcome.last_lines.empty()) return "it printed nothing";
  return fmt::format("its last lines:\n  {}", fmt::join(outcome.last_lines, "\n  "));
}

// "Registering image #12 (5)": the fifth image of the current model.
int RegisteredCount(const std::string& line) {
  if (line.find("Registering image #") == std::string::npos) return 0;
  const size_t bracket = line.rfind('(');
  int count = 0;
  if (bracket != std::string::npos)
    std::from_chars(line.data() + bracket + 1, line.data() + line.size(), count);
  return count;
}

Error NoStart(const MapperInput& input) {
  size_t most = 0;
  for (const TwoViewGeometry& geometry : input.geometries) most = std::max(most, geometry.inliers.size());
  return MakeError(
      ErrorCode::kNoData,
      "colmap mapper found no two images to start a reconstruction from, among {} images with {} "
      "verified pairs (the best of {} matches); neighbouring images must show the same things "
      "from places some steps apart: take more images, or raise extract_features' "
      "max_num_features",
      input.images.size(), input.geometries.size(), most);
}

Result<ProgramOutcome> RunColmap(const MapperInput& input, const std::vector<std::string>& words,
                                 const MapperOptions& options, Progress& progress) {
  RunProgramOptions run;
  run.max_seconds = options.max_hours * kSecondsPerHour;
  run.environment = {"QT_QPA_PLATFORM=offscreen"};  // it aborts where there is no display
  if (options.deterministic) {
    run.environment.insert(run.environment.end(), {"OMP_NUM_THREADS=1", "OPENBLAS_NUM_THREADS=1"});
  }
  int num_shown = 0;
  const int num_images = static_cast<int>(input.images.size());
  run.on_line = [&](const std::string& line) {
    const int count = std::min(RegisteredCount(line), num_images);
    if (count > num_shown) progress.Advance(count - num_shown);
    num_shown = std::max(num_shown, count);
  };
  progress.Begin("reconstruct", num_images, "images");
  Result<ProgramOutcome> outcome = RunProgram(words, run, progress);
  progress.End();
  if (!outcome.ok() && outcome.error().code == ErrorCode::kNotFound) {
    return MakeError(ErrorCode::kNotFound,
                     "no program colmap on PATH, which reconstructs captures without poses; install it (apt "
                     "install colmap), or give the capture an images.txt with poses");
  }
  return outcome;
}

Result<std::vector<ColmapModel>> ReadModels(const std::string& folder) {
  std::vector<fs::path> folders;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (IsColmapModel(entry.path())) folders.push_back(entry.path());
  }
  std::sort(folders.begin(), folders.end(), [](const fs::path& a, const fs::path& b) {  // 0, 1, ..., 10
    const std::string name1 = a.filename(), name2 = b.filename();
    return std::pair(name1.size(), name1) < std::pair(name2.size(), name2);
  });
  std::vector<ColmapModel> models;
  for (const fs::path& path : folders) {
    CAIRN_ASSIGN_OR_RETURN(ColmapModel model, ReadColmapModel(path));
    models.push_back(std::move(model));
  }
  std::stable_sort(models.begin(), models.end(), [](const ColmapModel& a, const ColmapModel& b) {
    return std::pair(a.images.size(), a.points.size()) > std::pair(b.images.size(), b.points.size());
  });
  return models;
}

}  // namespace

Result<std::vector<ColmapModel>> RunMapper(const MapperInput& input, const std::string& images_folder,
                                           const MapperOptions& options, const std::string& work_folder,
                                           Progress& progress) {
  const std::string database = work_folder + "/database.db", models_folder = work_folder + "/models";
  CAIRN_RETURN_IF_ERROR(WriteMapperDatabase(input, options, database));
  std::error_code error;
  if (!fs::create_directories(models_folder, error))
    return WriteError(models_folder, "cannot be created", error.value());
  CAIRN_ASSIGN_OR_RETURN(
      const ProgramOutcome outcome,
      RunColmap(input, MapperWords(database, images_folder, options, models_folder), options, progress));
  if (outcome.timed_out) {
    return MakeError(ErrorCode::kFailed,
                     "colmap mapper was ended after max_hours = {:g}; allow more, or give fewer images; {}",
                     options.max_hours, LastLines(outcome));
  }
  if (!outcome.succeeded()) {
    const bool has_no_start =
        std::any_of(outcome.last_lines.begin(), outcome.last_lines.end(), [](const std::string& line) {
          return line.find("failed to create sparse model") != std::string::npos;
        });
    if (has_no_start) return NoStart(input);
    return MakeError(ErrorCode::kFailed, "colmap mapper failed with exit code {}; {}", outcome.exit_code,
                     LastLines(outcome));
  }
  CAIRN_ASSIGN_OR_RETURN(std::vector<ColmapModel> models, ReadModels(models_folder));
  std::erase_if(models, [](const ColmapModel& model) { return model.images.empty(); });
  if (models.empty()) {
    return MakeError(ErrorCode::kFailed, "colmap mapper ended without an error, but left no model; {}",
                     LastLines(outcome));
  }
  return models;
}

}  // namespace cairn::reconstruct
