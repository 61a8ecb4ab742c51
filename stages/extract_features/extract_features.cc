#include "stages/extract_features/extract_features.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include <opencv2/core/utility.hpp>

#include "core/base/parallel.h"
#include "core/colmap/colmap_database.h"
#include "core/features/descriptor_kind_table.h"
#include "core/features/features.h"
#include "core/images/image_file.h"
#include "core/learned/feature_finder.h"
#include "stages/extract_features/extract_image.h"
#include "stages/extract_features/resources.h"

namespace cairn::extract_features {
namespace {

namespace fs = std::filesystem;

constexpr char kOwnSchema[] = R"sql(
CREATE TABLE cairn_images (image_id INTEGER PRIMARY KEY NOT NULL, content_hash TEXT NOT NULL);
CREATE TABLE cairn_rejects (name TEXT NOT NULL, reason TEXT NOT NULL);
)sql";

// A run of the stage: its inputs and its progress.
struct ExtractionRun {
  const Capture& capture;
  const ExtractFeaturesOptions& options;
  std::shared_ptr<const FeatureFinder> finder;
  std::string masks;                 // absolute, "" if none
  std::vector<CaptureImage> images;  // the run's share
  EarlierExtractions earlier;
  ExtractFeaturesSummary summary;
  std::vector<ReuseEntry> entries;
};

Result<std::vector<Extraction>> ExtractBatch(int64_t begin, int num_threads, Progress& progress,
                                             ExtractionRun* run) {
  std::vector<Extraction> batch(
      std::min<int64_t>(kNumImagesPerBatch, static_cast<int64_t>(run->images.size()) - begin));
  ParallelFor(static_cast<int64_t>(batch.size()), num_threads, [&](int64_t i) {
    if (progress.Cancelled()) return;
    const CaptureImage& image = run->images[begin + i];
    Result<Extraction> extraction = ExtractImage(run->capture, image, run->options, *run->finder,
                                                 FindMask(run->masks, image.name), &run->earlier);
    if (extraction.ok()) {
      batch[i] = std::move(*extraction);
    } else {
      batch[i].reject_reason = extraction.error().message;
    }
    progress.Advance();
  });
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while extracting features");
  return batch;
}

void WriteRejects(std::vector<Reject>* rejects, SQLite::Database& database) {
  std::stable_sort(rejects->begin(), rejects->end(),
                   [](const Reject& a, const Reject& b) { return a.name < b.name; });
  SQLite::Statement row(database, "INSERT INTO cairn_rejects VALUES (?, ?)");
  for (const Reject& reject : *rejects) {
    row.bind(1, reject.name);
    row.bind(2, reject.reason);
    row.exec();
    row.reset();
  }
}

// Which images show landmarks of a map alone, for those that try maps; no table where there are none.
void WriteLandmarkImages(const std::vector<ImageId>& images, SQLite::Database& database) {
  if (images.empty()) return;
  database.exec(kLandmarkFeaturesSchema);
  SQLite::Statement row(database, "INSERT INTO cairn_landmark_images VALUES (?)");
  for (const ImageId image_id : images) {
    row.bind(1, image_id);
    row.exec();
    row.reset();
  }
}

Error OtherKind(const View& view, const std::pair<DescriptorKind, std::string>& first) {
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: descriptors of the kind '{}', but those of {} are '{}': a survey has one kind",
                   view.name, ToString(view.features.kind), first.second, ToString(first.first));
}

Status WriteAll(int num_threads, Progress& progress, ExtractionRun* run, SQLite::Database& database) {
  for (const auto& [camera_id, camera] : run->capture.cameras) {
    const bool is_panorama = camera.model == CameraModel::kEquirectangular;
    WriteDatabaseCamera(database, is_panorama ? PanoramaViewCamera(camera, run->options.panorama) : camera);
  }
  database.exec(kOwnSchema);
  SQLite::Statement hash_row(database, "INSERT INTO cairn_images VALUES (?, ?)");
  ExtractFeaturesSummary& summary = run->summary;
  ImageId next_id = 1;
  std::vector<ImageId> of_landmarks;
  std::optional<std::pair<DescriptorKind, std::string>> kind;  // and the image that has it
  for (int64_t begin = 0; begin < static_cast<int64_t>(run->images.size()); begin += kNumImagesPerBatch) {
    CAIRN_ASSIGN_OR_RETURN(const std::vector<Extraction> batch,
                           ExtractBatch(begin, num_threads, progress, run));
    for (size_t i = 0; i < batch.size(); ++i) {
      const CaptureImage& image = run->images[begin + i];
      if (batch[i].reject_reason) {
        CAIRN_RETURN_IF_ERROR(CheckImageCodecs(image.name));  // not the image's fault
        summary.rejects.push_back({image.name, *batch[i].reject_reason});
        continue;
      }
      if (batch[i].is_elsewhere) continue;
      run->entries.push_back(EntryOf(batch[i], next_id));
      for (const View& view : batch[i].views) {
        if (!kind) kind.emplace(view.features.kind, view.name);
        if (view.features.kind != kind->first) return OtherKind(view, *kind);
        const ImageId image_id = next_id++;
        WriteDatabaseImage(database, {image_id, view.name, image.camera_id});
        WriteDatabaseFeatures(database, image_id, view.features);
        hash_row.bind(1, image_id);
        hash_row.bind(2, batch[i].content_hash);
        hash_row.exec();
        hash_row.reset();
        if (batch[i].are_landmarks) of_landmarks.push_back(image_id);
        summary.num_views++;
        summary.num_keypoints += static_cast<int64_t>(view.features.keypoints.size());
      }
      summary.num_images++;
      summary.num_taken_over += batch[i].is_taken_over ? 1 : 0;
    }
  }
  if (kind) WriteDescriptorKind(database, kind->first);
  WriteRejects(&summary.rejects, database);
  WriteLandmarkImages(of_landmarks, database);
  return Ok();
}

