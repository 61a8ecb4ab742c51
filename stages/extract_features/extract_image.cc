#include "stages/extract_features/extract_image.h"

#include <filesystem>

#include "core/colmap/colmap_database.h"
#include "core/features/descriptor_kind_table.h"
#include "core/features/hash_features.h"
#include "core/files/file.h"
#include "core/images/image_file.h"

namespace cairn::extract_features {
namespace {

namespace fs = std::filesystem;

// Of a camera only its size and its kind matter (a panorama's has no parameters).
ContentHash KeyOf(const Camera& camera, ContentHash image, const std::optional<ContentHash>& mask,
                  const std::string& codecs, ExtractFeaturesOptions options, const FeatureFinder& finder) {
  ContentHasher key;
  key.Text("features").Text(codecs).Hash(image).UInt(mask ? 1 : 0).Hash(mask.value_or(ContentHash()));
  key.UInt(camera.width)
      .UInt(camera.height)
      .UInt(camera.model == CameraModel::kEquirectangular ? 1 : 0)
      .Text(OptionsToml(DescribeOptions(&options.sift)));
  if (camera.model == CameraModel::kEquirectangular)
    key.Text(OptionsToml(DescribeOptions(&options.panorama)));
  if (!finder.kind().is_sift()) key.Text(ToString(finder.kind())).Hash(finder.model_hash());
  return key.Finish();
}

ContentHash HashViews(const std::vector<View>& views) {
  ContentHasher hasher;
  for (const View& view : views)
    hasher.Hash(HashFeatures(view.features.keypoints, view.features.descriptors));
  return hasher.Finish();
}

// The views' names, in order.
std::vector<std::string> ViewNames(const CaptureImage& image, const Camera& camera,
                                   const PanoramaOptions& options) {
  if (camera.model != CameraModel::kEquirectangular) return {image.name};
  std::vector<std::string> names;
  for (int view = 0; view < options.num_panorama_views; ++view)
    names.push_back(PanoramaViewName(image.name, view, options.num_panorama_views));
  return names;
}

// Views that an earlier run wrote; nothing where the rows were changed since.
std::optional<std::vector<View>> FindViews(const ContentHash& key, const std::vector<std::string>& names,
                                           ReuseSources* sources) {
  return sources->Find(key, [&](const ReuseEntry& entry, ReuseSources::Source& source) {
    std::optional<std::vector<View>> views;
    if (entry.count != static_cast<int64_t>(names.size())) return views;
    const auto kind = ReadDescriptorKind(source.Database(), DatabasePath(source.Database()));
    if (!kind.ok()) return views;
    views.emplace();
    for (size_t i = 0; i < names.size(); ++i) {
      const auto image_id = static_cast<ImageId>(entry.row + static_cast<int64_t>(i));
      auto keypoints = ReadDatabaseKeypoints(source.Database(), image_id);
      auto descriptors = ReadDatabaseDescriptors(source.Database(), image_id, *kind);
      if (!keypoints.ok() || !descriptors.ok()) return std::optional<std::vector<View>>();
      views->push_back({names[i], {std::move(*keypoints), std::move(*descriptors), *kind}});
    }
    if (HashViews(*views) != entry.contents) views.reset();
    return views;
  });
}

Result<std::vector<View>> ExtractPanorama(const std::vector<std::string>& names, const cv::Mat& grey,
                                          const cv::Mat& mask, const Camera& camera,
                                          const ExtractFeaturesOptions& options,
                                          const FeatureFinder& finder) {
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
    CAIRN_ASSIGN_OR_RETURN(Features features,
                           finder.Find(CutPanoramaView(grey, view_camera, view, num_views), view_mask));
    KeepSectorOfView(view_camera, num_views, &features);
    views.push_back({names[view], std::move(features)});
  }
  return views;
}

Result<std::vector<View>> ExtractViews(const std::string& path, const std::string& bytes,
                                       const std::string& mask_path, const std::string& mask_bytes,
                                       const std::vector<std::string>& names, const Camera& camera,
                                       const ExtractFeaturesOptions& options, const FeatureFinder& finder) {
  CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, DecodeGreyImage(bytes, path));
  if (grey.cols != camera.width || grey.rows != camera.height) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: {} x {} px, but its camera {} has {} x {} px", path,
                     grey.cols, grey.rows, camera.camera_id, camera.width, camera.height);
  }
  cv::Mat mask;
  if (!mask_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(mask, DecodeGreyImage(mask_bytes, mask_path));
  }
  if (camera.model == CameraModel::kEquirectangular)
    return ExtractPanorama(names, grey, mask, camera, options, finder);
  CAIRN_ASSIGN_OR_RETURN(Features features, finder.Find(grey, mask));
  return std::vector<View>{{names.front(), std::move(features)}};
}

