#include "pipeline/atlas/find_look_alikes.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "core/base/parallel.h"
#include "core/blocks/map_rows.h"
#include "core/camera/pixel_ray.h"
#include "core/features/features.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/landmark_set.h"

namespace cairn::pipeline {
namespace {

// Other maps in which an image is localized: those that have most of its features.
constexpr size_t kNumRivals = 3;

struct SeenImage {
  Features features;
  Camera camera;
};

const Camera* FindCamera(const Map& map, CameraId id) {
  for (const Camera& camera : map.head().cameras) {
    if (camera.camera_id == id) return &camera;
  }
  return nullptr;
}

// The landmarks of a survey image as features of it; nothing where its camera sees all around.
Result<std::optional<SeenImage>> SeenIn(const Map& map, int32_t image_idx) {
  CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(image_idx));
  const Camera* camera = FindCamera(map, image->camera_id);
  if (camera == nullptr || !CheckQueryCamera(*camera).ok()) return std::optional<SeenImage>();
  CAIRN_ASSIGN_OR_RETURN(const auto landmarks, map.Gather(image->landmarks, false));
  SeenImage seen{.camera = *camera};
  std::vector<Eigen::Index> rows;
  for (size_t k = 0; k < landmarks->idx.size(); ++k) {
    const MapLandmark& landmark = landmarks->landmarks[k];
    const Eigen::Vector3d point = image->cam_from_world * landmark.position;
    const auto pixel = ImageFromCamera(*camera, point);
    if (!pixel) continue;
    const double focal_px = camera->MeanFocal();
    seen.features.keypoints.push_back(
        {static_cast<float>(pixel->x()), static_cast<float>(pixel->y()),
         static_cast<float>(landmark.scale_m * focal_px / DepthOfScale(*camera, point)), 0});
    rows.push_back(static_cast<Eigen::Index>(k));
  }
  seen.features.descriptors = landmarks->descriptors(rows, Eigen::all);
  return std::optional(std::move(seen));
}

// The place in another map that explains the image, if one does.
Result<std::optional<int32_t>> PlaceIn(const std::shared_ptr<const Map>& map, const SeenImage& seen) {
  Localizer localizer(map);
  CAIRN_ASSIGN_OR_RETURN(const Localization found, localizer.LocalizeFeatures(seen.features, seen.camera));
  if (!found.has_places()) return std::optional<int32_t>();
  CAIRN_ASSIGN_OR_RETURN(const int32_t image, ImageNearFix(*map, found));
  return std::optional(image);
}

}  // namespace

Result<std::vector<AtlasLookAlike>> FindLookAlikes(const AtlasRows& atlas,
                                                   const std::vector<std::shared_ptr<const Map>>& maps,
                                                   int num_images, int num_threads, Progress* progress) {
  const CodeIndex index(atlas);
  std::vector<AtlasImage> images;
  for (size_t map = 0; map < maps.size(); ++map) {
    const int64_t all = maps[map]->num_images(), num = std::min<int64_t>(all, num_images);
    for (int64_t i = 0; i < num; ++i)
      images.push_back({static_cast<int32_t>(map), static_cast<int32_t>(i * all / num)});
  }
  progress->Begin("look-alikes", static_cast<int64_t>(images.size()), "images");
  std::vector<std::vector<AtlasLookAlike>> found(images.size());
  std::vector<Status> statuses(images.size(), Ok());
  ParallelFor(static_cast<int64_t>(images.size()), num_threads, [&](int64_t i) {
    if (progress->Cancelled()) return;
    statuses[i] = [&]() -> Status {
      const AtlasImage& image = images[i];
      CAIRN_ASSIGN_OR_RETURN(const auto seen, SeenIn(*maps[image.map], image.image));
      if (!seen) return Ok();
      size_t num_tried = 0;
      for (const MapScore& rival : index.Rank(seen->features)) {
        if (rival.map == image.map) continue;
        if (++num_tried > kNumRivals) break;
        CAIRN_ASSIGN_OR_RETURN(const auto place, PlaceIn(maps[rival.map], *seen));
        if (place) found[i].push_back({image, {rival.map, *place}});
      }
      return Ok();
    }();
    progress->Advance();
  });
  progress->End();
  if (progress->Cancelled()) return MakeError(ErrorCode::kCancelled, "looking for look-alikes was stopped");
  std::vector<AtlasLookAlike> all;
  for (size_t i = 0; i < found.size(); ++i) {
    CAIRN_RETURN_IF_ERROR(statuses[i]);
    all.insert(all.end(), found[i].begin(), found[i].end());
  }
  return all;
}

}  // namespace cairn::pipeline