// Every n-th image for n shards: which images are new depends on their contents, and new ones lie
// side by side.
std::vector<CaptureImage> ImagesOfShard(const std::vector<CaptureImage>& images, const Shard& shard) {
  std::vector<CaptureImage> share;
  for (size_t i = shard.index - 1; i < images.size(); i += shard.count) share.push_back(images[i]);
  return share;
}

// Every file that the run reads.
std::vector<std::string> ListInputs(const ExtractionRun& run) {
  std::vector<std::string> inputs;
  std::error_code error;
  for (const char* list : {"cameras.txt", "images.txt", "queries.txt"}) {
    const std::string path = run.capture.root + "/" + list;
    if (fs::exists(path, error)) inputs.push_back(path);
  }
  std::set<std::string> databases;
  for (const CaptureImage& image : run.images) {
    if (const FeaturesRow* row = run.capture.FeaturesOf(image); row != nullptr) {
      databases.insert(row->path);
      continue;
    }
    inputs.push_back(run.capture.ImagePath(image));
    if (const std::string mask = FindMask(run.masks, image.name); !mask.empty()) inputs.push_back(mask);
  }
  inputs.insert(inputs.end(), databases.begin(), databases.end());
  return inputs;
}

}  // namespace

OptionTable DescribeOptions(ExtractFeaturesOptions* options) {
  OptionTable table = DescribeOptions(&options->sift);
  for (OptionTable::value_type& option : DescribeOptions(&options->panorama)) table.push_back(option);
  table.push_back({.name = "model",
                   .value = &options->model,
                   .help = "learned model that finds features in place of SIFT: an ONNX file with XFeat's "
                           "outputs; absolute or relative to the recipe; empty: SIFT"});
  table.push_back({.name = "masks",
                   .value = &options->masks,
                   .help = "folder of masks NAME.png, absolute or relative to the capture; pixels that are "
                           "zero in a mask are ignored"});
  return table;
}

Result<ExtractFeaturesSummary> ExtractFeatures(const Capture& capture, const ExtractFeaturesOptions& options,
                                               const std::string& features_path, int num_threads,
                                               Progress& progress, const ReuseOptions& reuse) {
  const std::string masks = options.masks.empty() || fs::path(options.masks).is_absolute()
                                ? options.masks
                                : (fs::path(capture.root) / options.masks).string();
  CAIRN_RETURN_IF_ERROR(CheckPanoramaOptions(options.panorama));
  std::error_code error;
  if (!masks.empty() && !fs::is_directory(masks, error)) {
    return MakeError(ErrorCode::kNotFound, "option masks: {} is not a folder", masks);
  }
  CAIRN_ASSIGN_OR_RETURN(auto finder, FeatureFinder::Make(options.sift, options.model));
  ExtractionRun run{.capture = capture,
                    .options = options,
                    .finder = std::move(finder),
                    .masks = masks,
                    .images = reuse.shard ? ImagesOfShard(capture.images, *reuse.shard) : capture.images};
  ReuseSources& named = reuse.shard ? run.earlier.to_leave : run.earlier.to_take_over;
  CAIRN_ASSIGN_OR_RETURN(run.summary.not_reused,
                         AddReuseSources(reuse, features_path, &named, &run.earlier.to_take_over));
  run.summary.rejects = capture.rejects;
  run.summary.inputs = ListInputs(run);
  if (!options.model.empty()) run.summary.inputs.push_back(options.model);
  cv::setNumThreads(1);  // images are the unit of parallel work
  progress.Begin("extract features", static_cast<int64_t>(run.images.size()), "images");
  const Status status =
      WriteDatabase(features_path, kColmapSchema, [&](SQLite::Database& database) -> Status {
        CAIRN_RETURN_IF_ERROR(WriteAll(num_threads, progress, &run, database));
        if (run.summary.num_images > 0 || reuse.shard) return Ok();
        return MakeError(ErrorCode::kNoData, "{}: none of {} images can be read; the first: {}", capture.root,
                         capture.images.size(), run.summary.rejects.front().reason);
      });
  progress.End();
  if (!status.ok()) return status.error();
  CAIRN_RETURN_IF_ERROR(WriteReuseFile(features_path, std::move(run.entries)));
  return std::move(run.summary);
}

}  // namespace cairn::extract_features
