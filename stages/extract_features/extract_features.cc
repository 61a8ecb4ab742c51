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

// One image of the database.
struct View {
  std::string name;
  Features features;
};

// What one image file gave: its views (several for a panorama), or the reason why not.
struct Extraction {
  std::string content_hash;
  std::vector<View> views;
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

Result<std::vector<View>> ExtractPanorama(const std::string& name, const cv::Mat& grey, const cv::Mat& mask,
                                          const Camera& camera, const ExtractFeaturesOptions& options) {
  if (!mask.empty() && mask.size() != grey.size()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "a mask of {} x {} px does not fit the panorama of {} x {} px", mask.cols, mask.rows,
                     grey.cols, grey.rows);
  }
  const Camera view_camera = PanoramaViewCamera(camera, options.panorama);
  const int num_views = options.panorama.num_panorama_views;
  std::vector<View> views;
  for (int view = 0; view < num_views; ++view) {
    cv::Mat view_mask;
    if (!mask.empty()) view_mask = CutPanoramaView(mask, view_camera, view, num_views) == 255;
    CAIRN_ASSIGN_OR_RETURN(Features features, ExtractSift(CutPanoramaView(grey, view_camera, view, num_views),
                                                          options.sift, view_mask));
    KeepSectorOfView(view_camera, num_views, &features);
    views.push_back({PanoramaViewName(name, view, num_views), std::move(features)});
  }
  return views;
}

Result<Extraction> ExtractImage(const Capture& capture, const CaptureImage& image,
                                const ExtractFeaturesOptions& options, const std::string& mask_path) {
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
  if (camera.model == CameraModel::kEquirectangular) {
    CAIRN_ASSIGN_OR_RETURN(extraction.views, ExtractPanorama(image.name, grey, mask, camera, options));
  } else {
    CAIRN_ASSIGN_OR_RETURN(Features features, ExtractSift(grey, options.sift, mask));
    extraction.views.push_back({image.name, std::move(features)});
  }
  return extraction;
}

Status WriteAll(const Capture& capture, const ExtractFeaturesOptions& options, const std::string& masks,
                int num_threads, Progress& progress, ExtractFeaturesSummary* summary,
                SQLite::Database& database) {
  for (const auto& [camera_id, camera] : capture.cameras) {
    const bool is_panorama = camera.model == CameraModel::kEquirectangular;
    WriteDatabaseCamera(database, is_panorama ? PanoramaViewCamera(camera, options.panorama) : camera);
  }
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
      Result<Extraction> extraction = ExtractImage(capture, image, options, FindMask(masks, image.name));
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
      for (const View& view : batch[i].views) {
        const ImageId image_id = next_id++;
        WriteDatabaseImage(database, {image_id, view.name, image.camera_id});
        WriteDatabaseFeatures(database, image_id, view.features);
        hash_row.bind(1, image_id);
        hash_row.bind(2, batch[i].content_hash);
        hash_row.exec();
        hash_row.reset();
        summary->num_views++;
        summary->num_keypoints += static_cast<int64_t>(view.features.keypoints.size());
      }
      summary->num_images++;
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
  for (OptionTable::value_type& option : DescribeOptions(&options->panorama)) table.push_back(option);
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
  CAIRN_RETURN_IF_ERROR(CheckPanoramaOptions(options.panorama));
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
