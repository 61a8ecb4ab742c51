#include "stages/extract_features/extract_features.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include <opencv2/core/utility.hpp>

#include "core/colmap_database.h"
#include "core/file.h"
#include "core/image_file.h"
#include "core/parallel.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr int kBatchSize = 64;

constexpr char kOwnSchema[] = R"sql(
CREATE TABLE cairn_images (image_id INTEGER PRIMARY KEY NOT NULL, content_hash TEXT NOT NULL);
CREATE TABLE cairn_rejects (name TEXT NOT NULL, reason TEXT NOT NULL);
)sql";

// What one image gave: features, or the reason why not.
struct Extraction {
  std::string content_hash;
  Features features;
  std::optional<std::string> reject_reason;
};

// The mask of an image, if `masks` has one; "" if not.
std::string FindMask(const std::string& masks, const std::string& name) {
  if (masks.empty()) return "";
  for (const fs::path& path :
       {fs::path(masks) / (name + ".png"), (fs::path(masks) / name).replace_extension(".png")}) {
    std::error_code error;
    if (fs::exists(path, error)) return path.string();
  }
  return "";
}

Result<Extraction> ExtractImage(const Capture& capture, const CaptureImage& image, const SiftOptions& options,
                                const std::string& mask_path) {
  Extraction extraction;
  const std::string path = capture.ImagePath(image);
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  extraction.content_hash = HashBytes(bytes);
  CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, DecodeGreyImage(bytes, path));
  const Camera& camera = capture.cameras.at(image.camera_id);
  if (grey.cols != camera.width || grey.rows != camera.height) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: {} x {} px, but its camera {} has {} x {} px", path,
                     grey.cols, grey.rows, camera.camera_id, camera.width, camera.height);
  }
  cv::Mat mask;
  if (!mask_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(mask, ReadGreyImage(mask_path));
  }
  CAIRN_ASSIGN_OR_RETURN(extraction.features, ExtractSift(grey, options, mask));
  return extraction;
}

Status WriteAll(const Capture& capture, const ExtractFeaturesOptions& options, const std::string& masks,
                int num_threads, Progress& progress, ExtractFeaturesSummary* summary,
                SQLite::Database& database) {
  for (const auto& [camera_id, camera] : capture.cameras) WriteDatabaseCamera(database, camera);
  database.exec(kOwnSchema);
  SQLite::Statement hash_row(database, "INSERT INTO cairn_images VALUES (?, ?)");
  const auto num_images = static_cast<int64_t>(capture.images.size());
  ImageId next_id = 1;
  for (int64_t begin = 0; begin < num_images; begin += kBatchSize) {
    const int64_t size = std::min<int64_t>(kBatchSize, num_images - begin);
    std::vector<Extraction> batch(size);
    ParallelFor(size, num_threads, [&](int64_t i) {
      if (progress.Cancelled()) return;
      const CaptureImage& image = capture.images[begin + i];
      Result<Extraction> extraction = ExtractImage(capture, image, options.sift, FindMask(masks, image.name));
      if (extraction.ok()) {
        batch[i] = std::move(*extraction);
      } else {
        batch[i].reject_reason = extraction.error().message;
      }
      progress.Advance();
    });
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while extracting features");
    for (int64_t i = 0; i < size; ++i) {
      const CaptureImage& image = capture.images[begin + i];
      if (batch[i].reject_reason) {
        summary->rejects.push_back({image.name, *batch[i].reject_reason});
        continue;
      }
      const ImageId image_id = next_id++;
      WriteDatabaseImage(database, {image_id, image.name, image.camera_id});
      WriteDatabaseFeatures(database, image_id, batch[i].features);
      hash_row.bind(1, image_id);
      hash_row.bind(2, batch[i].content_hash);
      hash_row.exec();
      hash_row.reset();
      summary->num_images++;
      summary->num_keypoints += static_cast<int64_t>(batch[i].features.keypoints.size());
    }
  }
  std::stable_sort(summary->rejects.begin(), summary->rejects.end(),
                   [](const Reject& a, const Reject& b) { return a.name < b.name; });
  SQLite::Statement reject_row(database, "INSERT INTO cairn_rejects VALUES (?, ?)");
  for (const Reject& reject : summary->rejects) {
    reject_row.bind(1, reject.name);
    reject_row.bind(2, reject.reason);
    reject_row.exec();
    reject_row.reset();
  }
  if (summary->num_images == 0) {
    return MakeError(ErrorCode::kNoData, "{}: none of {} images can be read; the first: {}", capture.root,
                     num_images, summary->rejects.front().reason);
  }
  return Ok();
}

}  // namespace

OptionTable DescribeOptions(ExtractFeaturesOptions* options) {
  OptionTable table = DescribeOptions(&options->sift);
  table.push_back(
      {.name = "masks",
       .value = &options->masks,
       .help = "folder of masks NAME.png, absolute or relative to the capture; zero switches a pixel off"});
  return table;
}

Result<ExtractFeaturesSummary> ExtractFeatures(const Capture& capture, const ExtractFeaturesOptions& options,
                                               const std::string& features_path, int num_threads,
                                               Progress& progress) {
  const std::string masks = options.masks.empty() || fs::path(options.masks).is_absolute()
                                ? options.masks
                                : (fs::path(capture.root) / options.masks).string();
  std::error_code error;
  if (!masks.empty() && !fs::is_directory(masks, error)) {
    return MakeError(ErrorCode::kNotFound, "option masks: {} is not a folder", masks);
  }
  ExtractFeaturesSummary summary;
  summary.rejects = capture.rejects;
  for (const char* list : {"cameras.txt", "images.txt", "queries.txt"}) {
    const std::string path = capture.root + "/" + list;
    if (fs::exists(path, error)) summary.inputs.push_back(path);
  }
  for (const CaptureImage& image : capture.images) {
    summary.inputs.push_back(capture.ImagePath(image));
    if (const std::string mask = FindMask(masks, image.name); !mask.empty()) summary.inputs.push_back(mask);
  }
  cv::setNumThreads(1);  // images are the unit of parallel work
  progress.Begin("extract features", static_cast<int64_t>(capture.images.size()), "images");
  const Status status = WriteDatabase(features_path, kColmapSchema, [&](SQLite::Database& database) {
    return WriteAll(capture, options, masks, num_threads, progress, &summary, database);
  });
  progress.End();
  if (!status.ok()) return status.error();
  return summary;
}

}  // namespace cairn