// The features that the capture has of an image: they are its contents.
Result<Extraction> TakeGivenFeatures(const FeaturesRow& row, const CaptureImage& image, const Camera& camera,
                                     EarlierExtractions* earlier) {
  if (camera.model == CameraModel::kEquirectangular) {
    return MakeError(ErrorCode::kUnsupported,
                     "{}: features of a panorama, which has views; give the views and their PINHOLE camera",
                     row.path);
  }
  Extraction extraction;
  CAIRN_ASSIGN_OR_RETURN(Features features, ReadCaptureFeatures(row, camera));
  const ContentHash contents = HashFeatures(features.keypoints, features.descriptors);
  extraction.content_hash = fmt::format("{:016x}{:016x}", contents.high, contents.low);
  ContentHasher key;
  key.Text("given features").Hash(contents);
  if (!features.kind.is_sift()) key.Text(ToString(features.kind));
  extraction.key = key.Finish();
  extraction.are_landmarks = row.are_landmarks;
  if (FindViews(extraction.key, {image.name}, &earlier->to_leave)) {
    extraction.is_elsewhere = true;
    return extraction;
  }
  extraction.is_taken_over = FindViews(extraction.key, {image.name}, &earlier->to_take_over).has_value();
  extraction.views.push_back({image.name, std::move(features)});
  return extraction;
}

}  // namespace

std::string FindMask(const std::string& masks, const std::string& name) {
  if (masks.empty()) return "";
  for (const fs::path& path :
       {fs::path(masks) / (name + ".png"), (fs::path(masks) / name).replace_extension(".png")}) {
    std::error_code error;
    if (fs::exists(path, error)) return path.string();
  }
  return "";
}

Result<Extraction> ExtractImage(const Capture& capture, const CaptureImage& image,
                                const ExtractFeaturesOptions& options, const FeatureFinder& finder,
                                const std::string& mask_path, EarlierExtractions* earlier) {
  if (const FeaturesRow* row = capture.FeaturesOf(image); row != nullptr)
    return TakeGivenFeatures(*row, image, capture.cameras.at(image.camera_id), earlier);
  Extraction extraction;
  const std::string path = capture.ImagePath(image);
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  extraction.content_hash = HashBytes(bytes);
  std::string mask_bytes;
  std::optional<ContentHash> mask_hash;
  if (!mask_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(mask_bytes, ReadFile(mask_path));
    mask_hash = HashContents(mask_bytes);
  }
  const Camera& camera = capture.cameras.at(image.camera_id);
  CAIRN_ASSIGN_OR_RETURN(const std::string codecs, ImageCodecsIdentity(path));
  extraction.key = KeyOf(camera, HashContents(bytes), mask_hash, codecs, options, finder);
  const std::vector<std::string> names = ViewNames(image, camera, options.panorama);
  if (FindViews(extraction.key, names, &earlier->to_leave)) {
    extraction.is_elsewhere = true;
    return extraction;
  }
  if (auto views = FindViews(extraction.key, names, &earlier->to_take_over)) {
    extraction.is_taken_over = true;
    extraction.views = std::move(*views);
    return extraction;
  }
  CAIRN_ASSIGN_OR_RETURN(extraction.views,
                         ExtractViews(path, bytes, mask_path, mask_bytes, names, camera, options, finder));
  return extraction;
}

ReuseEntry EntryOf(const Extraction& extraction, ImageId first_view) {
  return {.key = extraction.key,
          .contents = HashViews(extraction.views),
          .row = first_view,
          .count = static_cast<int64_t>(extraction.views.size())};
}

}  // namespace cairn::extract_features
